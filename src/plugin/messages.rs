//! Messages and entity events: brushes in, news out.

use std::sync::Arc;

use bevy::prelude::*;

use super::MaterialColors;
use super::meshes::MeshBuilder;
use crate::brush::Brush;
use crate::terrain::{HistoryReceipt, LoosePiece, Receipt, Terrain};

/// A brush in world space: every terrain that it reaches obeys it, hidden ones too.
///
/// On a terrain that a parent stretches, a brush's points, axes and heights are where the world has them. Its sizes (radii,
/// half sides, amounts, falloff, roughness) are scaled by the cube root of what a volume is scaled by: counted in voxels, a
/// ball stays a ball.
impl Message for Brush {}

/// A brush in world space for one terrain alone.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct TargetedBrush {
    /// The terrain's entity.
    pub terrain: Entity,
    /// What to do.
    pub brush: Brush,
}

/// What became of a brush: one from each terrain that it reaches, whether that took it or refused it. Bounds count in
/// voxels of the terrain.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct BrushApplied {
    /// The terrain; `None` for a brush that reaches none, or whose place is no number.
    pub terrain: Option<Entity>,
    /// Scenario, volumes, bounds, or why it was rejected.
    pub receipt: Receipt,
}

/// A step back: the last stroke that changed the ground is undone, or where brushes are of no [stroke](Brush::stroke), what
/// was sent in one frame. [`HistoryMoved`] says what came of it.
///
/// Steps are queued with brushes, in one order. Bevy keeps messages of one type in theirs, and none between types: those
/// of one frame are taken as all [`Brush`]es, then [`TargetedBrush`]es, then `Undo`s, then [`Redo`]s. What is a step does not
/// depend on when transactions run. Frames come as fast as a machine draws them: where steps must be the same on all, give
/// brushes a stroke.
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
#[derive(Message, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Undo {
    /// The terrain's entity; `None` for every terrain there is.
    pub terrain: Option<Entity>,
}

/// A step forth: what was undone last is done again. See [`Undo`].
#[derive(Message, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Redo {
    /// The terrain's entity; `None` for every terrain there is.
    pub terrain: Option<Entity>,
}

/// A step through a terrain's history was taken, in the frame in which its meshes are shown, or there was none to take.
/// Each [`Undo`] and [`Redo`] gets one from each terrain that it is for.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct HistoryMoved {
    /// The terrain; `None` where there is none at all.
    pub terrain: Option<Entity>,
    /// Back or forth, and what it changed; bounds count in voxels of the terrain.
    pub receipt: HistoryReceipt,
}

/// A brush cut a piece of ground off, on a terrain with [`LooseGround`](super::LooseGround). What was taken out of the
/// ground is gone in the frame of this message. The brush's receipt lists its pieces as well.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct LoosePieceFound {
    /// The terrain; below it the piece is at home, counted in voxels.
    pub terrain: Entity,
    /// The brush's tag.
    pub tag: u64,
    /// Its bounds, voxels, materials and, where it broke off, its surface.
    pub piece: LoosePiece,
    /// Its mesh, where there are meshes: made in the transaction's task.
    pub(super) ready: Option<Arc<Mesh>>,
}

impl LoosePieceFound {
    /// Where the piece's mesh counts from, in voxels of the terrain: the translation of an entity below it that shows it.
    pub fn origin(&self) -> Vec3 {
        self.piece.bounds.min.as_vec3()
    }

    /// The piece as a mesh like those of chunks, for any material that they can have; `None` unless it broke off. It wants
    /// the terrain, which knows how deep in the ground the piece was. With a [`GroundPiece`](super::GroundPiece) it is drawn
    /// as the terrain is; its colours are those of when the brush began to work.
    pub fn mesh(&self, terrain: &Terrain, colors: &MaterialColors) -> Option<Mesh> {
        if let Some(ready) = &self.ready {
            return Some(Mesh::clone(ready));
        }
        self.build(&MeshBuilder::new(terrain.world(), Some(colors)))
    }

    fn build(&self, mesh_builder: &MeshBuilder) -> Option<Mesh> {
        let surface = self.piece.mesh.as_ref()?;
        mesh_builder.build_whole(self.piece.bounds.min, surface).map(|(mesh, _)| mesh)
    }

    /// Makes its mesh, in the task.
    pub(super) fn build_mesh(&mut self, mesh_builder: &MeshBuilder) {
        self.ready = self.build(mesh_builder).map(Arc::new);
    }
}

/// All tiles of a terrain are shown, and it takes transactions.
///
/// A terrain that is shown may not be drawn yet: while textures are made or loaded, a terrain with a `GroundLook` has no
/// material. Games that wait for a picture wait for `GroundLoading::is_ready` as well. A terrain with neither a look nor a
/// `MeshMaterial3d` of a type that a `TerrainMaterialPlugin` propagates becomes ready too, and is never drawn.
///
/// The event comes again whenever a terrain has loaded anew, because another terrain took its place, or because the game
/// itself changed more of it than a frame [swaps](super::BurrowSettings::swaps_per_frame). An observer that spawns something
/// should check whether it is there already.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct TerrainReady {
    /// The terrain's entity.
    pub entity: Entity,
}

/// A chunk got its entity.
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

/// A field got its entity.
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

/// A field went into another one; its entity is despawned right after this.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldMerged {
    /// The entity of the field that is gone.
    pub entity: Entity,
    /// The entity of the field that holds its data now.
    pub into: Entity,
}
