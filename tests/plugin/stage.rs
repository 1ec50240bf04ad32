//! The test app: spawns terrains, sends brushes and collects receipts.

use std::time::{Duration, Instant};

use bevy::ecs::system::RunSystemOnce;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_burrow::prelude::*;
use fastrand::Rng;

use crate::worlds;

/// How long a stage waits before it gives up: the machine may be busy.
const TIMEOUT: Duration = Duration::from_secs(300);

/// Sleep between two frames, so that tasks can proceed.
const FRAME_SLEEP: Duration = Duration::from_micros(500);

/// Longer than small transactions take.
const TRANSACTION_TIME: Duration = Duration::from_millis(60);

/// All receipts.
#[derive(Resource, Default)]
struct Receipts(Vec<BrushApplied>);

/// All messages of one kind.
#[derive(Resource)]
struct Recorded<M: Message>(Vec<M>);

/// The terrains that reported that they are ready.
#[derive(Resource, Default)]
struct ReadyTerrains(Vec<Entity>);

/// An app with the plugin.
pub struct Stage {
    /// The app itself.
    pub app: App,
}

impl Stage {
    /// An app with meshes and transforms, but without a renderer that would extract the meshes.
    pub fn drawing() -> Self {
        Self::with((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin))
    }

    /// A dedicated server: `MinimalPlugins` and nothing else.
    pub fn server() -> Self {
        Self::with(MinimalPlugins)
    }

    /// An app with these plugins besides those of the crate.
    pub fn with<M>(plugins: impl bevy::app::Plugins<M>) -> Self {
        Self::with_all(plugins, |_: &mut App| {})
    }

    /// An app with these plugins besides those of the crate, and some after them.
    pub fn with_all<M, N>(before: impl bevy::app::Plugins<M>, after: impl bevy::app::Plugins<N>) -> Self {
        let mut app = App::new();
        app.add_plugins(before).add_plugins(BurrowPlugins).add_plugins(after);
        app.finish();
        app.cleanup();
        Self::of(app)
    }

    /// An app that has the plugin. Transactions end in a later frame than that in which they begin, unless a test sets
    /// it otherwise: many say what happens between.
    pub fn of(mut app: App) -> Self {
        app.world_mut().get_resource_or_init::<BurrowSettings>().same_frame = Duration::ZERO;
        app.init_resource::<Receipts>()
            .init_resource::<ReadyTerrains>()
            .add_observer(|ready: On<TerrainReady>, mut terrains: ResMut<ReadyTerrains>| {
                terrains.0.push(ready.entity)
            })
            .add_systems(Last, |mut new: MessageReader<BrushApplied>, mut kept: ResMut<Receipts>| {
                kept.0.extend(new.read().cloned());
            });
        Self { app }
    }

    /// Bevy's own plugins, without a window and without a renderer: materials are assets, and nothing is drawn.
    #[cfg(feature = "examples")]
    pub fn windowless() -> Self {
        Self::windowless_with(())
    }

    /// A windowless stage with more plugins.
    #[cfg(feature = "examples")]
    pub fn windowless_with<M>(after: impl bevy::app::Plugins<M>) -> Self {
        let mut app = App::new();
        app.add_plugins(bevys_plugins()).add_plugins(BurrowPlugins).add_plugins(after);
        finish_plugins(&mut app);
        Self::of(app)
    }

    /// Makes the app record messages of one more kind.
    pub fn recording<M: Message + Clone>(mut self) -> Self {
        self.app.insert_resource(Recorded::<M>(Vec::new())).add_systems(
            Last,
            |mut new: MessageReader<M>, mut recorded: ResMut<Recorded<M>>| {
                recorded.0.extend(new.read().cloned())
            },
        );
        self
    }

    /// The messages recorded since the last call.
    pub fn recorded<M: Message>(&mut self) -> Vec<M> {
        std::mem::take(&mut self.app.world_mut().resource_mut::<Recorded<M>>().0)
    }

    /// Writes any message, to be read in the next frame.
    pub fn write<M: Message>(&mut self, message: M) {
        self.app.world_mut().write_message(message).expect("the plugin added the message");
    }

    /// Replaces the settings.
    pub fn with_settings(mut self, settings: BurrowSettings) -> Self {
        self.app.insert_resource(settings);
        self
    }

    /// Inserts a resource, and makes the plugin's systems in `Update` run only while it has this value.
    pub fn run_while<R: Resource + Clone + PartialEq>(&mut self, value: R) {
        self.app.insert_resource(value.clone()).configure_sets(
            Update,
            (
                BurrowSystems::Load,
                BurrowSystems::Collect,
                BurrowSystems::Commit,
                BurrowSystems::Begin,
                BurrowSystems::Propagate,
            )
                .run_if(resource_equals(value)),
        );
    }

    /// Makes each transaction end in a later frame than that in which it begins.
    pub fn without_waiting(mut self) -> Self {
        self.app.world_mut().resource_mut::<BurrowSettings>().same_frame = Duration::ZERO;
        self
    }

    /// Spawns a terrain at the world's origin.
    pub fn spawn(&mut self, terrain: Terrain) -> Entity {
        self.spawn_at(terrain, Vec3::ZERO)
    }

    /// Spawns a terrain at another place.
    pub fn spawn_at(&mut self, terrain: Terrain, place: Vec3) -> Entity {
        self.app.world_mut().spawn((terrain, Transform::from_translation(place))).id()
    }

    /// Spawns a terrain and waits until it is shown.
    pub fn show(&mut self, terrain: Terrain) -> Entity {
        let entity = self.spawn(terrain);
        self.settle();
        entity
    }

    /// Writes a brush message, to be read in the next frame.
    pub fn send(&mut self, brush: Brush) {
        self.app.world_mut().write_message(brush).expect("the plugin added the message");
    }

    /// Writes a brush message for one terrain alone.
    pub fn send_to(&mut self, terrain: Entity, brush: Brush) {
        self.app
            .world_mut()
            .write_message(TargetedBrush { terrain, brush })
            .expect("the plugin added the message");
    }

    /// One frame.
    pub fn frame(&mut self) {
        self.app.update();
    }

    /// Several frames, with time for tasks.
    pub fn frames(&mut self, count: usize) {
        for _ in 0..count {
            self.frame();
            std::thread::sleep(FRAME_SLEEP);
        }
    }

    /// Sleeps, so that small running transactions finish before the next frame.
    pub fn rest(&self) {
        std::thread::sleep(TRANSACTION_TIME);
    }

    /// Updates frames, at least one, until a condition holds. Panics if it never does.
    pub fn frames_until(&mut self, what: &str, is_so: impl FnMut(&mut Self) -> bool) {
        assert!(self.frames_within(TIMEOUT, is_so), "timed out waiting until {what}");
    }

    /// Updates frames, at least one, until a condition holds. Returns `false` if it does not in this time.
    pub fn frames_within(&mut self, time: Duration, mut is_so: impl FnMut(&mut Self) -> bool) -> bool {
        let start = Instant::now();
        while start.elapsed() < time {
            self.frame();
            if is_so(self) {
                return true;
            }
            std::thread::sleep(FRAME_SLEEP);
        }
        false
    }

    /// Updates frames until every terrain is shown and no brush is pending.
    pub fn settle(&mut self) {
        self.frames_until("all terrains settle", |stage| stage.is_settled());
    }

    /// Whether every terrain is shown and no brush is pending.
    pub fn is_settled(&mut self) -> bool {
        let terrains: Vec<Entity> = self.with_component::<Terrain>();
        let ready = &self.app.world().resource::<ReadyTerrains>().0;
        terrains.iter().all(|&entity| {
            let terrain = self.terrain(entity);
            ready.contains(&entity) && terrain.queued() == 0 && !terrain.is_busy()
        })
    }

    /// Waits until all ground is shown as it is, also after a terrain was replaced or changed by the game itself.
    pub fn settle_shown(&mut self) {
        self.frames_until("all ground is shown", |stage| {
            let is_shown = |terrains: Terrains| terrains.is_ready(Vec3::NEG_INFINITY, Vec3::INFINITY);
            let is_shown = stage.app.world_mut().run_system_once(is_shown).expect("terrains can be asked");
            is_shown && stage.is_settled()
        });
    }

    /// A terrain's model.
    pub fn terrain(&self, entity: Entity) -> &Terrain {
        self.app.world().get(entity).expect("the terrain is there")
    }

    /// The hash of a terrain's world.
    pub fn hash(&self, entity: Entity) -> u64 {
        self.terrain(entity).world().hash()
    }

    /// All receipts.
    pub fn receipts(&self) -> &[BrushApplied] {
        &self.app.world().resource::<Receipts>().0
    }

    /// Forgets all receipts.
    #[cfg(feature = "examples")]
    pub fn forget_receipts(&mut self) {
        self.app.world_mut().resource_mut::<Receipts>().0.clear();
    }

    /// The tags of all receipts.
    pub fn tags(&self) -> Vec<u64> {
        self.receipts().iter().map(|applied| applied.receipt.tag).collect()
    }

    /// The plugin's figures.
    pub fn figures(&self) -> &BurrowFigures {
        self.app.world().resource()
    }

    /// All entities with a component.
    pub fn with_component<C: Component>(&mut self) -> Vec<Entity> {
        let world = self.app.world_mut();
        world.query_filtered::<Entity, With<C>>().iter(world).collect()
    }

    /// How many entities have a component.
    pub fn count<C: Component>(&mut self) -> usize {
        self.with_component::<C>().len()
    }

    /// The number of mesh assets.
    pub fn meshes(&self) -> usize {
        self.app.world().resource::<Assets<Mesh>>().len()
    }
}

/// Bevy's own plugins, without a window and without a renderer.
#[cfg(feature = "examples")]
pub fn bevys_plugins() -> bevy::app::PluginGroupBuilder {
    use bevy::log::LogPlugin;
    use bevy::render::RenderPlugin;
    use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
    use bevy::render::settings::WgpuSettings;
    use bevy::window::ExitCondition;
    use bevy::winit::WinitPlugin;

    let settings = WgpuSettings { backends: None, ..default() };
    DefaultPlugins
        .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
        .set(RenderPlugin { render_creation: settings.into(), ..default() })
        .disable::<LogPlugin>()
        .disable::<WinitPlugin>()
        .disable::<PipelinedRenderingPlugin>()
}

/// Lets plugins finish what they have begun.
#[cfg(feature = "examples")]
pub fn finish_plugins(app: &mut App) {
    while app.plugins_state() == bevy::app::PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
}

/// Steep hills of 64 x 64 voxels.
pub fn hills() -> Ground {
    let noise = NoiseHeights {
        seed: 5,
        kind: NoiseKind::Ridged,
        octaves: 4,
        scale: 24.0,
        amplitude: 24.0,
        base: 3.0,
    };
    Ground::from_noise(64, 64, &noise).expect("valid hills")
}

/// Steep hills without edits, in 4 x 4 tiles.
pub fn steep() -> Terrain {
    terrain(hills(), 1.0)
}

/// Level ground of 64 x 64 voxels at height 8, in 4 x 4 tiles.
pub fn level(voxel_size: f32) -> Terrain {
    terrain(Ground::flat(64, 64, 8.0).expect("valid ground"), voxel_size)
}

fn terrain(ground: Ground, voxel_size: f32) -> Terrain {
    Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size }).expect("valid settings")
}

/// A brush that digs a ball.
pub fn dig(x: f32, y: f32, z: f32, radius: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, y, z), radius))
}

/// Brushes of all kinds for the [`hills`]; every other one lies on chunk faces or at the rim. Tags count from 0.
pub fn random_brushes(seed: u64, count: u64) -> Vec<Brush> {
    let (mut rng, ground) = (Rng::with_seed(seed), hills());
    let brush = |tag: u64| {
        let brush = match tag % 2 {
            0 => worlds::random_brush(&mut rng, &ground),
            _ => worlds::random_brush_at_a_face(&mut rng, &ground, 16),
        };
        brush.with_tag(tag)
    };
    (0..count).map(brush).collect()
}
