//! Messages and entity events: brushes in, news out.

use bevy::prelude::*;

use crate::brush::Brush;
use crate::terrain::Receipt;

/// A brush in world space: every terrain that it reaches obeys it.
impl Message for Brush {}

/// A brush in world space for one terrain alone.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct TargetedBrush {
    /// The terrain's entity.
    pub terrain: Entity,
    /// What to do.
    pub brush: Brush,
}

/// What became of a brush; each brush gets at least one. Bounds count in voxels of the terrain.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct BrushApplied {
    /// The terrain that was changed; `None` for a brush that no terrain took.
    pub terrain: Option<Entity>,
    /// Scenario, volumes, bounds, or why it was rejected.
    pub receipt: Receipt,
}

/// A chunk got its entity.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkCreated {
    /// The chunk's entity.
    pub entity: Entity,
}

/// A chunk's mesh was swapped. Its removal is Bevy's own `On<Remove, Chunk>`.
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
