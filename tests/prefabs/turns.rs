//! Quarter turns and mirrors are exact: a turned copy of edits has the hash of the turned edits.

use std::sync::Arc;

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{IVec3, Mat3, Vec3};

use crate::laws::terrain;
use crate::worlds::world_count;

/// An edit that can be turned: a ball or a box around a place.
struct Piece {
    at: Vec3,
    /// Half sides of a box; none for a ball.
    half: Option<Vec3>,
    radius: f32,
    operation: u32,
}

impl Piece {
    fn random(rng: &mut Rng) -> Self {
        // Places and sizes in 1/4 voxel, so that nothing is rounded.
        let mut part = |low: i32, high: i32| rng.i32(low * 4..high * 4) as f32 / 4.0;
        let at = Vec3::new(part(-6, 6), part(-6, 6), part(-6, 6));
        let (half, radius) = (Vec3::new(part(1, 5), part(1, 5), part(1, 5)), part(1, 5));
        Self { at, half: rng.bool().then_some(half), radius, operation: rng.u32(0..5) }
    }

    /// The brush around a middle, turned about it.
    fn brush(&self, middle: Vec3, turn: Mat3) -> Brush {
        let at = middle + turn * self.at;
        let shape = match self.half {
            Some(half) => Shape::cuboid(at, (turn * half).abs()),
            None => Shape::sphere(at, self.radius),
        };
        match self.operation {
            0 => Brush::add(shape, MaterialId(3)),
            1 => Brush::paint(shape, MaterialId(5)),
            2 => Brush::paint(shape, MaterialId::GROUND),
            _ => Brush::dig(shape),
        }
    }
}

/// Every turn by quarters, each once, and as a matrix; mirrored and not.
fn turns(prefab: &Arc<Prefab>, at: Vec3, is_upright: bool) -> Vec<(Paste, Mat3)> {
    let mut found: Vec<(Paste, Mat3)> = Vec::new();
    for (x, y, z) in (0..4).flat_map(|x| (0..4).flat_map(move |y| (0..4).map(move |z| (x, y, z)))) {
        let paste = Paste::new(Arc::clone(prefab), at);
        let paste = paste.turned_about_x(x).turned_about_y(y).turned_about_z(z);
        for paste in [paste.clone(), paste.mirrored()] {
            let flip = if paste.mirror { Vec3::new(-1.0, 1.0, 1.0) } else { Vec3::ONE };
            let matrix = Mat3::from_quat(paste.rotation) * Mat3::from_diagonal(flip);
            let matrix = Mat3::from_cols_array(&matrix.to_cols_array().map(f32::round));
            let is_allowed = !is_upright || matrix.y_axis == Vec3::Y;
            if is_allowed && found.iter().all(|(_, other)| *other != matrix) {
                found.push((paste, matrix));
            }
        }
    }
    assert_eq!(found.len(), if is_upright { 8 } else { 48 });
    found
}

/// Pastes the copy of random edits in every way, and compares with the edits made in that way.
fn check(seed: u64, ground: &Arc<Ground>, from: Vec3, to: Vec3, is_upright: bool) {
    let mut rng = Rng::with_seed(seed);
    let pieces: Vec<Piece> = (0..6).map(|_| Piece::random(&mut rng)).collect();
    let mut copied = terrain(ground, 16 + 8 * (seed % 3) as u32);
    copied.apply(pieces.iter().map(|piece| piece.brush(from, Mat3::IDENTITY)).collect::<Vec<_>>());
    let around = LatticeBox::point(from.as_ivec3()).grown(15);
    let prefab = Arc::new(copied.world().copy(around, from.as_ivec3()).expect("it lies in the world"));
    for (paste, matrix) in turns(&prefab, to, is_upright) {
        let mut expected = terrain(ground, 32);
        expected.apply(pieces.iter().map(|piece| piece.brush(to, matrix)).collect::<Vec<_>>());
        for paste in [paste.clone(), paste.clone().edited_only()] {
            if !is_upright && !paste.edited_only {
                // The pristine densities of a turned box are others.
                continue;
            }
            let mut pasted = terrain(ground, 32);
            pasted.apply([Brush::paste(paste)]);
            assert_eq!(pasted.world().hash(), expected.world().hash(), "seed {seed}, turned by {matrix}");
            assert!(pasted.world().check_seams().is_flawless());
        }
    }
}

#[test]
fn pastes_turned_upright_on_level_ground_are_the_turned_edits() {
    let ground = Arc::new(Ground::flat(96, 96, 40.0).expect("valid"));
    for seed in 0..world_count(12) {
        check(seed, &ground, Vec3::new(24.0, 40.0, 24.0), Vec3::new(64.0, 40.0, 61.0), true);
    }
}

#[test]
fn pastes_turned_in_any_way_deep_in_the_rock_are_the_turned_edits() {
    // More than 128 voxels deep, where all densities are stored alike.
    let ground = Arc::new(Ground::flat(96, 96, 400.0).expect("valid"));
    for seed in 0..world_count(6) {
        check(seed, &ground, Vec3::new(24.0, 40.0, 24.0), Vec3::new(64.0, 90.0, 61.0), false);
    }
}

#[test]
fn turning_back_is_what_it_was() {
    let ground = Arc::new(Ground::flat(96, 96, 40.0).expect("valid"));
    let (from, to) = (IVec3::new(24, 40, 24), IVec3::new(64, 40, 61));
    let mut rng = Rng::with_seed(9);
    let mut terrain = terrain(&ground, 32);
    let pieces: Vec<Piece> = (0..6).map(|_| Piece::random(&mut rng)).collect();
    terrain.apply(pieces.iter().map(|piece| piece.brush(from.as_vec3(), Mat3::IDENTITY)).collect::<Vec<_>>());
    let around = |at: IVec3| LatticeBox::point(at).grown(15);
    let first = terrain.world().copy(around(from), from).expect("it lies in the world");
    let mut prefab = first.clone();
    for _ in 0..4 {
        terrain.apply([Brush::paste(Paste::new(prefab, to.as_vec3()).turned_about_y(1))]);
        prefab = terrain.world().copy(around(to), to).expect("it lies in the world");
        terrain.undo();
    }
    assert_eq!(prefab, first);
    for _ in 0..2 {
        terrain.apply([Brush::paste(Paste::new(prefab, to.as_vec3()).mirrored())]);
        prefab = terrain.world().copy(around(to), to).expect("it lies in the world");
        terrain.undo();
    }
    assert_eq!(prefab, first);
}
