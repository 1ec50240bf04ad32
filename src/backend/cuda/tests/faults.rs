//! Devices that fail on command: no edit is lost.

use std::ops::Range;
use std::sync::{Mutex, Once};

use super::super::device::{Device, DeviceResult, Fault, HostMemory, Launch, Mark, forward};
use super::*;
use crate::backend::Stage;

/// Number of calls until a device fails, and the fault. [`Fault::Memory`] counts only allocations;
/// [`refused`] counts only waits for marks.
struct FaultPlan(Arc<Mutex<Option<(u32, Fault)>>>);

/// A device that fails as planned.
struct FaultyDevice {
    own: Box<dyn Device>,
    plan: FaultPlan,
}

/// Stands for a panic.
const PANIC: Fault = Fault::SelfTest;

/// A fault of marks only.
fn refused() -> Fault {
    Fault::Refused("a mark".into())
}

impl FaultPlan {
    fn call(&self) -> Result<(), Fault> {
        let is_other = matches!(&*lock(&self.0), Some((_, Fault::Memory(_) | Fault::Refused(_))));
        if is_other { Ok(()) } else { self.ask() }
    }

    fn pass_mark(&self) -> Result<(), Fault> {
        if matches!(&*lock(&self.0), Some((_, Fault::Refused(_)))) { self.ask() } else { self.call() }
    }

    fn ask(&self) -> Result<(), Fault> {
        let mut plan = lock(&self.0);
        match &mut *plan {
            Some((0, PANIC)) => panic!("as planned"),
            Some((0, fault)) => Err(fault.clone()),
            Some((left, _)) => {
                *left -= 1;
                Ok(())
            }
            None => Ok(()),
        }
    }
}

impl Device for FaultyDevice {
    forward!(own: name free_memory free);

    fn alloc(&mut self, bytes: usize) -> Result<u64, Fault> {
        self.plan.ask()?;
        self.own.alloc(bytes)
    }
    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault> {
        self.plan.ask()?;
        self.own.alloc_host(bytes)
    }
    unsafe fn upload(&mut self, from: &dyn HostMemory, bytes: Range<usize>, to: u64) -> DeviceResult {
        self.plan.call()?;
        // SAFETY: the caller promises the same.
        unsafe { self.own.upload(from, bytes, to) }
    }
    unsafe fn download(&mut self, from: u64, to: &mut dyn HostMemory, bytes: Range<usize>) -> DeviceResult {
        self.plan.call()?;
        // SAFETY: the caller promises the same.
        unsafe { self.own.download(from, to, bytes) }
    }
    unsafe fn copy(&mut self, from: u64, to: u64, bytes: usize) -> Result<(), Fault> {
        self.plan.call()?;
        // SAFETY: the caller promises the same.
        unsafe { self.own.copy(from, to, bytes) }
    }
    unsafe fn launch(&mut self, launch: Launch<'_>) -> Result<(), Fault> {
        self.plan.call()?;
        // SAFETY: the caller promises the same.
        unsafe { self.own.launch(launch) }
    }
    fn mark(&mut self) -> Result<Box<dyn Mark>, Fault> {
        self.plan.call()?;
        Ok(Box::new(FaultyMark { own: self.own.mark()?, plan: FaultPlan(Arc::clone(&self.plan.0)) }))
    }
    fn wait(&mut self) -> Result<(), Fault> {
        self.plan.call()?;
        self.own.wait()
    }
}

/// A mark of such a device. Waiting for it counts as a call.
struct FaultyMark {
    own: Box<dyn Mark>,
    plan: FaultPlan,
}

impl Mark for FaultyMark {
    fn wait(&self) -> Result<(), Fault> {
        self.plan.pass_mark()?;
        self.own.wait()
    }
}

/// Collects log messages.
struct Log(Mutex<Vec<String>>);

impl log::Log for Log {
    fn enabled(&self, _: &log::Metadata) -> bool {
        true
    }
    fn log(&self, record: &log::Record) {
        if record.level() <= log::Level::Warn {
            lock(&self.0).push(record.args().to_string());
        }
    }
    fn flush(&self) {}
}

static LOG: Log = Log(Mutex::new(Vec::new()));

/// Number of logged messages that contain this text. Messages are collected from the first call on.
pub(super) fn logged(what: &str) -> usize {
    static KEPT: Once = Once::new();
    KEPT.call_once(|| {
        log::set_logger(&LOG).expect("no other logger is set");
        log::set_max_level(log::LevelFilter::Warn);
    });
    lock(&LOG.0).iter().filter(|line| line.contains(what)).count()
}

#[test]
fn a_device_that_fails_at_any_call_is_given_up_with_one_warning_and_nothing_is_lost() {
    logged("");
    let mut lost = 0;
    for calls in 0..40 {
        let Some(own) = device() else { return };
        let plan = Arc::new(Mutex::new(None));
        let engine = engine(Box::new(FaultyDevice { own, plan: FaultPlan(Arc::clone(&plan)) }), 64 << 20);
        assert!(matches!(engine.state(), EngineState::Cuda(_)));
        let name = format!("CUDA_ERROR_LAUNCH_FAILED after {calls}.");
        *lock(&plan) = Some((calls, Fault::Failed(name.clone())));
        let mut rng = Rng::with_seed(u64::from(calls));
        (0..2).for_each(|index| compare(&mut rng, index, &engine));
        let is_lost = matches!(engine.state(), EngineState::Lost(_));
        let warnings = logged(&name);
        assert_eq!(warnings, usize::from(is_lost), "after {calls} calls");
        lost += warnings;
    }
    // Two worlds may make fewer calls than the last faults wait for.
    assert!(lost > 20, "{lost}");
}

#[test]
fn a_transaction_of_several_runs_survives_a_device_that_fails_in_its_middle() {
    // Each edit reads what the previous one may change.
    let shape = |i: i32| Shape::sphere(glam::Vec3::new(30.0 + 3.0 * i as f32, 31.0, 30.0), 6.0);
    let brush = |i: i32| match i % 3 {
        0 => Brush::dig(shape(i)),
        1 => Brush::smooth(shape(i), 1.0),
        _ => Brush::raise(shape(i), 2.0),
    };
    let brushes: Vec<Brush> = (0..9).map(brush).collect();
    let ground = Arc::new(Ground::from_fn(80, 60, |x, z| 30.0 + f64::from(x * z % 5)).expect("valid"));
    let terrain = || Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid settings");
    let mut expected = terrain();
    let receipts = expected.apply(&brushes);
    let mut runs_done = Vec::new();
    for calls in (0..).step_by(3) {
        let Some(own) = device() else { return };
        let plan = Arc::new(Mutex::new(None));
        let engine = engine(Box::new(FaultyDevice { own, plan: FaultPlan(Arc::clone(&plan)) }), 64 << 20);
        let fault = if calls % 2 == 0 { Fault::Failed("in the middle".into()) } else { PANIC };
        *lock(&plan) = Some((calls, fault));
        let mut found = terrain();
        found.set_engine(engine.clone());
        assert_eq!(receipts, found.apply(&brushes), "after {calls} calls");
        assert_same(expected.world(), found.world(), u64::from(calls));
        let choices = engine.figures().choices;
        let runs = choices.iter().filter(|choice| choice.stage == Stage::Edit);
        runs_done.push(runs.filter(|choice| choice.is_cuda).count());
        if !matches!(engine.state(), EngineState::Lost(_)) {
            break;
        }
    }
    // None, some, and all seven.
    assert!(runs_done.is_sorted() && runs_done.first() == Some(&0), "{runs_done:?}");
    assert!((0..=7).all(|runs| runs_done.contains(&runs)), "{runs_done:?}");
}

#[test]
fn surfaces_that_never_arrive_are_drawn_by_the_cpu_with_all_others() {
    let half = glam::Vec3::new(40.0, 9.0, 40.0);
    let brush = Brush::dig(Shape::cuboid(glam::Vec3::new(60.0, 28.0, 60.0), half));
    let brushes = [brush.with_roughness(Roughness::new(2.0, 3.0, 5))];
    let ground = Arc::new(Ground::from_fn(120, 120, |x, z| 30.0 + f64::from(x * z % 7)).expect("valid"));
    let terrain = || Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid settings");
    let mut expected = terrain();
    expected.apply(&brushes);
    let mut lost = 0;
    for marks in 0.. {
        let Some(own) = device() else { return };
        let plan = Arc::new(Mutex::new(None));
        let engine = engine(Box::new(FaultyDevice { own, plan: FaultPlan(Arc::clone(&plan)) }), 64 << 20);
        *lock(&plan) = Some((marks, refused()));
        let mut found = terrain();
        found.set_engine(engine.clone());
        found.apply(&brushes);
        assert_same(expected.world(), found.world(), marks.into());
        if !matches!(engine.state(), EngineState::Lost(_)) {
            break;
        }
        lost += 1;
    }
    assert!(lost > 4, "{lost} pieces");
}

#[test]
fn ground_is_made_by_the_cpu_if_a_device_fails() {
    // Two slices, of which the second is short.
    let (width, depth, noise) = (1030, 1020, NoiseHeights { octaves: 1, ..NoiseHeights::default() });
    let expected = Ground::from_noise(width, depth, &noise);
    let mut failed = 0;
    for calls in 0..13 {
        let Some(own) = device() else { return };
        let plan = Arc::new(Mutex::new(None));
        let engine = engine(Box::new(FaultyDevice { own, plan: FaultPlan(Arc::clone(&plan)) }), 64 << 20);
        assert!(matches!(engine.state(), EngineState::Cuda(_)));
        *lock(&plan) = Some((calls, Fault::Failed("CUDA_ERROR_LAUNCH_FAILED".into())));
        assert_eq!(engine.ground_from_noise(width, depth, &noise), expected, "after {calls} calls");
        let reached = lock(&plan).as_ref().is_some_and(|plan| plan.0 == 0);
        let is_lost = matches!(engine.state(), EngineState::Lost(_));
        assert!(reached || !is_lost, "after {calls} calls");
        failed += u32::from(is_lost);
        assert_eq!(engine.ground_from_noise(9, 9, &noise), Ground::from_noise(9, 9, &noise));
    }
    assert_eq!(failed, 11, "calls that ground takes");
}

#[test]
fn a_device_without_memory_for_ground_is_kept() {
    let noise = NoiseHeights::default();
    let expected = Ground::from_noise(70, 50, &noise);
    let Some(own) = device() else { return };
    let plan = Arc::new(Mutex::new(None));
    let engine = engine(Box::new(FaultyDevice { own, plan: FaultPlan(Arc::clone(&plan)) }), 64 << 20);
    // Host memory twice, then device memory.
    for calls in 0..3 {
        *lock(&plan) = Some((calls, Fault::Memory(1 << 20)));
        assert_eq!(engine.ground_from_noise(70, 50, &noise), expected, "after {calls} calls");
        assert_eq!(lock(&plan).take(), Some((0, Fault::Memory(1 << 20))), "after {calls} calls");
        assert_eq!(engine.ground_from_noise(70, 50, &noise), expected, "after {calls} calls");
        assert!(matches!(engine.state(), EngineState::Cuda(_)));
    }
}

#[test]
fn a_device_that_panics_is_given_up_and_nothing_is_lost() {
    for calls in [0, 3, 9] {
        let Some(own) = device() else { return };
        let plan = Arc::new(Mutex::new(None));
        let engine = engine(Box::new(FaultyDevice { own, plan: FaultPlan(Arc::clone(&plan)) }), 64 << 20);
        *lock(&plan) = Some((calls, PANIC));
        (0..2).for_each(|index| compare(&mut Rng::with_seed(8), index, &engine));
        assert!(matches!(engine.state(), EngineState::Lost(_)), "{:?}", engine.state());
    }
}

#[test]
fn a_device_without_memory_for_a_transaction_does_the_next_one() {
    let ball = |x: f32, radius| Brush::dig(Shape::sphere(glam::Vec3::new(x, 30.0, 60.0), radius));
    for allocations in 0..12 {
        let Some(own) = device() else { return };
        let plan = Arc::new(Mutex::new(None));
        let engine = engine(Box::new(FaultyDevice { own, plan: FaultPlan(Arc::clone(&plan)) }), 64 << 20);
        let ground = Arc::new(Ground::flat(120, 120, 30.0).expect("valid"));
        let [mut expected, mut found] = [0, 1]
            .map(|_| Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid settings"));
        found.set_engine(engine.clone());
        *lock(&plan) = Some((allocations, Fault::Memory(1)));
        assert_eq!(expected.apply([ball(60.0, 40.0)]), found.apply([ball(60.0, 40.0)]));
        *lock(&plan) = None;
        let done = engine.figures().cuda;
        for x in [14.0, 106.0, 20.0] {
            assert_eq!(expected.apply([ball(x, 6.0)]), found.apply([ball(x, 6.0)]), "after {allocations}");
        }
        assert_eq!(engine.figures().cuda, done + 6, "after {allocations}");
        assert_same(expected.world(), found.world(), u64::from(allocations));
    }
}
