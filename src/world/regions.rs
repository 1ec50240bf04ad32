//! The world by regions, the units in which it is saved, compared and sent.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::parts::columns_of;
use super::state::World;
use crate::lattice::{BrickPos, RegionPos};
use crate::volume::{Brick, Layers, layers};

impl World {
    /// The regions that hold bricks, in order.
    pub fn regions(&self) -> impl Iterator<Item = RegionPos> {
        self.bricks.keys().map(|&pos| RegionPos::of(pos)).collect::<BTreeSet<_>>().into_iter()
    }

    /// The stored bricks of a region, in order.
    pub fn bricks_in(&self, region: RegionPos) -> impl Iterator<Item = (BrickPos, &Arc<Brick>)> {
        let first = region.first_brick().0;
        let last = first + (RegionPos::BRICKS - 1);
        let stacks = (first.x..=last.x).flat_map(move |x| (first.z..=last.z).map(move |z| (x, z)));
        stacks
            .flat_map(move |(x, z)| {
                let ys = self.stacks.get(&(x, z)).map(Vec::as_slice).unwrap_or_default();
                let from = ys.partition_point(|&y| y < first.y);
                let inside = ys.iter().skip(from).take_while(move |&&y| y <= last.y);
                inside.filter_map(move |&y| self.bricks.get_key_value(&BrickPos(glam::IVec3::new(x, y, z))))
            })
            .map(|(pos, brick)| (*pos, brick))
    }

    /// A stored brick; `None` where nothing was edited.
    pub fn brick(&self, pos: BrickPos) -> Option<&Arc<Brick>> {
        self.bricks.get(&pos)
    }

    /// The greatest name that any field has had.
    pub fn next_field(&self) -> u64 {
        self.next_field
    }

    /// The sum of the [hashes of all regions](Self::region_hash), which wraps around; it is kept, so this takes no
    /// time.
    pub fn regions_hash(&self) -> u64 {
        self.sample_hash
    }

    /// Hash of the edited samples of a region; 0 where nothing was edited. The sum of all, which wraps around, is that
    /// of the world: see [`hash_of`](Self::hash_of).
    pub fn region_hash(&self, region: RegionPos) -> u64 {
        let hash = |(pos, brick): (BrickPos, &Arc<Brick>)| {
            brick.hash(pos.origin().y, brick.edited(), &columns_of(pos))
        };
        self.bricks_in(region).map(hash).fold(0, u64::wrapping_add)
    }

    /// The number to add to its region's [hash](Self::region_hash), wrapping around, when a brick is replaced: only
    /// samples that differ are hashed. `None` stands for a pristine brick.
    #[cfg_attr(not(feature = "net"), allow(dead_code))]
    pub(crate) fn hash_step(&self, pos: BrickPos, new: Option<&Arc<Brick>>) -> u64 {
        let old = self.brick(pos);
        let edited = [old, new].map(|brick| brick.map_or(&layers::NONE, |brick| brick.edited()));
        let mut differ = Brick::differences([old, new].map(|brick| brick.map(Arc::as_ref)));
        for (layer, bits) in differ.iter_mut().enumerate() {
            *bits |= edited[0][layer] ^ edited[1][layer];
        }
        let columns = columns_of(pos);
        let [old, new] = [old, new].map(|brick| {
            let of = |brick: &Arc<Brick>| {
                let own: Layers = std::array::from_fn(|layer| differ[layer] & brick.edited()[layer]);
                brick.hash(pos.origin().y, &own, &columns)
            };
            brick.map_or(0, of)
        });
        new.wrapping_sub(old)
    }
}
