//! Chooses the backend for a stage: the one that recently took less time for such stages.
//!
//! There is a row for each kind of stage and each power of two of its amount. A row has the last three times of each
//! backend, and their median is what the next stage is expected to take. A backend that was never timed in a row is
//! expected to take as little as its times in other rows allow, so it is tried once where that could pay.
//!
//! The slower backend of a row is timed again occasionally: each stage done by the faster one earns [`SHARE`]
//! of its time as credit for the row. Once the credit covers the expected loss, the slower one runs a stage.

use std::time::Duration;

use super::Estimate;
use crate::edits::{Job, PreparedEdit, PreparedEdits};

/// Share of a row's time that may be spent on timing the slower backend: a fiftieth.
const SHARE: f64 = 0.02;

/// CPU seconds from which a stage may be worth opening a GPU, whose latency is about a tenth of that.
const WORTH: f64 = 1e-3;

/// Kind of work, as far as it affects how long a stage takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Edits.
    Edit,
    /// Edits, some of them rough.
    Rough,
    /// Edits that read samples around those they change, as sculpting does.
    Stencil,
    /// Edits that round edges: they look for the surface around the samples that they change.
    Rounded,
    /// Blocks meshed.
    Mesh,
}

/// The work of a stage.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load {
    pub kind: Kind,
    /// Bricks, once for each edit that may reach them; or blocks. For edits that round edges, the bricks that they look
    /// at, once for each brick that they may reach.
    pub amount: usize,
    /// Blocks that will be meshed after edits, roughly: the bricks that they reach, each once.
    pub blocks: usize,
    /// Whether most of the needed data has to be uploaded to the GPU first.
    pub is_cold: bool,
}

impl Load {
    /// Blocks to be meshed.
    pub fn of_blocks(blocks: usize) -> Self {
        Self { kind: Kind::Mesh, amount: blocks, blocks, is_cold: false }
    }

    /// The work of these edits.
    pub fn of_edits(work: &PreparedEdits) -> Self {
        let jobs = work.jobs();
        let kind = if work.edits.iter().any(|edit| edit.rounding().is_some()) {
            Kind::Rounded
        } else if work.looks_around() {
            Kind::Stencil
        } else if work.edits.iter().any(|record: &PreparedEdit| record.evaluator.is_rough()) {
            Kind::Rough
        } else {
            Kind::Edit
        };
        // Jobs are sorted by brick. Of many, a sample will do.
        let step = jobs.len().div_ceil(SAMPLED).max(1);
        let is_first = |&at: &usize| at == 0 || !Job::is_same_brick(&jobs[at - 1], &jobs[at]);
        let blocks = (0..jobs.len()).step_by(step).filter(is_first).count() * step;
        let amount = match kind {
            Kind::Rounded => jobs.iter().map(|job| work.edits[job.edit as usize].bricks_read()).sum(),
            _ => jobs.len(),
        };
        Self { kind, amount, blocks, is_cold: false }
    }
}

/// Number of jobs that are sampled to estimate how many bricks they reach.
const SAMPLED: usize = 1 << 10;

/// The last times of one backend in one row, in seconds.
#[derive(Clone, Copy, Debug, Default)]
struct Recent {
    times: [f64; 3],
    /// Number of valid entries in `times`.
    count: usize,
    /// Whether the last stage was left out because memory was allocated in it.
    has_skipped: bool,
}

impl Recent {
    /// The median; of two times, the shorter one. One stage that had to wait for something else does not move
    /// a median of three.
    fn median(&self) -> Option<f64> {
        let mut times = self.times;
        let times = &mut times[..self.count];
        times.sort_unstable_by(f64::total_cmp);
        times.get(times.len().saturating_sub(1) / 2).copied()
    }

    /// The shortest time, which may be reached again.
    fn shortest(&self) -> Option<f64> {
        self.times[..self.count].iter().copied().min_by(f64::total_cmp)
    }

    fn push(&mut self, time: f64) {
        self.times.rotate_right(1);
        self.times[0] = time;
        self.count = (self.count + 1).min(self.times.len());
    }
}

/// Predicts the next time of a row from its last ones.
type Statistic = fn(&Recent) -> Option<f64>;

/// The times of one backend for one kind of stage, by powers of two of the amount.
#[derive(Clone, Debug, Default)]
struct Times(Vec<Recent>);

/// The power of two that an amount belongs to.
fn size(amount: usize) -> usize {
    amount.checked_ilog2().unwrap_or_default() as usize
}

impl Times {
    /// Seconds that an amount is expected to take. If none was timed: at least as long as smaller amounts,
    /// and per piece at least as long as larger ones.
    fn at(&self, amount: usize, statistic: Statistic) -> f64 {
        let own = size(amount);
        let row = |at: usize| self.0.get(at).and_then(statistic);
        let smaller = || (0..own).rev().find_map(row).unwrap_or_default();
        let larger =
            || (own + 1..self.0.len()).find_map(|at| Some(row(at)? / f64::powi(2.0, (at - own) as i32)));
        row(own).unwrap_or_else(|| smaller().max(larger().unwrap_or_default()))
    }

    fn row(&mut self, amount: usize) -> &mut Recent {
        let own = size(amount);
        if self.0.len() <= own {
            self.0.resize(own + 1, Recent::default());
        }
        &mut self.0[own]
    }
}

/// Index into [`Costs::times`]: the CPU, a GPU that has its data, or a GPU that does not.
const CPU: usize = 0;
const WARM_GPU: usize = 1;
const COLD_GPU: usize = 2;

/// The index of the GPU for this load.
fn gpu_index(load: Load) -> usize {
    if load.is_cold { COLD_GPU } else { WARM_GPU }
}

/// The recorded times of both backends.
#[derive(Clone, Debug, Default)]
pub(super) struct Costs {
    /// By kind and by backend ([`CPU`], [`WARM_GPU`], [`COLD_GPU`]).
    times: [[Times; 3]; 5],
    /// Seconds that each row may lose on the slower backend; negative after a larger loss.
    credit: [Vec<f64>; 5],
}

impl Costs {
    /// Returns the expected times of a stage, and whether the GPU runs it.
    pub fn choose(&self, load: Load) -> (Estimate, bool) {
        let [cpu, gpu] = self.expected(load, Recent::median);
        let is_faster = gpu < cpu;
        let credit = self.credit[load.kind as usize].get(size(load.amount)).copied().unwrap_or_default();
        // If the median comes from stages that had to wait, the shortest time is the better estimate.
        let shortest = self.expected(load, Recent::shortest);
        let may_be_faster = shortest[usize::from(!is_faster)] < shortest[usize::from(is_faster)];
        let is_turn = may_be_faster || (gpu - cpu).abs() < credit;
        let time = |seconds: f64| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        (Estimate { cpu: time(cpu), cuda: time(gpu) }, is_faster != is_turn)
    }

    /// Seconds on the CPU and on the GPU. The times of edits include the meshing that follows: that stage
    /// makes its own choice, but bricks edited on the CPU have to be uploaded before a GPU can mesh them.
    fn expected(&self, load: Load, statistic: Statistic) -> [f64; 2] {
        let own =
            [CPU, gpu_index(load)].map(|who| self.times[load.kind as usize][who].at(load.amount, statistic));
        if load.kind == Kind::Mesh {
            return own;
        }
        let mesh = |who: usize| self.times[Kind::Mesh as usize][who].at(load.blocks, Recent::median);
        [own[0] + mesh(CPU).min(mesh(COLD_GPU)), own[1] + mesh(CPU).min(mesh(WARM_GPU))]
    }

    /// Records how long a stage took. `is_chosen` is false if only the CPU could do it. `has_grown` says
    /// whether memory was allocated for it, which later stages will not need to do.
    pub fn learn(&mut self, load: Load, is_cuda: bool, is_chosen: bool, took: Duration, has_grown: bool) {
        if load.amount == 0 {
            return;
        }
        let (took, expected) = (took.as_secs_f64(), self.expected(load, Recent::median));
        let own = &mut self.times[load.kind as usize][if is_cuda { gpu_index(load) } else { CPU }];
        let surprise = took - own.at(load.amount, Recent::median);
        let row = own.row(load.amount);
        // If every stage allocates, the time for that is part of the cost.
        row.has_skipped = has_grown && !row.has_skipped;
        if row.has_skipped {
            return;
        }
        let lost = expected[usize::from(is_cuda)] - expected[usize::from(!is_cuda)];
        if lost > 0.0 && lost + surprise < 0.0 {
            // The backend that was expected to be slower was faster: the new time replaces the old ones.
            *row = Recent::default();
        }
        row.push(took);
        if !is_chosen {
            return;
        }
        let (credits, size) = (&mut self.credit[load.kind as usize], size(load.amount));
        credits.resize(credits.len().max(size + 1), 0.0);
        let credit = &mut credits[size];
        if lost > 0.0 {
            *credit = credit.min(lost) - (lost + surprise).max(0.0);
        } else {
            *credit += took * SHARE;
        }
    }

    /// Returns `true` if such a stage may be worth opening a GPU.
    pub fn may_be_worth_a_gpu(&self, load: Load) -> bool {
        self.times[load.kind as usize][CPU].at(load.amount, Recent::median) >= WORTH
    }
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;

    use super::*;
    use crate::brush::{Brush, Edit, Shape};
    use crate::ground::Ground;
    use crate::lattice::ChunkGrid;
    use crate::volume::{Bricks, SampleView};

    fn load(kind: Kind, amount: usize) -> Load {
        Load { kind, ..Load::of_blocks(amount) }
    }

    fn micros(time: f64) -> Duration {
        Duration::from_secs_f64(time * 1e-6)
    }

    /// Records that a stage of `amount` blocks took `time` microseconds.
    fn took(costs: &mut Costs, amount: usize, is_cuda: bool, time: f64) {
        costs.learn(Load::of_blocks(amount), is_cuda, true, micros(time), false);
    }

    fn estimate(costs: &Costs, amount: usize) -> [u128; 2] {
        let (Estimate { cpu, cuda }, _) = costs.choose(Load::of_blocks(amount));
        [cpu, cuda].map(|time| time.as_micros())
    }

    #[test]
    fn edits_that_round_edges_cost_as_much_as_they_look_at() {
        let (ground, none) = (Ground::flat(64, 64, 20.0).expect("a ground"), Bricks::default());
        let (samples, grid) = (SampleView::new(&ground, &none), ChunkGrid::new(32, 64, 64));
        let of_each_brick = |brush: Brush| {
            let edit = Edit::quantize(&brush).expect("a valid brush");
            let work = PreparedEdits::new(samples, grid, &[&edit]);
            let load = Load::of_edits(&work);
            (load.kind, load.amount / work.jobs().len())
        };
        let shape = Shape::sphere(glam::Vec3::splat(30.0), 5.0);
        assert_eq!(of_each_brick(Brush::dig(shape)), (Kind::Edit, 1));
        assert_eq!(of_each_brick(Brush::smooth(shape, 1.0)), (Kind::Stencil, 1));
        // 18 and 42 samples along each side instead of 8.
        assert_eq!(of_each_brick(Brush::fill(shape, 3.0)), (Kind::Rounded, 11));
        assert_eq!(of_each_brick(Brush::carve(shape, 16.0)), (Kind::Rounded, 144));
    }

    #[test]
    fn what_had_to_wait_once_does_not_count() {
        let mut costs = Costs::default();
        for (time, expected) in
            [(90.0, 90), (9000.0, 90), (80.0, 90), (70.0, 80), (9000.0, 80), (9000.0, 9000)]
        {
            took(&mut costs, 10, false, time);
            assert_eq!(estimate(&costs, 10)[0], expected);
        }
    }

    #[test]
    fn amounts_that_were_never_timed_take_what_others_allow() {
        let mut costs = Costs::default();
        assert_eq!(estimate(&costs, 10), [0, 0]);
        took(&mut costs, 100, true, 640.0);
        // No less a block than larger ones; no less than smaller ones.
        assert_eq!(
            [1, 10, 63, 64, 127, 128, 5000].map(|amount| estimate(&costs, amount)[1]),
            [10, 80, 320, 640, 640, 640, 640]
        );
        took(&mut costs, 8, true, 300.0);
        assert_eq!(
            [1, 7, 15, 16, 63, 70].map(|amount| estimate(&costs, amount)[1]),
            [37, 150, 300, 300, 320, 640]
        );
        assert_eq!(estimate(&costs, 100)[0], 0);
    }

    #[test]
    fn a_time_in_which_memory_was_allocated_counts_only_where_each_one_is_such() {
        let mut costs = Costs::default();
        let mut grown = |time: f64, has_grown| {
            costs.learn(Load::of_blocks(10), true, true, micros(time), has_grown);
            estimate(&costs, 10)[1]
        };
        assert_eq!([grown(900.0, true), grown(100.0, false), grown(800.0, true)], [0, 100, 100]);
        assert_eq!([grown(700.0, true), grown(600.0, true), grown(600.0, true)], [100, 100, 600]);
    }

    /// A simulated machine: microseconds by the number of blocks, on CPU and GPU.
    #[derive(Clone, Copy)]
    struct Machine {
        cpu: fn(f64) -> f64,
        gpu: fn(f64) -> f64,
        /// Relative deviation of times, in both directions.
        noise: f64,
    }

    /// Sixteen threads, from 48 blocks on.
    fn threads(blocks: f64) -> f64 {
        if blocks < 48.0 { 1.0 + 1.4 * blocks } else { 35.0 + 0.3 * blocks }
    }

    const MACHINES: [(&str, Machine); 5] = [
        ("a fast GPU", Machine { cpu: threads, gpu: |blocks| 45.0 + 0.08 * blocks, noise: 0.15 }),
        ("a slow GPU", Machine { cpu: threads, gpu: |blocks| 150.0 + 0.9 * blocks, noise: 0.15 }),
        (
            "a GPU that is always faster",
            Machine { cpu: threads, gpu: |blocks| 0.5 + 0.1 * blocks, noise: 0.1 },
        ),
        ("one thread", Machine { cpu: |blocks| 1.4 * blocks, gpu: |blocks| 60.0 + 0.1 * blocks, noise: 0.3 }),
        ("nearly as fast", Machine { cpu: threads, gpu: |blocks| 38.0 + 0.28 * blocks, noise: 0.15 }),
    ];

    /// What became of stages.
    #[derive(Default)]
    struct Played {
        /// Microseconds that they took, and that the faster backend would have taken.
        took: f64,
        best: f64,
        /// The longest that one of them takes on the slower backend.
        longest: f64,
    }

    impl Played {
        fn regret(&self) -> f64 {
            self.took / self.best - 1.0
        }
    }

    /// Plays stages of these amounts.
    fn play(
        costs: &mut Costs,
        machine: Machine,
        rng: &mut Rng,
        amounts: impl IntoIterator<Item = usize>,
    ) -> Played {
        let mut played = Played::default();
        for amount in amounts {
            let truth = [machine.cpu, machine.gpu].map(|time| time(amount as f64));
            let load = Load::of_blocks(amount);
            let (_, is_cuda) = costs.choose(load);
            let noise = 1.0 + machine.noise * (2.0 * rng.f64() - 1.0);
            // One in a hundred has to wait for something else.
            let waits = if rng.u32(0..100) == 0 { 2000.0 } else { 0.0 };
            let time = truth[usize::from(is_cuda)];
            costs.learn(load, is_cuda, true, micros(time * noise + waits), false);
            played.took += time;
            played.best += truth[0].min(truth[1]);
            played.longest = played.longest.max(truth[0].max(truth[1]));
        }
        played
    }

    /// Mostly small amounts, some of them large.
    fn amounts(rng: &mut Rng, stages: usize) -> Vec<usize> {
        (0..stages).map(|_| f64::powf(20_000.0, rng.f64().powi(2)) as usize).collect()
    }

    #[test]
    fn little_time_is_lost_compared_with_the_faster_backend() {
        for (seed, (name, machine)) in (0..9).flat_map(|seed| MACHINES.map(|machine| (seed, machine))) {
            let rng = &mut Rng::with_seed(seed);
            let (mut costs, first, rest) = (Costs::default(), amounts(rng, 300), amounts(rng, 20_000));
            let played = play(&mut costs, machine, rng, first);
            // Each amount has to be tried once.
            let (lost, longest) = (played.took - played.best, played.longest);
            assert!(lost < 2.0 * longest, "{name}: {lost} lost at first, where one stage takes {longest}");
            let played = play(&mut costs, machine, rng, rest);
            assert!(played.regret() < 0.08, "{name}: {}", played.regret());
        }
    }

    #[test]
    fn each_amount_of_a_sweep_is_done_by_the_faster_backend_soon() {
        // As the benchmark has them: thirty stages of each, of which six are not timed.
        let (mut rows, mut bad) = (0, 0);
        for (seed, (name, machine)) in (0..9).flat_map(|seed| MACHINES.map(|machine| (seed, machine))) {
            let (mut costs, rng) = (Costs::default(), &mut Rng::with_seed(seed));
            for amount in [1, 3, 12, 25, 50, 100, 170, 340, 700, 1400, 2700, 5200] {
                play(&mut costs, machine, rng, [amount; 6]);
                let mut times: Vec<f64> =
                    (0..24).map(|_| play(&mut costs, machine, rng, [amount]).regret()).collect();
                times.sort_unstable_by(f64::total_cmp);
                rows += 1;
                if times[12] > 0.1 {
                    bad += 1;
                    println!("{name}, {amount}: {:.2}", times[12]);
                }
            }
        }
        assert!(bad * 20 <= rows, "{bad} of {rows}");
    }

    #[test]
    fn small_stages_do_not_pay_for_a_slower_gpu() {
        for gpu in [45.0, 100.0, 1000.0, 100_000.0] {
            let (mut costs, rng) = (Costs::default(), &mut Rng::with_seed(3));
            let mut times = [0.0, 0.0];
            for stage in 0..10_000 {
                let (_, is_cuda) = costs.choose(Load::of_blocks(16));
                let time = if is_cuda { gpu } else { 24.0 } * (0.9 + 0.2 * rng.f64());
                took(&mut costs, 16, is_cuda, time);
                // Once it has to be tried.
                times[usize::from(is_cuda)] += if stage < 2 { 0.0 } else { time };
            }
            let all = times[0] + times[1];
            let lost = all / (10_000.0 * 24.0) - 1.0;
            assert!(lost < 0.03, "{gpu}: {lost}");
        }
    }

    #[test]
    fn large_stages_move_to_the_gpu_at_once() {
        // The CPU did small stages and a large one before the GPU was open.
        let mut costs = Costs::default();
        for amount in [1, 16, 16, 90, 32_000] {
            costs.learn(Load::of_blocks(amount), false, false, micros(threads(amount as f64)), false);
        }
        assert!(!costs.may_be_worth_a_gpu(Load::of_blocks(90)));
        assert!(costs.may_be_worth_a_gpu(Load::of_blocks(32_000)));
        // The first stage on the GPU allocates much memory.
        let mut times = Vec::new();
        for stage in 0..20 {
            let load = Load::of_blocks(32_000 + 100 * stage);
            let (_, is_cuda) = costs.choose(load);
            let time = if is_cuda { 2600.0 + if stage == 0 { 60_000.0 } else { 0.0 } } else { 9600.0 };
            costs.learn(load, is_cuda, true, micros(time), is_cuda && stage == 0);
            times.push(is_cuda);
        }
        assert_eq!(times, [true; 20]);
    }

    #[test]
    fn a_backend_that_becomes_faster_or_slower_is_found_out() {
        let [fast, slow] = [|_: f64| 100.0, |_: f64| 400.0];
        for (before, after) in [([fast, slow], [slow, fast]), ([slow, fast], [fast, slow])] {
            let machine = |[cpu, gpu]: [fn(f64) -> f64; 2]| Machine { cpu, gpu, noise: 0.1 };
            let (mut costs, rng) = (Costs::default(), &mut Rng::with_seed(9));
            assert!(play(&mut costs, machine(before), rng, [60; 500]).regret() < 0.05);
            assert!(play(&mut costs, machine(after), rng, [60; 500]).regret() < 0.08);
        }
        // The slower backend becomes twice as fast as the other, whose times do not change: only timing it again
        // reveals that.
        for is_cuda in [false, true] {
            let (mut costs, rng) = (Costs::default(), &mut Rng::with_seed(9));
            let pick = |own: fn(f64) -> f64, other: fn(f64) -> f64| {
                let [cpu, gpu] = if is_cuda { [other, own] } else { [own, other] };
                Machine { cpu, gpu, noise: 0.1 }
            };
            play(&mut costs, pick(fast, slow), rng, [60; 500]);
            let played = play(&mut costs, pick(fast, |_| 50.0), rng, [60; 1000]);
            assert!(played.regret() < 0.2, "{}", played.regret());
        }
    }

    /// Plays transactions: edits, then the meshing of as many blocks. `edit` and `mesh` hold times on the
    /// CPU, on the GPU, and on the GPU when all bricks that the CPU edited have to be uploaded.
    fn play_transactions(costs: &mut Costs, edit: [f64; 2], mesh: [f64; 3], count: usize) -> f64 {
        let mut all = 0.0;
        for _ in 0..count {
            let edits = load(Kind::Edit, 1000);
            let (_, is_edited) = costs.choose(edits);
            let time = edit[usize::from(is_edited)];
            costs.learn(edits, is_edited, true, micros(time), false);
            let blocks = Load { is_cold: !is_edited, ..Load::of_blocks(1000) };
            let (_, is_meshed) = costs.choose(blocks);
            let meshed = mesh[match (is_meshed, is_edited) {
                (false, _) => 0,
                (true, true) => 1,
                (true, false) => 2,
            }];
            costs.learn(blocks, is_meshed, true, micros(meshed), false);
            all += time + meshed;
        }
        all
    }

    #[test]
    fn edits_are_chosen_together_with_the_meshing_that_follows() {
        for (edit, mesh, best) in [
            // Edits are a little slower on the GPU. Meshing is much faster there, unless everything has to be
            // uploaded.
            ([300.0, 340.0], [600.0, 200.0, 580.0], 540.0),
            ([300.0, 340.0], [600.0, 200.0, 210.0], 510.0),
            ([300.0, 150.0], [200.0, 400.0, 600.0], 350.0),
            ([300.0, 900.0], [200.0, 180.0, 600.0], 500.0),
            ([300.0, 100.0], [200.0, 100.0, 600.0], 200.0),
        ] {
            let mut costs = Costs::default();
            let first = play_transactions(&mut costs, edit, mesh, 100) / 100.0 / best;
            let rest = play_transactions(&mut costs, edit, mesh, 2000) / 2000.0 / best;
            assert!(first < 1.1 && rest < 1.05, "{edit:?}, {mesh:?}: {first}, {rest}");
        }
    }

    #[test]
    fn a_gpu_that_fails_a_stage_is_seldom_tried_again() {
        // The time that the CPU needed in the end is charged to the GPU.
        let (mut costs, mut failed) = (Costs::default(), 0);
        for _ in 0..2000 {
            let (_, is_cuda) = costs.choose(Load::of_blocks(60));
            took(&mut costs, 60, is_cuda, if is_cuda { 700.0 } else { 500.0 });
            failed += usize::from(is_cuda);
        }
        assert!((1..110).contains(&failed), "{failed}");
    }
}
