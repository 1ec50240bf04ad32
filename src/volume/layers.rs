//! Sets of samples of a brick, one bit each.

use glam::IVec3;

use crate::lattice::{BRICK, BrickPos, LatticeBox};

/// One bit for each sample of a brick: a word for each y, in it bit `z * 8 + x`.
pub type Layers = [u64; BRICK as usize];

/// No sample of a brick.
pub(crate) const NONE: Layers = [0; 8];

/// All samples of a brick.
pub(crate) const ALL: Layers = [u64::MAX; 8];

/// The samples of a layer with the lowest x.
pub(crate) const FIRST_X: u64 = 0x0101_0101_0101_0101;

pub(crate) fn and(a: &Layers, b: &Layers) -> Layers {
    std::array::from_fn(|y| a[y] & b[y])
}

pub(crate) fn or(a: &Layers, b: &Layers) -> Layers {
    std::array::from_fn(|y| a[y] | b[y])
}

pub(crate) fn without(a: &Layers, b: &Layers) -> Layers {
    std::array::from_fn(|y| a[y] & !b[y])
}

pub(crate) fn count(layers: &Layers) -> u64 {
    layers.iter().map(|layer| u64::from(layer.count_ones())).sum()
}

/// Returns `true` if the sample with this index is in the set.
pub(crate) fn contains(layers: &Layers, index: usize) -> bool {
    layers[index >> 6] >> (index & 63) & 1 == 1
}

/// The indices of the samples in the set, in order.
pub(crate) fn indices(layers: &Layers) -> impl Iterator<Item = usize> + '_ {
    (0..8).flat_map(|y| ones(layers[y]).map(move |bit| y * 64 + bit))
}

/// The columns (`z * 8 + x`) that hold some sample of the set.
pub(crate) fn columns(layers: &Layers) -> u64 {
    layers.iter().fold(0, |all, layer| all | layer)
}

/// The layer that holds only this row.
#[inline(always)]
pub(crate) fn of_row(row: u8, z: usize) -> u64 {
    u64::from(row) << (z * 8)
}

/// Positions of the bits that are set, lowest first.
#[inline(always)]
pub(crate) fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (bit < 64).then_some(bit)
    })
}

/// From a brick's lowest sample to the one with this index.
pub(crate) fn offset(index: usize) -> IVec3 {
    IVec3::new((index & 7) as i32, (index >> 6) as i32, (index >> 3 & 7) as i32)
}

/// The box around the samples of the set, where `low` is the brick's lowest sample.
pub(crate) fn bounds(layers: &Layers, low: IVec3) -> Option<LatticeBox> {
    let all = columns(layers);
    if all == 0 {
        return None;
    }
    let row = all.to_le_bytes().iter().fold(0, |row, byte| row | byte);
    let is_filled = |y: &usize| layers[*y] != 0;
    let (bottom, top) = ((0..8).find(is_filled).unwrap_or(0), (0..8).rfind(is_filled).unwrap_or(7));
    let min = IVec3::new(row.trailing_zeros() as i32, bottom as i32, (all.trailing_zeros() >> 3) as i32);
    let max = IVec3::new(7 - row.leading_zeros() as i32, top as i32, 7 - (all.leading_zeros() >> 3) as i32);
    LatticeBox::new(low + min, low + max)
}

/// The samples of a brick that lie in a box.
pub(crate) fn within(pos: BrickPos, samples: LatticeBox) -> Layers {
    let Some(own) = pos.samples().intersection(samples) else { return NONE };
    if own == pos.samples() {
        return ALL;
    }
    let (from, to) = ((own.min - pos.origin()).as_usizevec3(), (own.max - pos.origin()).as_usizevec3());
    let row = 0xff >> (7 - (to.x - from.x)) << from.x;
    let layer = (from.z..=to.z).fold(0, |layer, z| layer | of_row(row, z));
    std::array::from_fn(|y| if (from.y..=to.y).contains(&y) { layer } else { 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_cut_out_of_bricks() {
        let pos = BrickPos(IVec3::new(0, -1, 3));
        let cut = LatticeBox { min: IVec3::new(-5, -7, 26), max: IVec3::new(3, -2, 90) };
        let expected: Vec<IVec3> = pos.samples().points().filter(|&p| cut.contains(p)).collect();
        let found = within(pos, cut);
        assert_eq!(indices(&found).map(|index| pos.origin() + offset(index)).collect::<Vec<_>>(), expected);
        assert_eq!(bounds(&found, pos.origin()), pos.samples().intersection(cut));
        assert_eq!(within(pos, LatticeBox::point(IVec3::ZERO)), NONE);
    }
}
