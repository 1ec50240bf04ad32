//! Which backend is faster for what: measured at the start, and learnt from every transaction since.

use std::time::Duration;

use super::{Estimate, PARALLEL_BLOCKS, Stage};
use crate::volume::{EditWork, Tool};

/// Time by amount: measured at some amounts, linear between them and beyond.
#[derive(Clone, Debug, Default)]
pub(super) struct Curve {
    /// Amount and seconds, ascending.
    points: Vec<(f64, f64)>,
}

impl Curve {
    /// Takes in a measurement; amounts must ascend.
    pub fn push(&mut self, amount: usize, time: Duration) {
        // More never takes less time: what says otherwise is noise.
        let least = self.points.last().map_or(0.0, |point| point.1);
        self.points.push((amount as f64, time.as_secs_f64().max(least)));
    }

    /// Does it say anything of so little?
    fn reaches(&self, amount: usize) -> bool {
        self.points.first().is_some_and(|&(least, _)| least <= amount as f64)
    }

    /// Seconds for an amount.
    pub fn at(&self, amount: usize) -> f64 {
        let amount = amount as f64;
        match self.points.as_slice() {
            [] => 0.0,
            [only] => only.1 * (amount / only.0).max(1.0),
            points => {
                let above = points.partition_point(|point| point.0 < amount).clamp(1, points.len() - 1);
                let ((x0, y0), (x1, y1)) = (points[above - 1], points[above]);
                // Below the smallest amount it takes as long: that is what starting costs.
                y0 + (y1 - y0) * ((amount - x0) / (x1 - x0)).max(0.0)
            }
        }
    }
}

/// What a stage has to do.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Load {
    /// Bricks, once for each edit that may reach them; or blocks.
    pub amount: usize,
    /// Of those, how many times an edit is rough, and how many times one looks around: it sculpts, or rules
    /// bear on it.
    pub rough: usize,
    pub careful: usize,
    /// Bricks and stacks of the ground that the card does not have.
    pub missing: usize,
}

impl Load {
    /// What edits are to do, as if the card had all bricks.
    pub fn of_edits(work: &EditWork) -> Self {
        let (jobs, tools) = (work.jobs(), &work.tools);
        // Mostly all edits are of one kind, and jobs are many.
        let count = |is: fn(&Tool) -> bool| match tools.iter().filter(|tool| is(tool)).count() {
            0 => 0,
            all if all == tools.len() => jobs.len(),
            _ => {
                let is: Vec<bool> = tools.iter().map(is).collect();
                jobs.iter().filter(|job| is[job.edit as usize]).count()
            }
        };
        Self {
            amount: jobs.len(),
            rough: count(|tool| tool.evaluator.is_rough()),
            careful: if work.looks_around() { count(Tool::looks_around) } else { 0 },
            missing: 0,
        }
    }
}

/// What both backends take, by measurement: the processor first, then the card.
#[derive(Clone, Debug)]
pub(super) struct Costs {
    pub edit: [Curve; 2],
    /// Edits that look around.
    pub careful: [Curve; 2],
    /// What roughness adds.
    pub rough: [Curve; 2],
    pub mesh: [Curve; 2],
    /// Seconds to bring a brick to the card.
    pub upload: f64,
    /// How much longer stages take than was measured: edits, meshing, edits some of which look around; of so little that the
    /// processor does it on one thread, and of more.
    drift: [[[f64; 2]; 2]; 3],
    /// How many stages of that kind the other backend did since this one did any.
    idle: [[[u32; 2]; 2]; 3],
    /// How many times in a row a backend that came back to such stages was the slower one still.
    in_vain: [[u32; 2]; 3],
    /// Blocks that are meshed anew for each brick that an edit may reach, as it was lately: of few such bricks, of many.
    blocks: [f64; 2],
    /// Such bricks of the transaction at hand.
    edited: usize,
}

/// What is expected of that at first.
const BLOCKS: f64 = 1.25;
/// The most that one transaction may say of it: edits that hardly reach a brick are meshed with all that is around it.
const MOST_BLOCKS: f64 = 8.0;

/// How far one transaction moves what is expected of the next.
const LEARNING: f64 = 0.2;
/// How fast it is forgotten that a backend took longer than was measured, while it is not used: it is tried again after some
/// twenty stages.
const FORGETTING: f64 = 0.04;
/// After how many stages a backend is looked at again that is expected to be slower: only what is used is known to be so fast.
const IDLE: u32 = 32;
/// But not where it is expected to take so many times as long.
const HOPELESS: u32 = 3;
/// After how many stages a backend that is used again has come back, and the other one was not just looked at.
const AWAY: u32 = 4;
/// How often both last twice as long where a backend came back in vain.
const PATIENCE: u32 = 5;
/// The least and the most that it may come to: a card may have to draw besides, and a game may need the processor.
const DRIFT: [f64; 2] = [1.0 / 16.0, 16.0];
/// And what one transaction may say of it beside what was expected: one that had to wait says little of the next.
const SURPRISE: [f64; 2] = [0.5, 2.0];

impl Default for Costs {
    fn default() -> Self {
        Self {
            edit: Default::default(),
            careful: Default::default(),
            rough: Default::default(),
            mesh: Default::default(),
            upload: 0.0,
            drift: [[[1.0; 2]; 2]; 3],
            idle: Default::default(),
            in_vain: Default::default(),
            blocks: [BLOCKS; 2],
            edited: 0,
        }
    }
}

impl Costs {
    /// What a stage takes on either backend, and whether it is the card's: the faster one does it, but for a look at the
    /// other one now and then.
    pub fn choose(&self, stage: Stage, load: Load) -> (Estimate, bool) {
        let estimate = match stage {
            Stage::Edit => self.edit(load),
            Stage::Mesh => self.mesh(load),
        };
        let Estimate { cpu, cuda } = estimate;
        let is_faster = cuda < cpu;
        let is_turn = self.has_waited(stage, load, !is_faster) && cpu.max(cuda) < cpu.min(cuda) * HOPELESS;
        (estimate, is_faster != is_turn)
    }

    /// Has a backend not been used for so long that it is worth a look?
    fn has_waited(&self, stage: Stage, load: Load, is_cuda: bool) -> bool {
        let (kind, size) = (kind(stage, load), size(load.amount));
        self.idle[kind][size][usize::from(is_cuda)] >= IDLE << self.in_vain[kind][size]
    }

    /// Takes in that the card could not do a stage.
    pub fn fail(&mut self, stage: Stage, load: Load) {
        let (kind, size) = (kind(stage, load), size(load.amount));
        self.idle[kind][size][1] = 0;
        self.in_vain[kind][size] = (self.in_vain[kind][size] + 1).min(PATIENCE);
    }

    /// The stages of a transaction are chosen one by one. But what is edited on the processor has to be brought to the
    /// card before it is meshed there, and that counts already when edits are chosen.
    pub fn edit(&self, load: Load) -> Estimate {
        let drift = self.drift[kind(Stage::Edit, load)][size(load.amount)];
        let [cpu, cuda] = [0, 1].map(|on| self.edits(load, on) * drift[on]);
        let blocks = load.amount as f64 * self.blocks[size(load.amount)];
        let mesh = self.meshing(blocks.round() as usize);
        let brought = mesh[1] + self.upload * load.amount as f64;
        estimate(cpu + mesh[0].min(brought), cuda + self.upload * load.missing as f64 + mesh[0].min(mesh[1]))
    }

    /// Seconds that edits take on a backend as measured, where nothing is missing.
    fn edits(&self, load: Load, on: usize) -> f64 {
        // What looking around takes longer than digging alone does.
        let more = match load.careful {
            0 => 0.0,
            careful => (self.careful[on].at(careful) - self.edit[on].at(careful)).max(0.0),
        };
        let rough = if load.rough > 0 { self.rough[on].at(load.rough) } else { 0.0 };
        self.edit[on].at(load.amount) + rough + more
    }

    /// Meshing blocks.
    pub fn mesh(&self, load: Load) -> Estimate {
        let [cpu, cuda] = self.meshing(load.amount);
        estimate(cpu, cuda + self.upload * load.missing as f64)
    }

    /// Seconds that meshing takes on both, where nothing is missing.
    fn meshing(&self, blocks: usize) -> [f64; 2] {
        let drift = self.drift[kind(Stage::Mesh, Load::default())][size(blocks)];
        [0, 1].map(|on| self.mesh[on].at(blocks) * drift[on])
    }

    /// Takes in how long a stage took that was expected to take so long, the other one's part not counted; and how much
    /// there is to mesh after edits. Nothing to do, or less than was ever measured, says nothing.
    pub fn learn(&mut self, stage: Stage, load: Load, is_cuda: bool, took: Duration) {
        match stage {
            Stage::Edit => self.edited += load.amount,
            Stage::Mesh => {
                let edited = std::mem::take(&mut self.edited);
                if edited > 0 && load.amount > 0 {
                    let (found, blocks) =
                        (load.amount as f64 / edited as f64, &mut self.blocks[size(edited)]);
                    *blocks += (found.min(MOST_BLOCKS) - *blocks) * LEARNING;
                }
            }
        }
        let (on, is_look) = (usize::from(is_cuda), self.has_waited(stage, load, is_cuda));
        let (kind, size) = (kind(stage, load), size(load.amount));
        let is_back = self.idle[kind][size][on] >= AWAY;
        let idle = &mut self.idle[kind][size];
        (idle[on], idle[1 - on]) = (0, idle[1 - on].saturating_add(1));
        let (curve, expected) = match stage {
            Stage::Edit => (&self.edit[on], [0, 1].map(|on| self.edits(load, on))),
            Stage::Mesh => (&self.mesh[on], [0, 1].map(|on| self.mesh[on].at(load.amount))),
        };
        let own = expected[on] + if is_cuda { self.upload * load.missing as f64 } else { 0.0 };
        if !curve.reaches(load.amount) || own <= 0.0 {
            return;
        }
        let (drift, in_vain) = (&mut self.drift[kind][size], &mut self.in_vain[kind][size]);
        let found = took.as_secs_f64() / own;
        // What nobody has seen for long is news; else, one that had to wait says little of the next.
        drift[on] = if is_look {
            found.clamp(DRIFT[0], DRIFT[1])
        } else {
            let found = found.clamp(drift[on] * SURPRISE[0], drift[on] * SURPRISE[1]);
            (drift[on] + (found - drift[on]) * LEARNING).clamp(DRIFT[0], DRIFT[1])
        };
        drift[1 - on] -= (drift[1 - on] - 1.0).max(0.0) * FORGETTING / f64::from(1 << *in_vain);
        if is_back {
            let is_slower = expected[on] * drift[on] > expected[1 - on] * drift[1 - on];
            *in_vain = if is_slower { (*in_vain + 1).min(PATIENCE) } else { 0 };
        }
    }
}

/// Is an amount small, or large?
fn size(amount: usize) -> usize {
    usize::from(amount >= PARALLEL_BLOCKS)
}

/// Which drift is that of a stage.
fn kind(stage: Stage, load: Load) -> usize {
    match stage {
        Stage::Edit if load.careful > 0 => 2,
        stage => stage as usize,
    }
}

fn estimate(cpu: f64, cuda: f64) -> Estimate {
    let time = |seconds: f64| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
    Estimate { cpu: time(cpu), cuda: time(cuda) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_linear_between_what_was_measured() {
        let mut curve = Curve::default();
        assert_eq!(curve.at(10), 0.0);
        for (amount, micros) in [(10, 20), (20, 30), (40, 25), (80, 110)] {
            curve.push(amount, Duration::from_micros(micros));
        }
        let micros = |amount| (curve.at(amount) * 1e6).round();
        assert_eq!([1, 10, 15, 20, 30, 40].map(micros), [20.0, 20.0, 25.0, 30.0, 30.0, 30.0]);
        assert_eq!([60, 80, 160].map(micros), [70.0, 110.0, 270.0]);
    }

    #[test]
    fn looking_around_takes_its_own_time() {
        let mut costs = Costs::default();
        for (on, per) in [(0, 10), (1, 3)] {
            for amount in [10, 100] {
                costs.edit[on].push(amount, Duration::from_micros(amount as u64));
                costs.careful[on].push(amount, Duration::from_micros(amount as u64 * per));
            }
        }
        let of = |amount, careful| {
            let estimate = costs.edit(Load { amount, careful, ..Load::default() });
            [estimate.cpu, estimate.cuda].map(|time| time.as_nanos().div_ceil(1000))
        };
        assert_eq!(of(50, 0), [50, 50]);
        assert_eq!(of(50, 50), [500, 150]);
        assert_eq!(of(70, 50), [520, 170]);
    }

    /// What edits take, and what meshing takes, in microseconds each; linear in the amount.
    fn linear(edit: [u64; 2], mesh: [u64; 2]) -> Costs {
        let mut costs = Costs::default();
        for on in [0, 1] {
            for amount in [1, 100] {
                costs.edit[on].push(amount, Duration::from_micros(edit[on] * amount as u64));
                costs.mesh[on].push(amount, Duration::from_micros(mesh[on] * amount as u64));
            }
        }
        costs
    }

    fn micros(estimate: Estimate) -> [f64; 2] {
        [estimate.cpu, estimate.cuda].map(|time| (time.as_secs_f64() * 1e6).round())
    }

    #[test]
    fn roughness_takes_its_own_time() {
        let mut costs = linear([3, 4], [0, 0]);
        for (curve, each) in costs.rough.iter_mut().zip([5, 2]) {
            [1, 100]
                .into_iter()
                .for_each(|amount| curve.push(amount, Duration::from_micros(each * amount as u64)));
        }
        let of = |amount, rough| micros(costs.edit(Load { amount, rough, ..Load::default() }));
        assert_eq!(of(10, 0), [30.0, 40.0]);
        assert_eq!(of(10, 4), [30.0 + 20.0, 40.0 + 8.0]);
        assert_eq!(of(10, 10), [30.0 + 50.0, 40.0 + 20.0]);
    }

    #[test]
    fn what_is_missing_has_to_be_brought_to_the_card() {
        let costs = Costs { upload: 7e-6, ..linear([3, 4], [0, 0]) };
        let of = |amount, missing| micros(costs.edit(Load { amount, missing, ..Load::default() }));
        assert_eq!([of(10, 0), of(10, 3)], [[30.0, 40.0], [30.0, 40.0 + 21.0]]);
        let costs = Costs { upload: 7e-6, ..linear([0, 0], [3, 4]) };
        let of = |amount, missing| micros(costs.mesh(Load { amount, missing, ..Load::default() }));
        assert_eq!([of(10, 0), of(10, 3)], [[30.0, 40.0], [30.0, 40.0 + 21.0]]);
    }

    #[test]
    fn edits_are_followed_by_the_cheaper_meshing() {
        // Fifty blocks are meshed for forty bricks.
        let of = |mesh, upload| {
            let costs = Costs { upload, ..linear([1, 2], mesh) };
            micros(costs.edit(Load { amount: 40, ..Load::default() }))
        };
        // On the card, even if all has to be brought there.
        assert_eq!(of([10, 1], 5e-6), [40.0 + 50.0 + 200.0, 80.0 + 50.0]);
        // On the processor, rather than that.
        assert_eq!(of([10, 1], 20e-6), [40.0 + 500.0, 80.0 + 50.0]);
        // On the processor in any case.
        assert_eq!(of([1, 10], 5e-6), [40.0 + 50.0, 80.0 + 50.0]);
    }

    #[test]
    fn as_many_blocks_are_expected_as_there_were_lately() {
        let mut costs = linear([1, 1], [10, 10]);
        let load = |amount| Load { amount, ..Load::default() };
        let of = |costs: &Costs, amount| micros(costs.edit(load(amount)))[0];
        assert_eq!([100, 40].map(|amount| of(&costs, amount)), [100.0 + 1250.0, 40.0 + 500.0]);
        // Two runs of edits, and half as many blocks; then a step through history, which says nothing.
        for _ in 0..40 {
            for (stage, amount, each) in
                [(Stage::Edit, 100, 1), (Stage::Edit, 60, 1), (Stage::Mesh, 80, 10), (Stage::Mesh, 900, 10)]
            {
                costs.learn(stage, load(amount), false, Duration::from_micros(amount as u64 * each));
            }
        }
        // Many say nothing of few.
        assert_eq!([100, 40].map(|amount| of(&costs, amount)), [100.0 + 500.0, 40.0 + 500.0]);
        // However little the edits reached.
        for _ in 0..40 {
            costs.learn(Stage::Edit, load(1), false, Duration::from_micros(1));
            costs.learn(Stage::Mesh, load(900), false, Duration::from_micros(9000));
        }
        assert_eq!(of(&costs, 40), 40.0 + 3200.0);
    }

    #[test]
    fn what_was_brought_is_no_slowness_of_the_stage() {
        let mut costs = Costs { upload: 7e-6, ..linear([3, 4], [3, 4]) };
        let load = Load { amount: 60, missing: 10, ..Load::default() };
        let before = [costs.mesh(load), costs.edit(load)];
        for stage in [Stage::Mesh, Stage::Edit] {
            (0..30).for_each(|_| costs.learn(stage, load, true, Duration::from_micros(60 * 4 + 70)));
            (0..30).for_each(|_| costs.learn(stage, load, false, Duration::from_micros(60 * 3)));
        }
        assert_eq!([costs.mesh(load), costs.edit(load)].map(micros), before.map(micros));
    }

    #[test]
    fn what_takes_longer_than_it_should_is_expected_to_next_time() {
        let mut costs = Costs::default();
        for curve in &mut costs.mesh {
            curve.push(10, Duration::from_micros(10));
            curve.push(100, Duration::from_micros(100));
        }
        let load = Load { amount: 50, ..Load::default() };
        let expected = |costs: &Costs| {
            let estimate = costs.mesh(load);
            [estimate.cpu, estimate.cuda].map(|time| time.as_micros())
        };
        assert_eq!(expected(&costs), [50, 50]);
        (0..30).for_each(|_| costs.learn(Stage::Mesh, load, true, Duration::from_micros(100)));
        assert_eq!(expected(&costs), [50, 99]);
        // What one thread does says nothing of what all do, and the other way round.
        let few = costs.mesh(Load { amount: 40, ..load });
        assert_eq!([few.cpu, few.cuda].map(|time| time.as_micros()), [40, 40]);
        // One that had to wait for something else says little.
        let mut disturbed = costs.clone();
        disturbed.learn(Stage::Mesh, load, true, Duration::from_millis(900));
        assert!(expected(&disturbed)[1] < 125);
        // Nothing to do says nothing, nor less than was measured.
        for amount in [0, 9] {
            let load = Load { amount, ..load };
            (0..30).for_each(|_| costs.learn(Stage::Mesh, load, true, Duration::from_nanos(100)));
            (0..30).for_each(|_| costs.learn(Stage::Edit, load, true, Duration::from_nanos(100)));
        }
        assert_eq!(expected(&costs), [50, 99]);
        assert_eq!(
            [few.cpu, few.cuda],
            [costs.mesh(Load { amount: 40, ..load })].map(|few| [few.cpu, few.cuda])[0]
        );
        // And forgotten while the other one is used.
        (0..400).for_each(|_| costs.learn(Stage::Mesh, load, false, Duration::from_micros(50)));
        assert_eq!(expected(&costs), [50, 50]);
    }

    /// Plays meshing of sixty blocks that takes so many microseconds on either; returns how many of all stages the card did,
    /// and how many times as long all of them took as on the faster one.
    fn play(costs: &mut Costs, truth: [u64; 2], stages: usize) -> (usize, f64) {
        let load = Load { amount: 60, ..Load::default() };
        let (mut card, mut took) = (0, 0);
        for _ in 0..stages {
            let (_, is_cuda) = costs.choose(Stage::Mesh, load);
            let time = truth[usize::from(is_cuda)];
            costs.learn(Stage::Mesh, load, is_cuda, Duration::from_micros(time));
            (card, took) = (card + usize::from(is_cuda), took + time);
        }
        (card, took as f64 / (truth[0].min(truth[1]) * stages as u64) as f64)
    }

    #[test]
    fn a_backend_that_is_faster_than_it_was_measured_is_found_out() {
        // Six hundred beside four hundred and eighty microseconds were measured; the other way round for the other one.
        for stages in [100, 300, 1000] {
            let (card, took) = play(&mut linear([1, 1], [10, 8]), [180, 360], stages);
            assert!(card < 50 && took < 1.5, "{card} of {stages}: {took}");
            let (card, took) = play(&mut linear([1, 1], [8, 10]), [360, 180], stages);
            assert!(stages - card < 50 && took < 1.5, "{card} of {stages}: {took}");
        }
        // Nothing is looked at soon, nor where there is no hope.
        let soon = IDLE as usize;
        assert_eq!(play(&mut linear([1, 1], [10, 8]), [600, 480], soon), (soon, 1.0));
        assert_eq!(play(&mut linear([1, 1], [20, 6]), [1200, 360], 500), (500, 1.0));
    }

    #[test]
    fn a_backend_that_is_slower_is_looked_at_less_and_less() {
        // The processor takes sixty microseconds. Of the card, what was measured, its truth, and the most that all stages may take.
        for (measured, truth, most) in [
            (90, 90, 1.01),
            (90, 300, 1.02),
            (90, 900, 1.06),
            (170, 170, 1.01),
            (30, 600, 1.15),
            (30, 1800, 1.4),
        ] {
            let mut costs = Costs::default();
            for (on, time) in [(0, 60), (1, measured)] {
                costs.mesh[on].push(60, Duration::from_micros(time));
            }
            let (card, took) = play(&mut costs, [60, truth], 5000);
            assert!(took <= most && card < 100, "{measured}, {truth}: {card}, {took}");
        }
    }

    #[test]
    fn what_the_card_can_not_do_is_no_reason_to_look_again_at_once() {
        let (mut costs, load) = (linear([1, 1], [8, 10]), Load { amount: 60, ..Load::default() });
        let mut failed = 0;
        for _ in 0..1000 {
            if costs.choose(Stage::Mesh, load).1 {
                costs.fail(Stage::Mesh, load);
                failed += 1;
            } else {
                costs.learn(Stage::Mesh, load, false, Duration::from_micros(480));
            }
        }
        assert!((1..8).contains(&failed), "{failed}");
    }
}
