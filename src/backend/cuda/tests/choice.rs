//! Which backend runs a stage: the one expected to be faster.

use super::faults::logged;
use super::output_lists::SmallDevice;
use super::*;
use crate::backend::costs::Kind;
use crate::backend::{Choice, Compute, Cpu, Stage};
use crate::lattice::{BrickPos, LatticeBox};
use crate::surface::block::Parts;

/// A simulated device that is open, with measured times for sixteen blocks in microseconds.
fn open_cuda(is_auto: bool, cpu: u64, cuda: u64) -> Cuda {
    let own = Cuda::with_device(is_auto, limits(1 << 20), &[], |_| panic!("it is open"));
    let session = Session::new(Box::new(SmallDevice::new(1 << 30, 1 << 30)), 1 << 20).expect("a session");
    *lock(&own.pending) = None;
    *lock(&own.shared.session) = Some(Box::new(session));
    *lock(&own.shared.state) = EngineState::Cuda("tight".into());
    for (is_cuda, micros) in [(false, cpu), (true, cuda)] {
        for is_cold in [false, true] {
            let load = Load { is_cold, ..Load::of_blocks(16) };
            let micros = micros + if is_cold && is_cuda { 8 } else { 0 };
            lock(&own.costs).learn(load, is_cuda, false, Duration::from_micros(micros), false);
        }
    }
    own
}

/// Offers a mesh stage of this many blocks to the device; returns whether it ran there, and the record of the
/// choice.
fn attempt(cuda: &Cuda, blocks: usize, missing: usize) -> (bool, Choice) {
    let mut choice = Choice::of(Stage::Mesh, blocks);
    let load = Load::of_blocks(blocks);
    let attempt = cuda.attempt_stage(&mut choice, load, |_| missing, |_| Ok(()), |_, done| Ok(done));
    assert_eq!(attempt.done.is_some(), choice.is_cuda);
    (choice.is_cuda, choice)
}

#[test]
fn auto_takes_the_device_where_it_is_faster_and_nowhere_else() {
    for (cpu, device, is_device) in [(20, 19, true), (20, 20, false), (19, 20, false)] {
        let auto = open_cuda(true, cpu, device);
        let (is_taken, choice) = attempt(&auto, 16, 0);
        let estimate = choice.estimate.expect("both could do it");
        assert_eq!([estimate.cpu, estimate.cuda], [cpu, device].map(Duration::from_micros));
        assert_eq!(is_taken, is_device, "CPU {cpu}, device {device}");
    }
    // A device that was requested explicitly does every stage that has any work.
    let asked = open_cuda(false, 1, 100);
    assert!(attempt(&asked, 16, 50).0);
    assert!(!attempt(&asked, 0, 0).0);
    assert!(!attempt(&open_cuda(true, 100, 1), 0, 0).0);
}

#[test]
fn what_the_device_does_not_have_counts_against_it() {
    let auto = open_cuda(true, 20, 15);
    for (missing, is_device) in [(0, true), (8, true), (9, false), (90, false)] {
        let (is_taken, choice) = attempt(&auto, 16, missing);
        assert_eq!((is_taken, choice.missing), (is_device, missing));
    }
    // If the device is slower in any case, missing data is not counted.
    let mut choice = Choice::of(Stage::Mesh, 16);
    let slower = open_cuda(true, 10, 20);
    let load = Load::of_blocks(16);
    let attempt =
        slower.attempt_stage(&mut choice, load, |_| panic!("looked"), |_| Ok(()), |_, done| Ok(done));
    assert!(attempt.done.is_none() && choice.missing == 0);
}

#[test]
fn a_device_is_given_up_for_what_does_not_pass() {
    for (fault, is_kept) in [
        (Fault::TooLarge(1_234_003), true),
        (Fault::Memory(1_234_009), true),
        (Fault::Failed("gone for good".into()), false),
    ] {
        let own = open_cuda(true, 20, 10);
        assert_eq!(logged(&fault.to_string()), 0);
        for _ in 0..3 {
            let mut choice = Choice::of(Stage::Mesh, 16);
            let work = |_: &mut Session| Err::<(), Fault>(fault.clone());
            let attempt =
                own.attempt_stage(&mut choice, Load::of_blocks(16), |_| 0, work, |_, done| Ok(done));
            // A failed attempt leaves no estimate.
            assert!(attempt.done.is_none() && !choice.is_cuda && choice.estimate.is_none());
            assert_eq!(logged(&fault.to_string()), 1, "one warning, and no other");
        }
        assert_eq!(matches!(own.state(), EngineState::Cuda(_)), is_kept, "{fault}");
        assert_eq!(attempt(&own, 16, 0).0, is_kept, "{fault}");
    }
}

#[test]
fn time_that_was_lost_on_a_device_is_the_devices() {
    let own = open_cuda(true, 20, 10);
    let mut choice = Choice::of(Stage::Mesh, 16);
    let work = |_: &mut Session| Err::<(), Fault>(Fault::TooLarge(1_234_101));
    let tried = own.attempt_stage(&mut choice, Load::of_blocks(16), |_| 0, work, |_, done| Ok(done));
    choice.took = Duration::from_micros(500);
    (0..2).for_each(|_| own.learn(&choice, &tried));
    let estimate = attempt(&own, 16, 0).1.estimate.expect("both could do it");
    assert_eq!([estimate.cpu, estimate.cuda], [20, 500].map(Duration::from_micros));
}

#[test]
fn a_panic_over_results_is_passed_on_and_the_device_is_kept() {
    let own = open_cuda(true, 20, 10);
    let mut choice = Choice::of(Stage::Mesh, 16);
    let on_done = |_: &mut Session, ()| -> Result<u32, Fault> { panic!("as planned") };
    let attempt_stage = || own.attempt_stage(&mut choice, Load::of_blocks(16), |_| 0, |_| Ok(()), on_done);
    assert!(catch_unwind(AssertUnwindSafe(attempt_stage)).is_err());
    assert!(matches!(own.state(), EngineState::Cuda(_)));
    assert!(attempt(&own, 16, 0).0);
}

#[test]
fn a_panic_while_surfaces_arrive_releases_the_device() {
    let Some(engine) = async_copies() else { return };
    let half = glam::Vec3::new(40.0, 9.0, 40.0);
    let brush = Brush::dig(Shape::cuboid(glam::Vec3::new(60.0, 28.0, 60.0), half));
    let ground = Ground::from_fn(120, 120, |x, z| 30.0 + f64::from(x * z % 7)).expect("valid");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    terrain.apply([brush.with_roughness(Roughness::new(2.0, 3.0, 5))]);
    let view = terrain.world().view();
    let around = LatticeBox { min: glam::IVec3::ZERO, max: glam::IVec3::new(119, 47, 119) };
    let mut bricks: Vec<BrickPos> = BrickPos::covering(around).collect();
    bricks.sort_unstable_by_key(|brick| (brick.0.x, brick.0.z, brick.0.y));
    let block = |&brick: &BrickPos| Block { brick, chunk: view.grid.chunk_of(brick.origin()) };
    let blocks: Vec<Block> = bricks.iter().map(block).collect();
    let mesh =
        |on_done: &mut dyn FnMut(&dyn MeshedBlocks)| engine.compute().mesh(&view, &blocks, &|| {}, on_done);
    let drawn = catch_unwind(AssertUnwindSafe(|| mesh(&mut |_| panic!("as planned"))));
    assert!(drawn.is_err());
    let mut found = Parts::default();
    mesh(&mut |parts| found = self_test::collected(&blocks, parts));
    assert!(matches!(engine.state(), EngineState::Cuda(_)), "{:?}", engine.state());
    let mut expected = Parts::default();
    Cpu.mesh(&view, &blocks, &|| {}, &mut |parts| expected = self_test::collected(&blocks, parts));
    assert!(found.vertices.len() > 10_000 && found.indices == expected.indices);
}

#[test]
fn callers_continue_without_a_busy_device() {
    let own = open_cuda(true, 20, 10);
    let mut choice = Choice::of(Stage::Mesh, 16);
    let draw = |_: &mut Session, ()| {
        let mut other = Choice::of(Stage::Mesh, 16);
        let attempt =
            own.attempt_stage(&mut other, Load::of_blocks(16), |_| 0, |_| Ok(()), |_, done| Ok(done));
        other.took = Duration::from_micros(20);
        own.learn(&other, &attempt);
        Ok(attempt.done.is_some())
    };
    let first = own.attempt_stage(&mut choice, Load::of_blocks(16), |_| 0, |_| Ok(()), draw);
    assert_eq!(first.done, Some(false));
    assert!(attempt(&own, 16, 0).0);
}

#[test]
fn auto_does_the_same_and_learns_what_both_take() {
    let Some(device) = device() else { return };
    let name = device.name();
    let engine = Engine::from_cuda(Cuda::with_device(true, limits(64 << 20), &[(1, 2.0)], |_| Ok(device)));
    assert_eq!(engine.wait(Duration::from_secs(60)), EngineState::Cuda(name));
    assert!(!engine.figures().opening.is_zero());
    for _ in 0..4 {
        (0..10).for_each(|index| compare(&mut Rng::with_seed(index), index, &engine));
    }
    let figures = engine.figures();
    assert!(figures.cpu > 0 && figures.cuda > 0, "{figures:?}");
    let estimates = || figures.choices.iter().filter_map(|choice| choice.estimate);
    assert!(estimates().any(|estimate| !estimate.cpu.is_zero() && !estimate.cuda.is_zero()), "{figures:?}");
}

#[test]
fn loads_are_of_the_kinds_that_take_their_own_time() {
    let ground = Ground::flat(64, 64, 20.0).expect("valid");
    let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let sphere = Shape::sphere(glam::Vec3::new(30.0, 20.0, 30.0), 5.0);
    let dig = Brush::dig(sphere);
    let load = |brushes: &[Brush]| {
        let edits: Vec<_> =
            brushes.iter().map(|brush| crate::brush::Edit::quantize(brush).expect("valid")).collect();
        let (view, grid) = (terrain.world().samples(), terrain.world().grid());
        Load::of_edits(&PreparedEdits::new(view, grid, &edits.iter().collect::<Vec<_>>()))
    };
    let [one, two] = [load(std::slice::from_ref(&dig)), load(&[dig.clone(), dig.clone()])];
    assert_eq!([one.kind, two.kind], [Kind::Edit; 2]);
    assert_eq!(two.amount, 2 * one.amount);
    assert_eq!(load(&[dig.clone().with_roughness(Roughness::new(1.0, 4.0, 1))]).kind, Kind::Rough);
    assert_eq!(load(&[dig, Brush::smooth(sphere, 1.0)]).kind, Kind::Stencil);
}
