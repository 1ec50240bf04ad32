//! An edit with derived data that is computed once.

use glam::IVec3;

use super::surface_distance::margin;
use crate::brush::{Edit, Evaluator, Kind, Rounding, SculptKernel};
#[cfg(feature = "cuda")]
use crate::lattice::BRICK;
use crate::lattice::{BrickPos, ChunkGrid, LatticeBox};
use crate::volume::DiggingRules;

/// Distance in voxels, down and up, within which new ground searches for its material.
pub(super) const LOOK: i32 = 64;

/// An edit with derived data that is computed once.
pub(crate) struct PreparedEdit {
    /// The part of the edit's reach that lies in the world.
    pub reach: Option<LatticeBox>,
    /// At least the number of bricks that it may change.
    pub max_bricks: u64,
    pub operation: Kind,
    pub evaluator: Evaluator,
    pub sculptor: Option<SculptKernel>,
    pub power: u8,
    /// Whether a digging rule may restrict it. If not, it acts as without any rule.
    pub is_ruled: bool,
}

impl PreparedEdit {
    pub fn new(grid: ChunkGrid, edit: &Edit, rules: Option<&DiggingRules>) -> Self {
        let mut own = Self {
            reach: reach(grid, edit),
            max_bricks: max_bricks(grid, edit).unwrap_or(0),
            operation: edit.kind(),
            evaluator: edit.evaluator(),
            sculptor: edit.sculptor(),
            power: edit.power(),
            is_ruled: false,
        };
        own.set_rules(rules);
        own
    }

    /// Finds out whether rules may restrict the edit.
    pub(super) fn set_rules(&mut self, rules: Option<&DiggingRules>) {
        self.is_ruled =
            rules.zip(self.reach).is_some_and(|(rules, own)| may_restrict(rules, own, self.power));
    }

    /// Returns `true` if the edit reads other samples than those that it changes.
    pub fn looks_around(&self) -> bool {
        self.sculptor.is_some() || self.is_ruled
    }

    /// Whether only the CPU computes it.
    #[cfg(feature = "cuda")]
    pub fn is_for_cpu(&self) -> bool {
        self.evaluator.is_for_cpu() || self.sculptor.as_ref().is_some_and(SculptKernel::is_for_cpu)
    }

    /// How the edit rounds edges, if it does.
    pub fn rounding(&self) -> Option<Rounding> {
        self.sculptor.as_ref().and_then(SculptKernel::rounding)
    }

    /// Samples that the CPU looks at for each brick of the edit, in bricks.
    #[cfg(feature = "cuda")]
    pub fn bricks_read(&self) -> usize {
        let side = |rounding: Rounding| (BRICK + 2 * margin(rounding.horizon())) as usize;
        self.rounding().map_or(1, |rounding| side(rounding).pow(3) / (BRICK as usize).pow(3))
    }

    /// The samples that the edit reads, if it reads others than those that it changes.
    pub(super) fn reads(&self) -> Option<LatticeBox> {
        let LatticeBox { min, max } = self.reach.filter(|_| self.looks_around())?;
        let around = reads_around(self.sculptor.as_ref());
        Some(LatticeBox { min: min - around, max: max + around })
    }

    /// Returns `true` if the edit may change some of these samples; `false` if it certainly changes none.
    pub(super) fn reaches(&self, samples: LatticeBox) -> bool {
        let reached = self.reach.and_then(|reach| reach.intersection(samples));
        reached.is_some_and(|samples| !self.evaluator.is_out_of_reach(samples))
    }
}

/// How far from the samples that it changes an edit with this kernel, or one that rules restrict, reads others, in
/// voxels along each axis.
fn reads_around(sculptor: Option<&SculptKernel>) -> IVec3 {
    let rounding = sculptor.and_then(SculptKernel::rounding);
    let around = rounding.map_or(1, |rounding| margin(rounding.horizon()));
    let has_to_look = sculptor.is_some_and(|own| own.material().is_none());
    IVec3::splat(around) + IVec3::Y * if has_to_look { LOOK } else { 0 }
}

/// How far from the samples that it changes an edit reads others, in voxels along each axis, whatever the rules.
#[cfg(feature = "net")]
pub(crate) fn max_read_around(edit: &Edit) -> IVec3 {
    reads_around(edit.sculptor().as_ref())
}

/// The part of an edit's reach that lies in the world; `None` when it lies outside.
pub(crate) fn reach(grid: ChunkGrid, edit: &Edit) -> Option<LatticeBox> {
    edit.reach().intersection(grid.edit_bounds())
}

/// At least the number of bricks of a world that an edit may change: along paths far fewer than the bricks in its
/// reach. `None` when it lies outside.
pub(crate) fn max_bricks(grid: ChunkGrid, edit: &Edit) -> Option<u64> {
    let around = BrickPos::range(reach(grid, edit)?).volume();
    Some(edit.max_bricks().map_or(around, |most| most.min(around)))
}

/// The fixed work of an edit, in bricks.
pub(crate) const EDIT_WORK: u64 = 20;
/// How many times as much work a brick is for an edit that sculpts: it reads a stencil around each sample.
const SCULPTED: u64 = 4;

/// The work of an edit, in bricks: what queues limit, and what servers charge. `None` for an edit outside the world.
pub(crate) fn edit_work(grid: ChunkGrid, edit: &Edit) -> Option<u64> {
    let weight = if edit.kind() == Kind::Sculpt { SCULPTED } else { 1 };
    Some(EDIT_WORK + weight * max_bricks(grid, edit)?)
}

/// Returns `true` if some rule may restrict an edit of this power that changes these samples.
fn may_restrict(rules: &DiggingRules, samples: LatticeBox, power: u8) -> bool {
    let around = samples.grown(1);
    !rules.unbreakable.is_empty()
        || rules.hardness.values().any(|&hardness| hardness > power)
        || rules.bedrock.is_some_and(|bedrock| around.min.y < bedrock)
        || rules.protected.iter().any(|own| own.intersection(around).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::MaterialId;

    #[test]
    fn edits_that_no_rule_can_restrict_are_recognised() {
        let samples = LatticeBox::point(IVec3::ZERO).grown(4);
        let restricts = |rules: DiggingRules| may_restrict(&rules, samples, 100);
        let (none, at) = (DiggingRules::default, |x| LatticeBox::point(IVec3::new(x, 0, 0)));
        assert!(!restricts(none()) && !restricts(none().with_hardness(MaterialId(1), 100)));
        assert!(restricts(none().with_hardness(MaterialId(1), 101)));
        assert!(restricts(none().with_unbreakable(MaterialId(1))));
        // A neighbour that does not change also defines the surface.
        assert!(restricts(none().with_bedrock(-4)) && !restricts(none().with_bedrock(-5)));
        assert!(restricts(none().with_protected(at(5))) && !restricts(none().with_protected(at(6))));
        let inverted = LatticeBox { min: IVec3::splat(i32::MAX), max: IVec3::splat(-i32::MAX) };
        assert!(!restricts(none().with_protected(inverted)));
    }
}
