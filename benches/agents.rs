//! Frames with many agents on ground that is dug: `cargo bench --features examples --bench agents [-- OPTIONS]`.
//!
//! A server without rendering at 60 frames a second: hills with pits and tunnels, a `NavigationSource`, and agents of landmass.
//! They walk to random places nearby, and on to others once they arrive. With digs, 20 spheres of radius 3 to 4 are dug a second.
//!
//! Prints for each number of agents, without digs and with them, the median, the 95th and the 99th percentile of whole frames, of
//! this plugin's systems (from the first to the last in each schedule, with what they wait for tasks), of landmass, and of
//! what moves the agents; the share of frames over 16.7 ms; how many agents walk; and how many navigation meshes are replaced.
//!
//! `--help` lists the options.

use std::time::{Duration, Instant};

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::navigation::WalkSettings;
use bevy_burrow::paths::bevy_landmass::prelude::*;
use bevy_burrow::paths::bevy_landmass::{Agent3d, PauseAgent};
use bevy_burrow::paths::{
    Navigation, NavigationArea, NavigationPlugin, NavigationSource, NavigationSystems, NavigationTiles,
};
use bevy_burrow::prelude::*;
use clap::Parser;
use fastrand::Rng;

/// The time of a frame.
const FRAME: Duration = Duration::from_nanos(16_666_667);
/// Cells along each side of the world.
const SIDE: u32 = 512;
/// Pits and tunnels that are there from the beginning.
const WORKS: usize = 400;
/// Frames from one dig to the next: 20 digs a second.
const DIG_EVERY: u32 = 3;
/// Frames that are not counted, while all agents look for their first path.
const FIRST: u32 = 60;

#[derive(Parser, Resource, Clone, Debug)]
struct Options {
    /// Numbers of agents.
    #[arg(long, value_delimiter = ',', default_values_t = [0, 100, 1000])]
    agents: Vec<usize>,
    /// Metres around the middle of the world where there are navigation meshes and agents.
    #[arg(long, default_value_t = 120.0)]
    radius: f32,
    /// Metres to the farthest targets.
    #[arg(long, default_value_t = 40.0)]
    target: f32,
    /// Metres that polygons may be above or below the ground.
    #[arg(long, default_value_t = 0.3)]
    precision: f32,
    /// Metres within which agents avoid each other and walls; those of landmass for their radius unless given.
    #[arg(long)]
    neighbourhood: Option<f32>,
    /// Agents take turns: in each frame, landmass sees one agent in this many.
    #[arg(long, default_value_t = 1)]
    turns: u32,
    /// Seconds that are measured.
    #[arg(long, default_value_t = 6)]
    seconds: u32,
    /// Given by Cargo.
    #[arg(long, hide = true)]
    bench: bool,
}

impl Options {
    fn agent(&self) -> WalkSettings {
        WalkSettings {
            radius: 0.4,
            height: 1.8,
            step: 0.4,
            slope: 1.0,
            precision: self.precision,
            ..default()
        }
    }

    /// A position on the ground within the radius, at most `target` metres from another one.
    fn place(&self, rng: &mut Rng, terrain: &Terrain, near: Option<Vec3>) -> Vec3 {
        let middle = Vec2::splat(SIDE as f32 / 2.0);
        loop {
            let (center, reach) = near.map_or((middle, self.radius), |near| (near.xz(), self.target));
            let way = Vec2::from_angle(rng.f32() * std::f32::consts::TAU);
            let at = center + way * reach * rng.f32().sqrt();
            if at.distance(middle) < self.radius
                && let Some(height) = terrain.world().height(at.x.into(), at.y.into())
            {
                return Vec3::new(at.x, height as f32, at.y);
            }
        }
    }
}

/// What plays the game.
#[derive(Resource)]
struct Game(Rng);

/// How long parts of a frame took: this plugin, landmass, and what moves agents.
#[derive(Resource, Default)]
struct Clock {
    since: Option<Instant>,
    parts: [Duration; 3],
}

const PLUGIN: usize = 0;
const LANDMASS: usize = 1;
const WALKING: usize = 2;

fn begin(mut clock: ResMut<Clock>) {
    clock.since = Some(Instant::now());
}

fn end<const PART: usize>(mut clock: ResMut<Clock>) {
    let took = clock.since.take().map_or(Duration::ZERO, |since| since.elapsed());
    clock.parts[PART] += took;
}

/// Navigation meshes that were replaced.
#[derive(Resource, Default)]
struct Replaced(usize);

fn count_replaced(mut events: MessageReader<AssetEvent<NavMesh3d>>, mut replaced: ResMut<Replaced>) {
    replaced.0 += events.read().filter(|event| matches!(event, AssetEvent::Modified { .. })).count();
}

/// Moves agents over the ground nearest to their feet, and gives those that arrived, or cannot, another target.
fn walk(
    mut agents: Query<(
        &mut Transform,
        &mut Velocity3d,
        &mut AgentTarget3d,
        &AgentDesiredVelocity3d,
        &AgentState,
    )>,
    terrain: Single<&Terrain>,
    options: Res<Options>,
    mut game: ResMut<Game>,
    time: Res<Time>,
) {
    let world = terrain.world();
    for (mut place, mut velocity, mut target, wanted, state) in &mut agents {
        let wanted = wanted.velocity().with_y(0.0);
        let mut at = place.translation + wanted * time.delta_secs();
        let spans = world.spans(at.x.into(), at.z.into()).into_iter();
        let floors = spans.map(|span| span.floor as f32);
        if let Some(floor) = floors.min_by(|a, b| (a - at.y).abs().total_cmp(&(b - at.y).abs())) {
            at.y = floor;
        }
        let has_target = !matches!(
            state,
            AgentState::ReachedTarget
                | AgentState::NoPath
                | AgentState::TargetNotOnNavMesh
                | AgentState::AgentNotOnNavMesh
        );
        if *state == AgentState::AgentNotOnNavMesh {
            at = options.place(&mut game.0, &terrain, None);
        }
        if !has_target {
            *target = AgentTarget3d::Point(options.place(&mut game.0, &terrain, Some(at)));
        }
        place.translation = at;
        velocity.velocity = wanted;
    }
}

/// Lets landmass see one of several agents in each frame. The others keep their velocity, or stop if their path is gone.
fn take_turns(
    agents: Query<(Entity, Has<PauseAgent>), With<Agent3d>>,
    options: Res<Options>,
    mut turn: Local<u32>,
    mut commands: Commands,
) {
    *turn = (*turn + 1) % options.turns;
    for (agent, is_paused) in &agents {
        let is_next = agent.index_u32() % options.turns == *turn;
        if is_next && is_paused {
            commands.entity(agent).remove::<PauseAgent>();
        } else if !is_next && !is_paused {
            commands.entity(agent).insert(PauseAgent);
        }
    }
}

/// An app whose navigation meshes are loaded, with these agents.
fn app(options: &Options, agents: usize) -> App {
    let mut app = App::new();
    app.insert_resource(TimeUpdateStrategy::ManualDuration(FRAME))
        .insert_resource(Time::<Fixed>::from_duration(FRAME))
        .insert_resource(options.clone())
        .insert_resource(Game(Rng::with_seed(1)))
        .init_resource::<Clock>()
        .init_resource::<Replaced>()
        .add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin))
        .add_plugins((BurrowPlugins, Landmass3dPlugin::default(), NavigationPlugin::default()))
        .add_systems(PreUpdate, (begin.before(NavigationSystems), end::<PLUGIN>.after(NavigationSystems)))
        .add_systems(
            FixedPreUpdate,
            (begin.before(LandmassSystems::SyncExistence), end::<LANDMASS>.after(LandmassSystems::Output)),
        )
        .add_systems(FixedUpdate, (begin, walk, end::<WALKING>).chain())
        .add_systems(
            Update,
            (begin.before(BurrowSystems::Load), end::<PLUGIN>.after(BurrowSystems::Propagate)),
        )
        .add_systems(PostUpdate, (begin.before(NavigationSystems), end::<PLUGIN>.after(NavigationSystems)))
        .add_systems(Last, count_replaced);
    if options.turns > 1 {
        app.add_systems(FixedPreUpdate, take_turns.before(begin).before(LandmassSystems::SyncExistence));
    }
    app.finish();
    app.cleanup();

    let noise = NoiseHeights { seed: 5, amplitude: 14.0, scale: 60.0, base: 20.0, ..NoiseHeights::default() };
    let ground = Ground::from_noise(SIDE, SIDE, &noise).expect("valid parameters");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let mut rng = Rng::with_seed(2);
    for _ in 0..WORKS {
        let at = options.place(&mut rng, &terrain, None);
        let to = options.place(&mut rng, &terrain, Some(at));
        let shape = match rng.bool() {
            true => Shape::sphere(at, 3.5),
            false => Shape::capsule(at - 2.0 * Vec3::Y, to - 2.0 * Vec3::Y, 3.0),
        };
        terrain.apply([Brush::dig(shape)]);
    }
    let places: Vec<[Vec3; 2]> = (0..agents)
        .map(|_| {
            let at = options.place(&mut rng, &terrain, None);
            [at, options.place(&mut rng, &terrain, Some(at))]
        })
        .collect();

    let world = app.world_mut();
    let terrain = world.spawn(terrain).id();
    let agent = options.agent();
    let mut landmass = agent.archipelago_options(1.0);
    landmass.neighbourhood = options.neighbourhood.unwrap_or(landmass.neighbourhood);
    let archipelago = world.spawn(Archipelago3d::new(landmass)).id();
    let area = NavigationArea::NearSources;
    let navigation = world.spawn(Navigation { terrain, archipelago, agent, area }).id();
    let middle = Transform::from_xyz(SIDE as f32 / 2.0, 20.0, SIDE as f32 / 2.0);
    world.spawn((NavigationSource { radius: options.radius }, middle));
    let start = Instant::now();
    let mut is_loading = true;
    while is_loading {
        assert!(start.elapsed() < Duration::from_secs(300), "the navigation meshes never came");
        app.update();
        std::thread::sleep(Duration::from_millis(1));
        let tiles = app.world().get::<NavigationTiles>(navigation);
        is_loading = tiles.is_none_or(|tiles| tiles.is_empty() || tiles.is_loading() || tiles.is_building());
    }
    for [at, to] in places {
        app.world_mut().spawn((
            Transform::from_translation(at),
            Agent3dBundle {
                agent: default(),
                settings: AgentSettings { radius: agent.radius, desired_speed: 3.0, max_speed: 4.0 },
                archipelago_ref: ArchipelagoRef3d::new(archipelago),
            },
            AgentTarget3d::Point(to),
        ));
    }
    app
}

/// How many agents walk, and how many arrived: they have a path.
fn count_walking(app: &mut App) -> [usize; 2] {
    let mut agents = app.world_mut().query::<(&AgentState, &AgentDesiredVelocity3d)>();
    let mut counts = [0; 2];
    for (state, wanted) in agents.iter(app.world()) {
        let walks = match state {
            AgentState::Moving => true,
            // Between its turns.
            AgentState::Paused => wanted.velocity() != Vec3::ZERO,
            _ => false,
        };
        counts[0] += usize::from(walks);
        counts[1] += usize::from(*state == AgentState::ReachedTarget);
    }
    counts
}

fn percentiles(mut times: Vec<Duration>) -> String {
    times.sort_unstable();
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e3;
    format!("{:.2} / {:.2} / {:.2}", at(0.5), at(0.95), at(0.99))
}

/// Prints a row of the table.
fn measure(options: &Options, agents: usize, digs: bool) {
    let mut app = app(options, agents);
    let mut rng = Rng::with_seed(3);
    let (mut frames, mut parts) = (Vec::new(), [const { Vec::new() }; 3]);
    let (mut walking, mut arrived) = (0, 0);
    for frame in 0..FIRST + options.seconds * 60 {
        if frame == FIRST {
            app.world_mut().resource_mut::<Replaced>().0 = 0;
        }
        if digs && frame % DIG_EVERY == 0 {
            let terrain = app.world_mut().query::<&Terrain>().single(app.world()).expect("one terrain");
            let at = options.place(&mut rng, terrain, None);
            let dig = Brush::dig(Shape::sphere(at, 3.0 + rng.f32()));
            app.world_mut().write_message(dig);
        }
        app.world_mut().resource_mut::<Clock>().parts = default();
        let start = Instant::now();
        app.update();
        let took = start.elapsed();
        if frame >= FIRST {
            frames.push(took);
            let clock = app.world().resource::<Clock>();
            parts.iter_mut().zip(clock.parts).for_each(|(times, part)| times.push(part));
            let counts = count_walking(&mut app);
            (walking, arrived) = (walking + counts[0], arrived + counts[1]);
        }
        std::thread::sleep(FRAME.saturating_sub(start.elapsed()));
    }
    let (count, replaced) = (frames.len(), app.world().resource::<Replaced>().0);
    let late = frames.iter().filter(|frame| **frame > FRAME).count() as f64 / count as f64;
    let [plugin, landmass, moving] = parts.map(percentiles);
    println!(
        "| {agents} | {} | {} | {plugin} | {landmass} | {moving} | {:.1} % | {} | {} | {} |",
        if digs { 20 } else { 0 },
        percentiles(frames),
        100.0 * late,
        walking / count,
        (walking + arrived) / count,
        replaced as u32 / options.seconds,
    );
}

fn main() {
    let options = Options::parse();
    assert!(options.turns > 0 && options.seconds > 0, "turns and seconds must be at least 1");
    println!(
        "| agents | digs a second | frame ms: median / 95 % / 99 % | plugin | landmass | moving agents | over 16.7 ms | walking | \
         with a path | meshes replaced a second |"
    );
    println!("|{}", " --- |".repeat(10));
    for &agents in &options.agents {
        for digs in [false, true] {
            measure(&options, agents, digs);
        }
    }
}
