//! Parts of a world: bricks and fields, as they are saved, sent and put in place.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::patch::Patch;
use super::state::World;
use crate::ground::Ground;
use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, Column};
use crate::volume::{Brick, FieldId, Fields, column_hash, pristine_layers};

impl Patch {
    /// Extends fields over edited samples that no field contains; new fields get unused names.
    /// Returns whether there were any.
    pub(crate) fn cover(&mut self, grid: ChunkGrid) -> bool {
        let mut fields: BTreeMap<ChunkPos, Fields> = std::mem::take(&mut self.fields).into_iter().collect();
        let (mut next, mut has_grown) = (self.next_field, false);
        for (pos, brick) in &self.bricks {
            let Some(edited) = brick.as_ref().and_then(|brick| brick.edited_bounds(*pos)) else { continue };
            for chunk in grid.chunks_of(edited) {
                let Some(own) = grid.chunk_samples(chunk).intersection(edited) else { continue };
                let fields = fields.entry(chunk).or_default();
                if fields.iter().any(|field| field.bounds.encloses(own)) {
                    continue;
                }
                has_grown = true;
                fields.absorb(own, || {
                    next = next.saturating_add(1);
                    FieldId(next)
                });
            }
        }
        (self.fields, self.next_field) = (fields.into_iter().collect(), next);
        has_grown
    }
}

impl World {
    /// All bricks and fields, in order.
    pub(crate) fn all_parts(&self) -> Patch {
        let mut bricks: Vec<(BrickPos, Option<Arc<Brick>>)> =
            self.bricks.iter().map(|(pos, brick)| (*pos, Some(Arc::clone(brick)))).collect();
        bricks.sort_unstable_by_key(|(pos, _)| *pos);
        let mut fields: Vec<_> = self.fields.iter().map(|(chunk, fields)| (*chunk, fields.clone())).collect();
        fields.sort_unstable_by_key(|(chunk, _)| *chunk);
        Patch { bricks, fields, next_field: self.next_field }
    }
}

/// The brick with the same edited samples over another ground; the same `Arc` where all its bits are the same.
pub(crate) fn brick_over(ground: &Ground, pos: BrickPos, brick: Arc<Brick>) -> Arc<Brick> {
    let on_ground = brick.on_pristine(&pristine_layers(ground, pos));
    if on_ground.solid() == brick.solid() { brick } else { Arc::new(on_ground) }
}

/// The hashes of a brick's columns.
pub(crate) fn columns_of(pos: BrickPos) -> [u64; 64] {
    let low = Column::of(pos.origin());
    std::array::from_fn(|bit| column_hash(low.offset(bit as i32 & 7, bit as i32 >> 3)))
}
