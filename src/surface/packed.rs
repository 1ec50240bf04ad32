//! Vertices as a GPU writes them: smaller than those of a mesh, so that less is sent.

use glam::IVec3;

use super::mesh::{MaterialMix, Vertex};

/// Vertices as a GPU writes them.
#[derive(Clone, Copy)]
pub(crate) struct PackedVertices<'a> {
    /// Where positions count from.
    pub origin: IVec3,
    /// Position in 1/4096 voxel; the fourth number is unused.
    pub positions: &'a [[u16; 4]],
    /// Normals, one per position.
    pub normals: &'a [[f32; 3]],
    pub mixes: PackedMixes<'a>,
}

/// The materials of packed vertices.
#[derive(Clone, Copy)]
pub(crate) enum PackedMixes<'a> {
    /// One mix for all.
    One(MaterialMix),
    /// One for each vertex: four ids, four weights.
    Each(&'a [[u8; 8]]),
}

impl<'a> PackedVertices<'a> {
    /// The number of vertices.
    pub fn len(self) -> usize {
        self.positions.len()
    }

    /// Each vertex as it is in a mesh.
    pub fn iter(self) -> impl Iterator<Item = Vertex> + 'a {
        let Self { origin, positions, normals, mixes } = self;
        let mix = move |number: usize| match mixes {
            PackedMixes::One(mix) => mix,
            PackedMixes::Each(mixes) => {
                let [a, b, c, d, e, f, g, h] = mixes[number];
                MaterialMix { ids: [a, b, c, d], weights: [e, f, g, h] }
            }
        };
        let vertex = move |(number, (&[x, y, z, _], &normal)): (usize, (&[u16; 4], &[f32; 3]))| Vertex {
            position: origin + IVec3::new(x.into(), y.into(), z.into()),
            normal: normal.into(),
            materials: mix(number),
        };
        positions.iter().zip(normals).enumerate().map(vertex)
    }
}
