//! How long a tile takes, and how much memory.

use std::time::Instant;

use bevy_burrow::navigation::{NavTilePos, WalkSettings, WalkableTile};
use fastrand::Rng;

use crate::{random_works, walker, worlds};
use bevy_burrow::prelude::*;

/// Prints figures; asserts none of them.
///
/// ```text
/// cargo test --release --no-default-features --features navigation --test navigation -- --ignored --nocapture speed
/// ```
#[test]
#[ignore = "prints figures"]
fn speed_of_tiles() {
    let hills = || {
        let noise =
            NoiseHeights { seed: 5, amplitude: 14.0, scale: 60.0, base: 20.0, ..NoiseHeights::default() };
        Ground::from_noise(512, 512, &noise).expect("a valid ground")
    };
    let mountains = || worlds::steep_real_ground(512, 512, 100, 100, 80.0);
    for (name, ground, digs) in [
        ("plain", Ground::flat(512, 512, 20.0).expect("a valid ground"), 0),
        ("hills", hills(), 0),
        ("dug hills", hills(), 800),
        ("mountains", mountains(), 0),
        ("dug mountains", mountains(), 800),
    ] {
        let mut rng = Rng::with_seed(1);
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("a valid terrain");
        for _ in 0..digs {
            let brush = random_works(&mut rng, terrain.world());
            terrain.apply([brush]);
        }
        let world = terrain.world();
        let walker = walker(&WalkSettings {
            radius: 0.4,
            height: 1.8,
            step: 0.5,
            slope: 1.0,
            precision: 0.5,
            ..WalkSettings::default()
        });
        let tiles: Vec<NavTilePos> = NavTilePos::all(world).collect();
        let mut times = [const { Vec::new() }; 3];
        let (mut cells, mut polygons, mut bytes) = (0, 0, 0);
        for &pos in tiles.iter().chain(&tiles) {
            let start = Instant::now();
            let tile = WalkableTile::new(world, pos, &walker);
            times[0].push(start.elapsed());
            let start = Instant::now();
            let made = tile.polygons();
            times[1].push(start.elapsed());
            let whole = times[0][times[0].len() - 1] + times[1][times[1].len() - 1];
            times[2].push(whole);
            (cells, polygons, bytes) =
                (cells + made.cell_count(), polygons + made.len(), bytes + made.bytes());
        }
        let count = tiles.len() as f64 * 2.0;
        let median = times.map(|mut times| {
            times.sort_unstable();
            (times[times.len() / 2].as_secs_f64() * 1e6, times[times.len() * 99 / 100].as_secs_f64() * 1e6)
        });
        println!(
            "{name}: cells {:.0} us (99 %: {:.0}), polygons {:.0} us (99 %: {:.0}), both {:.0} us (99 %: {:.0}); \
             per tile {:.0} cells, {:.1} polygons, {:.0} bytes",
            median[0].0,
            median[0].1,
            median[1].0,
            median[1].1,
            median[2].0,
            median[2].1,
            cells as f64 / count,
            polygons as f64 / count,
            bytes as f64 / count
        );
    }
}
