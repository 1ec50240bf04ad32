//! Walkable cells are exactly those of the definition, and an agent fits wherever it walks.
//!
//! ```text
//! BURROW_PATH_WORLDS=1000 cargo test --release --no-default-features --features navigation --test navigation
//! ```

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::navigation::{NavTilePos, WalkableTile};
use bevy_burrow::terrain::World;
use fastrand::Rng;

use crate::reference::walkable_cells;
use crate::{all_cells, height_in, random_dug_world, random_settings, random_works, walker, world_count};

#[test]
fn cells_are_walkable_exactly_where_the_definition_says() {
    let mut total = 0;
    for index in 0..world_count(12) {
        let mut rng = Rng::with_seed(index);
        let terrain = random_dug_world(&mut rng, index);
        let settings = random_settings(&mut rng);
        let found = all_cells(terrain.world(), &walker(&settings));
        let expected = walkable_cells(terrain.world(), &settings);
        let missing = expected.iter().find(|cell| found.binary_search(cell).is_err());
        let wrong = found.iter().find(|cell| expected.binary_search(cell).is_err());
        assert_eq!((missing, wrong), (None, None), "world {index}, {settings:?}");
        assert_eq!(found, expected, "world {index}");
        total += found.len();
    }
    assert!(total > 1000, "{total} cells");
}

/// Whether a vertical cylinder stands free on the surface that is drawn: over each place of its base there is as much air as it
/// is tall, above ground that it can climb.
fn fits(world: &World, at: [f64; 3], radius: f64, height: f64, climb: f64) -> Result<(), String> {
    let [x, y, z] = at;
    for turn in 0..8 {
        for part in [0.0, 0.5, 0.99] {
            let (sin, cos) = (f64::from(turn) * std::f64::consts::TAU / 8.0 + 0.1).sin_cos();
            let (x, z) = (x + cos * radius * part, z + sin * radius * part);
            let spans = world.spans(x, z);
            // Where a wall begins in a cell that the agent only touches, the ground may rise by a voxel.
            let slack = if part == 0.0 { 0.02 } else { 1.0 };
            let rise = (climb + 0.02) * (1.5 + radius * part) + slack;
            let is_free = spans.iter().any(|span| {
                (span.floor - y).abs() <= rise
                    && span.ceiling.is_none_or(|roof| roof - span.floor >= height - slack)
            });
            if !is_free {
                return Err(format!("at {x} {z} from height {y}: {spans:?}"));
            }
        }
    }
    Ok(())
}

#[test]
fn agents_fit_wherever_they_walk() {
    for index in 0..world_count(12) {
        let mut rng = Rng::with_seed(1000 + index);
        let terrain = random_dug_world(&mut rng, index);
        let settings = random_settings(&mut rng);
        let cells = all_cells(terrain.world(), &walker(&settings));
        for _ in 0..cells.len().min(300) {
            let cell = cells[rng.usize(0..cells.len())];
            let (x, z) = (f64::from(cell.cell.x) + rng.f64(), f64::from(cell.cell.z) + rng.f64());
            let climb = f64::from(settings.step.max(settings.slope));
            let (radius, height) = (f64::from(settings.radius), f64::from(settings.height));
            fits(terrain.world(), [x, height_in(&cell, x, z), z], radius, height, climb)
                .unwrap_or_else(|why| panic!("world {index}, {settings:?}, {cell:?}: {why}"));
        }
    }
}

#[test]
fn an_edit_changes_only_the_tiles_that_are_said_to_be_affected() {
    for index in 0..world_count(12) {
        let mut rng = Rng::with_seed(2000 + index);
        let mut terrain = random_dug_world(&mut rng, index);
        let walker = walker(&random_settings(&mut rng));
        let polygons = |world: &World, pos| WalkableTile::new(world, pos, &walker).polygons();
        for _ in 0..4 {
            let before = terrain.world().clone();
            let brush = random_works(&mut rng, &before);
            terrain.apply([brush]);
            let after = terrain.world();
            let mut changed = None;
            for (pos, _) in before.bricks().chain(after.bricks()) {
                let (old, new) = (before.samples(), after.samples());
                let differs = |point: &glam::IVec3| old.distance(*point) != new.distance(*point);
                for point in pos.samples().points().filter(differs) {
                    LatticeBox::include(&mut changed, LatticeBox::point(point));
                }
            }
            let affected: Vec<NavTilePos> = changed
                .map(|samples| NavTilePos::affected(after, samples, &walker).collect())
                .unwrap_or_default();
            for pos in NavTilePos::all(after).filter(|pos| !affected.contains(pos)) {
                assert_eq!(polygons(&before, pos), polygons(after, pos), "world {index}, {pos:?}");
            }
        }
    }
}
