//! The confirmed world, which follows the log, and the shown world, which also contains the client's pending edits.
//!
//! Both share their bricks. The shown world is never edited: after each update, its difference from the expected state
//! is applied as one change.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use glam::IVec3;

use super::message::{Entry, RuleState};
use super::never_shown;
use super::regions::{RegionSums, chunks_of, run_submitted};
use crate::brush::{Edit, Evaluator};
use crate::edits::max_read_around;
use crate::ground::Ground;
use crate::lattice::{BrickPos, ChunkPos, LatticeBox, RegionPos};
use crate::terrain::{
    Order, OrderKind, Patch, Receipt, Rejection, RestoreError, Terrain, TerrainError, TerrainSettings, World,
    WorldParts,
};
use crate::volume::{Brick, Fields};
use crate::world::{Overlay, Positions, State};

type Stored = Option<Arc<Brick>>;

/// The samples that a pending edit may read.
struct Reads {
    /// The samples that it may change.
    reach: LatticeBox,
    /// How far from those it reads, along each axis.
    around: IVec3,
    /// The edit's evaluator, if its box is mostly empty, as that of a long path is.
    evaluator: Option<Evaluator>,
}

impl Reads {
    fn of(edit: &Edit) -> Self {
        let evaluator = edit.max_bricks().map(|_| edit.evaluator());
        Self { reach: edit.reach(), around: max_read_around(edit), evaluator }
    }

    fn meets(&self, LatticeBox { min, max }: LatticeBox) -> bool {
        // Samples from which it would read some of these.
        let near = LatticeBox { min: min.saturating_sub(self.around), max: max.saturating_add(self.around) };
        let Some(near) = self.reach.intersection(near) else { return false };
        self.evaluator.as_ref().is_none_or(|evaluator| !evaluator.is_out_of_reach(near))
    }
}

/// With at least this many pending edits, the shown world is kept as a separate terrain. A further edit is then
/// predicted alone, and not together with all previous ones.
const MANY: usize = 16;

/// An edit of this client that the server has not ordered yet.
#[derive(Clone, Debug)]
struct Pending {
    sequence: u64,
    edit: Edit,
}

/// The results of applied entries.
#[derive(Debug, Default)]
pub(super) struct Applied {
    /// A receipt for each edit and each replacement of parts among them, in order.
    pub receipts: Vec<Receipt>,
    /// The regions that changed.
    pub regions: BTreeSet<RegionPos>,
    /// Whether an entry failed here that may succeed on other machines.
    pub failed_locally: bool,
}

/// The confirmed and the shown world.
pub(super) struct Replica {
    /// The world after the entries of the log. It is never meshed.
    confirmed: Terrain,
    pending: VecDeque<Pending>,
    /// The hashes of its regions.
    sums: RegionSums,
    /// The shown content where it differs from the confirmed one.
    predicted: Overlay,
    /// The sum of the hashes of all regions of the shown world.
    shown_regions_hash: u64,
    /// Difference from the confirmed world's hash at the last comparison.
    hash_offset: u64,
    /// The greatest name that a field of what is shown has had.
    next_field: u64,
    /// The old content of those parts of the confirmed world that changed since the last comparison with the shown
    /// world.
    before: Overlay,
    /// Whether the shown world may differ from the confirmed world with the pending edits.
    is_outdated: bool,
    /// Whether all changes of the confirmed world since the last comparison are outside the samples that pending edits
    /// read.
    changes_are_independent: bool,
    /// The number of last pending edits without a prediction.
    appended: usize,
    /// The shown world, while many edits are pending.
    shown: Option<Terrain>,
    /// How often pending edits were predicted.
    drafts: u64,
    /// Edits that were worked out, each time.
    drafted: u64,
}

impl Replica {
    /// The pristine world.
    pub fn new(ground: Arc<Ground>, settings: &TerrainSettings) -> Result<Self, TerrainError> {
        let mut confirmed = Terrain::new(ground, settings)?;
        never_shown(&mut confirmed);
        let (shown_regions_hash, next_field) =
            (confirmed.world().regions_hash(), confirmed.world().next_field());
        Ok(Self {
            confirmed,
            pending: VecDeque::new(),
            sums: RegionSums::default(),
            predicted: Overlay::default(),
            shown_regions_hash,
            hash_offset: 0,
            next_field,
            before: Overlay::default(),
            is_outdated: false,
            changes_are_independent: false,
            appended: 0,
            shown: None,
            drafts: 0,
            drafted: 0,
        })
    }

    /// The world after the entries of the log.
    pub fn world(&self) -> &World {
        self.confirmed.world()
    }

    /// The present state in addition to bricks and fields.
    pub fn rule_state(&self) -> RuleState {
        RuleState {
            edit_settings: self.confirmed.edit_settings().clone(),
            next_field: self.world().next_field(),
        }
    }

    /// The hash of the shown world after all returned changes.
    pub fn shown_hash(&self) -> u64 {
        World::hash_of(self.world().ground().hash(), self.shown_regions_hash)
    }

    /// The [hash](super::region_hash) of a region of the confirmed world.
    pub fn region_hash(&mut self, region: RegionPos) -> u64 {
        self.sums.hash(self.confirmed.world(), region)
    }

    /// Times that pending edits were worked out.
    pub fn drafts(&self) -> u64 {
        self.drafts
    }

    /// Edits that were worked out, counted each time.
    pub fn drafted(&self) -> u64 {
        self.drafted
    }

    /// Adds an edit of this client.
    pub fn predict(&mut self, sequence: u64, edit: Edit) {
        self.pending.push_back(Pending { sequence, edit });
        self.appended += 1;
        self.is_outdated |= self.pending.len() < MANY;
    }

    /// The pending edit with a sequence number.
    pub fn pending_edit(&self, sequence: u64) -> Option<&Edit> {
        let at = self.pending.binary_search_by_key(&sequence, |pending| pending.sequence).ok()?;
        self.pending.get(at).map(|pending| &pending.edit)
    }

    /// The edits that the server has not ordered yet, with their sequence numbers.
    pub fn pending(&self) -> impl Iterator<Item = (u64, &Edit)> {
        self.pending.iter().map(|pending| (pending.sequence, &pending.edit))
    }

    /// Renumbers the pending edits beyond `seen`, from the one after `last` on; returns the next number. `last` is not
    /// less than `seen`.
    pub fn renumber(&mut self, seen: u64, last: u64) -> u64 {
        let mut next = last + 1;
        for pending in self.pending.iter_mut().filter(|pending| pending.sequence > seen) {
            pending.sequence = next;
            next += 1;
        }
        next
    }

    /// Removes an edit, for example after a refusal; returns it if it was pending.
    pub fn take_back(&mut self, sequence: u64) -> Option<Edit> {
        let at = self.pending.iter().position(|pending| pending.sequence == sequence)?;
        self.is_outdated = true;
        self.appended = 0;
        self.pending.remove(at).map(|pending| pending.edit)
    }

    /// Applies entries of the log. This client's edits among them are no longer pending; `sequence_of`
    /// returns their sequence numbers.
    pub fn apply(&mut self, entries: &[Entry], sequence_of: impl Fn(&Entry) -> Option<u64>) -> Applied {
        // Those may be among them.
        self.is_outdated |= self.appended > 0;
        let (mut is_own, mut is_foreign) = (false, false);
        let next_field = self.world().next_field();
        self.is_outdated |=
            self.changes_are_independent && entries.iter().any(|entry| sequence_of(entry).is_some());
        for entry in entries {
            if let Some(order) = entry.order() {
                // The server checked rules.
                self.confirmed.submit(order);
            }
            match sequence_of(entry) {
                // What is shown contains it already.
                Some(number) if self.pending.front().is_some_and(|first| first.sequence == number) => {
                    self.pending.pop_front();
                    is_own = true;
                }
                Some(number) => {
                    self.is_outdated = true;
                    self.pending.retain(|pending| pending.sequence != number);
                }
                None if entry.edit().is_some() || entry.parts().is_some() => is_foreign = true,
                None if entry.order().is_some() => {
                    self.is_outdated = true;
                    self.shown = None;
                }
                None => {}
            }
        }
        let applied = self.run();
        // A deterministic failure happens on all machines; the pending edits are predicted again.
        let is_rejected = |receipt: &Receipt| receipt.kind == OrderKind::Edit && receipt.outcome.is_err();
        self.is_outdated |= applied.receipts.iter().any(is_rejected);
        if is_foreign && !self.is_outdated {
            self.changes_are_independent = !is_own && self.reads_nothing_of_before(next_field);
            self.is_outdated = !self.changes_are_independent;
        }
        self.share();
        applied
    }

    /// Runs all that is submitted.
    fn run(&mut self) -> Applied {
        let Self { confirmed, sums, before, .. } = self;
        let keep = |world: &World, change: &Patch| before.keep(change.inverse(world));
        let (receipts, regions) = run_submitted(confirmed, sums, keep);
        let mut parts = receipts.iter().filter(|receipt| receipt.kind == OrderKind::Parts);
        let failed_locally = parts.any(Receipt::is_local_failure);
        Applied { receipts, regions, failed_locally }
    }

    /// Shares the shown bricks with the confirmed world where they are equal, and forgets these differences.
    fn share(&mut self) {
        let shown = |pos: &BrickPos| self.predicted.bricks.get(pos).and_then(Option::as_ref);
        let changed = self.before.bricks.keys().filter_map(|pos| Some((*pos, Arc::clone(shown(pos)?))));
        let changed: Vec<(BrickPos, Arc<Brick>)> = changed.collect();
        self.confirmed.share_bricks(changed.iter().map(|(pos, brick)| (*pos, brick)));
        if self.is_outdated || self.changes_are_independent {
            return;
        }
        // The shown world does not change: all changes were shown before.
        self.hash_offset = self.shown_regions_hash.wrapping_sub(self.world().regions_hash());
        let before = std::mem::take(&mut self.before);
        let positions = before.positions();
        self.predicted.keep(before.patch(0));
        self.predicted.forget(self.confirmed.world(), &positions);
    }

    /// Replaces parts of the confirmed world by those of another machine.
    ///
    /// # Errors
    /// When they do not fit.
    pub fn put(&mut self, change: Patch) -> Result<Applied, Rejection> {
        self.confirmed.submit(Order::parts(change, None));
        let applied = self.run();
        self.is_outdated = true;
        match applied.receipts.iter().find_map(|receipt| receipt.outcome.as_ref().err()) {
            None => Ok(applied),
            Some(why) => Err(why.clone()),
        }
    }

    /// Continues from another position of a log with the rules and settings there, either with the present world or
    /// from the pristine one.
    ///
    /// # Errors
    /// When the rules or settings are invalid.
    pub fn restart(&mut self, state: &RuleState, keeps_world: bool) -> Result<(), RestoreError> {
        let WorldParts { change, chunk_size, .. } = self.confirmed.parts();
        if !keeps_world {
            self.before.keep(change.inverse(self.confirmed.world()));
        }
        let kept = if keeps_world { change } else { Patch::default() };
        let change = Patch { next_field: state.next_field, ..kept };
        let edit_settings = state.edit_settings.clone();
        let parts = WorldParts { change, chunk_size, revision: 0, edit_settings };
        let settings = TerrainSettings { chunk_size, voxel_size: self.confirmed.voxel_size() };
        self.confirmed = Terrain::restore(self.confirmed.world().shared_ground(), &settings, parts)?;
        never_shown(&mut self.confirmed);
        self.sums.clear();
        self.is_outdated = true;
        self.shown = None;
        Ok(())
    }

    /// The change that gives a whole region of the confirmed world these bricks and fields.
    pub fn region_change(
        &self,
        region: RegionPos,
        bricks: Vec<(BrickPos, Arc<Brick>)>,
        fields: Vec<(ChunkPos, Fields)>,
        next_field: u64,
    ) -> Patch {
        let world = self.confirmed.world();
        let mut all: BTreeMap<BrickPos, Stored> =
            world.bricks_in(region).map(|(pos, _)| (pos, None)).collect();
        all.extend(bricks.into_iter().map(|(pos, brick)| (pos, Some(brick))));
        let mut chunks: BTreeMap<ChunkPos, Fields> = chunks_of(world.grid(), region)
            .filter(|chunk| world.fields_of(*chunk).is_some())
            .map(|chunk| (chunk, Fields::default()))
            .collect();
        chunks.extend(fields);
        Patch { bricks: all.into_iter().collect(), fields: chunks.into_iter().collect(), next_field }
    }

    /// Whether the pending edits have the same results as before, despite the changes of the confirmed world.
    /// `next_field` is its old value.
    fn reads_nothing_of_before(&self, next_field: u64) -> bool {
        if self.pending.is_empty() {
            return self.predicted.is_empty();
        }
        let world = self.world();
        // Pieces may come loose anywhere, and new fields have the next names.
        if self.confirmed.loose().is_some()
            || (world.next_field() != next_field && self.next_field > next_field)
        {
            return false;
        }
        let reads: Vec<Reads> = self.pending.iter().map(|pending| Reads::of(&pending.edit)).collect();
        let grid = world.grid();
        let is_read = |samples: LatticeBox| reads.iter().any(|read| read.meets(samples));
        let is_read_chunk = |chunk: ChunkPos| is_read(grid.chunk_samples(chunk));
        self.before
            .fields
            .keys()
            .all(|chunk| !self.predicted.fields.contains_key(chunk) && !is_read_chunk(*chunk))
            && self
                .before
                .bricks
                .keys()
                .all(|pos| !self.predicted.bricks.contains_key(pos) && !is_read(pos.samples()))
    }

    /// Updates the shown world. Returns the order that changes it, if there is a change, and the receipts of the
    /// pending edits that were predicted last, in order.
    pub fn update(&mut self) -> (Option<Order>, Option<Vec<Receipt>>) {
        // Names of fields may differ that were drafted one after the other.
        self.is_outdated |= self.pending.is_empty() && !self.predicted.is_empty();
        let updated = match self.can_append().then(|| self.append()).flatten() {
            Some((change, receipts)) => (change, Some(receipts)),
            None => {
                self.is_outdated |= self.appended > 0;
                let updated = self.update_all();
                if let (Some(shown), Some(order)) = (&mut self.shown, &updated.0)
                    && shown.apply_one(order).outcome.is_err()
                {
                    self.shown = None;
                }
                updated
            }
        };
        if self.pending.is_empty() {
            self.shown = None;
        }
        updated
    }

    /// Whether the last pending edits can be predicted alone, as long as no entries are applied.
    pub fn can_append(&self) -> bool {
        self.appended > 0 && !self.is_outdated && !self.changes_are_independent
    }

    /// Predicts the last pending edits over the shown world. `None` if that world can't be built.
    fn append(&mut self) -> Option<(Option<Order>, Vec<Receipt>)> {
        if self.shown.is_none() {
            self.shown = self.fork_shown();
        }
        let shown = self.shown.as_mut()?;
        let from = self.pending.len() - self.appended;
        let edits: Vec<Edit> = self.pending.iter().skip(from).map(|pending| pending.edit.clone()).collect();
        (self.drafts, self.drafted) = (self.drafts + 1, self.drafted + edits.len() as u64);
        self.appended = 0;
        shown.submit_all(&edits);
        let mut receipts = shown.take_receipts();
        let mut change = Patch::default();
        while let Some(transaction) = shown.begin() {
            let commit = transaction.run();
            change.then(commit.change());
            // It is the one under way.
            receipts.extend(shown.commit(commit).unwrap_or_default());
        }
        let world = self.confirmed.world();
        self.predicted.lay(&change);
        self.predicted.forget(world, &change.positions());
        (self.shown_regions_hash, self.next_field) =
            (shown.world().regions_hash(), shown.world().next_field());
        self.hash_offset = self.shown_regions_hash.wrapping_sub(world.regions_hash());
        change.next_field = self.next_field;
        Some((self.order_of(change), receipts))
    }

    /// The shown world, as a terrain.
    fn fork_shown(&self) -> Option<Terrain> {
        let mut shown = self.confirmed.fork().ok()?;
        never_shown(&mut shown);
        let predicted = Order::parts(self.predicted.patch(self.next_field), Some(self.shown_hash()));
        shown.apply_one(predicted).outcome.ok()?;
        Some(shown)
    }

    /// The order that makes a change of the shown world; `None` if nothing changes.
    fn order_of(&self, change: Patch) -> Option<Order> {
        (!change.is_empty()).then(|| Order::parts(change, Some(self.shown_hash())))
    }

    fn update_all(&mut self) -> (Option<Order>, Option<Vec<Receipt>>) {
        if self.changes_are_independent && !self.is_outdated {
            self.changes_are_independent = false;
            return (self.follow_apart(), None);
        }
        if !self.is_outdated {
            return (None, None);
        }
        (self.is_outdated, self.changes_are_independent) = (false, false);
        self.drafts += u64::from(!self.pending.is_empty());
        (self.appended, self.drafted) = (0, self.drafted + self.pending.len() as u64);
        let edits: Vec<Edit> = self.pending.iter().map(|pending| pending.edit.clone()).collect();
        let draft = self.confirmed.draft(&edits);
        let (world, before) = (self.confirmed.world(), std::mem::take(&mut self.before));
        let mut predicted = Overlay::default();
        predicted.lay(&draft.change);
        predicted.forget(world, &draft.change.positions());
        let positions = before.positions().and(self.predicted.positions()).and(predicted.positions());
        let confirmed = before.over(world);
        let shown = self.predicted.over(&confirmed);
        let change = Patch::between(&shown, &predicted.over(world), positions, draft.change.next_field);
        // Of equal bricks the one that is shown stays, so that it is held once.
        for (pos, brick) in &mut predicted.bricks {
            if change.bricks.binary_search_by_key(pos, |(at, _)| *at).is_err() {
                *brick = shown.brick(*pos).cloned();
            }
        }
        self.hash_offset = draft.regions_hash.wrapping_sub(world.regions_hash());
        (self.predicted, self.shown_regions_hash) = (predicted, draft.regions_hash);
        self.next_field = change.next_field;
        (self.order_of(change), Some(draft.receipts))
    }

    /// The change of the shown world if the confirmed world has changed apart from the pending edits, whose results
    /// stay.
    fn follow_apart(&mut self) -> Option<Order> {
        let before = std::mem::take(&mut self.before);
        self.shown_regions_hash = self.world().regions_hash().wrapping_add(self.hash_offset);
        let world = self.confirmed.world();
        self.next_field = self.next_field.max(world.next_field());
        self.order_of(Patch::between(&before.over(world), world, before.positions(), self.next_field))
    }

    /// The order that makes any world equal to the one to be shown.
    pub fn whole(&self, shown: &World) -> Order {
        let world = self.confirmed.world();
        let positions = Positions::of(world).and(self.predicted.positions()).and(Positions::of(shown));
        let next_field = self.next_field.max(world.next_field());
        let change = Patch::between(shown, &self.predicted.over(world), positions, next_field);
        Order::parts(change, Some(self.shown_hash()))
    }
}

#[cfg(test)]
#[path = "replica_tests.rs"]
mod tests;
