//! Physics with [avian](https://docs.rs/avian3d): colliders for tiles and chunks, and a character that walks on them.
//!
//! ```no_run
//! use avian3d::prelude::*;
//! use bevy::prelude::*;
//! use bevy_burrow::prelude::*;
//! use bevy_burrow::physics::{ColliderSource, TerrainPhysicsPlugin};
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, BurrowPlugins, PhysicsPlugins::default(), TerrainPhysicsPlugin::default()))
//!     .add_systems(Startup, |mut commands: Commands| {
//!         // Ground within 60 m of this has colliders; any entity with a Transform will do.
//!         commands.spawn((Camera3d::default(), ColliderSource { radius: 60.0 }));
//!         commands.spawn((RigidBody::Dynamic, Collider::sphere(0.5), Transform::from_xyz(0.0, 30.0, 0.0)));
//!     })
//!     .run();
//! ```
//!
//! # Overview
//!
//! | for | use |
//! | --- | --- |
//! | ground to stand on | [`TerrainPhysicsPlugin`], and a [`ColliderSource`] on everything that moves about |
//! | a first-person body | [`Character`], steered by [`CharacterSteering`], moved by [`CharacterPlugin`] |
//! | ground that breaks off and falls | [`DebrisPlugin`], and `LooseSettings` on the terrain; [`debris_collider`] for bodies of your own |
//! | finding the terrain of a collider that was hit | [`GroundBody`] on the collider's entity |
//! | live figures | [`PhysicsFigures`] |
//! | bodies that cannot leave the terrain | [`EdgeWalls`] on the terrain |
//! | a terrain without physics | [`TerrainPhysicsDisabled`] on the terrain |
//!
//! # Guarantees
//!
//! - **One commit.** A collider is built from the same arrays as the mesh, in the same task, and swapped in the same
//!   frame. It has exactly the triangles that are drawn, each once. Servers without meshes have the same colliders.
//!   Only if a source arrives during a transaction does the collider follow one task later. A terrain may move and
//!   rotate: its colliders are moved to its tiles and chunks before each step.
//! - **No bumps.** Triangles know their neighbours, including those of other tiles and chunks (see [`GroundShape`]), so
//!   a body that rolls over a border or a seam does not feel it.
//! - **Nothing falls through.** An old collider stays until the new one replaces it, and a collider that was built from
//!   an outdated world is dropped. Colliders are made within the radius of a source, and around where it will be in a
//!   second. A body over ground without a collider [is held](HeldByGround) until there is one. Where a game despawned
//!   the tile, bodies fall.
//! - **Dug ground releases bodies.** Sleeping bodies are woken where a surface changed, moved or disappeared. Bodies
//!   that were built over, or are squeezed into the ground soon after it changed, are lifted to the nearest air above
//!   (along the terrain's own y axis), since ground is one-sided. Bodies that get into the ground in another way are
//!   lifted some frames later. Sensors, bodies on layers that ignore the ground, sleeping bodies and those locked along
//!   y are left alone.
//!
//! Bodies are ordinary avian bodies, and ground is `RigidBody::Static`. [`GroundContact`] sets its `Friction`,
//! `Restitution` and `CollisionLayers`, and [`TerrainContact`] those of one terrain.

pub mod character;
mod character_plugin;
mod collider_source;
mod colliders;
mod columns;
mod cone;
pub mod debris;
mod edge_walls;
mod frame;
mod ground;
mod hold;
mod hull;
mod near;
mod ordered_bvh;
mod shape;
mod solids;
mod sources;
mod upkeep;
mod wake;
mod walking;
mod welded;

#[doc(hidden)]
pub use character::{Character, CharacterMotion, CharacterSteering};
pub use character_plugin::{CharacterPlugin, CharacterSystems};
pub use collider_source::ColliderSource;
#[doc(hidden)]
pub use debris::{Debris, DebrisCrumbled, DebrisOf, DebrisPlugin, DebrisSettings, TerrainDebris};
pub use edge_walls::EdgeWalls;
#[doc(hidden)]
pub use ground::GroundCollider;
pub use ground::{GroundBody, GroundContact, TerrainContact, TerrainPhysicsDisabled};
pub use hold::HeldByGround;
#[doc(hidden)]
pub use hull::debris_collider;
#[doc(hidden)]
pub use shape::GroundShape;

use std::time::Duration;

use avian3d::physics_transform::PhysicsTransformSystems;
use avian3d::prelude::{PhysicsSchedule, PhysicsStepSystems, PhysicsSystems};
use bevy::prelude::*;

use crate::plugin::{BeforeLoad, BurrowSystems, CommitSameFrame, SurfaceProcessors};

/// Colliders for terrains. Requires avian's `PhysicsPlugins` and the crate's `BurrowPlugins`.
///
/// Avian must run in `FixedPostUpdate`, where `PhysicsPlugins::default()` puts it, since this plugin's systems run
/// right before and after its steps (see [`TerrainPhysicsSystems`]). With another schedule, colliders follow moving
/// terrains late and bodies are lifted late; an error is logged.
#[derive(Default)]
pub struct TerrainPhysicsPlugin;

/// The plugin's systems, in the order in which they run.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TerrainPhysicsSystems {
    /// In `Update`: finds where colliders are wanted.
    Near,
    /// In `Update`, after commits: starts tasks for missing colliders and removes those far from all sources.
    Upkeep,
    /// In `PostUpdate`: holds bodies over ground without colliders and releases others.
    Hold,
    /// In `FixedPreUpdate`, before a frame's first step: wakes bodies where ground changed and lifts buried ones. In
    /// `FixedPostUpdate`, after the frame's last step: lifts bodies that the steps pushed into the ground.
    Wake,
    /// In `FixedPostUpdate`, before each step: moves colliders to their tiles and chunks.
    Follow,
}

/// Live figures of the plugin.
#[derive(Resource, Reflect, Clone, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct PhysicsFigures {
    /// Tiles and chunks that have a collider.
    pub colliders: usize,
    /// Tiles and chunks that still need one.
    pub missing: usize,
    /// Colliders swapped in since the start.
    pub swaps: u64,
    /// Colliders dropped because their surface had changed again.
    pub stale: u64,
    /// Colliders that could not be made: each is retried, and then its tile or chunk keeps the collider that it has.
    pub failed: u64,
    /// Tiles and chunks checked since the start, because they changed or a source arrived or left.
    pub looked_at: u64,
    /// Tiles and chunks that changed since bodies were last woken.
    pub changes: usize,
    /// Bodies being held.
    pub held: usize,
    /// Bodies woken since the start.
    pub woken: u64,
    /// Bodies lifted out of the ground since the start.
    pub lifted: u64,
    /// Time spent on the main thread in this frame. Colliders that are swapped in with commits count as part of those.
    pub main_thread: Duration,
}

impl Plugin for TerrainPhysicsPlugin {
    fn build(&self, app: &mut App) {
        let colliders = colliders::GroundColliders::default();
        app.init_resource::<SurfaceProcessors>()
            .init_resource::<PhysicsFigures>()
            .init_resource::<GroundContact>()
            .init_resource::<InFixedPostUpdate>()
            .init_resource::<wake::GroundChanges>()
            .init_resource::<wake::WatchedBodies>()
            .init_resource::<upkeep::ColliderTasks>()
            .init_resource::<columns::Columns>();
        app.world_mut().resource_mut::<SurfaceProcessors>().add(colliders.clone());
        app.insert_resource(colliders)
            .configure_sets(
                Update,
                (
                    TerrainPhysicsSystems::Near.in_set(BeforeLoad::Sources),
                    TerrainPhysicsSystems::Upkeep.after(BurrowSystems::Propagate),
                ),
            )
            .add_observer(colliders::forget)
            .add_observer(hold::restore_motion)
            .add_observer(columns::record_insert)
            .add_observer(columns::record_remove)
            .add_observer(edge_walls::build)
            .add_observer(edge_walls::rebuild)
            .add_observer(edge_walls::remove)
            .add_observer(edge_walls::remove_with_terrain)
            .add_observer(ground::change_contact)
            .add_observer(ground::reset_contact)
            .add_systems(First, |mut figures: ResMut<PhysicsFigures>| figures.main_thread = Duration::ZERO)
            .add_systems(Update, sources::find_near.in_set(TerrainPhysicsSystems::Near))
            .add_systems(
                Update,
                (upkeep::finish, upkeep::update).chain().in_set(TerrainPhysicsSystems::Upkeep),
            )
            .add_systems(
                PostUpdate,
                hold::hold_bodies.in_set(TerrainPhysicsSystems::Hold).after(CommitSameFrame),
            )
            .add_systems(
                FixedPreUpdate,
                (wake::wake, wake::find_buried, wake::lift_before_steps)
                    .chain()
                    .run_if(wake::is_first_step)
                    .in_set(TerrainPhysicsSystems::Wake),
            )
            .add_systems(
                FixedPostUpdate,
                (
                    colliders::follow
                        .in_set(PhysicsSystems::Prepare)
                        .after(PhysicsTransformSystems::Propagate)
                        .before(PhysicsTransformSystems::TransformToPosition)
                        .in_set(TerrainPhysicsSystems::Follow),
                    colliders::reset_to_parent
                        .in_set(PhysicsSystems::Writeback)
                        .after(PhysicsTransformSystems::PositionToTransform),
                    wake::lift_after_steps
                        .run_if(wake::is_last_step)
                        .after(PhysicsSystems::Last)
                        .in_set(TerrainPhysicsSystems::Wake),
                    (enter_steps.before(PhysicsSystems::First), leave_steps.after(PhysicsSystems::Last))
                        .chain(),
                ),
            )
            .add_systems(PhysicsSchedule, check_schedule.before(PhysicsStepSystems::First));
    }
}

/// Set while `FixedPostUpdate` runs avian's systems.
#[derive(Resource, Default)]
struct InFixedPostUpdate(bool);

fn enter_steps(mut inside: ResMut<InFixedPostUpdate>) {
    inside.0 = true;
}

fn leave_steps(mut inside: ResMut<InFixedPostUpdate>) {
    inside.0 = false;
}

fn check_schedule(inside: Res<InFixedPostUpdate>) {
    if !inside.0 {
        error_once!(
            "avian took a step outside `FixedPostUpdate`: colliders may follow moving terrains late, and buried bodies may not \
             be lifted. Add `PhysicsPlugins::default()`, unless the game runs such steps itself"
        );
    }
}
