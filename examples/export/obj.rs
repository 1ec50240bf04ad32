//! Writes the drawn mesh as a Wavefront OBJ file.

use std::io::{self, Write};

use bevy_burrow::lattice::SNAP;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::{Drawn, World};
use glam::{I64Vec3, IVec3};

/// Writes all tiles and chunks of a world, one group each, and returns the number of bytes.
pub fn write(world: &World, out: &mut impl Write) -> io::Result<u64> {
    let mut obj = ObjWriter { out, text: String::new(), vertices: 0, bytes: 0 };
    obj.text.push_str(
        "# bevy_burrow: y is up, one unit is one voxel, triangles are counter-clockwise from the air\n",
    );
    for (drawn, mesh) in world.drawn().filter(|(_, mesh)| !mesh.is_empty()) {
        obj.group(drawn, &mesh, world.origin(drawn))?;
    }
    obj.flush()?;
    Ok(obj.bytes)
}

struct ObjWriter<'a, W> {
    out: &'a mut W,
    /// The lines of the current group.
    text: String,
    /// Vertices of the previous groups: OBJ numbers vertices across groups.
    vertices: usize,
    bytes: u64,
}

impl<W: Write> ObjWriter<'_, W> {
    fn group(&mut self, drawn: Drawn, mesh: &SurfaceMesh, origin: IVec3) -> io::Result<()> {
        self.text += &match drawn {
            Drawn::Tile(tile) => format!("g tile_{}_{}\n", tile.x, tile.z),
            Drawn::Chunk(chunk) => format!("g chunk_{}_{}_{}\n", chunk.x, chunk.y, chunk.z),
        };
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
