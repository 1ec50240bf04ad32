//! A player that digs, undoes and changes rules at random, and the states of all revisions of the world.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::lattice::{BrickPos, ChunkPos, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::store::{Opened, SimulatedDisk, Store, StoreError, StoreOptions};
use bevy_burrow::terrain::Meshing;
use bevy_burrow::volume::{Brick, Field};
use fastrand::Rng;
use glam::{IVec3, UVec3, Vec2, Vec3};

use crate::worlds::{any_random_brush, random_ground_of_size, random_rules};

/// A count from the environment, or the default.
pub fn count(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|count| count.parse().ok()).unwrap_or(default)
}

/// A small ground.
pub fn ground(seed: u64) -> Arc<Ground> {
    Arc::new(random_ground_of_size(&mut Rng::with_seed(seed), seed, 70 + seed as u32 % 60, 80))
}

/// A terrain without meshes.
pub fn terrain(ground: &Arc<Ground>) -> Terrain {
    let settings = TerrainSettings { chunk_size: 25, ..TerrainSettings::default() };
    let mut terrain = Terrain::new(Arc::clone(ground), &settings).expect("valid settings");
    terrain.set_meshing(Meshing::Never);
    terrain
}

/// Saves at once, and makes a checkpoint after this many commits.
pub fn options(checkpoint_commits: u64) -> StoreOptions {
    StoreOptions { loss_window: Duration::ZERO, checkpoint_commits, ..StoreOptions::default() }
}

/// Everything that a save must restore.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    pub hash: u64,
    pub fields: BTreeMap<ChunkPos, Vec<Field>>,
    pub next_field: u64,
    pub rules: Option<DiggingRules>,
    pub loose: Option<LooseSettings>,
}

/// The state of a terrain.
pub fn state(terrain: &Terrain) -> State {
    let world = terrain.world();
    State {
        hash: world.hash(),
        fields: world.fields().map(|(chunk, fields)| (chunk, fields.iter().copied().collect())).collect(),
        next_field: terrain.parts().change.next_field,
        rules: terrain.rules().cloned(),
        loose: terrain.loose().copied(),
    }
}

/// The edited samples of each brick.
pub fn samples(terrain: &Terrain) -> BTreeMap<BrickPos, Vec<String>> {
    let of = |(pos, brick): (BrickPos, &Brick)| {
        (pos, brick.edited_samples(pos).map(|sample| format!("{sample:?}")).collect())
    };
    terrain.world().bricks().map(of).collect()
}

/// Does something at random: mostly digs.
pub fn act(terrain: &mut Terrain, rng: &mut Rng) {
    match rng.u32(0..14) {
        0 => drop(terrain.undo()),
        1 => drop(terrain.redo()),
        2 => {
            let rules = match rng.u32(0..3) {
                0 => DiggingRules::default().with_unbreakable(MaterialId(rng.u8(0..4))),
                1 => random_rules(rng, terrain.world().ground()),
                _ => DiggingRules::default(),
            };
            terrain.set_rules(rules).expect("valid rules");
        }
        3 => {
            let loose = LooseSettings { largest: 4096, crumbs: rng.u32(0..40), debris: rng.u32(0..400) };
            terrain.set_loose(rng.bool().then_some(loose));
        }
        4 => drop(terrain.apply([brush_with_content(rng)])),
        _ => {
            let brush = any_random_brush(rng, terrain.world().ground());
            drop(terrain.apply([brush]));
        }
    }
}

/// A brush with a grid, with a prefab, with both, or with an image: one of a few, so that they come again.
pub fn brush_with_content(rng: &mut Rng) -> Brush {
    let place = |rng: &mut Rng, low: f32| Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 40.0 + low;
    let within = GridShape::new(ball(rng.i32(5..8)), place(rng, 8.0)).with_scale(1.5);
    let paste = Paste::new(block(rng.u64(0..3)), place(rng, 0.0)).turned_about_y(rng.i32(0..4));
    match rng.u8(0..6) {
        0 => Brush::add(within, MaterialId(rng.u8(0..4))),
        1 => Brush::paste(paste),
        2 => Brush::reset(within),
        3 => Brush::reset(Shape::sphere(place(rng, 8.0), 9.0)),
        4 => {
            let at = place(rng, 0.0);
            Brush::stamp(within, Stamp::new(ramp(rng.u16(1..4)), at, Vec2::splat(12.0), 3.0))
        }
        _ => Brush { operation: Operation::Paste { paste }, ..Brush::dig(within) },
    }
}

/// A ball of some samples along its side.
pub fn ball(side: i32) -> ShapeGrid {
    let middle = (side - 1) as f32 / 2.0;
    let distance = |at: IVec3| (at.as_vec3() - middle).length() - middle + 1.2;
    ShapeGrid::from_fn(UVec3::splat(side as u32), distance).expect("valid")
}

/// An image that becomes brighter along one side.
fn ramp(steepness: u16) -> GreyImage {
    let samples = (0..64).map(|at| at % 8 * 2000 * steepness).collect();
    GreyImage::from_samples(8, 8, samples).expect("valid")
}

/// A copy of some ground with a ball of ground or of air in it.
pub fn block(seed: u64) -> Prefab {
    let ground = Ground::flat(32, 32, 10.0).expect("valid");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    let ball = Shape::sphere(Vec3::new(16.0, 10.0, 16.0), 3.0 + seed as f32);
    terrain.apply([if seed.is_multiple_of(2) { Brush::dig(ball) } else { Brush::add(ball, MaterialId(2)) }]);
    let min = IVec3::new(9, 3, 9);
    terrain.world().copy(LatticeBox { min, max: min + 14 }, min + 7).expect("in the world")
}

/// The key of the revision in the game data, so that game data and ground can be compared.
pub const TURN: &str = "turn";

/// Stores the revision together with the commits that lead to it.
pub fn save(store: &mut Store, terrain: &mut Terrain) -> Result<(), StoreError> {
    store.put(TURN, terrain.world().revision().to_le_bytes());
    store.follow(terrain)
}

/// Checks that an opened world equals one of the states between two revisions; returns its revision.
pub fn check_opened(
    (store, opened): &(Store, Opened),
    states: &BTreeMap<u64, Vec<State>>,
    acknowledged: u64,
    latest: u64,
) -> u64 {
    let revision = opened.terrain.world().revision();
    assert!(
        (acknowledged..=latest).contains(&revision),
        "revision {revision}, but {acknowledged} was acknowledged and {latest} the last: {:?}",
        opened.warnings
    );
    let found = state(&opened.terrain);
    let was = states.get(&revision).is_some_and(|states| states.contains(&found));
    assert!(was, "revision {revision} was never like {found:?}: {:?}", opened.warnings);
    let turn = store.get(TURN).map(|turn| u64::from_le_bytes(turn.try_into().expect("8 bytes")));
    assert_eq!(turn.unwrap_or_default(), revision, "game data is of another revision");
    assert_eq!((store.revision(), store.durable()), (revision, revision));
    revision
}

/// Opens the world of a simulated disk.
pub fn open(disk: &SimulatedDisk, ground: &Arc<Ground>) -> Result<(Store, Opened), StoreError> {
    Store::open_in(Arc::new(disk.clone()), Arc::clone(ground), options(16))
}
