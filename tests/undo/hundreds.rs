//! Five hundred edits of every kind, undone and redone one by one: all of them, or as many as the budget allows.

use allocation_counter::measure;
use bevy_burrow::prelude::*;
use fastrand::Rng;

use crate::scripts::{EditStatistics, any_brush, terrain};
use crate::state::{DisplayedMeshes, State};
use crate::worlds::random_ground;

const EDITS: usize = 500;

/// A ground, its chunk size, an index that selects rules and loose pieces (see [`terrain`]), and a seed. All grounds
/// are small, so that hundreds of states are compared quickly.
type Start = (u64, u32, u64, u64);

/// A terrain with its displayed meshes, and its past and future states.
struct Walker {
    name: String,
    terrain: Terrain,
    displayed: DisplayedMeshes,
    budget: usize,
    /// The states to which undo and redo lead, next ones last.
    past: Vec<State>,
    future: Vec<State>,
    now: State,
}

impl Walker {
    fn new((ground, chunk_size, index, seed): Start, budget: usize) -> (Self, Rng) {
        let mut rng = Rng::with_seed(seed);
        let (ground, _) = random_ground(&mut rng, ground);
        let mut terrain = terrain(&mut rng, ground, chunk_size, index);
        terrain.set_undo_budget(budget);
        let new = Self {
            name: format!("world {index}, chunks of {chunk_size}, {budget} bytes"),
            displayed: DisplayedMeshes::of(terrain.world()),
            now: State::of(terrain.world()),
            terrain,
            budget,
            past: Vec::new(),
            future: Vec::new(),
        };
        (new, rng)
    }

    /// Runs the pending work. History is within its budget before and after.
    fn play(&mut self) -> Vec<Receipt> {
        let receipts = self.displayed.play(&mut self.terrain);
        let history = self.terrain.history();
        assert!(history.bytes <= self.budget, "{}: {history:?}", self.name);
        assert_eq!(self.terrain.memory().undo, history.bytes, "{}", self.name);
        assert!(
            history.undos <= self.past.len() + 1 && history.redos <= self.future.len() + 1,
            "{}",
            self.name
        );
        receipts
    }

    fn edit(&mut self, rng: &mut Rng, turn: usize, statistics: &mut EditStatistics) {
        let world = self.terrain.world();
        let brush = any_brush(rng, world.ground(), world.grid().size() as u32);
        let hash = world.hash();
        self.terrain.submit(&brush);
        let receipts = self.play();
        statistics.record(&brush, &receipts[0]);
        let world = self.terrain.world();
        let is_changed = receipts[0].outcome.as_ref().is_ok_and(|applied| applied.bounds.is_some());
        assert_eq!(world.hash() != hash, is_changed, "{}, edit {turn}: {brush:?}", self.name);
        if is_changed {
            self.past.push(std::mem::replace(&mut self.now, State::of(world)));
        } else {
            self.now.check(world, &format!("{}, edit {turn} without effect", self.name));
        }
        if turn.is_multiple_of(10) {
            let report = world.check_seams();
            assert!(report.is_flawless(), "{}, edit {turn}: {report}", self.name);
            self.displayed.check(world, &self.name);
        }
    }

    /// Takes one history step; returns whether there was one.
    fn step(&mut self, step: OrderKind) -> bool {
        match step {
            OrderKind::Undo => self.terrain.submit(Order::Undo),
            _ => self.terrain.submit(Order::Redo),
        }
        let mut receipts = self.play();
        // If there is nothing to do, there is no transaction.
        receipts.append(&mut self.terrain.take_receipts());
        let [Receipt { kind: done, outcome, .. }] = &receipts[..] else {
            panic!("{}: one receipt for a step", self.name)
        };
        assert_eq!(*done, step);
        let what = format!("{}, {step:?} to {}", self.name, self.past.len());
        let nothing = match step {
            OrderKind::Undo => Rejection::NothingToUndo,
            _ => Rejection::NothingToRedo,
        };
        assert!(outcome.as_ref().err().is_none_or(|why| *why == nothing), "{}: {outcome:?}", self.name);
        if outcome.is_ok() {
            let (from, to) = match step {
                OrderKind::Undo => (&mut self.past, &mut self.future),
                _ => (&mut self.future, &mut self.past),
            };
            let next = from.pop().expect("a step leads to what was");
            to.push(std::mem::replace(&mut self.now, next));
        }
        self.now.check(self.terrain.world(), &what);
        if self.past.len().is_multiple_of(10) {
            self.displayed.check(self.terrain.world(), &what);
        }
        outcome.is_ok()
    }

    /// Takes as many steps as there are.
    fn walk(&mut self, step: OrderKind) -> usize {
        let count = (0..).take_while(|_| self.step(step)).count();
        self.displayed.check(self.terrain.world(), &self.name);
        let report = self.terrain.world().check_seams();
        assert!(report.is_flawless(), "{}: {report}", self.name);
        count
    }
}

#[test]
fn five_hundred_edits_of_every_kind_are_undone_and_redone_exactly() {
    let starts: [Start; 2] = [(8, 128, 0, 530), (0, 8, 2, 500)];
    let mut statistics = EditStatistics::default();
    for start in starts {
        let (mut walker, mut rng) = Walker::new(start, 64 << 20);
        (0..EDITS).for_each(|turn| walker.edit(&mut rng, turn, &mut statistics));
        let steps = walker.past.len();
        assert!(steps > 400, "only {steps} steps");
        assert_eq!(walker.terrain.history().undos, steps, "the budget holds all of {steps}");
        // Rules apply to edits, but not to history steps.
        walker.terrain.set_rules(DiggingRules::default().with_bedrock(i32::MAX)).expect("valid rules");
        assert_eq!(walker.walk(OrderKind::Undo), steps);
        assert!(walker.now.is_pristine());
        assert_eq!(walker.walk(OrderKind::Redo), steps);
    }
    statistics.check(12);
}

#[test]
fn a_tight_budget_keeps_the_last_of_five_hundred_edits() {
    let starts: [(Start, usize); 4] = [
        ((12, 25, 3, 511), 200_000),
        ((12, 25, 3, 511), 400_000),
        ((0, 8, 2, 500), 600_000),
        ((0, 8, 2, 500), 990_000),
    ];
    let (mut statistics, mut lost) = (EditStatistics::default(), 0);
    for (start, budget) in starts {
        let (mut walker, mut rng) = Walker::new(start, budget);
        (0..EDITS).for_each(|turn| walker.edit(&mut rng, turn, &mut statistics));
        let (steps, kept) = (walker.past.len(), walker.terrain.history().undos);
        assert!(0 < kept && kept < steps / 2, "{}: {kept} of {steps} steps are kept", walker.name);
        // A redo may take more bytes than the undo, so the oldest steps are dropped for it.
        let back = walker.walk(OrderKind::Undo);
        let forth = walker.walk(OrderKind::Redo);
        assert!(0 < back && back <= kept && forth <= back, "{}: {kept}, {back}, {forth}", walker.name);
        println!("{}: {steps} steps, {kept} kept, {back} back, {forth} forth", walker.name);
        lost += kept - forth;
        let history = walker.terrain.history();
        let freed = measure(|| walker.terrain.set_undo_budget(0));
        assert_eq!(-freed.bytes_current, history.bytes as i64, "{}: {history:?}", walker.name);
    }
    assert!(lost > 0, "no step was lost on the way");
    statistics.check(12);
}
