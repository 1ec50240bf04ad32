//! Small terrains for these tests.

use bevy_burrow::prelude::*;

pub fn terrain(ground: Ground, chunk_size: u32) -> Terrain {
    Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid settings")
}

/// Level ground with a step, small enough that any brush is applied quickly.
pub fn small_terrain() -> Terrain {
    let height = |x: i32, z: i32| if x < 6 { 4.0 } else { 9.5 + f64::from(z) / 4.0 };
    terrain(Ground::from_fn(14, 12, height).expect("finite heights"), 8)
}

pub fn assert_flawless(terrain: &Terrain, what: impl std::fmt::Debug) {
    let report = terrain.world().check_seams();
    assert!(report.is_flawless(), "{what:?}: {report}");
}
