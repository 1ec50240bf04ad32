//! Plants and stones on the ground: where each one stands, and whether it still does.
//!
//! [`ScatterRules`] describe species. A [`Scatter`] made from them answers where their plants are: a pure function of
//! seed, species and the undug ground, in integers. It is the same on every machine, for every chunk size and level of
//! detail, and nothing of it is saved or sent.
//!
//! A plant stands exactly as long as
//!
//! 1. its cell is drawn as heightmap: no sample at the surface over the four columns around it has been edited, and
//! 2. in its [clearance](Clearance), the topmost ground of each column is there, and the air above it is free.
//!
//! So a plant disappears when the ground under it or in its clearance changes, and returns when undo or a
//! [reset](crate::brush::Brush::reset) restores that ground. It never hangs in the air or stands in the ground.
//!
//! To remove a plant, mark the ground under it: [`Plant::removal`] is a brush that paints one sample with the ground's
//! own material. Nothing looks different, and the plant is gone, together with what grows within a voxel of that
//! sample. As it is a brush like any other, it is saved, sent, undone and refused like any other.
//!
//! ```
//! use bevy_burrow::prelude::*;
//! use bevy_burrow::scatter::{Scatter, ScatterRules, Species};
//! use glam::DVec3;
//!
//! let oak = Species { spacing: 6.0, distance: 5.0, ..Species::named("oak") };
//! let scatter = Scatter::new(&ScatterRules { seed: 7, species: vec![oak] })?;
//! let mut terrain = Terrain::new(Ground::flat(64, 64, 10.0)?, &TerrainSettings::default())?;
//! let nearest = |terrain: &Terrain| scatter.nearest(terrain.world(), DVec3::new(32.0, 10.0, 32.0), 20.0, |_| true);
//! let tree = nearest(&terrain).expect("one every few voxels");
//!
//! terrain.apply([tree.removal()]);
//! assert_ne!(nearest(&terrain), Some(tree));
//! terrain.undo();
//! assert_eq!(nearest(&terrain), Some(tree));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | file | what it holds |
//! | --- | --- |
//! | `rules` | species, as a game writes them |
//! | `species` | species as integers |
//! | `spots` | the spots of a species, before other species are considered |
//! | `plants` | the plants of an area |
//! | `stands` | whether a plant stands in a world |
//! | `patches` | squares of plants that follow a world from commit to commit |
//! | `query` | the nearest plant, plants in a box, plants along a ray |

mod patches;
mod plants;
mod query;
mod rules;
mod species;
mod spots;
mod stands;

#[doc(hidden)]
pub use patches::PlantChange;
pub use patches::{PatchPos, PlantPatch, PlantPatches};
pub use plants::{Plant, PlantId, Scatter};
pub use query::PlantHit;
pub use rules::{Clearance, Clusters, ScatterError, ScatterRules, Species, Stem, ViewDistances};
