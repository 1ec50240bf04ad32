//! The world at one revision: ground, bricks, fields, mask and the surfaces that were meshed from them; and queries.
//!
//! | file | what it holds |
//! | --- | --- |
//! | `state` | the committed world |
//! | `patch` | what differs between two states |
//! | `change` | what a commit swaps |
//! | `parts`, `regions` | bricks and fields, as they are saved, compared and sent |
//! | `edited_nodes` | which nodes of the quadtree contain edits |
//! | `meshes`, `kept_surfaces`, `unmeshed` | surfaces that are kept, and surfaces that are made when they are asked for |
//! | `query`, `ray`, `triangles`, `inspect`, `heights` | heights, rays, debug views, export |
//! | `memory` | the bytes that it takes |
//! | `settings` | voxel size and chunk size |
//! | `sky` | how much of the sky lights a place |

mod change;
mod copy;
mod edited_nodes;
mod glb;
mod heights;
mod inspect;
mod kept_surfaces;
mod memory;
mod meshes;
mod parts;
// Some of it is for saving, some for sending.
#[cfg_attr(not(all(feature = "store", feature = "net")), allow(dead_code))]
mod patch;
mod query;
mod ray;
mod regions;
mod settings;
// Some of it is for meshes, which only the plugin makes.
#[cfg_attr(not(feature = "plugin"), allow(dead_code, unused_imports))]
pub(crate) mod sky;
mod splats;
mod state;
mod triangles;
mod unmeshed;

pub(crate) use change::{Change, Reached, brick_bytes, replaced_bytes};
pub use glb::GlbError;
pub use memory::Memory;
pub(crate) use meshes::NewSurfaces;
pub(crate) use parts::{brick_over, columns_of};
pub use patch::Patch;
#[cfg_attr(not(feature = "net"), allow(unused_imports))]
pub(crate) use patch::{ChangedBrick, Overlay, Positions, State};
pub use query::{RayHit, Span};
pub use settings::{TerrainError, TerrainSettings};
pub use splats::SplatMaps;
pub(crate) use state::unique;
pub use state::{MeshKey, Version, World};
pub use unmeshed::Meshing;
pub(crate) use unmeshed::{UnmeshedChunk, blocks_of};
