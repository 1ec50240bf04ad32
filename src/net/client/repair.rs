//! Hash checks: positions of the log at which hashes of regions are compared; and the repair of regions that differ.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::super::message::{Entry, MAX_REGIONS, RegionContent, RegionHashes, ToServer};
use super::join::Stage;
use super::{Client, ClientEvent};
use crate::lattice::{BrickPos, LatticeBox, RegionPos};
use crate::net::replica::Replica;
use crate::terrain::{Order, Patch};

/// The most hash checks that wait for the other side.
const MAX_HASH_CHECKS: usize = 256;

/// The most edits whose reach is remembered, in case the server fails to apply one.
const MAX_REACHES: usize = 4096;

/// The most announced failed entries.
const MAX_FAILED: usize = 1 << 16;

/// The most regions that are fetched because of one failed entry.
const MAX_DOUBTFUL: usize = 512;

/// The hashes of both sides at hash checks.
#[derive(Default)]
pub(super) struct HashChecks {
    /// Regions that were touched since the last hash check.
    touched: BTreeSet<RegionPos>,
    ours: BTreeMap<u64, RegionHashes>,
    theirs: BTreeMap<u64, RegionHashes>,
}

impl HashChecks {
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    pub fn touch(&mut self, mut regions: BTreeSet<RegionPos>) {
        self.touched.append(&mut regions);
    }

    /// Records the hashes of the confirmed world at a hash check.
    pub fn record_ours(&mut self, number: u64, replica: &mut Replica) {
        let touched = std::mem::take(&mut self.touched);
        let hashes = touched.into_iter().map(|region| (region, replica.region_hash(region))).collect();
        self.ours.insert(number, hashes);
        while self.ours.len() > MAX_HASH_CHECKS {
            self.ours.pop_first();
        }
    }

    pub fn take_theirs(&mut self, number: u64, regions: RegionHashes) {
        self.theirs.insert(number, regions);
        while self.theirs.len() > MAX_HASH_CHECKS {
            self.theirs.pop_first();
        }
    }

    /// Forgets recorded hashes of regions before their repair.
    fn forget(&mut self, repaired: &BTreeSet<RegionPos>) {
        self.touched.retain(|region| !repaired.contains(region));
        self.ours.values_mut().for_each(|hashes| hashes.retain(|(region, _)| !repaired.contains(region)));
    }

    /// Compares hash checks that both sides have; returns how many, and the regions that differ.
    fn compare(&mut self, replica: &mut Replica) -> (u64, BTreeSet<RegionPos>) {
        let (mut count, mut differing) = (0, BTreeSet::new());
        let both: Vec<u64> =
            self.theirs.keys().filter(|number| self.ours.contains_key(number)).copied().collect();
        for number in both {
            let ours: BTreeMap<RegionPos, u64> =
                self.ours.remove(&number).unwrap_or_default().into_iter().collect();
            let theirs: BTreeMap<RegionPos, u64> =
                self.theirs.remove(&number).unwrap_or_default().into_iter().collect();
            count += 1;
            for (&region, &hash) in &theirs {
                // A region that was not touched here before the hash check is unchanged since, unless it was touched
                // later: then the next hash check compares it.
                let known = ours.get(&region).copied();
                let known = known.or_else(|| {
                    (!self.is_touched_after(number, region)).then(|| replica.region_hash(region))
                });
                if known.is_some_and(|known| known != hash) {
                    differing.insert(region);
                }
            }
            differing.extend(ours.keys().filter(|region| !theirs.contains_key(region)));
        }
        (count, differing)
    }

    fn is_touched_after(&self, number: u64, region: RegionPos) -> bool {
        let later = self.ours.range(number + 1..);
        self.touched.contains(&region)
            || later.into_iter().any(|(_, hashes)| hashes.iter().any(|(other, _)| *other == region))
    }
}

/// What the latest edits reach, by number.
#[derive(Default)]
pub(super) struct Reaches(VecDeque<(u64, LatticeBox)>);

impl Reaches {
    pub fn note(&mut self, number: u64, reach: LatticeBox) {
        if self.0.len() == MAX_REACHES {
            self.0.pop_front();
        }
        self.0.push_back((number, reach));
    }

    fn of(&self, number: u64) -> Option<LatticeBox> {
        self.0.iter().find(|(other, _)| *other == number).map(|(_, reach)| *reach)
    }
}

/// Regions that are being fetched. Until all of them have arrived, no entries are applied; then those up to their
/// number are, and the regions are replaced.
pub(super) struct Repair {
    wanted: BTreeSet<RegionPos>,
    /// The number that the world was at when they were asked for.
    from: u64,
    /// Regions that have arrived, all of one number.
    contents: BTreeMap<RegionPos, RegionContent>,
}

impl Repair {
    pub fn add(&mut self, content: RegionContent) {
        if content.number >= self.from && self.wanted.contains(&content.pos) {
            self.contents.retain(|_, other| other.number == content.number);
            self.contents.insert(content.pos, content);
        }
    }

    /// The number up to which entries may be applied: that of the regions, once all are there.
    pub fn number(&self) -> Option<u64> {
        let is_complete = self.contents.len() == self.wanted.len();
        self.contents.values().next().filter(|_| is_complete).map(|content| content.number)
    }
}

impl Client {
    /// Fetches regions that differ.
    pub(super) fn begin_repair(&mut self) {
        if !matches!(self.stage, Stage::Following) || self.repair.is_some() {
            return;
        }
        let (count, mut differing) = self.hash_checks.compare(&mut self.replica);
        self.figures.hash_checks += count;
        differing.append(&mut self.doubtful);
        if differing.is_empty() {
            return;
        }
        let wanted: BTreeSet<RegionPos> = differing.iter().take(MAX_REGIONS).copied().collect();
        self.doubtful = differing.difference(&wanted).copied().collect();
        let regions = wanted.iter().copied().collect();
        let from = self.number();
        self.outgoing.push(ToServer::Fetch { number: from, regions }.to_bytes());
        self.repair = Some(Repair { wanted, from, contents: BTreeMap::new() });
    }

    /// Replaces regions by the fetched ones, once the world is at their number.
    pub(super) fn finish_repair(&mut self) {
        let at = self.number();
        let Some(repair) = self.repair.take_if(|repair| repair.number().is_some_and(|number| number <= at))
        else {
            return;
        };
        self.figures.repairs += repair.wanted.len() as u64;
        let next_field = repair.contents.values().map(|content| content.next_field).max();
        let before = self.ground_pieces(None);
        repair.contents.into_values().for_each(|content| self.put_region(content));
        self.check_pieces(None, &before);
        next_field.into_iter().for_each(|next_field| self.lower_names(next_field));
        self.hash_checks.forget(&repair.wanted);
        self.events.push(ClientEvent::Repaired(repair.wanted.into_iter().collect()));
    }

    /// Handles an entry that the server could not apply.
    pub(super) fn take_failed(&mut self, number: u64) {
        if number > self.number() {
            if self.failed.len() < MAX_FAILED {
                self.failed.insert(number);
            }
        } else if let Some(reach) = self.reaches.of(number) {
            let low = RegionPos::of(BrickPos::of(reach.min)).0;
            let high = RegionPos::of(BrickPos::of(reach.max)).0;
            let regions = (low.x..=high.x)
                .flat_map(|x| (low.y..=high.y).map(move |y| (x, y)))
                .flat_map(|(x, y)| (low.z..=high.z).map(move |z| RegionPos(glam::IVec3::new(x, y, z))));
            self.doubtful.extend(regions.take(MAX_DOUBTFUL));
        }
    }

    /// The entry to apply: one without effect if the server could not apply it.
    pub(super) fn valid(&mut self, number: u64, entry: Entry) -> Entry {
        if !self.failed.remove(&number) {
            return entry;
        }
        match entry.number_of(self.id) {
            Some(sequence) if entry.edit().is_some() => {
                if let Some(edit) = self.replica.take_back(sequence) {
                    self.refuse_pieces(sequence);
                    self.events.push(ClientEvent::Refused { tag: edit.tag(), why: None });
                }
            }
            Some(sequence) if entry.parts().is_some() && self.undos.remove(&sequence) => {
                self.events.push(ClientEvent::UndoRefused(None));
            }
            _ => {}
        }
        Entry::of_server(Order::parts(Patch::default(), None))
    }
}
