//! Compares receipts, samples, bricks, fields and mask with the reference.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use bevy_burrow::lattice::{ChunkPos, Column};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::mask::cell_sheet;
use bevy_burrow::terrain::FieldChange;
use bevy_burrow::volume::Brick;

use crate::bits::mix;
use crate::checked_terrain::{CheckedTerrain, Effect};

impl CheckedTerrain {
    pub fn check_receipt(&mut self, receipt: &Receipt, brush: &Brush, what: &str) {
        assert_eq!(receipt.tag, brush.tag, "{what}");
        let Ok(edit) = Edit::quantize(brush) else {
            assert!(matches!(receipt.outcome, Err(Rejection::Brush(_))), "{what}: {receipt:?}");
            return;
        };
        let expected = self.naive(brush, &edit);
        let Ok(applied) = &receipt.outcome else {
            assert_eq!(expected, Effect::default(), "{what}: {receipt:?}");
            return;
        };
        let tally = |tally: &bevy_burrow::volume::MaterialCounts| tally.iter().collect::<BTreeMap<_, _>>();
        let reported = Effect {
            chunks: applied.chunks.iter().map(|part| part.chunk).collect(),
            bounds: applied.bounds,
            removed: tally(&applied.removed),
            added: tally(&applied.added),
            painted: tally(&applied.painted),
        };
        assert!(applied.chunks.is_sorted_by_key(|part| part.chunk), "{what}: chunks in order");
        assert!(reported == expected, "{what}: {brush:?}\nreported {reported:?}\nexpected {expected:?}");
    }

    /// Samples, solid bits, edited bits and hash.
    pub fn check_samples(&self, what: &str) {
        let world = self.terrain.world();
        let mut found = 0;
        let mut hash = 0u64;
        for (pos, brick) in world.bricks() {
            let mut is_any = false;
            for point in pos.samples().points() {
                let bit = (point.z & 7) * 8 + (point.x & 7);
                let layer = (point.y & 7) as usize;
                let is_set = |layers: &[u64; 8]| layers[layer] >> bit & 1 == 1;
                let stored = self.samples.get(&point);
                let ours = brick.sample(point).distance().map(|d| (d, brick.material(point)));
                assert_eq!(ours, stored.copied(), "{what}: sample at {point}");
                assert_eq!(is_set(brick.edited()), stored.is_some(), "{what}: edited bit at {point}");
                let distance = stored.map_or_else(|| world.ground().distance(point), |s| s.0);
                assert_eq!(is_set(brick.solid()), distance < 0, "{what}: solid bit at {point}");
                if let Some(&(distance, material)) = stored {
                    found += 1;
                    is_any = true;
                    let place = mix(u64::from(point.x as u32) | u64::from(point.z as u32) << 32);
                    let sample = u64::from(distance as u16) << 8 ^ u64::from(material.0);
                    hash = hash.wrapping_add(mix(place ^ u64::from(point.y as u32) << 32 ^ sample));
                }
            }
            assert!(is_any, "{what}: {pos:?} is stored without edited samples");
        }
        assert_eq!(found, self.samples.len(), "{what}: edited samples");
        assert_eq!(world.hash(), mix(world.ground().hash() ^ mix(hash)), "{what}: hash");
    }

    /// Uniform bricks are shared, and memory counts each kind once.
    pub fn check_bricks(&mut self, what: &str) {
        let world = self.terrain.world();
        let mut shared: HashMap<(i32, MaterialId), *const Brick> = HashMap::new();
        let (mut single, mut materials) = (0, 0);
        for (pos, brick) in world.bricks() {
            let of = |point| Some((brick.sample(point).distance()?, brick.material(point)));
            let first = of(pos.origin());
            match first.filter(|_| pos.samples().points().all(|point| of(point) == first)) {
                Some(kind) => {
                    let one = *shared.entry(kind).or_insert(brick);
                    assert!(std::ptr::eq(one, brick), "{what}: {pos:?} of {kind:?} is not shared");
                    self.kinds.insert(kind, brick.material_bytes());
                }
                None => {
                    single += 1;
                    materials += brick.material_bytes();
                }
            }
        }
        let memory = world.memory();
        // From 64 kinds on, a world may drop those that are no longer used.
        assert!(self.kinds.len() < 64, "{what}: too many kinds of uniform bricks for this check");
        assert_eq!(memory.samples, Brick::BYTES * (single + self.kinds.len()), "{what}: memory of samples");
        materials += self.kinds.values().sum::<usize>();
        assert_eq!(memory.materials, materials, "{what}: memory of materials");
    }

    /// Each edited sample lies in one field of its chunk, fields do not touch, and events report every change of them.
    pub fn check_fields(&mut self, news: &[(ChunkPos, FieldChange)], what: &str) {
        let world = self.terrain.world();
        for &(chunk, news) in news {
            match news {
                FieldChange::Created(id) => assert!(self.fields.insert((chunk, id)), "{what}: created twice"),
                FieldChange::Changed(id) => assert!(self.fields.contains(&(chunk, id)), "{what}: unknown"),
                FieldChange::Merged { gone, into } => {
                    assert!(self.fields.remove(&(chunk, gone)), "{what}: removed twice");
                    assert!(world.fields_of(chunk).is_some_and(|f| f.get(into).is_some()), "{what}: into");
                }
                FieldChange::Removed(id) => {
                    assert!(self.fields.remove(&(chunk, id)), "{what}: removed twice")
                }
            }
        }
        let all = world.fields().flat_map(|(chunk, fields)| fields.iter().map(move |f| (chunk, f.id)));
        assert_eq!(all.collect::<BTreeSet<_>>(), self.fields, "{what}: fields");
        for (chunk, fields) in world.fields() {
            for (i, a) in fields.iter().enumerate() {
                assert!(world.grid().chunk_samples(chunk).encloses(a.bounds), "{what}");
                assert!(fields.iter().skip(i + 1).all(|b| !a.bounds.meets(b.bounds)), "{what}: fields meet");
            }
        }
        for &point in self.samples.keys() {
            let fields = world.fields_of(world.grid().chunk_of(point)).expect("its chunk has a field");
            assert!(fields.iter().any(|field| field.bounds.contains(point)), "{what}: {point} in no field");
        }
    }

    /// Rule 2, cell by cell.
    pub fn check_mask(&self, what: &str) {
        let world = self.terrain.world();
        let mut edited: HashMap<Column, Vec<i32>> = HashMap::new();
        for point in self.samples.keys() {
            edited.entry(Column::of(*point)).or_default().push(point.y);
        }
        let (width, depth) = (world.grid().width(), world.grid().depth());
        let mut count = 0;
        for cell in (0..depth).flat_map(|z| (0..width).map(move |x| Column::new(x, z))) {
            let sheet = cell_sheet(world.ground(), cell);
            let is_in_sheet = |y: &i32| (sheet.start..=sheet.end).contains(y);
            let is_touched =
                |column| edited.get(column).is_some_and(|all: &Vec<i32>| all.iter().any(is_in_sheet));
            let expected = cell.corners().iter().any(is_touched);
            assert_eq!(world.mask().contains(cell), expected, "{what}: {cell:?}");
            count += usize::from(expected);
        }
        assert_eq!(world.mask().len(), count, "{what}: no cells beyond the rim");
    }
}
