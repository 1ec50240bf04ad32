//! Drafts: the result of edits on a world, without changing it.

use std::sync::Arc;

use super::model::Terrain;
use super::order::Request;
use super::queue::{Queue, Together, WorkLimits};
use super::receipt::Receipt;
use super::transaction::Transaction;
use super::work::Work;
use crate::brush::Edit;
use crate::world::{Meshing, Patch, World, unique};

/// The changes that edits would make.
#[derive(Clone, Debug, Default)]
pub struct Draft {
    /// A receipt for each edit.
    pub receipts: Vec<Receipt>,
    /// The changes.
    pub change: Patch,
    /// The [hash](World::hash) that the world would have.
    pub hash: u64,
    /// The [sum of the hashes of all regions](World::regions_hash) that the world would have.
    pub regions_hash: u64,
}

impl Terrain {
    /// The result of these edits on the last committed world, under the rules and settings of edits that are
    /// submitted now. Nothing changes. It takes as long as their transaction on a terrain that [never
    /// meshes](Meshing::Never).
    #[doc(hidden)]
    pub fn draft(&self, edits: &[Edit]) -> Draft {
        let mut queue = Queue::default();
        queue.limits = WorkLimits::UNBOUNDED;
        let together = Together::Batch(unique());
        for edit in edits {
            let request = Request::from(edit);
            let work = request.work(self.world.grid());
            queue.push(request, work, together, self.edit_settings.clone());
        }
        let mut world = Arc::clone(&self.world);
        let (mut receipts, mut regions_hash) = (Vec::new(), world.sample_hash);
        let mut change = Patch { next_field: world.next_field, ..Patch::default() };
        // All of them are one transaction, unless there is a reset among them.
        while let Some((edits, _)) = queue.take() {
            let transaction = self.transaction(unique(), Work::Orders(edits, None));
            let transaction = Transaction {
                meshing: Meshing::Never,
                drawn_cut: None,
                is_logged: false,
                world: Arc::clone(&world),
                ..transaction
            };
            let mut commit = transaction.run();
            regions_hash = commit.sample_hash();
            receipts.append(&mut commit.outcome.receipts);
            change.then(commit.change());
            if queue.len() > 0 {
                let mut next = World::clone(&world);
                commit.install(&mut next);
                world = Arc::new(next);
            }
        }
        let hash = World::hash_of(self.world.ground().hash(), regions_hash);
        Draft { receipts, change, hash, regions_hash }
    }
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::{Ground, MaterialId, NoiseHeights};
    use crate::terrain::{LooseSettings, Order, TerrainSettings};
    use crate::volume::DiggingRules;

    fn terrain() -> Terrain {
        let noise = NoiseHeights { seed: 3, scale: 20.0, amplitude: 8.0, base: 20.0, ..Default::default() };
        let ground = Ground::from_noise(64, 64, &noise).expect("valid ground");
        let settings = TerrainSettings { chunk_size: 16, ..TerrainSettings::default() };
        Terrain::new(ground, &settings).expect("valid settings")
    }

    fn edits(rng: &mut Rng, count: usize) -> Vec<Edit> {
        let mut part = |low: f32, high: f32| low + rng.f32() * (high - low);
        let brushes = (0..count).map(|number| {
            let at = Vec3::new(part(4.0, 60.0), part(12.0, 30.0), part(4.0, 60.0));
            let shape = Shape::sphere(at, part(1.0, 7.0));
            match number % 4 {
                0 => Brush::add(shape, MaterialId(2)),
                1 => Brush::smooth(shape, 0.7),
                _ => Brush::dig(shape),
            }
        });
        brushes.map(|brush| Edit::quantize(&brush).expect("a valid brush")).collect()
    }

    /// Hash, fields and names.
    fn state(terrain: &Terrain) -> (u64, Vec<(crate::lattice::ChunkPos, crate::volume::Fields)>, u64) {
        let parts = terrain.parts();
        (terrain.world().hash(), parts.change.fields, parts.change.next_field)
    }

    #[test]
    fn a_draft_is_the_result_of_its_edits_and_changes_nothing() {
        let mut rng = Rng::with_seed(5);
        for round in 0..40 {
            let (mut edited, mut put) = (terrain(), terrain());
            for own in [&mut edited, &mut put] {
                let mut rng = Rng::with_seed(round);
                own.submit_all(edits(&mut rng, 6));
                own.finish();
                if round % 3 == 0 {
                    own.set_loose(Some(LooseSettings::default()));
                    let rules = DiggingRules::default().with_unbreakable(MaterialId(2));
                    own.set_rules(rules).expect("valid rules");
                }
            }
            let edits = edits(&mut rng, 5);
            let before = state(&put);
            let draft = put.draft(&edits);
            assert_eq!(state(&put), before, "a draft changes nothing");
            edited.submit_all(&edits);
            let receipts = edited.finish();
            assert_eq!(draft.receipts, receipts);
            assert_eq!(draft.hash, edited.world().hash());
            put.apply_one(Order::parts(draft.change, Some(draft.hash))).outcome.expect("it fits");
            assert_eq!(state(&put), state(&edited));
            assert!(put.world().check_seams().is_flawless());
        }
    }

    #[test]
    fn nothing_drafted_is_the_world_as_it_is() {
        let terrain = terrain();
        let draft = terrain.draft(&[]);
        assert_eq!((draft.receipts.len(), draft.hash), (0, terrain.world().hash()));
        assert!(draft.change.bricks.is_empty() && draft.change.fields.is_empty());
    }
}
