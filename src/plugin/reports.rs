//! Logs each problem of a terrain once, with the terrain's name.

use std::sync::{Mutex, MutexGuard, PoisonError};

use bevy::ecs::system::SystemParam;
use bevy::platform::collections::HashSet;
use bevy::prelude::*;

use crate::terrain::Terrain;

/// Something that is logged once for each terrain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Report {
    /// The terrain's place is not finite, or a scale is 0.
    NoPlace,
    /// A parent mirrors the terrain.
    Mirrored,
    /// A parent stretches the terrain.
    Stretched,
    /// Seams may show where the terrain stands.
    Unaligned,
    /// The game gave the terrain a scale.
    ScaleReplaced,
    /// The terrain has materials of several types.
    #[cfg(feature = "render")]
    SeveralMaterials,
    /// The terrain has no material.
    #[cfg(feature = "render")]
    NoMaterial,
    /// Applying a brush panicked.
    BrushPanicked,
    /// A task panicked.
    TaskPanicked,
    /// A brush has numbers that are not allowed.
    BrushInvalid,
    /// The first brushes reach no terrain.
    BrushBeside,
    /// The terrain is too far from the origin, where numbers are coarse.
    Far,
    /// The terrain has levels of detail, and no camera looks at it.
    NobodyLooks,
    /// The terrain has a material with textures, and no texture coordinates.
    #[cfg(feature = "render")]
    Textures,
}

/// The logged problems. It is locked and not borrowed mutably, so that logging systems need no order.
#[derive(Resource, Default)]
pub(crate) struct Reported(Mutex<HashSet<(Entity, Report)>>);

impl Reported {
    fn lock(&self) -> MutexGuard<'_, HashSet<(Entity, Report)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Logs what is new.
#[derive(SystemParam)]
pub(crate) struct Reports<'w>(Res<'w, Reported>);

impl Reports<'_> {
    /// Whether this was not reported of the entity before. It counts as reported from now on.
    pub(crate) fn is_new(&self, entity: Entity, report: Report) -> bool {
        self.0.lock().insert((entity, report))
    }
}

/// Forgets the logs of a terrain that is gone.
pub(super) fn forget_reports(gone: On<Remove, Terrain>, reported: Res<Reported>) {
    reported.lock().retain(|(entity, _)| *entity != gone.entity);
}
