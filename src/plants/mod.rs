//! Plants on terrains: they disappear in the frame in which their ground is dug away, and return with it.
//!
//! Put [`Plants`] with [`ScatterRules`] on a terrain, and add the [`PlantsPlugin`]. It keeps the plants around cameras
//! and [`PlantSource`]s in a [`ShownPlants`] component, up to date in each commit, and sends a [`PlantRemoved`] or
//! [`PlantReturned`] for each plant that disappears or returns there.
//!
//! | part | content |
//! | --- | --- |
//! | [`Plants`] | the rules, on the terrain |
//! | [`ShownPlants`] | the patches that are loaded, and which of their plants stand |
//! | [`PlantRemoved`], [`PlantReturned`] | plants that a commit removed or brought back |
//! | `PlantLooks`, `PlantDrawingPlugin` | meshes for species, and how they are drawn (feature `render`) |
//! | `PlantCollidersPlugin` | stems as colliders, around `ColliderSource`s (feature `avian`) |
//!
//! A game removes a plant with [`Plant::removal`], which is a brush in voxels, or with
//! [`Plant::removal_in_world`].

#[cfg(feature = "avian")]
mod colliders;
#[cfg(feature = "render")]
mod draw;
mod follow;
mod load;
#[cfg(feature = "render")]
mod material;
#[cfg(feature = "render")]
mod slots;
#[cfg(feature = "render")]
mod upload;

#[cfg(feature = "avian")]
pub use colliders::PlantCollidersPlugin;
#[cfg(feature = "render")]
pub use draw::{PlantDrawingPlugin, PlantLook, PlantLooks};
#[cfg(feature = "render")]
#[doc(hidden)]
pub use material::PlantExtension;
#[cfg(feature = "render")]
#[doc(hidden)]
pub use material::PlantMaterial;

use std::sync::Arc;

use bevy::prelude::*;

use crate::brush::{Brush, Shape};
use crate::plugin::{BurrowSystems, CommitSameFrame, FollowCommits};
use crate::scatter::{Plant, PlantPatches, Scatter, ScatterRules};
use crate::terrain::Version;

/// Keeps plants of terrains with [`Plants`] up to date. Draws nothing.
#[derive(Default)]
pub struct PlantsPlugin;

/// The system that follows commits, in [`BurrowSystems::Commit`] and, for commits in the frame of the click, in
/// `PostUpdate`.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PlantSystems;

impl Plugin for PlantsPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<PlantRemoved>()
            .add_message::<PlantReturned>()
            .add_observer(load::forget_rules)
            .add_observer(load::forget_ground)
            .configure_sets(Update, PlantSystems.in_set(FollowCommits))
            .configure_sets(
                PostUpdate,
                PlantSystems
                    .after(CommitSameFrame)
                    .before(bevy::asset::AssetEventSystems)
                    .before(TransformSystems::Propagate)
                    .before(bevy::camera::visibility::VisibilitySystems::CalculateBounds),
            )
            .add_systems(
                Update,
                (
                    (load::read_rules, load::choose_patches)
                        .chain()
                        .after(BurrowSystems::Load)
                        .before(BurrowSystems::Commit),
                    follow::follow_commits.in_set(PlantSystems),
                ),
            )
            .add_systems(PostUpdate, follow::follow_commits.in_set(PlantSystems));
    }
}

/// The plants of a terrain. Insert it on the terrain's entity; plants follow when it changes. Lengths are in voxels.
///
/// If the rules are invalid, nothing grows, and the error is logged.
#[derive(Component, Reflect, Clone, Debug, Default, PartialEq)]
#[reflect(Component, Default)]
#[require(ShownPlants)]
pub struct Plants(pub ScatterRules);

/// A place around which plants are loaded, in addition to those that cameras see: for a server that simulates them.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component)]
#[require(Transform)]
pub struct PlantSource {
    /// Metres. A radius of more than 2048 voxels counts as 2048, an infinite one too, and a negative one as 0.
    pub radius: f32,
}

/// The plants of a terrain that are loaded: around cameras, as far as their species is drawn, and around
/// [`PlantSource`]s.
#[derive(Component, Debug, Default)]
pub struct ShownPlants {
    /// `None` until rules without an error were read.
    patches: Option<PlantPatches>,
    /// The world that they are up to date with.
    version: Option<Version>,
    task: Option<load::LoadTask>,
    /// The viewers of the last choice of patches, and whether all that they want is loaded.
    viewers: Vec<load::Viewer>,
    is_settled: bool,
    /// What the drawing has not followed yet.
    news: NewsList,
}

/// News for what draws the plants; none are kept before something does.
#[derive(Debug, Default)]
struct NewsList(Option<Vec<News>>);

impl NewsList {
    fn push(&mut self, news: News) {
        if let Self(Some(all)) = self {
            all.push(news);
        }
    }

    /// All news since the last call; `None` the first time.
    #[cfg(feature = "render")]
    fn take(&mut self) -> Option<Vec<News>> {
        self.0.replace(Vec::new())
    }
}

/// What changed of the plants that are shown.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(not(feature = "render"), allow(dead_code, reason = "for what draws plants"))]
enum News {
    /// Everything: other rules or another world.
    Cleared,
    Loaded(crate::scatter::PatchPos),
    Unloaded(crate::scatter::PatchPos),
    Changed(crate::scatter::PlantChange),
}

impl ShownPlants {
    /// The rules in use.
    pub fn scatter(&self) -> Option<&Arc<Scatter>> {
        self.patches.as_ref().map(PlantPatches::scatter)
    }

    /// The loaded patches.
    pub fn patches(&self) -> Option<&PlantPatches> {
        self.patches.as_ref()
    }

    /// Whether patches are still being loaded.
    pub fn is_loading(&self) -> bool {
        self.task.is_some() || !self.is_settled
    }
}

/// A plant that was shown no longer stands, from the frame of this message on: the ground under it or in its clearance
/// changed, or it was removed. Not sent when patches are unloaded, nor when the terrain, its [`Plants`] or its world as
/// a whole are removed or replaced.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct PlantRemoved {
    /// The terrain.
    pub terrain: Entity,
    /// The plant; its species is an index of the rules.
    pub plant: Plant,
    /// Where the plant stood, in world space: its foot, how it is turned, and its size.
    pub transform: Transform,
    /// Whether a game felled it, as with [`Plant::removal_in_world`]: its ground and the air around it are as they
    /// were. `false` if they were dug, built over or painted. See [`Scatter::is_felled`].
    pub is_felled: bool,
}

/// A plant stands again from the frame of this message on.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct PlantReturned {
    /// The terrain.
    pub terrain: Entity,
    /// The plant.
    pub plant: Plant,
    /// Where the plant stands, in world space.
    pub transform: Transform,
}

impl Plant {
    /// The brush that removes the plant, in world space: send it as a [`Brush`] message or
    /// [`TargetedBrush`](crate::plugin::TargetedBrush). See [`removal`](Self::removal).
    pub fn removal_in_world(&self, terrain: &GlobalTransform) -> Brush {
        to_world(self.removal(), terrain)
    }

    /// The brush that lets the removed plant grow again, in world space. See [`regrowth`](Self::regrowth).
    pub fn regrowth_in_world(&self, terrain: &GlobalTransform) -> Brush {
        to_world(self.regrowth(), terrain)
    }
}

/// The mark of a plant in world space.
fn to_world(brush: Brush, terrain: &GlobalTransform) -> Brush {
    let Shape::Sphere(sphere) = brush.shape else { return brush };
    // The mean, as brushes take it when they are brought into the terrain.
    let scale = terrain.affine().matrix3.determinant().abs().cbrt();
    let center = terrain.transform_point(sphere.center);
    Brush { shape: Shape::sphere(center, sphere.radius * scale), ..brush }
}

/// Where a plant stands in world space.
pub(crate) fn transform_of(plant: &Plant, terrain: &GlobalTransform) -> Transform {
    let (_, rotation, _) = terrain.to_scale_rotation_translation();
    let turn = f32::from(plant.turn) / 65536.0 * std::f32::consts::TAU;
    Transform {
        translation: terrain.transform_point(plant.position().as_vec3()),
        rotation: rotation * Quat::from_rotation_y(turn),
        scale: Vec3::splat(f32::from(plant.size) / 256.0),
    }
}
