//! The result of a transaction, and its installation into the world.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use super::history::UndoDelta;
use super::log::RecordDraft;
use super::receipt::Receipt;
use super::resolve::{FieldChange, Outcome, Resolved};
use crate::lattice::{ChunkPos, LatticeBox, RegionPos};
use crate::redraw::{DrawnCut, MeshUpdates, Stages};
use crate::world::{NewSurfaces, Patch, World};

/// The result of a transaction: only what changed.
#[must_use = "nothing has changed before `Terrain::commit` takes it"]
pub struct Commit {
    pub(super) ticket: u64,
    pub(super) outcome: Outcome,
    /// The record for the log, where one is kept.
    pub(super) record: Option<RecordDraft>,
    /// The surfaces that the world keeps: the meshes may be taken away before.
    pub(super) kept: NewSurfaces,
    /// The cut that is drawn afterwards, if it changes.
    pub(super) drawn_cut: Option<Arc<DrawnCut>>,
    /// Whether it only changes which nodes are drawn.
    pub(super) is_cut: bool,
    /// The world that this changes, if it is held elsewhere too.
    pub(super) copy: Option<Arc<World>>,
    /// Meshes to be swapped together with this commit. The world keeps its own.
    pub meshes: MeshUpdates,
    /// Durations of the stages.
    pub stages: Stages,
}

impl fmt::Debug for Commit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Commit")
            .field("ticket", &self.ticket)
            .field("chunks", &self.kept.chunks.len())
            .field("tiles", &self.kept.rings.len())
            .field("stages", &self.stages)
            .finish_non_exhaustive()
    }
}

/// The result of installing a commit.
pub(super) struct Installed {
    pub receipts: Vec<Receipt>,
    /// The replaced parts of each group, if it replaced any.
    pub replaced: Vec<UndoDelta>,
}

impl Commit {
    /// The commit of what a transaction's work leads to.
    pub(super) fn new(ticket: u64, is_cut: bool, resolved: Resolved) -> Self {
        let Resolved { outcome, meshes, stages } = resolved;
        Self {
            ticket,
            outcome,
            record: None,
            copy: None,
            drawn_cut: meshes.drawn_cut.clone(),
            is_cut,
            kept: meshes.kept(),
            meshes,
            stages,
        }
    }

    /// The bricks and fields that it leads to, as its [record](super::CommitRecord) lists them.
    pub fn change(&self) -> Patch {
        // A record holds it already, merged from all groups.
        match &self.record {
            Some(record) => record.change().clone(),
            None => self.outcome.patch(),
        }
    }

    /// Hash of every edited sample, once this is committed: equal for equal edits of equal samples, whatever ran them.
    pub fn sample_hash(&self) -> u64 {
        self.outcome.sample_hash
    }

    /// Changes of fields in this commit, by chunk.
    pub fn field_news(&self) -> &[(ChunkPos, FieldChange)] {
        &self.outcome.news
    }

    /// The cut that is drawn after this commit, if any.
    pub fn drawn_cut(&self) -> Option<&Arc<DrawnCut>> {
        self.drawn_cut.as_ref()
    }

    /// Returns `true` if it changes only what is drawn.
    pub fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// Returns `true` if another world replaces this one, so that all meshes are made again.
    pub fn is_whole(&self) -> bool {
        self.outcome.whole.is_some()
    }

    /// Boxes around the bricks that it changes, one for each region of the lattice: what a long path passes by lies in
    /// none.
    #[doc(hidden)]
    pub fn changed_boxes(&self) -> Vec<LatticeBox> {
        let mut boxes = BTreeMap::new();
        self.add_changed_boxes(&mut boxes);
        boxes.into_values().collect()
    }

    /// Adds the bricks that it changes to the boxes of their regions.
    pub(super) fn add_changed_boxes(&self, boxes: &mut BTreeMap<RegionPos, LatticeBox>) {
        for (pos, _) in self.outcome.changes.iter().flat_map(|delta| &delta.change.patch.bricks) {
            let own = pos.samples();
            boxes.entry(RegionPos::of(*pos)).and_modify(|all| *all = all.union(own)).or_insert(own);
        }
    }

    /// The receipts of its orders.
    #[cfg(feature = "plugin")]
    pub(crate) fn receipts(&self) -> &[Receipt] {
        &self.outcome.receipts
    }

    /// Makes this the world.
    pub(super) fn install(mut self, world: &mut World) -> Installed {
        let receipts = std::mem::take(&mut self.outcome.receipts);
        let replaced = self.outcome.install(world, self.kept);
        world.revision += 1;
        Installed { receipts, replaced }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::{Ground, MaterialId};
    use crate::terrain::{Terrain, TerrainSettings};
    use crate::volume::DiggingRules;
    use glam::Vec3;

    fn terrain() -> Terrain {
        let ground = Ground::flat(64, 64, 8.0).expect("valid");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
        terrain.apply([dig(20.0)]);
        terrain
    }

    fn dig(x: f32) -> Brush {
        Brush::dig(Shape::sphere(Vec3::new(x, 8.0, 30.0), 5.0))
    }

    /// Digs once more; returns whether the task's copy became the world, and the dropped world.
    fn dig_on(terrain: &mut Terrain, meanwhile: impl FnOnce(&mut Terrain)) -> (bool, Option<Arc<World>>) {
        terrain.submit(dig(40.0));
        let commit = terrain.begin().expect("something waits").run();
        let copy = commit.copy.as_ref().map(Arc::as_ptr);
        meanwhile(terrain);
        let (_, dropped) = terrain.install(commit).expect("the one under way");
        (copy == Some(Arc::as_ptr(&terrain.world)), dropped.copy)
    }

    #[test]
    fn a_world_that_others_hold_is_copied_in_the_task() {
        let mut alone = terrain();
        let (is_copy, dropped) = dig_on(&mut alone, |_| {});
        assert!(!is_copy && dropped.is_none());

        let mut held = terrain();
        let snapshot = held.snapshot();
        let before = snapshot.hash();
        let (is_copy, dropped) = dig_on(&mut held, |_| {});
        assert!(is_copy && dropped.is_none());
        assert_eq!((held.world().hash(), snapshot.hash()), (alone.world().hash(), before));

        let mut let_go = terrain();
        let mut snapshot = Some(let_go.snapshot());
        let (is_copy, dropped) = dig_on(&mut let_go, |_| snapshot = None);
        assert!(!is_copy && dropped.is_some());
        assert_eq!(let_go.world().hash(), alone.world().hash());
    }

    #[test]
    fn rules_that_come_during_a_transaction_hold_after_it() {
        let mut terrain = terrain();
        let mut held = vec![terrain.snapshot()];
        let (is_copy, _) = dig_on(&mut terrain, |terrain| {
            terrain.set_rules(DiggingRules::default().with_unbreakable(MaterialId(0))).expect("valid rules");
            held.push(terrain.snapshot());
        });
        assert!(is_copy);
        terrain.apply([dig(54.0)]);
        let is_solid = |x: f64| terrain.world().is_solid(glam::DVec3::new(x, 7.0, 30.0));
        assert_eq!([20.0, 40.0, 54.0].map(is_solid), [false, false, true]);
    }
}
