//! The lines of a seam: edges of the tiles' triangles, of the chunks' triangles, and those that both share.

use std::collections::HashSet;

use bevy::prelude::*;
use bevy_burrow::lattice::SNAP;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::Drawn;

/// Both ends in 1/4096 voxel of the world, the lesser first: edges that are drawn at the same bits are equal.
type Edge = [IVec3; 2];

/// The edges around a place, by who draws them.
pub struct Wires {
    tiles: HashSet<Edge>,
    chunks: HashSet<Edge>,
}

impl Wires {
    /// The edges of a terrain that lie within `radius` voxels of a place.
    pub fn around(terrain: &Terrain, place: Vec3, radius: f32) -> Self {
        let mut wires = Self { tiles: HashSet::new(), chunks: HashSet::new() };
        for (drawn, mesh) in terrain.world().drawn() {
            let edges = match drawn {
                Drawn::Tile(_) => &mut wires.tiles,
                Drawn::Chunk(_) => &mut wires.chunks,
            };
            let origin = terrain.world().origin(drawn) * SNAP;
            edges.extend(
                edges_of(&mesh, origin)
                    .filter(|edge| edge.iter().all(|&end| voxels(end).distance(place) < radius)),
            );
        }
        wires
    }

    /// Edges where a tile and a chunk meet.
    pub fn shared(&self) -> usize {
        self.tiles.intersection(&self.chunks).count()
    }

    /// Spawns the lines: tiles golden, chunks blue, and what they share in white, thicker.
    pub fn spawn(&self, commands: &mut Commands, assets: &mut Assets<GizmoAsset>) {
        let shared: HashSet<Edge> = self.tiles.intersection(&self.chunks).copied().collect();
        let without = |edges: &HashSet<Edge>| edges.difference(&shared).copied().collect();
        let layers: [(HashSet<Edge>, Color, f32); 3] = [
            (without(&self.tiles), Color::srgb(1.0, 0.72, 0.10), 1.6),
            (without(&self.chunks), Color::srgb(0.25, 0.75, 1.0), 1.6),
            (shared.clone(), Color::srgb(1.0, 1.0, 1.0), 4.0),
        ];
        for (edges, colour, width) in layers {
            let mut lines = GizmoAsset::default();
            for [a, b] in edges {
                lines.line(voxels(a), voxels(b), colour);
            }
            commands.spawn(Gizmo {
                handle: assets.add(lines),
                line_config: GizmoLineConfig { width, ..default() },
                // Just before the triangles.
                depth_bias: -0.0006,
            });
        }
    }
}

/// The edges of a mesh that is placed at `origin`, in 1/4096 voxel.
fn edges_of(mesh: &SurfaceMesh, origin: IVec3) -> impl Iterator<Item = Edge> {
    mesh.triangles().flat_map(move |triangle| {
        let [a, b, c] = triangle.map(|vertex| origin + vertex.position);
        [[a, b], [b, c], [c, a]].map(|[a, b]| if a.to_array() <= b.to_array() { [a, b] } else { [b, a] })
    })
}

fn voxels(place: IVec3) -> Vec3 {
    (place.as_dvec3() / f64::from(SNAP)).as_vec3()
}
