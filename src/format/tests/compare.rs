//! Compares values of one type bit by bit.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::format::Batch;
use crate::format::portable::{PortableWorld, SavedRegion};
use crate::lattice::{BrickPos, RegionPos};
use crate::terrain::{CommitRecord, Patch, WorldParts};
use crate::volume::Brick;

pub fn bricks(a: &Brick, b: &Brick) -> bool {
    let materials = (0..512).all(|index| a.material_at(index) == b.material_at(index));
    a.samples() == b.samples() && a.solid() == b.solid() && a.edited() == b.edited() && materials
}

pub fn lists(a: &[(BrickPos, Arc<Brick>)], b: &[(BrickPos, Arc<Brick>)]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.0 == b.0 && bricks(&a.1, &b.1))
}

pub fn changes(a: &Patch, b: &Patch) -> bool {
    let same = |pair: (&Option<Arc<Brick>>, &Option<Arc<Brick>>)| match pair {
        (Some(a), Some(b)) => bricks(a, b),
        (None, None) => true,
        _ => false,
    };
    a.bricks.len() == b.bricks.len()
        && a.bricks.iter().zip(&b.bricks).all(|(a, b)| a.0 == b.0 && same((&a.1, &b.1)))
        && a.fields == b.fields
        && a.next_field == b.next_field
}

pub fn parts(a: &WorldParts, b: &WorldParts) -> bool {
    let of = |parts: &WorldParts| (parts.chunk_size, parts.revision, parts.edit_settings.clone());
    changes(&a.change, &b.change) && of(a) == of(b)
}

fn commits(a: &CommitRecord, b: &CommitRecord) -> bool {
    let has_change = a.has_change();
    (a.revision, a.hash) == (b.revision, b.hash)
        && a.orders == b.orders
        && (!has_change || changes(&a.change, &b.change))
}

pub fn batches(a: &Batch, b: &Batch) -> bool {
    let same = a.commits.iter().zip(&b.commits).all(|(a, b)| commits(a, b));
    a.commits.len() == b.commits.len() && same && a.game == b.game
}

pub fn regions(a: &BTreeMap<RegionPos, SavedRegion>, b: &BTreeMap<RegionPos, SavedRegion>) -> bool {
    let same = |(a, b): ((&RegionPos, &SavedRegion), (&RegionPos, &SavedRegion))| {
        let of = |region: &SavedRegion| (region.revision, region.ground_hash, region.fields.clone());
        a.0 == b.0 && lists(&a.1.bricks, &b.1.bricks) && of(a.1) == of(b.1)
    };
    a.len() == b.len() && a.iter().zip(b).all(same)
}

pub fn portables(a: &PortableWorld, b: &PortableWorld) -> bool {
    let journals = a.journal.iter().zip(&b.journal).all(|(a, b)| batches(a, b));
    (a.world, &a.metadata) == (b.world, &b.metadata)
        && regions(&a.regions, &b.regions)
        && a.journal.len() == b.journal.len()
        && journals
}
