//! Facts about walkers.

use bevy_burrow::brush::{Brush, Roughness, Shape};
use bevy_burrow::ground::{Ground, MaterialId};
use bevy_burrow::terrain::{Terrain, TerrainSettings};

use super::*;

/// Chance, the same in every run.
struct Dice(fastrand::Rng);

impl Dice {
    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.0.f32()
    }

    fn place(&mut self) -> Vec3 {
        Vec3::new(self.between(4.0, 60.0), self.between(4.0, 40.0), self.between(4.0, 60.0))
    }
}

fn terrain(height: impl Fn(i32, i32) -> f64 + Sync) -> Terrain {
    let ground = Ground::from_fn(64, 64, height).expect("a small world");
    Terrain::new(ground, &TerrainSettings::default()).expect("default settings")
}

/// Waves so steep that they can't be walked up everywhere, dug and built over at random.
fn rough_country(dice: &mut Dice) -> Terrain {
    let wave = |at: i32, length: f64| (f64::from(at) / length).sin();
    let mut terrain = terrain(|x, z| 20.0 + 9.0 * wave(x, 5.0) + 7.0 * wave(z, 4.0) + 2.0 * wave(x + z, 2.0));
    let brushes: Vec<Brush> = (0..80)
        .map(|i| {
            let (at, radius) = (dice.place(), dice.between(1.5, 6.0));
            let shape = match i % 3 {
                0 => Shape::sphere(at, radius),
                1 => Shape::cuboid(at, Vec3::new(radius, 0.8 * radius, 0.6 * radius)),
                _ => Shape::capsule(at, dice.place(), radius.min(3.5)),
            };
            let brush = if i % 4 == 3 { Brush::add(shape, MaterialId(2)) } else { Brush::dig(shape) };
            brush.with_roughness(Roughness::new(0.6, 3.0, i))
        })
        .collect();
    let receipts = terrain.apply(&brushes);
    assert!(receipts.iter().all(|receipt| receipt.outcome.is_ok()));
    terrain
}

fn assert_in_the_air(body: &Body, ground: &terrain::World, when: &str) {
    assert!(body.is_free(ground), "{when}: {body:?}");
    for y in [0.02, 0.5, 1.0, EYE] {
        let place = body.feet + Vec3::Y * y;
        assert!(!ground.is_solid(place.as_dvec3()), "{when}: {place} is solid, {body:?}");
    }
}

#[test]
fn nobody_ever_gets_into_solid_ground() {
    let mut dice = Dice(fastrand::Rng::with_seed(17));
    for walk in 0..4 {
        let mut terrain = rough_country(&mut dice);
        let mut body = Body::at(Vec3::new(32.0, 60.0, 32.0));
        let mut steering = Steering::default();
        for step in 0..2_500 {
            if step % 25 == 0 {
                let direction = Vec2::from_angle(dice.between(0.0, TAU));
                steering = Steering { direction, run: dice.0.bool(), jump: dice.0.u8(..) < 100 };
            }
            if step % 250 == 249 {
                // Someone digs under him, or builds over him.
                let ball = Shape::sphere(body.feet, dice.between(1.0, 4.0));
                let brush =
                    if step % 500 == 249 { Brush::dig(ball) } else { Brush::add(ball, MaterialId(1)) };
                terrain.apply([brush]);
            }
            let dt = [1.0 / 120.0, 1.0 / 60.0, 1.0 / 15.0, 0.25][step % 4];
            body.advance(terrain.world(), &steering, dt);
            assert_in_the_air(&body, terrain.world(), &format!("walk {walk}, step {step}"));
        }
    }
}

#[test]
fn a_fall_ends_on_the_ground_at_any_frame_rate() {
    let terrain = terrain(|_, _| 10.0);
    for fps in [5.0, 15.0, 60.0, 240.0] {
        let mut body = Body::at(Vec3::new(20.0, 300.0, 20.0));
        for _ in 0..(20.0 * fps) as u32 {
            body.advance(terrain.world(), &Steering::default(), 1.0 / fps);
            assert!(body.feet.y >= 10.0 - HAIR, "at {fps} fps: {body:?}");
        }
        assert!(body.grounded && (body.feet.y - 10.0).abs() < HAIR, "at {fps} fps: {body:?}");
    }
}

#[test]
fn gentle_slopes_are_walked_and_walls_are_not() {
    // Height after 4 seconds eastwards, on a ramp of each slope that begins at x = 20.
    for (slope, climbs) in [(0.3, true), (0.8, true), (1.2, true), (3.0, false), (20.0, false)] {
        let terrain = terrain(|x, _| 5.0 + slope * f64::from((x - 20).clamp(0, 20)));
        for fps in [15.0, 60.0, 144.0] {
            let mut body = Body::at(Vec3::new(15.0, 5.0, 30.0));
            let steering = Steering { direction: Vec2::X, ..default() };
            for _ in 0..(4.0 * fps) as u32 {
                body.advance(terrain.world(), &steering, 1.0 / fps);
            }
            assert_eq!(body.feet.x > 28.0, climbs, "slope {slope} at {fps} fps: {body:?}");
        }
    }
}

#[test]
fn nobody_jumps_up_a_cliff() {
    let terrain = terrain(|x, _| 5.0 + 6.0 * f64::from((x - 30).clamp(0, 4)));
    let mut body = Body::at(Vec3::new(26.0, 5.0, 20.0));
    for step in 0..3_600 {
        let steering = Steering { direction: Vec2::X, run: step % 2 == 0, jump: true };
        body.advance(terrain.world(), &steering, 1.0 / 60.0);
        assert!(body.feet.y < 12.0, "step {step}: {body:?}");
    }
}

#[test]
fn a_jump_lifts_by_its_height_and_walls_are_slid_along() {
    let terrain = terrain(|x, _| if x < 30 { 5.0 } else { 15.0 });
    let mut body = Body::at(Vec3::new(28.0, 5.0, 20.0));
    body.advance(terrain.world(), &Steering::default(), 0.1);
    let mut highest = 0.0f32;
    for step in 0..240 {
        let steering = Steering { direction: Vec2::new(0.7, 0.7), jump: step == 0, run: false };
        body.advance(terrain.world(), &steering, 1.0 / 120.0);
        highest = highest.max(body.feet.y - 5.0);
    }
    assert!((highest - JUMP).abs() < 0.1, "{highest}");
    assert!(body.feet.x < 30.0 && body.feet.z > 25.0, "{body:?}");
}

#[test]
fn who_is_built_over_gets_out() {
    let mut terrain = terrain(|_, _| 10.0);
    let mut body = Body::at(Vec3::new(30.0, 10.0, 30.0));
    body.advance(terrain.world(), &Steering::default(), 0.1);
    terrain.apply([Brush::add(Shape::sphere(Vec3::new(30.0, 11.0, 30.0), 6.0), MaterialId(5))]);
    assert!(!body.is_free(terrain.world()));
    body.advance(terrain.world(), &Steering::default(), 1.0 / 60.0);
    assert_in_the_air(&body, terrain.world(), "after the fill");
}
