//! Nothing grows: entities, components, meshes and memory are the same after many levels, digs and undos, with
//! everything on. `BURROW_ROUNDS` is the number of rounds, each of which digs, undoes, walks and occasionally goes to
//! another level.

use avian3d::prelude::PhysicsPlugins;
use bevy_burrow::physics::{ColliderSource, DebrisPlugin, TerrainPhysicsPlugin};

use super::*;

/// Rounds on one level before the next.
const STAY: u64 = 10;

/// What there is of everything.
#[derive(Debug)]
struct Census {
    entities: usize,
    components: usize,
    /// Values in lists of components.
    listed: usize,
    meshes: usize,
    /// Bytes of the process, where the system says so.
    memory: Option<usize>,
}

impl Census {
    fn of(stage: &mut Stage) -> Self {
        let world = stage.app.world_mut();
        let archetypes = world.archetypes().iter();
        let components = archetypes.map(|kind| kind.len() as usize * kind.component_count()).sum();
        let mut classes = world.query::<&bevy::camera::visibility::VisibilityClass>();
        let classes: usize = classes.iter(world).map(|class| class.len()).sum();
        let mut children = world.query::<&Children>();
        let children: usize = children.iter(world).map(|children| children.len()).sum();
        let pages = std::fs::read_to_string("/proc/self/statm").ok();
        let pages = pages.and_then(|text| text.split(' ').nth(1)?.parse::<usize>().ok());
        Self {
            entities: world.entities().count_spawned() as usize,
            components,
            listed: classes + children,
            meshes: stage.meshes(),
            memory: pages.map(|pages| pages * 4096),
        }
    }

    /// Whether nothing has grown by more than what varies.
    fn is_as_small_as(&self, before: &Self) -> bool {
        let fits = |now: usize, before: usize| now <= before + before / 10 + 16;
        fits(self.entities, before.entities)
            && fits(self.components, before.components)
            && fits(self.listed, before.listed)
            && fits(self.meshes, before.meshes)
            && self
                .memory
                .zip(before.memory)
                .is_none_or(|(now, before)| now <= before + before / 4 + (64 << 20))
    }
}

/// One of two levels.
fn level(kind: u64) -> Terrain {
    let noise = NoiseHeights { seed: 7 + kind as u32, scale: 40.0, amplitude: 16.0, base: 8.0, ..default() };
    let ground = Ground::from_noise(128, 128, &noise).expect("valid");
    Terrain::new(ground, &TerrainSettings { chunk_size: 16, ..default() }).expect("valid")
}

struct Journey {
    stage: Stage,
    terrain: Entity,
    camera: Entity,
    folder: std::path::PathBuf,
    rng: Rng,
    kind: u64,
}

impl Journey {
    fn new() -> Self {
        let physics = (PhysicsPlugins::default(), TerrainPhysicsPlugin, DebrisPlugin);
        let mut stage = Stage::windowless_with(physics).recording::<HistoryMoved>();
        stage.app.insert_resource(GroundTextures::Baked { side: 16, anisotropy: 1 });
        let place = Transform::from_xyz(20.0, 30.0, 20.0);
        let camera =
            (Camera::default(), bevy::camera::Projection::default(), ColliderSource { radius: 24.0 });
        let camera = stage.app.world_mut().spawn((camera, place)).id();
        let folder = std::env::temp_dir().join(format!("burrow-flat-{}", std::process::id()));
        drop(std::fs::remove_dir_all(&folder));
        let mut journey = Self { stage, terrain: camera, camera, folder, rng: Rng::with_seed(1), kind: 0 };
        let loads = (levels(), loose(), GroundLook::default(), RenderLayers::from_layers(&[0, 3]));
        let terrain = (level(0), loads, journey.saved());
        journey.terrain = journey.stage.app.world_mut().spawn(terrain).id();
        journey.settle();
        journey
    }

    fn saved(&self) -> SavedWorld {
        SavedWorld::new(self.folder.join(self.kind.to_string()))
    }

    fn walk(&mut self, to: Vec3) {
        self.stage.app.world_mut().get_mut::<Transform>(self.camera).expect("a camera").translation = to;
    }

    fn settle(&mut self) {
        let terrain = self.terrain;
        self.stage.frames_until("nothing is under way", |stage| {
            let world = stage.app.world();
            let model = world.get::<Terrain>(terrain).expect("it is there");
            let shown = world.get::<ShownLevels>(terrain);
            shown.is_some_and(|shown| shown.waiting == 0 && !shown.nodes.is_empty())
                && !world.entity(terrain).contains::<Held>()
                && model.queued() == 0
                && !model.is_busy()
                && is_ready(stage)
        });
    }

    fn round(&mut self, number: u64) {
        if number % STAY == STAY - 1 {
            self.kind = 1 - self.kind;
            let next = (level(self.kind), self.saved());
            self.stage.app.world_mut().entity_mut(self.terrain).insert(next);
        }
        let to = Vec3::new(self.rng.f32() * 128.0, 30.0, self.rng.f32() * 128.0);
        self.walk(to);
        let at = Vec3::new(8.0 + self.rng.f32() * 112.0, 8.0, 8.0 + self.rng.f32() * 112.0);
        self.stage.send(Brush::dig(Shape::sphere(at, 3.0 + self.rng.f32() * 3.0)));
        self.stage.frames(1);
        self.stage.write(Undo::default());
        self.stage.frames(2);
        self.settle();
        // Nobody keeps what was answered.
        drop(self.stage.recorded::<HistoryMoved>());
        self.stage.forget_receipts();
    }

    /// Counts everything, on the first level and in the same place.
    fn census(&mut self) -> Census {
        self.walk(Vec3::new(20.0, 30.0, 20.0));
        self.stage.frames(20);
        self.settle();
        self.stage.frames(20);
        Census::of(&mut self.stage)
    }
}

#[test]
fn nothing_grows_over_many_levels_digs_and_undos() {
    let rounds = variable("BURROW_ROUNDS", 60).next_multiple_of(2 * STAY);
    let mut journey = Journey::new();
    let hash = journey.stage.hash(journey.terrain);
    // Both levels were there, and their folders keep their digs.
    let warm = 2 * STAY.max(rounds / 8 / (2 * STAY) * STAY);
    (0..warm).for_each(|number| journey.round(number));
    let before = journey.census();
    (0..rounds).for_each(|number| journey.round(number));
    let after = journey.census();
    println!("{rounds} rounds: {before:?}, then {after:?}");
    assert!(after.is_as_small_as(&before), "{before:?}, then {after:?}");
    assert_eq!(journey.kind, 0);
    assert_eq!(journey.stage.hash(journey.terrain), hash, "all was undone");
    let folder = journey.folder.clone();
    drop(journey);
    drop(std::fs::remove_dir_all(&folder));
}
