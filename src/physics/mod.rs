//! Ground for [avian](https://docs.rs/avian3d): colliders of tiles and chunks, and a body that walks on them.
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
//! # What is where
//!
//! | a game wants | it uses |
//! | --- | --- |
//! | ground that can be stood on | [`TerrainPhysicsPlugin`], and a [`ColliderSource`] on whatever moves about |
//! | a first-person body | [`Character`], steered by [`CharacterSteering`], moved by [`CharacterPlugin`] |
//! | ground that breaks off to fall | [`DebrisPlugin`], and `LooseGround` on the terrain; [`debris_collider`] for bodies of its own |
//! | bodies that cannot leave the terrain | [`EdgeWalls`] on the terrain |
//! | to know whose collider was hit | [`GroundBody`] on the collider's entity |
//! | to know what goes on | [`PhysicsFigures`] |
//!
//! # What holds
//!
//! - **One commit.** A collider is made from the same arrays as the mesh, in the same task, and swapped in the same frame.
//!   It has exactly the triangles that are drawn: none where the tile is dug away, none twice. Servers without meshes have
//!   the same colliders. Only where a source comes while a transaction is under way does the collider follow a task later.
//!   A terrain may be moved and turned: before each step its colliders are put where its tiles and chunks are.
//! - **No bump.** Triangles know their neighbours, those of other tiles and chunks included, see [`GroundShape`]; a body
//!   that rolls over a border or a seam feels the surface, and not where it is cut.
//! - **Nothing falls through.** An old collider stays until the new one takes its place; a collider that was made from an
//!   older world than the one that is shown is thrown away. Colliders are made within the radius of a source, and where it
//!   will be in a second. A body over ground that has no collider yet [is held](HeldByGround) until it has. Where a game
//!   despawned the tile, there is nothing to wait for.
//! - **Dug ground lets go.** Bodies that sleep where a surface changed, moved or went are woken. Bodies that were built over,
//!   or get squeezed into the ground soon after it changed near them, are lifted to the nearest air above, for ground has
//!   one side only; above is where the terrain's own y leads. So is whoever gets into the ground in another way, some
//!   frames later. Sensors, bodies whose layers have nothing to do with the ground, and those that sleep or cannot move up
//!   and down are left alone there.
//!
//! Avian optimises its trees in tasks on the pool that also runs transactions, and waits for them: a large transaction
//! would stop the simulation. The plugin turns that off, unless the game set `ColliderTreeOptimization` otherwise.
//!
//! Bodies are ordinary bodies of avian, and ground is `RigidBody::Static`. Put `Friction`, `CollisionLayers` and the like
//! into [`GroundContact`].

mod character;
mod character_plugin;
mod colliders;
mod columns;
mod cone;
mod debris;
mod edge_walls;
mod frame;
mod ground;
mod hold;
mod hull;
mod near;
mod shape;
mod solids;
mod sources;
mod upkeep;
mod wake;
mod walking;

pub use character::{Character, CharacterMotion, CharacterSteering};
pub use character_plugin::{CharacterPlugin, CharacterSystems};
pub use debris::{Debris, DebrisCrumbled, DebrisPlugin, DebrisSettings};
pub use edge_walls::EdgeWalls;
pub use ground::{GroundBody, GroundCollider, GroundContact};
pub use hold::HeldByGround;
pub use hull::debris_collider;
pub use shape::GroundShape;
pub use sources::ColliderSource;

use std::time::Duration;

use avian3d::physics_transform::PhysicsTransformSystems;
use avian3d::prelude::{PhysicsSchedule, PhysicsStepSystems, PhysicsSystems};
use bevy::prelude::*;

use crate::plugin::{BurrowSystems, SurfaceProcessors};

/// Colliders for terrains. Needs avian's `PhysicsPlugins`, and the crate's own `BurrowPlugins`.
///
/// Avian has to run in `FixedPostUpdate`, where `PhysicsPlugins::default()` puts it: what the plugin does before and after a
/// step is in `FixedPreUpdate` and `FixedPostUpdate`, see [`TerrainPhysicsSystems`]. With `PhysicsPlugins::new` and another
/// schedule, colliders would follow a terrain that moves, and bodies would be lifted, at other times than steps are taken: an
/// error says so.
#[derive(Default)]
pub struct TerrainPhysicsPlugin;

/// What the plugin does, in this order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TerrainPhysicsSystems {
    /// In `Update`: where colliders are wanted.
    Near,
    /// In `Update`, after commits: colliders that are missing are made in tasks, those far away removed.
    Upkeep,
    /// In `PostUpdate`: bodies over ground without colliders are held, others let go.
    Hold,
    /// In `FixedPreUpdate`, before a frame's first step: bodies where ground changed are woken, and lifted out of it, and so
    /// are others that are in it. In `FixedPostUpdate`, after its last step, those that were pushed into the ground are
    /// lifted too.
    Wake,
    /// In `FixedPostUpdate`, before a step: colliders are put where their tiles and chunks are.
    Follow,
}

/// What the plugin has, and did lately.
#[derive(Resource, Reflect, Clone, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct PhysicsFigures {
    /// Tiles and chunks that have a collider.
    pub colliders: usize,
    /// Tiles and chunks that wait for one.
    pub missing: usize,
    /// Colliders swapped in so far, with commits and without.
    pub swaps: u64,
    /// Colliders that came too late, for their surface had changed again.
    pub stale: u64,
    /// Tiles and chunks looked at so far, because something happened to them or a source came near or left.
    pub looked_at: u64,
    /// Tiles and chunks that changed, moved or went, and that bodies have not been told of yet.
    pub changes: usize,
    /// Bodies that are held.
    pub held: usize,
    /// Bodies woken so far.
    pub woken: u64,
    /// Bodies lifted out of the ground so far.
    pub lifted: u64,
    /// What all of this took on the main thread since the frame began, but for colliders that came with commits, which
    /// count there.
    pub main_thread: Duration,
}

impl Plugin for TerrainPhysicsPlugin {
    fn build(&self, app: &mut App) {
        let grounds = colliders::Grounds::default();
        app.init_resource::<SurfaceProcessors>()
            .init_resource::<PhysicsFigures>()
            .init_resource::<GroundContact>()
            .init_resource::<IsAroundSteps>()
            .init_resource::<wake::GroundChanges>()
            .init_resource::<wake::Watched>()
            .init_resource::<upkeep::Work>()
            .init_resource::<columns::Columns>();
        app.world_mut().resource_mut::<SurfaceProcessors>().add(grounds.clone());
        app.insert_resource(grounds)
            .configure_sets(
                Update,
                (
                    TerrainPhysicsSystems::Near.before(BurrowSystems::Load),
                    TerrainPhysicsSystems::Upkeep.after(BurrowSystems::Propagate),
                ),
            )
            .add_observer(colliders::forget)
            .add_observer(hold::go_on)
            .add_observer(columns::note_new)
            .add_observer(columns::note_gone)
            .add_observer(edge_walls::build)
            .add_observer(edge_walls::rebuild)
            .add_observer(edge_walls::remove)
            .add_systems(First, |mut figures: ResMut<PhysicsFigures>| figures.main_thread = Duration::ZERO)
            .add_systems(Update, sources::find_near.in_set(TerrainPhysicsSystems::Near))
            .add_systems(Update, (upkeep::finish, upkeep::tend).chain().in_set(TerrainPhysicsSystems::Upkeep))
            .add_systems(PostUpdate, hold::hold.in_set(TerrainPhysicsSystems::Hold))
            .add_systems(
                FixedPreUpdate,
                (wake::wake, wake::patrol, wake::rescue_before)
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
                    colliders::stay
                        .in_set(PhysicsSystems::Writeback)
                        .after(PhysicsTransformSystems::PositionToTransform),
                    wake::rescue_after
                        .run_if(wake::is_last_step)
                        .after(PhysicsSystems::Last)
                        .in_set(TerrainPhysicsSystems::Wake),
                    (come_to_steps.before(PhysicsSystems::First), leave_steps.after(PhysicsSystems::Last))
                        .chain(),
                ),
            )
            .add_systems(PhysicsSchedule, check_schedule.before(PhysicsStepSystems::First));
    }
}

/// Is avian's schedule the one that the plugin works around?
#[derive(Resource, Default)]
struct IsAroundSteps(bool);

fn come_to_steps(mut is_around: ResMut<IsAroundSteps>) {
    is_around.0 = true;
}

fn leave_steps(mut is_around: ResMut<IsAroundSteps>) {
    is_around.0 = false;
}

fn check_schedule(is_around: Res<IsAroundSteps>) {
    if !is_around.0 {
        error_once!(
            "avian took a step outside `FixedPostUpdate`: colliders of terrains may follow late, and bodies may not be lifted \
             out of the ground. Unless the game takes such steps by itself, add `PhysicsPlugins::default()`"
        );
    }
}
