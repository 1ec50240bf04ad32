//! Regions as they are compared and sent: bricks, and the names of fields.

use std::collections::BTreeSet;

use rustc_hash::FxHashMap;
use xxhash_rust::xxh3::Xxh3Default;

use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, LatticeBox, RegionPos};
use crate::terrain::{Patch, Receipt, Terrain, World};

/// Runs and commits everything that was submitted to a terrain, and updates the hashes of its regions. Calls `before`
/// with the world and the change of each commit, and returns the receipts and the regions that changed.
pub(super) fn run_submitted(
    terrain: &mut Terrain,
    sums: &mut RegionSums,
    mut before: impl FnMut(&World, &Patch),
) -> (Vec<Receipt>, BTreeSet<RegionPos>) {
    let (mut receipts, mut regions) = (terrain.take_receipts(), BTreeSet::new());
    while let Some(transaction) = terrain.begin() {
        let commit = transaction.run();
        let (world, change) = (terrain.world(), commit.change());
        before(world, &change);
        regions.append(&mut touched_regions(world.grid(), &change));
        let steps = Steps::of(world, &change);
        // It is the one under way.
        receipts.extend(terrain.commit(commit).unwrap_or_default());
        sums.add(terrain.world(), steps);
    }
    (receipts, regions)
}

/// The hash of a region in hash checks and tables: of its [samples](World::region_hash), and of the names of the fields
/// in all chunks that reach into it. 0 for a pristine region.
pub fn region_hash(world: &World, region: RegionPos) -> u64 {
    hash_with_names(world, region, world.region_hash(region))
}

/// The hashes of regions' samples, kept up to date with each patch. Otherwise a hash check would hash all bricks of the
/// regions that changed since the last one, in one tick.
#[derive(Clone, Debug, Default)]
pub(super) struct RegionSums(FxHashMap<RegionPos, u64>);

/// Changes of regions' hashes.
struct Steps(FxHashMap<RegionPos, u64>);

impl Steps {
    /// The changes of hashes that a patch causes; call it before the patch is applied.
    fn of(world: &World, change: &Patch) -> Self {
        let mut steps = FxHashMap::<RegionPos, u64>::default();
        for (pos, brick) in &change.bricks {
            let sum = steps.entry(RegionPos::of(*pos)).or_default();
            *sum = sum.wrapping_add(world.hash_step(*pos, brick.as_ref()));
        }
        Self(steps)
    }
}

impl RegionSums {
    /// Adds the steps of a patch that was applied. A region that was not known yet is hashed whole.
    fn add(&mut self, world: &World, steps: Steps) {
        for (region, step) in steps.0 {
            let known = self.0.entry(region).and_modify(|hash| *hash = hash.wrapping_add(step));
            known.or_insert_with(|| world.region_hash(region));
        }
    }

    /// The [hash](region_hash) of a region of the world as it is now.
    pub fn hash(&mut self, world: &World, region: RegionPos) -> u64 {
        let samples = *self.0.entry(region).or_insert_with(|| world.region_hash(region));
        hash_with_names(world, region, samples)
    }

    /// Forgets all hashes, for another world.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

/// The [hash](region_hash) of a region whose samples have a hash that is known.
fn hash_with_names(world: &World, region: RegionPos, samples: u64) -> u64 {
    let (mut names, mut is_empty) = (Xxh3Default::new(), true);
    names.update(&samples.to_le_bytes());
    for chunk in chunks_of(world.grid(), region) {
        let Some(fields) = world.fields_of(chunk).filter(|fields| !fields.is_empty()) else { continue };
        is_empty = false;
        let ChunkPos { x, y, z } = chunk;
        [x, y, z].iter().for_each(|part| names.update(&part.to_le_bytes()));
        fields.iter().for_each(|field| names.update(&field.id.0.to_le_bytes()));
    }
    if is_empty { samples } else { names.digest() }
}

/// The regions whose [hash](region_hash) a change may change.
pub fn touched_regions(grid: ChunkGrid, change: &Patch) -> BTreeSet<RegionPos> {
    let mut regions: BTreeSet<RegionPos> = change.bricks.iter().map(|(pos, _)| RegionPos::of(*pos)).collect();
    for (chunk, _) in &change.fields {
        let Some(samples) = grid.chunk_samples(*chunk).intersection(grid.edit_bounds()) else { continue };
        let [low, high] = [samples.min, samples.max].map(|corner| RegionPos::of(BrickPos::of(corner)).0);
        regions.extend(LatticeBox { min: low, max: high }.points().map(RegionPos));
    }
    regions
}

/// The chunks that have a sample in a region.
pub(super) fn chunks_of(grid: ChunkGrid, region: RegionPos) -> impl Iterator<Item = ChunkPos> {
    let samples = region.samples().intersection(grid.edit_bounds());
    samples.into_iter().flat_map(move |samples| grid.chunks_of(samples))
}

/// Regions with all bricks and fields of a world among them.
pub(super) fn regions_of(world: &World) -> BTreeSet<RegionPos> {
    let corners = world
        .fields()
        .flat_map(|(_, fields)| fields.iter().map(|field| RegionPos::of(BrickPos::of(field.bounds.min))));
    corners.chain(world.regions()).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::{IVec3, Vec3};

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::Ground;
    use crate::terrain::{Order, Terrain, TerrainSettings};
    use crate::volume::{Field, FieldId, Fields};

    /// With chunks that fit into regions, and with others.
    fn terrains() -> [Terrain; 3] {
        [16, 32, 100].map(|chunk_size| {
            let ground = Ground::flat(200, 200, 20.0).expect("a valid ground");
            let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
            Terrain::new(ground, &settings).expect("valid settings")
        })
    }

    fn hashes(world: &World) -> BTreeMap<RegionPos, u64> {
        let all = (-1..5).flat_map(|x| (-2..3).flat_map(move |y| (-1..5).map(move |z| IVec3::new(x, y, z))));
        all.map(|at| (RegionPos(at), region_hash(world, RegionPos(at)))).collect()
    }

    #[test]
    fn what_a_change_changes_is_among_the_regions_that_it_touches() {
        let mut rng = fastrand::Rng::with_seed(6);
        for mut terrain in terrains() {
            let pristine = hashes(terrain.world());
            assert!(pristine.values().all(|hash| *hash == 0));
            let mut sums = RegionSums::default();
            for _ in 0..30 {
                let at = Vec3::new(rng.f32() * 200.0, rng.f32() * 30.0, rng.f32() * 200.0);
                let before = hashes(terrain.world());
                terrain.submit(Brush::dig(Shape::sphere(at, 1.0 + 9.0 * rng.f32())));
                let mut change = Patch::default();
                let (receipts, touched) =
                    run_submitted(&mut terrain, &mut sums, |_, own| change = own.clone());
                assert_eq!(receipts.len(), 1);
                for region in before.keys().copied() {
                    let hash = region_hash(terrain.world(), region);
                    assert_eq!(sums.hash(terrain.world(), region), hash, "{region:?} at {at}");
                }
                assert_eq!(touched, touched_regions(terrain.world().grid(), &change));
                for (region, hash) in hashes(terrain.world()) {
                    assert!(hash == before[&region] || touched.contains(&region), "{region:?} at {at}");
                }
            }
            assert_ne!(hashes(terrain.world()), pristine);
        }
    }

    #[test]
    fn another_name_is_another_hash_of_the_same_samples() {
        for mut terrain in terrains() {
            terrain.apply([Brush::dig(Shape::sphere(Vec3::new(90.0, 20.0, 90.0), 6.0))]);
            let (before, hash) = (hashes(terrain.world()), terrain.world().hash());
            let parts = terrain.parts().change;
            let (chunk, fields) = parts.fields.first().expect("a field").clone();
            let renamed = fields.iter().map(|field| Field { id: FieldId(field.id.0 + 70), ..*field });
            let renamed = Fields::restored(renamed.collect()).expect("names that differ");
            let change = Patch { fields: vec![(chunk, renamed)], next_field: 100, ..Patch::default() };
            terrain.apply_one(Order::parts(change, Some(hash))).outcome.expect("it fits");
            let own = BrickPos::of(fields.iter().next().expect("a field").bounds.min);
            assert_ne!(hashes(terrain.world())[&RegionPos::of(own)], before[&RegionPos::of(own)]);
        }
    }
}
