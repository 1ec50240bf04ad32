//! Builds Bevy meshes of surfaces in tasks: their vertices, and the extra data that games attach.

mod builder;
mod ground_depth;
mod new_mesh;
mod palettes;
mod processor;
mod vertex_kind;

pub(super) use builder::MeshBuilder;
pub(super) use new_mesh::PendingMesh;
pub(super) use processor::{BuildSettings, BuiltNode, BuiltSurface, SurfaceBuilder, node_origin};
pub use processor::{CommitAction, Part, SurfaceProcessor, SurfaceProcessors};
pub use vertex_kind::CUT_VOXELS;
pub(super) use vertex_kind::{VertexExtras, VertexKind};
