//! Bumps at seams and chunk borders, as felt by a rolling ball and a walking capsule, compared with a single flat box.

use avian3d::parry::shape::{SharedShape, TypedShape};
use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_burrow::physics::Character;
use bevy_burrow::prelude::*;

use crate::stage::{STEP, Stage, level, pit};

/// How rough a ride was, in voxels of one metre.
#[derive(Clone, Copy, Debug, Default)]
struct Ride {
    /// The largest change of the vertical step from one frame to the next.
    jump: f32,
    /// The largest distance from the ground's height.
    off: f32,
    /// The distance covered along x.
    went: f32,
}

/// The ride given by the heights of all frames.
fn ride(heights: &[f32], ground: f32) -> Ride {
    let jump = heights.windows(3).map(|y| (y[2] - 2.0 * y[1] + y[0]).abs()).fold(0.0, f32::max);
    let off = heights.iter().map(|y| (y - ground).abs()).fold(0.0, f32::max);
    Ride { jump, off, went: 0.0 }
}

/// Level ground at height 8 from x = 0 to 96, divided in different ways.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ground8 {
    /// One box without any terrain.
    OnePiece,
    /// Only tiles: borders every 16 m.
    Tiles,
    /// Tiles with patches drawn by marching cubes: seams every few metres.
    Seams,
    /// All of it drawn by marching cubes: borders of chunks and of the blocks inside them.
    Chunks,
}

/// Replaces all ground colliders by plain triangle meshes that know nothing of neighbouring triangles.
fn forget_neighbours(stage: &mut Stage) {
    for body in stage.ground() {
        let mut body = stage.app.world_mut().entity_mut(body);
        let collider = body.get::<Collider>().expect("ground has a collider");
        let TypedShape::TriMesh(mesh) = collider.shape().as_typed_shape() else {
            panic!("the ground is not a mesh")
        };
        let plain = Collider::from(SharedShape::new(mesh.clone()));
        body.insert(plain);
    }
    stage.frame();
}

fn spawn_ground(ground: Ground8, voxel_size: f32) -> Stage {
    if ground == Ground8::OnePiece {
        let mut stage = Stage::new();
        let slab = Collider::cuboid(200.0, 2.0, 100.0);
        let middle = Transform::from_xyz(50.0, 8.0 * voxel_size - 1.0, 30.0);
        stage.app.world_mut().spawn((RigidBody::Static, slab, middle));
        stage.frames(2);
        return stage;
    }
    let cells = (96.0 / voxel_size) as u32;
    let (mut stage, _) = Stage::with_ground(level(cells, voxel_size));
    let painted = |shape| Brush::paint(shape, MaterialId(2));
    let top = 8.0 * voxel_size;
    match ground {
        Ground8::Seams => {
            let patch = |number: u32| {
                let place = Vec3::new(7.0 + 11.0 * number as f32, top, 31.0);
                painted(Shape::sphere(place, 3.3 * voxel_size.max(0.5)))
            };
            stage.dig((0..8).map(patch));
        }
        Ground8::Chunks => {
            let all = Shape::cuboid(Vec3::new(48.0, top, 48.0), Vec3::new(48.0, 3.0, 48.0));
            stage.dig([painted(all)]);
        }
        _ => {}
    }
    stage
}

/// The z of the two lanes: one between the borders along x, one right on such a border.
const LANES: [f32; 2] = [30.3, 32.0];

/// Lets two bodies move along x until one of them is across, and returns their rides.
fn travel(stage: &mut Stage, bodies: [Entity; 2], level: f32, voxel_size: f32) -> [Ride; 2] {
    // At first the bodies settle on the ground.
    stage.frames(20);
    let mut heights = bodies.map(|_| Vec::new());
    while bodies.iter().all(|&body| stage.place(body).x < 92.0) && heights[0].len() < 2000 {
        stage.frame();
        for (heights, body) in heights.iter_mut().zip(bodies) {
            heights.push(stage.place(body).y / voxel_size);
        }
    }
    let went = bodies.map(|body| stage.place(body).x);
    [0, 1].map(|lane| Ride { went: went[lane], ..ride(&heights[lane], level / voxel_size) })
}

/// Two balls roll along x.
fn roll(ground: Ground8, voxel_size: f32, speed: f32) -> [Ride; 2] {
    let mut stage = spawn_ground(ground, voxel_size);
    let level = 8.0 * voxel_size + 0.5;
    let balls = LANES.map(|lane| stage.ball(Vec3::new(2.0, level, lane), 0.5, Vec3::X * speed));
    travel(&mut stage, balls, level, voxel_size)
}

/// Two characters walk along x.
fn walk(ground: Ground8, voxel_size: f32) -> [Ride; 2] {
    let mut stage = spawn_ground(ground, voxel_size);
    let top = 8.0 * voxel_size;
    let people = LANES.map(|lane| stage.character(Vec3::new(2.0, top + 0.02, lane), Vec2::X));
    travel(&mut stage, people, top + Character::default().height / 2.0, voxel_size)
}

/// Checks that rides on divided ground are as smooth as on a single box.
fn compare(what: &str, ways: impl Fn(Ground8) -> [Ride; 2]) {
    let [plain, _] = ways(Ground8::OnePiece);
    println!("{what}, one piece: {plain:?}");
    for ground in [Ground8::Tiles, Ground8::Seams, Ground8::Chunks] {
        for (lane, cut) in LANES.into_iter().zip(ways(ground)) {
            println!("{what}, {ground:?}, z = {lane}: {cut:?}");
            assert!(cut.jump < 0.005 && cut.off < 0.05, "{ground:?}, {lane}: {cut:?}");
            assert!(cut.went > 0.98 * plain.went, "{ground:?}, {lane}: {cut:?} of {plain:?}");
        }
    }
}

#[test]
fn a_ball_feels_neither_seams_nor_borders() {
    for (voxel_size, speed) in [(1.0, 3.0), (1.0, 12.0), (0.5, 6.0)] {
        let what = format!("ball at {speed} m/s, voxels of {voxel_size} m");
        compare(&what, |ground| roll(ground, voxel_size, speed));
    }
}

#[test]
fn a_walker_feels_neither_seams_nor_borders() {
    for voxel_size in [1.0, 0.5] {
        compare(&format!("walker, voxels of {voxel_size} m"), |ground| walk(ground, voxel_size));
    }
}

/// Checks that the other tests can fail: plain triangle meshes do cause bumps larger than those tests allow.
#[test]
fn a_ball_feels_the_triangles_of_a_plain_mesh() {
    let mut worst = 0.0f32;
    for lane in [30.3, 32.0] {
        let mut stage = spawn_ground(Ground8::Tiles, 1.0);
        forget_neighbours(&mut stage);
        let mut heights = Vec::new();
        let ball = stage.ball(Vec3::new(2.0, 8.5, lane), 0.5, Vec3::X * 12.0);
        for _ in 0..400 {
            stage.frame();
            heights.push(stage.place(ball).y);
        }
        let plain = ride(&heights, 8.5);
        println!("ball at 12 m/s, plain meshes, z = {lane}: {plain:?}");
        worst = worst.max(plain.jump);
    }
    assert!(worst > 0.02, "a plain mesh jumps by {worst} only");
}

#[test]
fn a_ball_comes_to_rest_in_a_pit_and_not_below_it() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    stage.dig([pit(32.0, 8.0, 32.0, 5.0)]);
    let ball = stage.ball(Vec3::new(29.0, 12.0, 31.0), 0.5, Vec3::ZERO);
    stage.frames((20.0 / STEP) as usize);
    let place = stage.place(ball);
    assert!((3.3..4.2).contains(&place.y) && place.xz().distance(Vec2::splat(32.0)) < 2.0, "{place}");
}
