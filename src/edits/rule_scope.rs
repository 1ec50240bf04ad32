//! The scope of digging rules: the edits of a batch and the samples of a brick that they restrict. A world may have
//! thousands of protected boxes: edits search them once or twice, bricks search those nearby, and samples look up a
//! bit.

use glam::IVec3;

use super::prepared_edit::PreparedEdit;
use crate::brush::Stencil;
use crate::lattice::{BRICK, BrickPos, LatticeBox, ONE};
use crate::volume::{DiggingRules, SampleView, VoxelOutcome};

/// The rules that restrict some edit of a batch.
pub(crate) struct BatchRules<'a> {
    pub(crate) rules: &'a DiggingRules,
    /// The protected boxes that those edits reach or touch.
    pub(crate) protected: Vec<LatticeBox>,
}

impl<'a> BatchRules<'a> {
    /// The rules for those of the edits that are [ruled](PreparedEdit::is_ruled); `None` if none is.
    pub(super) fn new(rules: &'a DiggingRules, edits: &[PreparedEdit]) -> Option<Self> {
        let ruled = edits.iter().filter(|edit| edit.is_ruled);
        let around: Vec<LatticeBox> = ruled.filter_map(|edit| Some(edit.reach?.grown(1))).collect();
        let is_near = |own: &LatticeBox| around.iter().any(|around| own.intersection(*around).is_some());
        let protected = || rules.protected.iter().copied().filter(is_near).collect();
        (!around.is_empty()).then(|| Self { rules, protected: protected() })
    }
}

/// Samples along a side: the brick's and one on each side.
const SIDE: usize = BRICK as usize + 2;

/// The rules as they apply to one brick.
pub(super) struct BrickRules<'a> {
    pub rules: &'a DiggingRules,
    /// The lowest sample of the layer around the brick.
    low: IVec3,
    /// Which samples of the brick, and of one more on all sides, are protected: a bit for each x, by y and z.
    protected: [[u16; SIDE]; SIDE],
}

impl<'a> BrickRules<'a> {
    pub fn new(batch: &BatchRules<'a>, pos: BrickPos) -> Self {
        let all = pos.samples().grown(1);
        let mut own = Self { rules: batch.rules, low: all.min, protected: [[0; SIDE]; SIDE] };
        for part in batch.protected.iter().filter_map(|samples| samples.intersection(all)) {
            let (from, to) = ((part.min - all.min).as_usizevec3(), (part.max - all.min).as_usizevec3());
            let row = u16::MAX >> (15 - (to.x - from.x)) << from.x;
            for layer in &mut own.protected[from.y..=to.y] {
                layer[from.z..=to.z].iter_mut().for_each(|all| *all |= row);
            }
        }
        own
    }

    /// Returns `true` if no operation changes this sample, which must lie in the brick or next to it.
    pub fn is_protected(&self, at: IVec3) -> bool {
        let at = (at - self.low).as_usizevec3();
        self.protected[at.y][at.z] >> at.x & 1 == 1
    }

    /// The density that rules allow a sample of the brick in place of the proposed one, and why, where it is another
    /// one.
    pub fn judge(
        &self,
        view: &SampleView,
        at: IVec3,
        power: u8,
        around: &Stencil,
        proposed: i32,
    ) -> (i32, Option<VoxelOutcome>) {
        let before = around.own();
        if self.is_protected(at) {
            return (before, Some(VoxelOutcome::Protected));
        }
        if proposed <= before {
            return (proposed, None);
        }
        // Samples beyond the world's rim repeat those at the rim; they hold no surface.
        let (width, depth) = (view.ground().width(), view.ground().depth());
        let is_inside = |at: IVec3| (0..=width).contains(&at.x) && (0..=depth).contains(&at.z);
        let solid_faces = || around.solid_faces().filter(|&way| is_inside(at + way));
        let pace = |at: IVec3| self.rules.pace(view.material(at), at.y, power);
        let holds = |way: IVec3| if self.is_protected(at + way) { (0, None) } else { pace(at + way) };
        let (part, outcome) = if before < 0 {
            pace(at)
        } else {
            // Air next to solid samples also defines the surface.
            solid_faces().map(holds).min_by_key(|(part, _)| *part).unwrap_or((ONE, None))
        };
        let change = (i64::from(proposed) - i64::from(before)) * i64::from(part);
        let mut allowed = before + ((change + i64::from(ONE) - 1) >> 8) as i32;
        if before < 0 && allowed >= 0 {
            // A sample that turns to air uncovers neighbours that stay, and must not move their surface.
            for way in solid_faces().filter(|&way| holds(way).0 == 0) {
                allowed = allowed.min((ONE + around.density(way)).max(0));
            }
        }
        (allowed, outcome)
    }

    /// The reason why rules forbid to replace a sample by another one with the proposed density, if they do: samples
    /// are replaced entirely or not at all. `is_painted` says whether it stays solid and gets another material.
    pub fn refusal(
        &self,
        view: &SampleView,
        at: IVec3,
        power: u8,
        around: &Stencil,
        proposed: i32,
        is_painted: bool,
    ) -> Option<VoxelOutcome> {
        if self.is_protected(at) {
            return Some(VoxelOutcome::Protected);
        }
        if is_painted && self.rules.is_unbreakable(view.material(at)) {
            return Some(VoxelOutcome::Unbreakable);
        }
        let (allowed, outcome) = self.judge(view, at, power, around, proposed);
        outcome.filter(|_| allowed != proposed)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const END: i32 = i32::MAX;

    fn corner() -> impl Strategy<Value = i32> {
        prop_oneof![8 => -12..30i32, 1 => Just(END), 1 => Just(i32::MIN)]
    }

    proptest! {
        #[test]
        fn a_brick_protects_what_its_boxes_hold(
            corners in prop::collection::vec(prop::array::uniform6(corner()), 0..20),
            brick in prop::array::uniform3(-1..3i32),
        ) {
            // Some are inverted and hold nothing.
            let boxes: Vec<LatticeBox> = corners
                .into_iter()
                .map(|[a, b, c, d, e, f]| LatticeBox { min: IVec3::new(a, b, c), max: IVec3::new(d, e, f) })
                .collect();
            let (rules, pos) = (DiggingRules::default(), BrickPos(IVec3::from_array(brick)));
            let own = BrickRules::new(&BatchRules { rules: &rules, protected: boxes.clone() }, pos);
            for at in pos.samples().grown(1).points() {
                prop_assert_eq!(own.is_protected(at), boxes.iter().any(|samples| samples.contains(at)), "{}", at);
            }
        }
    }
}
