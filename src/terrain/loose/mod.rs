//! Loose pieces: ground that digging cut off from the world.
//!
//! **Connected** are solid samples that are neighbours along an axis, six for each sample. The surface connects the same
//! ones: its [case table](crate::surface::cases) puts no vertex on an edge between two solid samples,
//! and separates solid corners that only meet across a diagonal. So two samples belong to one piece of ground exactly if a
//! path inside the drawn surface connects them.
//!
//! **Anchored** is a piece that reaches ground below everything that was ever edited. The world's sides anchor
//! nothing. A piece of more than [`LooseSettings::largest`] voxels counts as anchored without looking further, which bounds
//! the search; its result does not depend on the order of the search.
//!
//! **Removal.** The samples of a removed piece get the density of air in the middle of a dig, and so does air that touches
//! them and no other ground, so that nothing of the shape is left. Other vertices keep their bits. All of this belongs to
//! the edit that cut the piece off: it is hashed, undone and replayed with it.

mod bits;
mod mesh;
mod search;

use std::sync::Arc;

use glam::IVec3;
use serde::{Deserialize, Serialize};

use super::world::World;
use crate::edits::{DraftedBrick, EditDelta, Overlay, take_out};
use crate::lattice::{BrickPos, Column, LatticeBox};
use crate::surface::SurfaceMesh;
use crate::volume::layers::{self, Layers, NONE};
use crate::volume::{DiggingRules, MaterialCounts, SampleView};
use bits::{SIDES, Samples};
use search::{Component, Solid};

/// Which loose pieces to search for after a dig, and what happens to them.
///
/// Each edit that can remove ground is followed by a search before the next edit applies, so the result does not depend on how
/// edits are batched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LooseSettings {
    /// The largest piece to look for, in voxels. Larger ones count as anchored; this bounds the time of a search.
    pub largest: u32,
    /// Pieces up to so many voxels vanish.
    pub crumbs: u32,
    /// Larger ones, up to so many voxels, break off: they are taken out of the ground, and leave a closed mesh to make a
    /// body of. Others stay where they are, and are reported.
    pub debris: u32,
}

impl Default for LooseSettings {
    /// Pieces up to 32768 voxels are reported, and stay.
    fn default() -> Self {
        Self { largest: 1 << 15, crumbs: 0, debris: 0 }
    }
}

impl LooseSettings {
    /// The fate of a piece of so many voxels.
    fn fate(&self, voxels: u64) -> PieceFate {
        if voxels <= u64::from(self.crumbs) {
            PieceFate::Removed
        } else if voxels <= u64::from(self.debris) {
            PieceFate::BrokeOff
        } else {
            PieceFate::Left
        }
    }
}

/// What happened to a loose piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum PieceFate {
    /// It stays where it is. So does every piece of which the terrain's [`DiggingRules`] protect a part.
    Left,
    /// It was taken out of the ground.
    Removed,
    /// It was taken out of the ground, and its mesh is there to make a body of.
    BrokeOff,
}

/// Solid samples in a row along x.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Run {
    /// The first of them.
    pub start: IVec3,
    /// How many.
    pub len: u32,
}

/// A piece of ground that is not connected to the world. It can be saved as it is, with its mesh: pieces that broke off are the
/// game's, not the terrain's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "Plain", into = "Plain")]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(opaque, Clone, Debug, PartialEq))]
pub struct LoosePiece {
    /// What happened to it.
    pub fate: PieceFate,
    /// Box around its samples.
    pub bounds: LatticeBox,
    /// How many samples it has.
    pub voxels: u64,
    /// Its voxels by material: times the density and volume of a voxel, its mass.
    pub materials: MaterialCounts,
    /// Its samples, by y, then z, then x.
    pub runs: Arc<[Run]>,
    /// Its surface as marching cubes draws it, closed, with positions counted from the lowest corner of `bounds`; for
    /// those that broke off.
    pub mesh: Option<Arc<SurfaceMesh>>,
}

/// A piece without shared parts, as it is saved.
#[derive(Serialize, Deserialize)]
#[serde(rename = "LoosePiece")]
struct Plain {
    fate: PieceFate,
    bounds: LatticeBox,
    voxels: u64,
    materials: MaterialCounts,
    runs: Vec<Run>,
    mesh: Option<SurfaceMesh>,
}

impl From<LoosePiece> for Plain {
    fn from(piece: LoosePiece) -> Self {
        let LoosePiece { fate, bounds, voxels, materials, runs, mesh } = piece;
        let mesh = mesh.map(Arc::unwrap_or_clone);
        Self { fate, bounds, voxels, materials, runs: runs.to_vec(), mesh }
    }
}

impl From<Plain> for LoosePiece {
    fn from(of: Plain) -> Self {
        let Plain { fate, bounds, voxels, materials, runs, mesh } = of;
        Self { fate, bounds, voxels, materials, runs: runs.into(), mesh: mesh.map(Arc::new) }
    }
}

impl World {
    /// The loose pieces of up to `largest` voxels that hold some sample of a box, in order of their lowest samples there.
    /// Says what the settings would make of each, but takes none out, and makes no meshes.
    pub fn loose_pieces(&self, around: LatticeBox, settings: &LooseSettings) -> Vec<LoosePiece> {
        let solid = Solid::new(self, self.samples(), None);
        let Some(around) = around.intersection(self.grid.edit_bounds()) else { return Vec::new() };
        let LatticeBox { min: low, max: high } = BrickPos::range(around);
        let near = |(x, z): (i32, i32)| (low.x..=high.x).contains(&x) && (low.z..=high.z).contains(&z);
        let mut seeds = Samples::default();
        for (&(x, z), ys) in self.stacks.iter().filter(|(stack, _)| near(**stack)) {
            // Below the stored bricks all ground is anchored; above them only pristine ground is solid.
            let (Some(&lowest), Some(&highest)) = (ys.first(), ys.last()) else { continue };
            let heights = self.ground.heights::<8>(Column::new(x * 8, z * 8));
            let top = heights.iter().flatten().max().map_or(highest, |&height| highest.max(height >> 11));
            for y in lowest.max(low.y)..=top.min(high.y) {
                let pos = BrickPos(IVec3::new(x, y, z));
                seeds.insert(pos, layers::within(pos, around));
            }
        }
        let found = search::search(&solid, &seeds, settings.largest.into());
        found.iter().map(|piece| describe(self.samples(), piece, settings)).collect()
    }
}

/// Samples next to those that drafted bricks turn to air; `before` are the samples without these bricks.
pub(super) fn seeds(world: &World, before: SampleView, drafted: &[DraftedBrick]) -> Samples {
    search::seeds(&Solid::new(world, before, None), drafted)
}

/// Looks for loose pieces at seeds, in a world under newer bricks, and takes them out where the settings and rules say so.
/// Returns the pieces, and what taking them out changed, as changes of edit 0.
pub(super) fn fall(
    world: &World,
    rules: Option<&DiggingRules>,
    newer: &Overlay,
    seeds: &Samples,
    settings: &LooseSettings,
) -> (Vec<LoosePiece>, EditDelta) {
    let (mut pieces, mut removed) = (Vec::new(), EditDelta::default());
    if seeds.is_empty() {
        return (pieces, removed);
    }
    let samples = newer.over(world.samples());
    let solid = Solid::new(world, samples, Some(newer));
    let found = search::search(&solid, seeds, settings.largest.into());
    let mut gone = Samples::default();
    for component in &found {
        let mut piece = describe(samples, component, settings);
        if rules.is_some_and(|rules| keep(rules, component, &piece)) {
            piece.fate = PieceFate::Left;
        }
        if piece.fate != PieceFate::Left {
            search::bricks(component).for_each(|(pos, layers)| bits::include(&mut gone, pos, layers));
        }
        if piece.fate == PieceFate::BrokeOff {
            piece.mesh = Some(Arc::new(mesh::closed(samples, world.grid, component, piece.bounds.min)));
        }
        pieces.push(piece);
    }
    let protected = protected_beside(rules, &pieces);
    let air = air_around(&solid, &gone);
    for (&pos, layers) in &air {
        let mut air = layers::and(layers, &layers::within(pos, world.grid.edit_bounds()));
        for &protected in &protected {
            air = layers::without(&air, &layers::within(pos, protected));
        }
        bits::include(&mut gone, pos, &air);
    }
    let mut gone: Vec<(BrickPos, Layers)> = gone.into_iter().collect();
    gone.sort_unstable_by_key(|(pos, _)| *pos);
    for (pos, gone) in &gone {
        take_out(samples, world.grid, *pos, gone, 0, &mut removed);
    }
    (pieces, removed)
}

/// Do the rules keep some part of a piece from being taken away, whatever the brush?
fn keep(rules: &DiggingRules, component: &Component, piece: &LoosePiece) -> bool {
    let is_protected = |samples: &LatticeBox| {
        samples.intersection(piece.bounds).is_some()
            && search::bricks(component)
                .any(|(pos, layers)| layers::and(layers, &layers::within(pos, *samples)) != NONE)
    };
    rules.bedrock.is_some_and(|bedrock| piece.bounds.min.y < bedrock)
        || rules.unbreakable.iter().any(|&material| piece.materials.of(material) > 0)
        || rules.protected.iter().any(is_protected)
}

/// The protected boxes that pieces which are taken out may touch.
fn protected_beside(rules: Option<&DiggingRules>, pieces: &[LoosePiece]) -> Vec<LatticeBox> {
    let taken = pieces.iter().filter(|piece| piece.fate != PieceFate::Left).map(|piece| piece.bounds);
    let (Some(rules), Some(all)) = (rules, taken.reduce(LatticeBox::union)) else {
        return Vec::new();
    };
    let all = all.grown(1);
    rules.protected.iter().copied().filter(|own| own.intersection(all).is_some()).collect()
}

/// The air that touches pieces and no other ground.
fn air_around(solid: &Solid, pieces: &Samples) -> Samples {
    let mut air = Samples::default();
    let rest = |pos: BrickPos| layers::without(&solid.layers(pos), pieces.get(&pos).unwrap_or(&NONE));
    for (pos, near) in bits::grown_set(pieces) {
        let near = layers::without(&near, &solid.layers(pos));
        if near == NONE {
            continue;
        }
        let mut other = bits::grown(&rest(pos));
        for side in SIDES {
            other = layers::or(&other, &bits::beyond(&rest(BrickPos(pos.0 - side)), side));
        }
        bits::include(&mut air, pos, &layers::without(&near, &other));
    }
    air
}

/// Describes a piece; the settings decide what becomes of it.
fn describe(samples: SampleView, piece: &Component, settings: &LooseSettings) -> LoosePiece {
    let mut runs: Vec<Run> = Vec::new();
    let (mut voxels, mut materials) = (0, MaterialCounts::default());
    for (pos, layers) in search::bricks(piece) {
        runs.extend(
            layers::indices(layers).map(|index| Run { start: pos.origin() + layers::offset(index), len: 1 }),
        );
        voxels += layers::count(layers);
    }
    runs.sort_unstable_by_key(|run| [run.start.y, run.start.z, run.start.x]);
    runs.dedup_by(|next, run| {
        let goes_on = next.start == run.start + IVec3::X * run.len as i32;
        run.len += if goes_on { next.len } else { 0 };
        goes_on
    });
    let mut bounds: Option<LatticeBox> = None;
    for run in &runs {
        let end = run.start + IVec3::X * (run.len as i32 - 1);
        LatticeBox::include(&mut bounds, LatticeBox { min: run.start, max: end });
        materials.count_each((0..run.len as i32).map(|x| samples.material(run.start + IVec3::X * x)));
    }
    let bounds = bounds.unwrap_or(LatticeBox::point(IVec3::ZERO));
    LoosePiece { fate: settings.fate(voxels), bounds, voxels, materials, runs: runs.into(), mesh: None }
}
