//! The whole terrain as one field of marching cubes, as in the paper's Table 5: each edit rebuilds the whole mesh.

mod dense;
mod world;

pub use dense::{DenseField, stored};
pub use world::FullWorld;

/// The mesher of the full field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// The hybrid's mesher with the hybrid's vertices: integer positions, materials, and the heightmap's normals on
    /// unedited ground.
    Same,
    /// The library's dense mesher: positions and gradient normals only.
    Bare,
}

impl Output {
    pub const BOTH: [Self; 2] = [Self::Same, Self::Bare];

    /// The name in files and arguments.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Same => "full_same_output",
            Self::Bare => "full_positions_and_normals",
        }
    }

    /// The name in the document.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Same => "same output",
            Self::Bare => "positions and normals only",
        }
    }
}
