//! Where digging rules bear: on which edits, and on which samples of a brick. A world may have thousands of protected
//! boxes: edits look through them once or twice, bricks through those that are near, and samples look up a bit.

use glam::IVec3;

use super::prepared::PreparedEdit;
use crate::brush::Stencil;
use crate::lattice::{BRICK, BrickPos, LatticeBox, ONE};
use crate::volume::{DiggingRules, SampleView, VoxelOutcome};

impl DiggingRules {
    /// May some rule be against an edit of this power that changes these samples? Where not, it is certain, and the edit
    /// does what it does without any rule.
    pub(super) fn bear_on(&self, samples: LatticeBox, power: u8) -> bool {
        let around = samples.grown(1);
        !self.unbreakable.is_empty()
            || self.hardness.values().any(|&hardness| hardness > power)
            || self.bedrock.is_some_and(|bedrock| around.min.y < bedrock)
            || self.protected.iter().any(|own| own.intersection(around).is_some())
    }
}

/// The rules that bear on some edit of a run.
pub(crate) struct RunRules<'a> {
    pub(crate) rules: &'a DiggingRules,
    /// The protected boxes among what those edits reach, or beside it.
    pub(crate) protected: Vec<LatticeBox>,
}

impl<'a> RunRules<'a> {
    /// Those for the tools that are bound; `None` where none is.
    pub(super) fn new(rules: &'a DiggingRules, tools: &[PreparedEdit]) -> Option<Self> {
        let bound = tools.iter().filter(|tool| tool.is_bound);
        let around: Vec<LatticeBox> = bound.filter_map(|tool| Some(tool.reach?.grown(1))).collect();
        let is_near = |own: &LatticeBox| around.iter().any(|around| own.intersection(*around).is_some());
        let protected = || rules.protected.iter().copied().filter(is_near).collect();
        (!around.is_empty()).then(|| Self { rules, protected: protected() })
    }

    /// What they say in a brick.
    pub(super) fn of_brick(&self, pos: BrickPos) -> BrickRules<'a> {
        BrickRules::new(self.rules, &self.protected, pos)
    }
}

/// Samples along a side: the brick's and one on each side.
const SIDE: usize = BRICK as usize + 2;

/// What rules say in a brick.
pub(super) struct BrickRules<'a> {
    pub rules: &'a DiggingRules,
    /// The lowest sample beside the brick.
    low: IVec3,
    /// Which samples of the brick, and of one more on all sides, are protected: a bit for each x, by y and z.
    protected: [[u16; SIDE]; SIDE],
}

impl<'a> BrickRules<'a> {
    fn new(rules: &'a DiggingRules, protected: &[LatticeBox], pos: BrickPos) -> Self {
        let all = pos.samples().grown(1);
        let mut own = Self { rules, low: all.min, protected: [[0; SIDE]; SIDE] };
        for part in protected.iter().filter_map(|samples| samples.intersection(all)) {
            let (from, to) = ((part.min - all.min).as_usizevec3(), (part.max - all.min).as_usizevec3());
            let row = u16::MAX >> (15 - (to.x - from.x)) << from.x;
            for layer in &mut own.protected[from.y..=to.y] {
                layer[from.z..=to.z].iter_mut().for_each(|all| *all |= row);
            }
        }
        own
    }

    /// Does no operation change this sample, which must lie in the brick or beside it?
    pub fn is_protected(&self, at: IVec3) -> bool {
        let at = (at - self.low).as_usizevec3();
        self.protected[at.y][at.z] >> at.x & 1 == 1
    }

    /// The density that a sample of the brick may have instead of the proposed one, and why it is another one.
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
        // What lies beyond the world's rim goes on as it is at the rim: nothing there holds anything.
        let (width, depth) = (view.ground().width(), view.ground().depth());
        let is_inside = |at: IVec3| (0..=width).contains(&at.x) && (0..=depth).contains(&at.z);
        let solid_faces = || around.solid_faces().filter(|&way| is_inside(at + way));
        let pace = |at: IVec3| self.rules.pace(view.material(at), at.y, power);
        let holds = |way: IVec3| if self.is_protected(at + way) { (0, None) } else { pace(at + way) };
        let (part, fate) = if before < 0 {
            pace(at)
        } else {
            // Air beside what is solid holds its surface.
            solid_faces().map(holds).min_by_key(|(part, _)| *part).unwrap_or((ONE, None))
        };
        let change = (i64::from(proposed) - i64::from(before)) * i64::from(part);
        let mut allowed = before + ((change + i64::from(ONE) - 1) >> 8) as i32;
        if before < 0 && allowed >= 0 {
            // What turns to air beside ground that stays uncovers it, and takes nothing of it.
            for way in solid_faces().filter(|&way| holds(way).0 == 0) {
                allowed = allowed.min((ONE + around.density(way)).max(0));
            }
        }
        (allowed, fate)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::ground::MaterialId;

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
            // Some are turned inside out, and hold nothing.
            let boxes: Vec<LatticeBox> = corners
                .into_iter()
                .map(|[a, b, c, d, e, f]| LatticeBox { min: IVec3::new(a, b, c), max: IVec3::new(d, e, f) })
                .collect();
            let (rules, pos) = (DiggingRules::default(), BrickPos(IVec3::from_array(brick)));
            let own = BrickRules::new(&rules, &boxes, pos);
            for at in pos.samples().grown(1).points() {
                prop_assert_eq!(own.is_protected(at), boxes.iter().any(|samples| samples.contains(at)), "{}", at);
            }
        }
    }

    #[test]
    fn rules_bear_on_what_they_may_be_against() {
        let samples = LatticeBox::point(IVec3::ZERO).grown(4);
        let bear = |rules: DiggingRules| rules.bear_on(samples, 100);
        let (none, at) = (DiggingRules::default, |x| LatticeBox::point(IVec3::new(x, 0, 0)));
        assert!(!bear(none()) && !bear(none().with_hardness(MaterialId(1), 100)));
        assert!(
            bear(none().with_hardness(MaterialId(1), 101)) && bear(none().with_unbreakable(MaterialId(1)))
        );
        // A neighbour that stays holds the surface.
        assert!(bear(none().with_bedrock(-4)) && !bear(none().with_bedrock(-5)));
        assert!(bear(none().with_protected(at(5))) && !bear(none().with_protected(at(6))));
        let inside_out = LatticeBox { min: IVec3::splat(END), max: IVec3::splat(-END) };
        assert!(!bear(none().with_protected(inside_out)));
    }
}

#[cfg(all(test, feature = "cuda"))]
mod plain_edits {
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Edit, Shape};
    use crate::edits::{Draft, EditDelta, PreparedEdits};
    use crate::ground::Ground;
    use crate::lattice::ChunkGrid;
    use crate::volume::{Bricks, UniformBricks};

    #[test]
    fn edits_that_no_rule_bears_on_are_plain_and_run_together() {
        let ground = Ground::flat(200, 60, 0.0).unwrap();
        let (grid, bricks, uniform) =
            (ChunkGrid::new(32, 200, 60), Bricks::default(), UniformBricks::default());
        let dig = |x| Edit::quantize(&Brush::dig(Shape::sphere(Vec3::new(x, 0.0, 30.0), 4.0))).unwrap();
        let runs = |edits: &[Edit], rules: DiggingRules| {
            let (edits, mut runs) = (edits.iter().collect::<Vec<_>>(), Vec::new());
            let note = |work: &PreparedEdits, _: &mut dyn FnMut(&mut [EditDelta])| {
                runs.push((work.tools.len(), !work.looks_around()));
            };
            let view = SampleView::new(&ground, &bricks);
            Draft::make(view, grid, &edits, 0, &uniform, Some(&rules), note);
            runs
        };
        let (none, at) = (DiggingRules::default, |x| LatticeBox::point(IVec3::new(x, 0, 30)));
        let edits = [dig(20.0), dig(22.0), dig(120.0)];
        assert_eq!(runs(&edits, none().with_protected(at(60)).with_bedrock(-90)), [(3, true)]);
        assert_eq!(runs(&edits, none().with_protected(at(120))), [(3, false)]);
        assert_eq!(runs(&edits, none().with_protected(at(22))), [(1, false), (2, false)]);
    }
}
