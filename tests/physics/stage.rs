//! The test app: a terrain, bodies, and one physics step per frame.

use std::time::{Duration, Instant};

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::physics::{
    Character, CharacterMotion, CharacterPlugin, CharacterSteering, ColliderSource, DebrisPlugin, GroundBody,
    HeldByGround, PhysicsFigures, TerrainPhysicsPlugin,
};
use bevy_burrow::prelude::*;

/// Seconds per step.
pub const STEP: f32 = 1.0 / 64.0;

/// How long a stage waits before it gives up: the machine may be busy.
const TIMEOUT: Duration = Duration::from_secs(300);

/// Sleep between two frames, so that tasks can proceed.
const FRAME_SLEEP: Duration = Duration::from_micros(500);

/// All receipts.
#[derive(Resource, Default)]
struct Receipts {
    all: usize,
    /// Receipts of edits that changed a sample.
    changed: usize,
}

/// An app with the plugin, as on a dedicated server: no meshes, no assets.
pub struct Stage {
    /// The app itself.
    pub app: App,
}

impl Stage {
    pub fn new() -> Self {
        Self::within(App::new())
    }

    /// Like [`Self::new`], in an app that already has settings for plugins.
    pub fn within(mut app: App) -> Self {
        app.add_plugins((
            MinimalPlugins,
            PhysicsPlugins::default(),
            BurrowPlugins,
            TerrainPhysicsPlugin,
            CharacterPlugin::default(),
            DebrisPlugin,
        ))
        .init_resource::<Receipts>()
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f32(STEP)))
        .add_systems(Last, |mut new: MessageReader<BrushApplied>, mut kept: ResMut<Receipts>| {
            for BrushApplied { receipt, .. } in new.read() {
                kept.all += 1;
                let is_change = receipt.outcome.as_ref().is_ok_and(|applied| applied.bounds.is_some());
                kept.changed += usize::from(is_change);
            }
        });
        app.finish();
        app.cleanup();
        Self { app }
    }

    /// With meshes, but no renderer.
    pub fn with_meshes() -> Self {
        let mut stage = Self::new();
        stage.app.init_resource::<Assets<Mesh>>();
        stage
    }

    /// Spawns a terrain, and a source that reaches all of it.
    pub fn with_ground(terrain: Terrain) -> (Self, Entity) {
        Self::new().on(terrain)
    }

    /// Spawns a terrain and its source in this stage.
    pub fn on(mut self, terrain: Terrain) -> (Self, Entity) {
        let entity = self.app.world_mut().spawn(terrain).id();
        self.app.world_mut().spawn((Transform::default(), ColliderSource { radius: 1e4 }));
        self.settle();
        (self, entity)
    }

    pub fn frame(&mut self) {
        self.app.update();
    }

    pub fn frames(&mut self, count: usize) {
        (0..count).for_each(|_| self.frame());
    }

    /// Updates frames until a condition holds. Panics if it never does.
    pub fn frames_until(&mut self, what: &str, mut is_so: impl FnMut(&mut Self) -> bool) {
        let start = Instant::now();
        while start.elapsed() < TIMEOUT {
            self.frame();
            if is_so(self) {
                return;
            }
            std::thread::sleep(FRAME_SLEEP);
        }
        panic!("timed out waiting until {what}");
    }

    /// Updates frames until no edit is pending and no collider is missing. Time is paused meanwhile.
    pub fn settle(&mut self) {
        self.app.world_mut().resource_mut::<Time<Physics>>().pause();
        self.frames_until("the ground settles", |stage| {
            stage.is_idle() && stage.figures().colliders > 0 && stage.figures().missing == 0
        });
        self.frames(2);
        self.app.world_mut().resource_mut::<Time<Physics>>().unpause();
    }

    /// Whether no edit is pending.
    pub fn is_idle(&mut self) -> bool {
        let world = self.app.world_mut();
        let mut terrains = world.query::<&Terrain>();
        terrains.iter(world).all(|terrain| terrain.queued() == 0 && !terrain.is_busy())
    }

    /// Updates frames until no edit is pending. All time is paused meanwhile: physics takes no step, not even the
    /// last one that it takes after it was paused itself.
    pub fn catch_up(&mut self) {
        self.app.world_mut().resource_mut::<Time<Virtual>>().pause();
        self.frames_until("edits are applied", Self::is_idle);
        self.app.world_mut().resource_mut::<Time<Virtual>>().unpause();
    }

    /// Elapsed seconds of physics.
    pub fn seconds(&self) -> f32 {
        self.app.world().resource::<Time<Physics>>().elapsed_secs()
    }

    pub fn figures(&self) -> &PhysicsFigures {
        self.app.world().resource()
    }

    pub fn receipts(&self) -> usize {
        self.app.world().resource::<Receipts>().all
    }

    /// The number of edits so far that changed a sample.
    pub fn changed(&self) -> usize {
        self.app.world().resource::<Receipts>().changed
    }

    pub fn send(&mut self, brush: Brush) {
        self.app.world_mut().write_message(brush).expect("the plugin added the message");
    }

    /// Sends brushes and waits until they are applied, with time paused.
    pub fn dig(&mut self, brushes: impl IntoIterator<Item = Brush>) {
        brushes.into_iter().for_each(|brush| self.send(brush));
        self.frame();
        self.settle();
    }

    /// Spawns a ball with a velocity.
    pub fn ball(&mut self, place: Vec3, radius: f32, velocity: Vec3) -> Entity {
        let body = (RigidBody::Dynamic, Collider::sphere(radius), Transform::from_translation(place));
        let turn = Vec3::new(velocity.z, 0.0, -velocity.x) / radius;
        self.app.world_mut().spawn((body, LinearVelocity(velocity), AngularVelocity(turn))).id()
    }

    /// Spawns a standing character.
    pub fn character(&mut self, feet: Vec3, direction: Vec2) -> Entity {
        let character = Character::default();
        let place = character.standing_at(feet);
        self.app.world_mut().spawn((character, place, CharacterSteering { direction, ..default() })).id()
    }

    pub fn place(&self, body: Entity) -> Vec3 {
        self.app.world().get::<Transform>(body).expect("the body is there").translation
    }

    pub fn feet(&self, character: Entity) -> Vec3 {
        Character::default().feet(self.place(character))
    }

    pub fn motion(&self, character: Entity) -> CharacterMotion {
        *self.app.world().get(character).expect("the character is there")
    }

    pub fn is_held(&self, body: Entity) -> bool {
        self.app.world().get::<HeldByGround>(body).is_some()
    }

    pub fn terrain(&self, entity: Entity) -> &Terrain {
        self.app.world().get(entity).expect("the terrain is there")
    }

    /// All bodies of ground.
    pub fn ground(&mut self) -> Vec<Entity> {
        let world = self.app.world_mut();
        world.query_filtered::<Entity, With<GroundBody>>().iter(world).collect()
    }
}

/// Level ground at height 8.
pub fn level(cells: u32, voxel_size: f32) -> Terrain {
    let ground = Ground::flat(cells, cells, 8.0).expect("valid ground");
    Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size }).expect("valid settings")
}

/// A brush that digs a ball.
pub fn pit(x: f32, y: f32, z: f32, radius: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, y, z), radius))
}
