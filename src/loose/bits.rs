//! Sets of samples over many bricks, and how they spread to neighbours.

use glam::IVec3;
use rustc_hash::FxHashMap;

use crate::lattice::BrickPos;
use crate::volume::layers::{ALL, FIRST_X, Layers, NONE, and, or};

/// Some samples of some bricks.
pub(super) type Samples = FxHashMap<BrickPos, Layers>;

/// The six neighbours of a brick.
pub(super) const SIDES: [IVec3; 6] = [IVec3::NEG_Y, IVec3::NEG_X, IVec3::X, IVec3::NEG_Z, IVec3::Z, IVec3::Y];

/// The samples of the brick at this side that touch those of a brick.
pub(super) fn beyond(layers: &Layers, side: IVec3) -> Layers {
    let mut beyond = NONE;
    match side {
        IVec3::Y => beyond[0] = layers[7],
        IVec3::NEG_Y => beyond[7] = layers[0],
        IVec3::X => beyond = layers.map(|layer| layer >> 7 & FIRST_X),
        IVec3::NEG_X => beyond = layers.map(|layer| (layer & FIRST_X) << 7),
        IVec3::Z => beyond = layers.map(|layer| layer >> 56),
        _ => beyond = layers.map(|layer| layer << 56),
    }
    beyond
}

/// Samples of a layer and their neighbours in it.
fn beside(layer: u64) -> u64 {
    layer | (layer & !(FIRST_X << 7)) << 1 | (layer & !FIRST_X) >> 1 | layer << 8 | layer >> 8
}

/// Samples and their six neighbours, as far as these lie in the same brick.
pub(super) fn grown(layers: &Layers) -> Layers {
    std::array::from_fn(|y| {
        let above = if y < 7 { layers[y + 1] } else { 0 };
        let below = if y > 0 { layers[y - 1] } else { 0 };
        beside(layers[y]) | above | below
    })
}

/// Everything in a brick that samples are connected with, step by step from neighbour to neighbour.
pub(super) fn flood(from: &Layers, solid: &Layers) -> Layers {
    let mut reached = and(from, solid);
    if *solid == ALL && reached != NONE {
        return ALL;
    }
    loop {
        let before = reached;
        let mut below = 0;
        for (layer, &solid) in reached.iter_mut().zip(solid) {
            *layer = fill(*layer | below & solid, solid);
            below = *layer;
        }
        let mut above = 0;
        for (layer, &solid) in reached.iter_mut().zip(solid).rev() {
            *layer = fill(*layer | above & solid, solid);
            above = *layer;
        }
        if reached == before {
            return reached;
        }
    }
}

/// Everything in a layer that samples are connected with.
fn fill(mut layer: u64, solid: u64) -> u64 {
    loop {
        let next = beside(layer) & solid;
        if next == layer {
            return layer;
        }
        layer = next;
    }
}

/// The first sample of a set, alone.
pub(super) fn first(layers: &Layers) -> Layers {
    let mut one = NONE;
    if let Some(y) = layers.iter().position(|&layer| layer != 0) {
        one[y] = layers[y] & layers[y].wrapping_neg();
    }
    one
}

/// Adds samples to a set.
pub(super) fn include(set: &mut Samples, pos: BrickPos, layers: &Layers) {
    if *layers != NONE {
        let own = set.entry(pos).or_insert(NONE);
        *own = or(own, layers);
    }
}

/// The samples of a set and all their six neighbours.
pub(super) fn grown_set(set: &Samples) -> Samples {
    let mut all = Samples::default();
    for (&pos, layers) in set {
        include(&mut all, pos, &grown(layers));
        for side in SIDES {
            include(&mut all, BrickPos(pos.0 + side), &beyond(layers, side));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::layers;
    use proptest::prelude::*;

    fn points(pos: BrickPos, layers: &Layers) -> Vec<IVec3> {
        layers::indices(layers).map(|index| pos.origin() + layers::offset(index)).collect()
    }

    proptest! {
        #[test]
        fn neighbours_are_the_six_around(layers: [u64; 8], thin: [u64; 8]) {
            let pos = BrickPos(IVec3::new(-1, 2, 0));
            let layers = and(&layers, &thin);
            let all = grown_set(&Samples::from_iter([(pos, layers)]));
            let mut expected: Vec<IVec3> = points(pos, &layers)
                .into_iter()
                .flat_map(|p| SIDES.map(|side| p + side).into_iter().chain([p]))
                .collect();
            let mut found: Vec<IVec3> = all.iter().flat_map(|(&pos, layers)| points(pos, layers)).collect();
            for list in [&mut expected, &mut found] {
                list.sort_unstable_by_key(|p| p.to_array());
                list.dedup();
            }
            prop_assert_eq!(found, expected);
        }

        #[test]
        fn floods_reach_what_steps_reach(a: [u64; 8], b: [u64; 8], seed in 0usize..512) {
            let solid = or(&a, &b);
            let mut from = NONE;
            from[seed >> 6] = 1 << (seed & 63);
            let found = flood(&from, &solid);
            let mut reached = and(&from, &solid);
            loop {
                let next = and(&grown(&reached), &solid);
                if next == reached { break; }
                reached = next;
            }
            prop_assert_eq!(found, reached);
        }
    }
}
