//! Checks of an edit before it is ordered.

use std::time::Duration;

use glam::{I64Vec3, IVec3};

use super::{Server, UndoPolicy};
use crate::brush::{Edit, Shape};
use crate::lattice::ONE;
use crate::net::message::{ClientId, Refusal};
use crate::net::price::UNDO;

/// Whether all of an edit's shape, with its roughness, lies within a distance of a position.
fn is_within(position: IVec3, edit: &Edit, allowed: u32) -> bool {
    let samples = edit.reach();
    // Its reach is what its shape and its roughness take up, and a band around them.
    let band = i64::from(edit.shape_band() / ONE);
    let middle = (samples.min.as_i64vec3() + samples.max.as_i64vec3()).div_euclid(I64Vec3::splat(2));
    let min = (samples.min.as_i64vec3() + band).min(middle);
    let max = (samples.max.as_i64vec3() - band).max(middle);
    let position = position.as_i64vec3();
    if let Shape::Sphere(_) = edit.shape() {
        // In half voxels, with one voxel for rounding.
        let way = min + max - 2 * position;
        let radius = (max - min).max_element().unsigned_abs();
        let left = (2 * (u64::from(allowed) + 1)).checked_sub(radius);
        return left.is_some_and(|left| squared_length(way) <= u128::from(left).pow(2));
    }
    let farthest = (min - position).abs().max((max - position).abs());
    squared_length(farthest) <= u128::from(u64::from(allowed) + 1).pow(2)
}

fn squared_length(way: I64Vec3) -> u128 {
    way.to_array().into_iter().map(|way| u128::from(way.unsigned_abs()).pow(2)).sum()
}

impl Server {
    /// Checks an edit, and charges its cost to the client's bucket; returns the cost. An edit without a cost reaches
    /// nothing of the world.
    pub(super) fn validate(
        &mut self,
        client: ClientId,
        edit: &Edit,
        cost: Option<u64>,
        now: Duration,
    ) -> Result<u64, Refusal> {
        let cost = cost.ok_or(Refusal::OutsideWorld)?;
        let player = self.players.player(client);
        if let Some(reach) = self.settings.reach
            && !player.position.is_some_and(|position| is_within(position, edit, reach.allowed()))
        {
            return Err(Refusal::TooFar);
        }
        if self.waiting_cost.saturating_add(cost) > self.settings.waiting {
            return Err(Refusal::Overloaded);
        }
        if !player.cost.spend(now, cost) {
            return Err(Refusal::Cost);
        }
        if !(self.permission)(client, edit) {
            return Err(Refusal::Forbidden);
        }
        Ok(cost)
    }

    /// Checks whether a client may undo strokes of another one, and charges the cost to its bucket.
    pub(super) fn validate_undo(
        &mut self,
        client: ClientId,
        of: ClientId,
        now: Duration,
    ) -> Result<(), Refusal> {
        let player = self.players.player(client);
        let is_allowed = match self.settings.undo {
            UndoPolicy::Nobody => false,
            UndoPolicy::Administrators => player.is_administrator,
            UndoPolicy::Own => player.is_administrator || of == client,
        };
        if !is_allowed {
            return Err(Refusal::Forbidden);
        }
        if self.waiting_cost.saturating_add(UNDO) > self.settings.waiting {
            return Err(Refusal::Overloaded);
        }
        if player.cost.spend(now, UNDO) { Ok(()) } else { Err(Refusal::Cost) }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::brush::Brush;

    #[test]
    fn all_of_a_shape_has_to_be_within_the_distance() {
        let within = |shape: Shape, allowed: u32| {
            let edit = Edit::quantize(&Brush::dig(shape)).expect("a valid brush");
            is_within(IVec3::new(64, 15, 64), &edit, allowed)
        };
        let ball = |x: f32, radius: f32| Shape::sphere(Vec3::new(x, 15.0, 64.0), radius);
        let pole = |x: f32| Shape::capsule(Vec3::new(x, 15.0, 64.0), Vec3::new(128.0 - x, 15.0, 64.0), 2.0);
        let slab = |half: f32| Shape::cuboid(Vec3::new(64.0, 15.0, 64.0), Vec3::new(half, 1.0, 1.0));
        for (shape, allowed, expected) in [
            (ball(64.0, 8.0), 8, true),
            (ball(69.0, 2.0), 8, true),
            (ball(70.0, 2.0), 8, true),
            (ball(74.0, 2.0), 8, false),
            (ball(69.0, 7.0), 8, false),
            (ball(64.0, 20.0), 8, false),
            (ball(64.0, 0.5), 0, true),
            (pole(60.0), 8, true),
            (pole(4.0), 8, false),
            (pole(4.0), 64, true),
            (slab(6.0), 8, true),
            (slab(12.0), 8, false),
            (ball(1.0e5, 4.0), 8, false),
            (ball(1.0e5, 4.0), u32::MAX, true),
        ] {
            assert_eq!(within(shape, allowed), expected, "{shape:?} {allowed}");
        }
    }

    #[test]
    fn the_radius_of_a_rounded_edit_does_not_count() {
        let ball = Shape::sphere(Vec3::new(70.0, 15.0, 64.0), 2.0);
        let fill = Edit::quantize(&Brush::fill(ball, 16.0)).expect("a valid brush");
        let dig = Edit::quantize(&Brush::dig(ball)).expect("a valid brush");
        for (allowed, expected) in [(6, false), (8, true)] {
            let found = [&fill, &dig].map(|edit| is_within(IVec3::new(64, 15, 64), edit, allowed));
            assert_eq!(found, [expected; 2], "{allowed}");
        }
    }
}
