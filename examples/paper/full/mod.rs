//! The whole terrain as one field of marching cubes, as in the paper's Table 5: all of its mesh is made again at each
//! edit.

mod dense;
mod world;

pub use dense::{DenseField, stored};
pub use world::FullWorld;

/// What the full field is meshed with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// The hybrid's mesher, for the hybrid's vertices: integer positions, materials, the heightmap's normals where nothing
    /// was edited.
    Same,
    /// The library's dense mesher: positions and gradient normals only.
    Bare,
}

impl Output {
    pub const BOTH: [Self; 2] = [Self::Same, Self::Bare];

    /// Its name in files and arguments.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Same => "full_same_output",
            Self::Bare => "full_positions_and_normals",
        }
    }

    /// Its name on the page.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Same => "same output",
            Self::Bare => "positions and normals only",
        }
    }
}
