//! Writes the drawn mesh as a Wavefront OBJ file.

use std::io::{self, Write};

use bevy_burrow::lattice::SNAP;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::{MeshKey, World};
use glam::{I64Vec3, IVec3};

use crate::lod::Levels;

/// Writes all tiles and chunks of a world, one group each, and returns the number of bytes.
pub fn write(world: &World, out: &mut impl Write) -> io::Result<u64> {
    let mut obj = ObjWriter::new(out);
    for (drawn, mesh) in world.drawn() {
        let name = match drawn {
            MeshKey::Tile(tile) => format!("tile_{}_{}", tile.x, tile.z),
            MeshKey::Chunk(chunk) => format!("chunk_{}_{}_{}", chunk.x, chunk.y, chunk.z),
        };
        obj.group(&name, &mesh, world.origin(drawn))?;
    }
    obj.finish()
}

/// Writes all nodes of a cut, one group each, and returns the number of bytes.
pub fn write_levels(levels: &Levels, out: &mut impl Write) -> io::Result<u64> {
    let mut obj = ObjWriter::new(out);
    for (node, mesh) in &levels.nodes {
        let name = format!("node_{}_{}_level_{}", node.x, node.z, node.level);
        obj.group(&name, mesh, levels.cut.grid().columns(*node).0.at(0))?;
    }
    obj.finish()
}

struct ObjWriter<'a, W> {
    out: &'a mut W,
    /// The lines of the current group.
    text: String,
    /// Vertices of the previous groups: OBJ numbers vertices across groups.
    vertices: usize,
    bytes: u64,
}

impl<'a, W: Write> ObjWriter<'a, W> {
    fn new(out: &'a mut W) -> Self {
        let text =
            "# bevy_burrow: y is up, one unit is one voxel, triangles are counter-clockwise from the air\n";
        Self { out, text: text.into(), vertices: 0, bytes: 0 }
    }

    /// Writes a mesh; nothing if it is empty.
    fn group(&mut self, name: &str, mesh: &SurfaceMesh, origin: IVec3) -> io::Result<()> {
        if mesh.is_empty() {
            return Ok(());
        }
        self.text += &format!("g {name}\n");
        // A tile still contains the vertices of ground that was dug away; only those in use are written.
        let mut numbers = vec![0; mesh.vertices.len()];
        let origin = origin.as_i64vec3() * i64::from(SNAP);
        for index in mesh.indices.iter() {
            let number = &mut numbers[index as usize];
            if *number == 0 {
                self.vertices += 1;
                *number = self.vertices;
                self.vertex(origin + mesh.vertices[index as usize].position.as_i64vec3());
            }
        }
        for triangle in mesh.indices.triangles() {
            let [a, b, c] = triangle.map(|index| numbers[index as usize]);
            self.text += &format!("f {a} {b} {c}\n");
        }
        self.flush()
    }

    fn finish(mut self) -> io::Result<u64> {
        self.flush()?;
        Ok(self.bytes)
    }

    fn vertex(&mut self, steps: I64Vec3) {
        self.text.push('v');
        for steps in steps.to_array() {
            self.text.push(' ');
            push_voxels(&mut self.text, steps);
        }
        self.text.push('\n');
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.write_all(self.text.as_bytes())?;
        self.bytes += self.text.len() as u64;
        self.text.clear();
        Ok(())
    }
}

/// Appends a position given in 1/4096 voxel as an exact decimal number of voxels.
pub fn push_voxels(text: &mut String, steps: i64) {
    const SNAPS: u64 = SNAP as u64;
    /// 10^12 / 4096: twelve digits represent every fraction exactly.
    const PER_STEP: u64 = 1_000_000_000_000 / SNAPS;
    let (whole, rest) = (steps.unsigned_abs() / SNAPS, steps.unsigned_abs() % SNAPS);
    if steps < 0 {
        text.push('-');
    }
    *text += &whole.to_string();
    if rest != 0 {
        *text += format!(".{:012}", rest * PER_STEP).trim_end_matches('0');
    }
}
