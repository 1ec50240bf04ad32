//! The plugin's messages and entity events: brushes for one terrain, receipts, undo and redo, loose pieces, changes of
//! chunks and fields.

use std::sync::Arc;

use bevy::asset::RenderAssetUsages;
use bevy::prelude::*;

use super::MaterialColors;
use super::meshes::{MeshBuilder, VertexExtras, VertexKind};
use crate::brush::Brush;
use crate::terrain::{LoosePiece, Receipt, ReturnedPiece, Terrain};

/// A brush in world space. It edits every terrain that it reaches, hidden ones too.
///
/// Like all messages of the plugin it is reflected, for editors and Bevy's remote protocol: its method
/// `world.write_message` takes `{"message": "bevy_burrow::brush::request::Brush", "value": {"shape": "sphere",
/// "center": [8, 0, 8], "radius": 4, "op": "dig"}}`.
///
/// If a parent stretches a terrain, the points, axes and heights of a brush are transformed exactly. Its sizes (radii,
/// half sides, amounts, falloff, roughness) are scaled by the cube root of the change in volume: in voxels, a ball
/// stays a ball.
impl Message for Brush {}

/// A brush in world space for one terrain alone.
#[derive(Message, Reflect, Clone, Debug, PartialEq)]
#[reflect(Message, Clone, Debug, PartialEq)]
pub struct TargetedBrush {
    /// The terrain's entity.
    pub terrain: Entity,
    /// The brush.
    pub brush: Brush,
}

/// The result of a brush: one message for each terrain that it reaches, applied or rejected. Bounds are in voxels of
/// the terrain.
#[derive(Message, Reflect, Clone, Debug, PartialEq)]
#[reflect(Message, Clone, Debug, PartialEq)]
pub struct BrushApplied {
    /// The terrain; `None` for a brush that reaches none, or whose position is not a number.
    pub terrain: Option<Entity>,
    /// Scenario, volumes, bounds, or why it was rejected.
    pub receipt: Receipt,
}

/// Undoes the last [stroke](Brush::stroke) that changed the ground. Brushes without a stroke are undone by the frame in
/// which they were sent. A [`HistoryMoved`] is sent when it is done.
///
/// Undo and redo are queued together with brushes. Bevy keeps the order of messages of one type only, so those of one
/// frame are read as all [`Brush`]es, then [`TargetedBrush`]es, then `Undo`s, then [`Redo`]s. When transactions run
/// makes no difference to what is undone together, but the frame rate does: give brushes a stroke if all machines must
/// agree.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// fn keys(keys: Res<ButtonInput<KeyCode>>, mut undo: MessageWriter<Undo>, mut redo: MessageWriter<Redo>) {
///     if keys.just_pressed(KeyCode::KeyZ) {
///         undo.write(Undo::default());
///     }
///     if keys.just_pressed(KeyCode::KeyY) {
///         redo.write(Redo::default());
///     }
/// }
/// ```
#[derive(Message, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Message, Default, Clone, Debug, PartialEq)]
pub struct Undo {
    /// The terrain's entity; `None` for every terrain there is.
    pub terrain: Option<Entity>,
}

/// Redoes the step that was undone last. See [`Undo`].
#[derive(Message, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Message, Default, Clone, Debug, PartialEq)]
pub struct Redo {
    /// The terrain's entity; `None` for every terrain there is.
    pub terrain: Option<Entity>,
}

/// The result of an [`Undo`] or [`Redo`], sent in the frame in which its meshes are shown: one for each terrain that it
/// is for.
#[derive(Message, Reflect, Clone, Debug, PartialEq)]
#[reflect(Message, Clone, Debug, PartialEq)]
pub struct HistoryMoved {
    /// The terrain; `None` if there is none at all.
    pub terrain: Option<Entity>,
    /// The undone or redone step and its changes; bounds are in voxels of the terrain.
    pub receipt: Receipt,
}

/// A brush cut off a piece of ground, on a terrain with [`LooseSettings`](crate::terrain::LooseSettings). A piece that
/// vanishes or breaks off is gone from the ground in the frame of this message. The brush's receipt lists its pieces as
/// well. A redo that cuts a piece off again sends this again, with the same [id](LoosePiece::id).
#[derive(Message, Reflect, Clone, Debug, PartialEq)]
#[reflect(Message, Clone, Debug, PartialEq)]
pub struct LoosePieceFound {
    /// The terrain. Positions of the piece are in its space, in voxels.
    pub terrain: Entity,
    /// The brush's tag.
    pub tag: u64,
    /// The piece: bounds, voxels, materials and, if it broke off, its surface.
    pub piece: LoosePiece,
    /// The piece's mesh, built in the transaction's task; `None` if there are no meshes.
    #[reflect(ignore, clone)]
    pub(super) mesh: Option<Arc<Mesh>>,
}

/// A piece that had been cut off is ground again from this frame on: by an undo, a player's own or another's, or
/// because a server refused the dig. The game must remove everything that it made from the piece; `DebrisPlugin` does
/// that for its debris, wherever it has rolled. Of several pieces with the same [id](ReturnedPiece::id) this is the one
/// that was cut off last.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct LoosePieceReturned {
    /// The terrain.
    pub terrain: Entity,
    /// The piece.
    pub piece: ReturnedPiece,
}

impl LoosePieceFound {
    /// A piece whose mesh is built where it is needed.
    #[cfg(feature = "replicon")]
    pub(crate) fn new(terrain: Entity, tag: u64, piece: LoosePiece) -> Self {
        Self { terrain, tag, piece, mesh: None }
    }

    /// The origin of the piece's mesh in voxels of the terrain: the translation for a child of the terrain that shows
    /// it.
    pub fn origin(&self) -> Vec3 {
        self.piece.bounds.min.as_vec3()
    }

    /// The piece as a mesh with the attributes of a chunk's, for the same materials; `None` unless it broke off. The
    /// terrain is needed for the depth of the piece in the ground. With a [`GroundPiece`](super::GroundPiece) it is
    /// drawn like the terrain. Its colours are those from the start of the transaction.
    pub fn mesh(&self, terrain: &Terrain, colors: &MaterialColors) -> Option<Mesh> {
        if let Some(mesh) = &self.mesh {
            return Some(Mesh::clone(mesh));
        }
        let extras = VertexExtras::of(Some(colors), VertexKind::default());
        self.build(&MeshBuilder::new(terrain.world(), extras, RenderAssetUsages::RENDER_WORLD))
    }

    fn build(&self, mesh_builder: &MeshBuilder) -> Option<Mesh> {
        let surface = self.piece.mesh.as_ref()?;
        mesh_builder.build_piece(self.piece.bounds, surface).map(|(mesh, _)| mesh)
    }

    /// Builds its mesh in the task.
    pub(super) fn build_mesh(&mut self, mesh_builder: &MeshBuilder) {
        self.mesh = self.build(mesh_builder).map(Arc::new);
    }
}

/// All tiles of a terrain are shown, and it takes transactions.
///
/// A terrain that is shown may not be drawn yet: while textures are made or loaded, a terrain with a `GroundLook` has
/// no material. Games that wait for a picture wait for `GroundLoading::is_ready` as well. A terrain with neither a look
/// nor a `MeshMaterial3d` of a type that a `TerrainMaterialPlugin` propagates becomes ready too, and is never drawn.
///
/// The event is triggered again whenever a terrain has been loaded again, because another terrain replaced it, or
/// because the game changed more of it through the model than a frame [swaps](super::BurrowSettings::swaps_per_frame).
/// An observer that spawns something should check whether it is there already.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct TerrainReady {
    /// The terrain's entity.
    pub entity: Entity,
}

/// The entity of a chunk was spawned.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkCreated {
    /// The chunk's entity.
    pub entity: Entity,
}

/// A chunk's surface changed, on servers without meshes too. Its removal is Bevy's own `On<Remove, Chunk>`.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkChanged {
    /// The chunk's entity.
    pub entity: Entity,
}

/// The entity of a field was spawned.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldCreated {
    /// The field's entity.
    pub entity: Entity,
}

/// A field's samples or box changed. Its removal is Bevy's own `On<Remove, Field>`.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldChanged {
    /// The field's entity.
    pub entity: Entity,
}

/// A field was merged into another one; its entity is despawned right after this event.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldMerged {
    /// The entity of the field that was merged.
    pub entity: Entity,
    /// The entity of the field that has its data now.
    pub into: Entity,
}
