//! What is checked of an edit before it gets into the order.

use std::time::Duration;

use glam::IVec3;

use super::{Server, UndoPolicy};
use crate::brush::Edit;
use crate::edits::reach;
use crate::lattice::{BrickPos, ChunkGrid, LatticeBox};
use crate::net::message::{ClientId, Refusal};

/// What every edit costs.
const EDIT: u64 = 20;
/// How many times as much a brick costs for an edit that sculpts.
const SCULPTED: u64 = 4;
/// What an undo costs.
pub(super) const UNDO: u64 = 200;

/// What an edit costs: see [`ServerSettings::cost`](super::ServerSettings::cost). `None` for one that reaches nothing of the world.
pub fn cost(grid: ChunkGrid, edit: &Edit) -> Option<u64> {
    let weight = if edit.blend().is_some() { SCULPTED } else { 1 };
    let bricks = BrickPos::range(reach(grid, edit)?).volume();
    Some(EDIT + weight * bricks)
}

/// May an edit with this reach be done from there?
fn is_near(place: IVec3, samples: LatticeBox, allowed: u32) -> bool {
    let (min, max) = (samples.min.as_i64vec3(), samples.max.as_i64vec3());
    // In half voxels.
    let way = min + max - 2 * place.as_i64vec3();
    let squared = |way: i64| u128::from(way.unsigned_abs()).pow(2);
    way.to_array().into_iter().map(squared).sum::<u128>() <= (2 * u128::from(allowed)).pow(2)
}

impl Server {
    /// Checks an edit, and takes its cost out of the client's bucket; returns the cost.
    pub(super) fn validate(&mut self, client: ClientId, edit: &Edit, now: Duration) -> Result<u64, Refusal> {
        let session = self.sessions.get_mut(&client).ok_or(Refusal::NotJoined)?;
        if !session.has_joined() {
            return Err(Refusal::NotJoined);
        }
        let cost = cost(self.terrain.world().grid(), edit).ok_or(Refusal::OutsideWorld)?;
        if let Some(reach) = self.settings.reach
            && !session.place.is_some_and(|place| is_near(place, edit.reach(), reach.allowed()))
        {
            return Err(Refusal::TooFar);
        }
        if self.waiting_cost.saturating_add(cost) > self.settings.waiting {
            return Err(Refusal::Overloaded);
        }
        if !session.cost.spend(now, cost) {
            return Err(Refusal::Cost);
        }
        if !(self.permission)(client, edit) {
            return Err(Refusal::Forbidden);
        }
        Ok(cost)
    }

    /// Checks whether a client may take back what this one did, and takes the cost out of its bucket.
    pub(super) fn validate_undo(
        &mut self,
        client: ClientId,
        of: ClientId,
        now: Duration,
    ) -> Result<(), Refusal> {
        let session = self.sessions.get_mut(&client).ok_or(Refusal::NotJoined)?;
        if !session.has_joined() {
            return Err(Refusal::NotJoined);
        }
        let is_allowed = match self.settings.undo {
            UndoPolicy::Nobody => false,
            UndoPolicy::Administrators => session.is_administrator,
            UndoPolicy::Own => session.is_administrator || of == client,
        };
        if !is_allowed {
            return Err(Refusal::Forbidden);
        }
        if session.cost.spend(now, UNDO) { Ok(()) } else { Err(Refusal::Cost) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_to_the_middle_of_what_an_edit_reaches() {
        let samples = LatticeBox { min: IVec3::new(10, 0, -3), max: IVec3::new(13, 4, 3) };
        // The middle is (11.5, 2, 0).
        for (place, allowed, near) in [
            (IVec3::new(11, 2, 0), 0, false),
            (IVec3::new(11, 2, 0), 1, true),
            (IVec3::new(1, 2, 0), 10, false),
            (IVec3::new(1, 2, 0), 11, true),
            (IVec3::splat(i32::MIN), u32::MAX, true),
            (IVec3::splat(i32::MIN), i32::MAX as u32, false),
            (IVec3::splat(i32::MAX), 9, false),
        ] {
            assert_eq!(is_near(place, samples, allowed), near, "{place} {allowed}");
        }
    }
}
