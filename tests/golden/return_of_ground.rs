//! Chunks and tiles whose surface vanished and came back are drawn again.

use std::time::Instant;

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::album::{Album, flip};
use crate::studio::{SIZE, Studio, TIMEOUT};

/// Height of the level ground: the middle of a chunk, so that the whole surface is in one layer of chunks.
const HEIGHT: f64 = 16.0;

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    // Pictures are compared only with each other, so small ones will do.
    studio.resize((SIZE.0 / 2, SIZE.1 / 2));
    let level = || Ground::flat(96, 96, HEIGHT).expect("valid ground");
    // In the middle of the tile and chunk at 32 to 64; the larger one removes the whole tile.
    let middle = Vec3::new(48.0, HEIGHT as f32, 48.0);
    let hole = || Brush::dig(Shape::sphere(middle, 6.0));
    let yard = || Brush::dig(Shape::cuboid(middle, Vec3::new(20.0, 3.0, 20.0)));
    // A chunk that contains a field keeps its entity, even without a surface.
    let vein = || Brush::paint(Shape::sphere(middle - Vec3::Y * 11.0, 3.0), MaterialId(7));
    for (what, dig) in [("a hole", &hole as &dyn Fn() -> Brush), ("a yard", &yard)] {
        studio.terrain(level(), GroundLook::default());
        studio.look(middle + Vec3::new(10.0, 34.0, 30.0), middle);
        while_looking(studio, vein());
        let untouched = studio.picture();
        while_looking(studio, dig());
        let dug = studio.picture();
        for round in 0..2 {
            while_looking(studio, Undo::default());
            let (apart, _) = flip(&untouched, &studio.picture());
            album.check(apart < 1e-4, || {
                format!("{what} undone {round}: FLIP {apart:.5} from what was there")
            });
            while_looking(studio, dig());
            let (apart, _) = flip(&dug, &studio.picture());
            album.check(apart < 1e-4, || format!("{what} dug again {round}: FLIP {apart:.5} from the first"));
        }
    }
    studio.resize(SIZE);
}

/// Sends a brush or a history step, and waits for its commit. The camera draws all the while, as anything that newly
/// comes into view would be drawn anyway.
fn while_looking(studio: &mut Studio, message: impl Message) {
    let commits = |studio: &Studio| studio.app.world().resource::<BurrowFigures>().commits;
    let (before, start) = (commits(studio), Instant::now());
    studio.app.world_mut().write_message(message);
    while commits(studio) == before {
        assert!(start.elapsed() < TIMEOUT, "nothing is committed");
        studio.app.update();
    }
}
