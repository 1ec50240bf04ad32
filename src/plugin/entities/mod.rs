//! The entities of a terrain: where they are, what they inherit from it, and what a commit changes on them. Also which
//! squares of ground are near cameras and sources.

mod display;
#[cfg(feature = "render")]
pub(super) mod materials;
pub(super) mod places;
pub(super) mod propagate;
#[cfg(any(feature = "avian", feature = "scatter", feature = "landmass"))]
#[cfg_attr(
    not(any(feature = "scatter", feature = "landmass")),
    allow(dead_code, reason = "colliders need only some of it")
)]
pub(super) mod squares;
mod terrain_entities;

pub(super) use display::Display;
pub(super) use terrain_entities::apply_actions;
pub(crate) use terrain_entities::{TerrainEntities, trigger_if_alive};
