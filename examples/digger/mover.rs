//! The walker's body: it walks, steps, jumps, falls and slides along walls, and is never inside the ground.
//!
//! A body is a capsule, looked at through thirteen vertical lines: one in the middle, four at half its radius and eight
//! at its rim. Over each line the ground says where there is air ([`Span`]s), which is all that is needed: no physics
//! engine, no meshes. A place is free when the capsule's piece of each line lies in the air.
//!
//! Nothing here knows of an app: [`Body::advance`] is a function of the ground, the steering and the time.

use std::f32::consts::TAU;

use bevy::prelude::*;
use bevy_burrow::plugin::Terrains;
use bevy_burrow::terrain::{self, Span};

/// Half the width of the body in metres.
const RADIUS: f32 = 0.4;
/// From the soles to the top of the head.
const HEIGHT: f32 = 1.8;
/// From the soles to the eyes.
pub const EYE: f32 = 1.7;
const WALK: f32 = 5.0;
const RUN: f32 = 10.0;
const GRAVITY: f32 = 16.0;
const FASTEST_FALL: f32 = 50.0;
/// How high a jump lifts the soles.
const JUMP: f32 = 1.4;
/// The highest step that is walked up without a jump.
const STEP: f32 = 0.6;
/// Rise over run from which on nobody can stand.
const STEEP: f32 = 2.0;
/// How far below the soles the ground may sink for the body to stay on it, on its way downhill.
const CLING: f32 = 0.3;
/// The longest way that is taken without looking, however long a frame is.
const STRIDE: f32 = 0.2;
/// A hair: distances below it are rounding.
const HAIR: f32 = 1e-3;

/// Ground that knows where there is air over a point, lowest stretch first; none outside the world.
pub trait Air {
    /// The stretches of air over (x, z).
    fn air(&self, x: f32, z: f32) -> Vec<Span>;
}

impl Air for terrain::World {
    fn air(&self, x: f32, z: f32) -> Vec<Span> {
        self.spans(x.into(), z.into())
    }
}

impl Air for Terrains<'_, '_> {
    fn air(&self, x: f32, z: f32) -> Vec<Span> {
        self.spans(x, z)
    }
}

/// What the walker wants.
#[derive(Component, Clone, Copy, Debug, Default)]
pub struct Steering {
    /// Where to, as (x, z) of the world; longer than 1 counts as 1.
    pub direction: Vec2,
    /// In a hurry?
    pub run: bool,
    /// Off the ground, if on it?
    pub jump: bool,
}

/// Where a body is and how it moves.
#[derive(Component, Clone, Copy, Debug)]
pub struct Body {
    /// The lowest point of the capsule.
    pub feet: Vec3,
    /// Metres per second.
    pub velocity: Vec3,
    /// Does it stand on something?
    pub grounded: bool,
}

/// The heights at which the soles may be, at one place.
#[derive(Clone, Copy)]
struct Room {
    low: f32,
    high: f32,
    /// Towards where the floor rises, as long as its rise over run.
    uphill: Vec2,
}

/// The lines through the capsule: offset from its axis, and how far its lower end lies above the soles. Its upper end
/// lies as far below the top of the head.
fn lines() -> impl Iterator<Item = (Vec2, f32)> {
    let ring = |count: u32, radius: f32| {
        let bottom = RADIUS - (RADIUS * RADIUS - radius * radius).max(0.0).sqrt();
        (0..count).map(move |i| (Vec2::from_angle(TAU * i as f32 / count as f32) * radius, bottom))
    };
    ring(1, 0.0).chain(ring(4, RADIUS / 2.0)).chain(ring(8, RADIUS))
}

/// The air of a line that holds the point at height `y`: its floor and ceiling.
fn air_around(ground: &impl Air, place: Vec2, y: f32) -> Option<(f32, f32)> {
    let spans = ground.air(place.x, place.y);
    let ends =
        spans.iter().map(|span| (span.floor as f32, span.ceiling.map_or(f32::INFINITY, |top| top as f32)));
    ends.into_iter().find(|&(floor, ceiling)| floor <= y && y <= ceiling)
}

/// The room for a body whose soles are near `feet`, or, where it does not fit, the way that leads out of the wall
/// (normalised; zero if it is walled in from all sides).
fn room(ground: &impl Air, feet: Vec3) -> Result<Room, Vec2> {
    let middle = feet.y + HEIGHT / 2.0;
    let mut room = Room { low: f32::NEG_INFINITY, high: f32::INFINITY, uphill: Vec2::ZERO };
    let mut walls = Vec2::ZERO;
    let mut walled = false;
    for (offset, bottom) in lines() {
        let Some((floor, ceiling)) = air_around(ground, feet.xz() + offset, middle) else {
            walls += offset;
            walled = true;
            continue;
        };
        room.low = room.low.max(floor - bottom);
        room.high = room.high.min(ceiling - HEIGHT + bottom);
        room.uphill += offset * (floor - feet.y);
    }
    if walled {
        return Err(-walls.normalize_or_zero());
    }
    // The least-squares plane through all floors: a ring of n lines gives n/2 times its radius squared.
    room.uphill /= (4.0 / 8.0 + 8.0 / 2.0) * RADIUS * RADIUS;
    if room.low > room.high { Err(-room.uphill.normalize_or_zero()) } else { Ok(room) }
}

impl Body {
    /// A body at rest.
    pub fn at(feet: Vec3) -> Self {
        Self { feet, velocity: Vec3::ZERO, grounded: false }
    }

    /// Between the eyes.
    pub fn eye(&self) -> Vec3 {
        self.feet + Vec3::Y * EYE
    }

    /// Is all of the body in the air?
    pub fn is_free(&self, ground: &impl Air) -> bool {
        room(ground, self.feet)
            .is_ok_and(|room| room.low <= self.feet.y + HAIR && self.feet.y <= room.high + HAIR)
    }

    /// Lets `dt` seconds pass; at most a quarter of one, so that nobody falls through a hiccup of the machine.
    pub fn advance(&mut self, ground: &impl Air, steering: &Steering, dt: f32) {
        let dt = dt.clamp(0.0, 0.25);
        if !self.is_free(ground) {
            self.escape(ground);
        }
        let wish = steering.direction.clamp_length_max(1.0) * if steering.run { RUN } else { WALK };
        let grip = if self.grounded { 12.0 } else { 2.5 };
        let level = self.velocity.xz().lerp(wish, 1.0 - (-grip * dt).exp());
        self.velocity = Vec3::new(level.x, self.velocity.y, level.y);
        if steering.jump && self.grounded {
            self.velocity.y = (2.0 * GRAVITY * JUMP).sqrt();
            self.grounded = false;
        }
        let way = (self.velocity.length() + GRAVITY * dt) * dt;
        let strides = (way / STRIDE).ceil().max(1.0);
        for _ in 0..strides as u32 {
            self.stride(ground, dt / strides);
        }
    }

    /// One look at the ground: along it, then up or down.
    fn stride(&mut self, ground: &impl Air, dt: f32) {
        self.slide(ground, self.velocity.xz() * dt);
        self.velocity.y = (self.velocity.y - GRAVITY * dt).max(-FASTEST_FALL);
        let Ok(room) = room(ground, self.feet) else { return };
        let y = self.feet.y + self.velocity.y * dt;
        let clings = self.grounded && self.velocity.y <= 0.0 && y - room.low <= CLING;
        self.grounded = (y <= room.low || clings) && room.uphill.length() < STEEP;
        if y <= room.low || clings {
            self.feet.y = room.low;
            self.velocity.y = 0.0;
            if !self.grounded {
                // Too steep to stand: slide down.
                let downhill = -room.uphill.normalize() * GRAVITY * dt;
                self.velocity += Vec3::new(downhill.x, 0.0, downhill.y);
            }
        } else if y > room.high {
            self.feet.y = room.high;
            self.velocity.y = self.velocity.y.min(0.0);
        } else {
            self.feet.y = y;
        }
    }

    /// Moves by (x, z); what leads into a wall is taken off the way and the velocity.
    fn slide(&mut self, ground: &impl Air, mut way: Vec2) {
        for _ in 0..3 {
            if way.length_squared() < 1e-10 {
                return;
            }
            match self.moved(ground, way) {
                Ok(feet) => {
                    self.feet = feet;
                    return;
                }
                Err(out) => {
                    let without = |v: Vec2| v - out * v.dot(out).min(0.0);
                    way = without(way);
                    let level = without(self.velocity.xz());
                    self.velocity = Vec3::new(level.x, self.velocity.y, level.y);
                }
            }
        }
        // A corner: stay.
        self.velocity = Vec3::new(0.0, self.velocity.y, 0.0);
    }

    /// Where the feet are after a way of (x, z), up or down a step; or the way out of the wall that stops it.
    fn moved(&self, ground: &impl Air, way: Vec2) -> Result<Vec3, Vec2> {
        let feet = self.feet + Vec3::new(way.x, 0.0, way.y);
        let room = room(ground, feet)?;
        let y = feet.y.clamp(room.low, room.high);
        let uphill = room.uphill.try_normalize().unwrap_or(way.normalize_or_zero());
        if (y - feet.y).abs() > STEP {
            return Err(-uphill);
        }
        if y > feet.y + HAIR {
            // The ground just before the toes says whether this is a step or the foot of a wall.
            let toes = feet.xz() + uphill * (RADIUS + 0.1);
            let floor = air_around(ground, toes, feet.y + HEIGHT / 2.0).map(|air| air.0);
            if floor.is_none_or(|floor| floor > self.feet.y + STEP) {
                return Err(-uphill);
            }
        }
        Ok(feet.with_y(y))
    }

    /// Out of ground that was built over the body: to the nearest free place, in the end on top of everything.
    fn escape(&mut self, ground: &impl Air) {
        let around = [0.3, 0.6, 1.0, 1.5, 2.0, 3.0]
            .into_iter()
            .flat_map(|radius| (0..8).map(move |i| Vec2::from_angle(TAU * i as f32 / 8.0) * radius));
        let places = std::iter::once(Vec2::ZERO).chain(around);
        let free = places.flat_map(|offset| self.free_places(ground, self.feet.xz() + offset));
        let nearest =
            free.min_by(|a, b| a.distance_squared(self.feet).total_cmp(&b.distance_squared(self.feet)));
        let over_all = || {
            let tops = lines().filter_map(|(offset, bottom)| {
                let place = self.feet.xz() + offset;
                ground.air(place.x, place.y).last().map(|span| span.floor as f32 - bottom)
            });
            tops.reduce(f32::max).map(|top| self.feet.with_y(top))
        };
        if let Some(feet) = nearest.or_else(over_all) {
            *self = Self::at(feet);
        }
    }

    /// The free place nearest to the feet in each stretch of air over a point.
    fn free_places(&self, ground: &impl Air, place: Vec2) -> Vec<Vec3> {
        let stand = |span: &Span| {
            let floor = span.floor as f32;
            let highest = span.ceiling.map_or(f32::INFINITY, |top| top as f32 - HEIGHT);
            if highest < floor {
                return None;
            }
            let feet = Vec3::new(place.x, self.feet.y.clamp(floor, highest), place.y);
            let room = room(ground, feet).ok()?;
            Some(feet.with_y(feet.y.clamp(room.low, room.high)))
        };
        ground.air(place.x, place.y).iter().filter_map(stand).collect()
    }
}

#[cfg(test)]
#[path = "mover_tests.rs"]
mod tests;
