//! The lines of a seam: edges of the tiles' triangles, of the chunks' triangles, and those that both share.

use std::collections::HashSet;

use bevy::prelude::*;

use super::lines::LineBuffer;
use crate::lattice::{LatticeBox, SNAP};
use crate::surface::SurfaceMesh;
use crate::terrain::{MeshKey, World};

/// Both ends in 1/4096 voxel of the terrain, the lesser first: edges that are drawn at the same bits are equal.
type Edge = [IVec3; 2];

const GOLD: LinearRgba = LinearRgba::rgb(1.0, 0.47, 0.01);
const BLUE: LinearRgba = LinearRgba::rgb(0.05, 0.52, 1.0);

/// The edges around a place, of tiles and of chunks.
pub struct SeamWires {
    tiles: HashSet<Edge>,
    chunks: HashSet<Edge>,
}

impl SeamWires {
    /// The edges of a world that lie within `radius` voxels of a place.
    pub fn around(world: &World, place: Vec3, radius: f32) -> Self {
        let mut wires = Self { tiles: HashSet::new(), chunks: HashSet::new() };
        let Some(near) = around(place, radius) else { return wires };
        for drawn in world.drawn_near(near) {
            let origin = world.origin(drawn) * SNAP;
            let is_near = |edge: &Edge| edge.iter().all(|&end| voxels(end).distance(place) < radius);
            match drawn {
                MeshKey::Tile(tile) => {
                    wires.tiles.extend(edges_of(&world.tile_mesh(tile), origin).filter(is_near));
                }
                MeshKey::Chunk(chunk) => {
                    let mesh = world.chunk_surface(chunk);
                    wires
                        .chunks
                        .extend(mesh.into_iter().flat_map(|mesh| edges_of(mesh, origin)).filter(is_near));
                }
            }
        }
        wires
    }

    /// How many edges a tile and a chunk share.
    pub fn shared(&self) -> usize {
        self.tiles.intersection(&self.chunks).count()
    }

    /// Draws them: tiles golden, chunks blue, and what they share in white, thicker.
    pub(super) fn draw(&self, out: &mut LineBuffer) {
        let sorted = |edges: &mut dyn Iterator<Item = &Edge>| {
            let mut edges: Vec<Edge> = edges.copied().collect();
            edges.sort_unstable_by_key(|edge| edge.map(|end| end.to_array()));
            edges
        };
        // Shared edges matter most: they are drawn first, in case there is not room for all.
        let layers = [
            (sorted(&mut self.tiles.intersection(&self.chunks)), LinearRgba::WHITE, 4.0),
            (sorted(&mut self.tiles.difference(&self.chunks)), GOLD, 1.6),
            (sorted(&mut self.chunks.difference(&self.tiles)), BLUE, 1.6),
        ];
        for (edges, color, width) in layers {
            out.width(width);
            for [from, to] in edges {
                out.line(voxels(from), voxels(to), color);
            }
        }
    }
}

/// The samples within `radius` voxels of a place; `None` if either is not a number.
pub fn around(place: Vec3, radius: f32) -> Option<LatticeBox> {
    let (min, max) = ((place - radius).floor(), (place + radius).ceil());
    (min.is_finite() && max.is_finite()).then(|| LatticeBox::new(min.as_ivec3(), max.as_ivec3()))?
}

/// The edges of a mesh that is placed at `origin`, in 1/4096 voxel.
pub(super) fn edges_of(mesh: &SurfaceMesh, origin: IVec3) -> impl Iterator<Item = Edge> {
    mesh.triangles().flat_map(move |triangle| {
        let [a, b, c] = triangle.map(|vertex| origin + vertex.position);
        [[a, b], [b, c], [c, a]].map(|[a, b]| if a.to_array() <= b.to_array() { [a, b] } else { [b, a] })
    })
}

pub(super) fn voxels(place: IVec3) -> Vec3 {
    (place.as_dvec3() / f64::from(SNAP)).as_vec3()
}
