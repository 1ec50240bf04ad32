//! Loose pieces: ground that digging cut off from the world.
//!
//! **Connected** are solid samples that are neighbours along an axis, six for each sample. The surface connects the
//! same ones: its case table (`surface::cases`) puts no vertex on an edge between two solid samples, and separates
//! solid corners that only meet across a diagonal. So two samples belong to one piece of ground exactly if a path
//! inside the drawn surface connects them.
//!
//! **Anchored** is a piece that reaches ground below everything that was ever edited. The world's sides anchor
//! nothing. A piece of more than [`LooseSettings::largest`] voxels counts as anchored without looking further. The
//! result does not depend on the order of the search.
//!
//! **Budget.** The search after an edit visits a bounded number of bricks, and what it finds has a bounded number of
//! voxels: see [`LooseSettings`]. Pieces beyond these bounds stay as ground, and the receipt reports it. Seeds are
//! taken in a fixed order, so the outcome is the same on every machine.
//!
//! **Removal.** The samples of a removed piece get the density of air in the middle of a dig, and so does air that
//! touches them and no other ground, so that nothing of the shape is left. Other vertices keep their bits. All of this
//! belongs to the edit that cut the piece off: it is hashed, undone and replayed with it.

mod bits;
mod mesh;
mod piece;
mod search;

use std::sync::Arc;

#[cfg(feature = "plugin")]
use bevy::ecs::reflect::ReflectComponent;
#[cfg(feature = "plugin")]
use bevy::reflect::std_traits::ReflectDefault;
use glam::IVec3;
use serde::{Deserialize, Serialize};

use crate::edits::{DraftedBrick, EditDelta, Overlay, take_out};
use crate::lattice::{BrickPos, Column, LatticeBox};
use crate::volume::layers::{self, Layers, NONE};
use crate::volume::{DiggingRules, SampleView};
use crate::world::World;
use bits::{SIDES, Samples};
pub use piece::{LoosePiece, PieceFate, PieceId, ReturnedPiece, Run};
use search::{Budget, Component, Solid};

/// Which loose pieces to search for after a dig, and what happens to them.
///
/// Each edit that can remove ground is followed by a search before the next edit applies, so the result does not depend
/// on how edits are batched.
///
/// A search is as bounded as its edit: it visits at most 4096 bricks of 8x8x8 samples and 16 more for each brick that
/// the edit changed, or an eighth of [`largest`](Self::largest) if that is more; all pieces that it finds have at most
/// four times `largest` voxels together, or 131,072 if that is more. Pieces beyond these bounds stay as ground, and
/// [`Applied::has_unsearched`](crate::terrain::Applied::has_unsearched) reports that there may be some. A later dig
/// next to them finds them.
///
/// A model gets them with [`Terrain::set_loose`](crate::terrain::Terrain::set_loose), and lists the pieces in receipts.
/// With the feature `plugin` they are also a component: on a terrain's entity they make brushes look for pieces, and a
/// `LoosePieceFound` message is sent for each. Brushes that a game [applies](crate::terrain::Terrain::apply) itself
/// look for pieces too, but these are only listed in the receipts: no message is sent, and none falls as debris. A
/// terrain that is not spawned yet does not have the component: set the same settings on it before you replay a
/// journal.
///
/// ```
/// # #[cfg(feature = "plugin")] {
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// # fn system(mut commands: Commands, terrain: Terrain) {
/// // Crumbs vanish, larger pieces break off, and pieces of more than 4096 voxels stay.
/// commands.spawn((terrain, LooseSettings { crumbs: 8, debris: 4096, ..default() }));
/// # }
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(
    feature = "plugin",
    derive(bevy::prelude::Component, bevy::reflect::Reflect),
    reflect(Component, Default)
)]
#[serde(default, deny_unknown_fields)]
pub struct LooseSettings {
    /// The largest piece to look for, in voxels. Larger ones count as anchored; this bounds the time of a search.
    pub largest: u32,
    /// Pieces of at most this many voxels vanish.
    pub crumbs: u32,
    /// Larger pieces of at most this many voxels break off: they are removed from the ground, and their closed mesh
    /// can become a body. Others stay where they are, and are reported.
    pub debris: u32,
}

impl Default for LooseSettings {
    /// Pieces up to 32768 voxels are reported, and stay.
    fn default() -> Self {
        Self { largest: 1 << 15, crumbs: 0, debris: 0 }
    }
}

impl LooseSettings {
    /// The fate of a piece with this number of voxels.
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

impl World {
    /// The loose pieces of up to `largest` voxels that hold some sample of a box, in order of their lowest samples
    /// there. Each has the fate that the settings give it, but none is removed and no mesh is built. The search has no
    /// budget.
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
        let mut budget = Budget::unbounded();
        let found = search::search(&solid, &seeds, settings.largest.into(), &mut budget);
        found.iter().map(|piece| LoosePiece::new(self.samples(), piece, settings)).collect()
    }
}

/// Samples next to those that drafted bricks turn to air; `before` are the samples without these bricks.
pub(crate) fn seeds(world: &World, before: SampleView, drafted: &[DraftedBrick]) -> Samples {
    search::seeds(&Solid::new(world, before, None), drafted)
}

/// The pieces that a search after an edit found, and the changes from removing them.
#[derive(Default)]
pub(crate) struct Fallen {
    pub pieces: Vec<LoosePiece>,
    /// Whether the budget ended the search.
    pub has_unsearched: bool,
    /// The changes, as those of edit 0.
    pub removed: EditDelta,
}

/// Looks for loose pieces at seeds, in a world under newer bricks, and takes them out where the settings and rules say
/// so. `changed` is the number of bricks that the edit changed.
pub(crate) fn fall(
    world: &World,
    rules: Option<&DiggingRules>,
    newer: &Overlay,
    (seeds, changed): (&Samples, usize),
    settings: &LooseSettings,
) -> Fallen {
    let (mut pieces, mut removed) = (Vec::new(), EditDelta::default());
    if seeds.is_empty() {
        return Fallen::default();
    }
    let samples = newer.over(world.samples());
    let solid = Solid::new(world, samples, Some(newer));
    let mut budget = Budget::of_edit(settings, changed);
    let found = search::search(&solid, seeds, settings.largest.into(), &mut budget);
    let mut gone = Samples::default();
    for component in &found {
        let mut piece = LoosePiece::new(samples, component, settings);
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
    Fallen { pieces, has_unsearched: budget.has_run_out, removed }
}

/// Whether the rules protect some part of a piece from removal, whatever the brush.
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
