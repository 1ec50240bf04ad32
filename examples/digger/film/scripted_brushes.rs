//! What the scripts dig and build, as brushes in world space.

use std::f32::consts::FRAC_PI_2;

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::film::places::{Hillside, ROOM_RADIUS, Ravine, TUNNEL_RADIUS, flat};
use crate::world::landscape::{CLAY, COAL, CONCRETE, GOLD, ROCK};

/// Metres of tunnel that one brush digs.
const STEP: f32 = 4.0;
/// How far the tunnel reaches below its floor.
const BELOW_FLOOR: f32 = 0.5;

/// The brushes of the tunnel from the mouth to the room, each with the place where the player stands after it.
pub fn tunnel(hillside: &Hillside) -> Vec<(Brush, Vec2)> {
    let [mouth, bend, end] = hillside.floor();
    let first = stations(mouth, bend);
    let second = stations(bend, end);
    let middle = Vec3::Y * (TUNNEL_RADIUS - BELOW_FLOOR);
    let all: Vec<Vec3> = first.chain(second.skip(1)).map(|station| station + middle).collect();
    all.windows(2)
        .enumerate()
        .map(|(number, ends)| {
            let shape = Shape::capsule(ends[0], ends[1], TUNNEL_RADIUS);
            let brush = Brush::dig(shape).with_roughness(Roughness::new(1.0, 2.6, 11));
            let stand = if number == 0 { ends[0] } else { ends[0].lerp(ends[1], 0.5) };
            (brush, stand.xz())
        })
        .collect()
}

/// Points at most one step apart, including both ends.
fn stations(from: Vec3, to: Vec3) -> impl Iterator<Item = Vec3> {
    let count = (from.distance(to) / STEP).ceil() as u32;
    (0..=count).map(move |i| from.lerp(to, i as f32 / count as f32))
}

/// Length of the tunnel without the room, in metres.
pub fn tunnel_length(hillside: &Hillside) -> f32 {
    let [mouth, bend, end] = hillside.floor();
    mouth.distance(bend) + bend.distance(end)
}

/// The room: a cave with a pillar, and ore in its walls.
pub fn room(hillside: &Hillside) -> Vec<Brush> {
    let middle = hillside.room();
    let onward = flat(hillside.onward);
    let aside = onward.cross(Vec3::Y);
    let dig = |place: Vec3, radius: f32| {
        Brush::dig(Shape::sphere(place, radius)).with_roughness(Roughness::new(0.9, 4.5, 11))
    };
    let paint = |place: Vec3, radius: f32, material| {
        Brush::paint(Shape::sphere(place, radius), material).with_roughness(Roughness::new(1.2, 2.5, 5))
    };
    // A point on a wall of the room, in multiples of its radius.
    let wall = |along: f32, across: f32, up: f32| {
        middle + (onward * along + aside * across + Vec3::Y * up) * ROOM_RADIUS
    };
    let base = middle - Vec3::Y * (ROOM_RADIUS + 1.0) + (onward * 0.35 + aside * 0.35) * ROOM_RADIUS;
    vec![
        dig(middle, ROOM_RADIUS),
        dig(middle + aside * 4.0 - Vec3::Y * 2.0, ROOM_RADIUS - 3.0),
        Brush::add(Shape::cylinder(base, Vec3::Y * 2.0 * (ROOM_RADIUS + 1.0), 1.5), ROCK)
            .with_roughness(Roughness::new(0.7, 3.0, 3)),
        paint(wall(0.95, -0.3, 0.15), 2.6, GOLD),
        paint(wall(0.75, -0.75, -0.1), 1.9, GOLD),
        paint(wall(0.6, 0.9, 0.2), 3.6, COAL),
        paint(wall(0.9, 0.2, -0.35), 2.2, CLAY),
    ]
}

/// Slightly tilted seams of clay and coal around the second leg of the tunnel, and pockets of gold.
pub fn strata(hillside: &Hillside) -> Vec<Brush> {
    let [_, bend, end] = hillside.floor();
    let onward = flat(hillside.onward);
    let aside = onward.cross(Vec3::Y);
    let middle = bend.midpoint(end);
    let turn = Quat::from_rotation_arc(Vec3::X, onward) * Quat::from_euler(EulerRot::ZYX, 0.10, 0.0, 0.06);
    let seam = |up: f32, thickness: f32, material, seed| {
        let half = Vec3::new(onward_half(bend, end), thickness, 9.0);
        let shape = Shape::turned_cuboid(middle + Vec3::Y * up, half, turn);
        Brush::paint(shape, material).with_roughness(Roughness::new(0.7, 6.0, seed))
    };
    let pocket = |along: f32, across: f32, up: f32, radius: f32| {
        let place = bend + onward * along + aside * across + Vec3::Y * up;
        Brush::paint(Shape::sphere(place, radius), GOLD).with_roughness(Roughness::new(0.8, 2.0, 31))
    };
    vec![
        seam(0.2, 0.8, CLAY, 7),
        seam(2.6, 0.7, COAL, 8),
        seam(4.6, 0.6, CLAY, 9),
        pocket(6.0, 2.2, 1.6, 1.0),
        pocket(10.0, -2.4, 1.0, 1.2),
        pocket(14.0, 1.8, 3.0, 1.1),
        pocket(19.0, -1.6, 2.2, 1.3),
    ]
}

/// Half the length of a seam that is longer than the leg.
fn onward_half(bend: Vec3, end: Vec3) -> f32 {
    bend.distance(end) / 2.0 + 6.0
}

/// An arch of blocks from bank to bank, posts on it, a deck on the posts, two parapets, and a ramp at each end.
pub fn bridge(ravine: &Ravine) -> Vec<Brush> {
    const WIDTH: f32 = 2.6;
    let Ravine { from, to, behind, bottom } = *ravine;
    let along = (to - from).with_y(0.0).normalize();
    let across = along.cross(Vec3::Y).abs();
    let deck = (from.y.max(to.y) + 0.5).ceil();
    let middle = from.midpoint(to).with_y(deck);
    let half = from.distance(to) / 2.0;
    let concrete = |centre: Vec3, length: f32, height: f32, width: f32, rotation: Quat| {
        let half = Vec3::new(length, height, width);
        let rotation = Quat::from_rotation_arc(Vec3::X, along) * rotation;
        Brush::add(Shape::turned_cuboid(centre, half, rotation), CONCRETE)
    };
    let level = Quat::IDENTITY;

    // The circle through the crown below the deck and both ends at the banks.
    let chord = half - 1.0;
    let drop = (0.75 * (deck - bottom)).min(chord);
    let radius = (chord * chord + drop * drop) / (2.0 * drop);
    let crown = middle - Vec3::Y * 2.0;
    let centre = crown - Vec3::Y * radius;
    let opening = (chord / radius).clamp(-1.0, 1.0).asin();
    let blocks = 2 * (radius * opening / 3.0).ceil() as i32 + 1;
    let step = 2.0 * opening / (blocks - 1) as f32;
    let arch = (0..blocks).map(|i| {
        let angle = -opening + step * i as f32;
        let place = centre + (along * angle.sin() + Vec3::Y * angle.cos()) * radius;
        concrete(place, 0.6 * radius * step, 1.0, WIDTH - 1.0, Quat::from_rotation_z(-angle))
    });
    let posts = [-0.8f32, -0.5, 0.5, 0.8].into_iter().map(|part| {
        let offset = part * chord;
        let foot = centre.y + (radius * radius - offset * offset).sqrt();
        let place = middle + along * offset;
        let height = (deck - foot) / 2.0;
        concrete(place.with_y(deck - height), 0.9, height.max(0.5), WIDTH - 1.2, level)
    });
    let slab = concrete(middle - Vec3::Y, half + 4.0, 1.0, WIDTH, level);
    let parapets = [-1.0, 1.0].map(|side| {
        concrete(middle + across * side * (WIDTH - 0.3) + Vec3::Y * 0.3, half + 4.0, 0.8, 0.75, level)
    });
    let ramps = behind.map(|foot| {
        let top = middle + along * (half + 3.0) * (foot - middle).dot(along).signum();
        let (foot, thickness) = (foot - Vec3::Y * 0.3, 1.5);
        let ramp = if (top - foot).dot(along) > 0.0 { top - foot } else { foot - top };
        let slope = Quat::from_rotation_arc(along, ramp.normalize());
        let place = top.midpoint(foot) - slope * Vec3::Y * thickness;
        let half = Vec3::new(ramp.length() / 2.0 + 1.0, thickness, WIDTH);
        Brush::add(
            Shape::turned_cuboid(place, half, slope * Quat::from_rotation_arc(Vec3::X, along)),
            CONCRETE,
        )
    });
    arch.chain(posts).chain([slab]).chain(ramps).chain(parapets).collect()
}

/// Two test holes, three terraces around a corner of four chunks, a ramp down, and heaps of what was dug.
pub fn pit(corner: Vec3) -> Vec<Brush> {
    let rough = |brush: Brush| brush.with_roughness(Roughness::new(0.35, 3.0, 23));
    // They are apart in one chunk: two fields, until the first terrace merges them.
    let trials = [Vec3::new(2.0, -1.0, 3.0), Vec3::new(14.0, -1.0, 4.0)]
        .map(|offset| rough(Brush::dig(Shape::sphere(corner + offset, 2.0))));
    let terraces = [(13.0, 4.0), (9.0, 8.5), (5.0, 13.0)].map(|(radius, depth)| {
        let base = corner - Vec3::Y * depth;
        rough(Brush::dig(Shape::cylinder(base, Vec3::Y * (depth + 12.0), radius)))
    });
    // The ramp follows the wall.
    let turns: Vec<Vec3> = (0..=7)
        .map(|i| {
            let t = i as f32 / 7.0;
            let out = Vec2::from_angle(-0.6 + t * 1.15 * FRAC_PI_2 * 2.0) * (16.0 - 9.0 * t);
            corner + Vec3::new(out.x, 3.2 - 12.5 * t, out.y)
        })
        .collect();
    let ramp = turns.windows(2).map(|ends| rough(Brush::dig(Shape::capsule(ends[0], ends[1], 2.4))));
    let heap = |angle: f32, radius: f32, material| {
        let out = Vec2::from_angle(angle) * 19.0;
        let place = corner + Vec3::new(out.x, -0.45 * radius, out.y);
        Brush::add(Shape::sphere(place, radius), material).with_roughness(Roughness::new(0.8, 3.0, 29))
    };
    let heaps = [heap(2.6, 5.0, CLAY), heap(3.3, 4.0, ROCK), heap(1.9, 3.5, ROCK)];
    trials.into_iter().chain(terraces).chain(ramp).chain(heaps).collect()
}

/// A boulder on a pillar.
pub fn boulder(foot: Vec3, middle: Vec3) -> [Brush; 2] {
    let rough = |brush: Brush, bumps: f32, seed: u32| brush.with_roughness(Roughness::new(bumps, 2.6, seed));
    [
        rough(Brush::add(Shape::capsule(foot - Vec3::Y * 3.0, middle, 1.1), ROCK), 0.25, 3),
        rough(Brush::add(Shape::sphere(middle, 2.9), ROCK), 0.5, 4),
    ]
}
