//! The drawn surface: marching cubes at edits, heightmap elsewhere, and the ring where they meet.
//!
//! - `cases`: the marching-cubes case table, derived from one rule about cube faces.
//! - `mask`: which cells marching cubes draws (rule 2), as bits.
//! - `vertex`: the one vertex function of cubes and ring (rule 4), with normals and materials.
//! - `block`: marching cubes over up to 8x8x8 cells of one chunk; `plain` is the same by the textbook.
//! - `tile`: the heightmap's triangles outside the mask, rings included (rule 3).
//! - `mesh`: vertex and index buffers, local to a chunk or tile; `indices` has 16 or 32 bits each.
//! - `lod`: the nodes of a quadtree cut, coarser ones included (rules 7 to 9).
//! - `seams`: checks that everything drawn together is closed.

#[doc(hidden)]
pub mod block;
pub(crate) mod brick_window;
#[doc(hidden)]
pub mod cases;
pub(crate) mod cell_outline;
mod chunk_surface;
mod crossings;
#[doc(hidden)]
pub mod indices;
mod layer_bits;
#[doc(hidden)]
pub mod lod;
#[doc(hidden)]
pub mod mask;
#[doc(hidden)]
pub mod mesh;
pub(crate) mod meshed_blocks;
mod neighbours;
#[cfg(feature = "cuda")]
mod packed;
mod padded_samples;
#[doc(hidden)]
pub mod plain;
pub(crate) mod pristine;
#[doc(hidden)]
pub mod seams;
mod stack;
#[doc(hidden)]
pub mod tile;
#[doc(hidden)]
pub mod vertex;

#[doc(hidden)]
pub use chunk_surface::ChunkSurface;
pub(crate) use chunk_surface::{FreshPart, PartKey};
#[doc(hidden)]
pub use indices::Indices;
#[doc(hidden)]
pub use mask::{Mask, MaskView};
#[doc(hidden)]
pub use mesh::MaterialMix;
pub use mesh::{SurfaceMesh, Vertex};
#[doc(hidden)]
pub use seams::SeamChecker;
pub use seams::{SeamFault, SeamReport};
