//! Samples taken out of a brick: what was a piece of ground becomes air.

use std::sync::Arc;

use super::brick_editor::{bounds, hash_of, offset, ones, place_hash};
use super::draft::{ChunkEffect, DraftedBrick};
use crate::brush::DEPTH;
use crate::ground::MaterialId;
use crate::lattice::{BrickPos, ChunkGrid, Column};
use crate::volume::{Brick, Layers, SampleView, pristine_layers, row};

/// A brick with samples taken out of it.
pub(crate) struct TakenOut {
    pub drafted: DraftedBrick,
    /// By how much the hash of the world's samples changes.
    pub hash: u64,
    /// What changed in each chunk.
    pub chunks: Vec<ChunkEffect>,
}

/// Makes samples of a brick the air that the middle of a large dig is; none of them may lie outside the world's columns.
/// Those that are such air already stay as they are. `None` where all are.
pub(crate) fn take_out(
    view: SampleView,
    grid: ChunkGrid,
    pos: BrickPos,
    samples: &Layers,
) -> Option<TakenOut> {
    let (low, base) = (pos.origin(), view.brick(pos));
    let mut brick = match base {
        Some(base) => base.clone(),
        None => Brick::pristine(pristine_layers(view.ground(), pos)),
    };
    let mut changed: Layers = [0; 8];
    for (y, layer) in changed.iter_mut().enumerate() {
        for bit in ones(samples[y]) {
            if view.distance(low + offset(y * 64 + bit)) < DEPTH {
                *layer |= 1 << bit;
            }
        }
        for z in (0..8).filter(|z| *layer >> (z * 8) & 0xff != 0) {
            let at = y * 64 + z * 8;
            let mut samples = row(brick.samples(), at);
            ones(*layer >> (z * 8) & 0xff).for_each(|x| samples[x] = DEPTH as i16);
            brick.set_row(at, samples);
        }
        brick.set_bits(y, *layer, 0);
        // Air is of no material.
        brick.set_materials(y, *layer, MaterialId::GROUND);
    }
    let around = bounds(&changed, low)?;
    let mut places = [0; 64];
    for bit in ones(changed.iter().fold(0, |all, layer| all | layer)) {
        places[bit] = place_hash(Column::of(low + offset(bit)));
    }
    let of = |brick: &Brick, edited: &Layers| {
        let stored = std::array::from_fn(|y| changed[y] & edited[y]);
        hash_of(brick, low.y, &stored, &places)
    };
    let before = base.map_or(0, |base| of(base, base.edited()));
    let hash = of(&brick, &changed).wrapping_sub(before);
    let chunks = grid.chunks_of(around).filter_map(|chunk| {
        let own = grid.chunk_samples(chunk).intersection(pos.samples())?;
        let (from, to) = (own.min - low, own.max - low);
        let inside = |y: usize| {
            let rows = (from.z..=to.z).fold(0u64, |all, z| all | 0xff << (z * 8));
            let row = 0xffu64 >> (7 - (to.x - from.x)) << from.x;
            let all = rows & (row * 0x0101_0101_0101_0101);
            if (from.y..=to.y).contains(&(y as i32)) { all } else { 0 }
        };
        let layers: Layers = std::array::from_fn(|y| changed[y] & inside(y));
        Some(ChunkEffect { chunk, bounds: bounds(&layers, low)? })
    });
    let chunks = chunks.collect();
    let is_extended = base.map_or([0; 8], |base| *base.edited()) != *brick.edited();
    let drafted = DraftedBrick::new(pos, Arc::new(brick), around, is_extended);
    Some(TakenOut { drafted, hash, chunks })
}
