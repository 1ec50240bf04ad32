//! Who does a stage: the faster of both, by what is known of them.

use super::faults::logged;
use super::room::Tight;
use super::*;
use crate::backend::costs::{Costs, Load};
use crate::backend::{Choice, Compute, Cpu, Estimate, Stage};
use crate::lattice::{BrickPos, LatticeBox};
use crate::surface::block::Parts;

/// A device that is open and needs no card, with what both take for ten blocks.
fn cuda(is_auto: bool, cpu: u64, cuda: u64) -> Cuda {
    let session = Session::new(Box::new(Tight::new(1 << 30, 1 << 30)), 1 << 20).expect("a session");
    let mut costs = Costs::default();
    for (curve, micros) in costs.mesh.iter_mut().zip([cpu, cuda]) {
        curve.push(10, Duration::from_micros(micros));
    }
    // Edits take the same on both, and are the device's where meshing is.
    costs.edit.iter_mut().for_each(|curve| curve.push(10, Duration::from_micros(3)));
    costs.upload = 1e-6;
    let place = Place::Open(Box::new(session), Box::new(costs));
    Cuda {
        is_auto,
        slot: Arc::new(Mutex::new(place)),
        state: Arc::new(Mutex::new(EngineState::Cuda("tight".into()))),
        trial: Arc::default(),
        has_passed: AtomicBool::default(),
    }
}

fn blocks(amount: usize) -> Load {
    Load { amount, ..Load::default() }
}

/// Is a stage the device's, which would do it if it were asked? And what was written down of that.
fn offered(cuda: &Cuda, stage: Stage, load: Load, missing: usize) -> (bool, Choice) {
    let mut choice = Choice::of(stage, load.amount);
    let (done, _) = cuda.offer(&mut choice, load, |_| missing, |_| Ok(()), |_, done| Ok(done));
    assert_eq!(done.is_some(), choice.is_cuda);
    (done.is_some(), choice)
}

#[test]
fn auto_takes_the_device_where_it_is_faster_and_nowhere_else() {
    for (cpu, device, is_device) in [(20, 19, true), (20, 20, false), (19, 20, false)] {
        let auto = cuda(true, cpu, device);
        let (is_taken, choice) = offered(&auto, Stage::Mesh, blocks(10), 0);
        let micros = Duration::from_micros;
        assert_eq!(choice.estimate, Some(Estimate { cpu: micros(cpu), cuda: micros(device) }));
        assert_eq!(is_taken, is_device, "{cpu} beside {device}");
    }
    // A device that somebody asked for does all, but what is nothing.
    let asked = cuda(false, 1, 100);
    assert!(offered(&asked, Stage::Mesh, blocks(10), 50).0);
    assert!(!offered(&asked, Stage::Mesh, blocks(0), 0).0);
    assert!(!offered(&cuda(true, 100, 1), Stage::Mesh, blocks(0), 0).0);
}

#[test]
fn what_the_device_does_not_have_counts_against_it() {
    let auto = cuda(true, 20, 10);
    for (missing, is_device) in [(0, true), (9, true), (10, false), (11, false)] {
        let (is_taken, choice) = offered(&auto, Stage::Mesh, blocks(10), missing);
        assert_eq!((is_taken, choice.missing), (is_device, missing));
    }
    // Where it is slower in any case, nobody looks.
    let mut choice = Choice::of(Stage::Mesh, 10);
    let slower = cuda(true, 10, 20);
    let (done, _) =
        slower.offer(&mut choice, blocks(10), |_| panic!("looked"), |_| Ok(()), |_, done| Ok(done));
    assert!(done.is_none() && choice.missing == 0);
}

#[test]
fn edits_are_chosen_by_what_edits_take() {
    let auto = cuda(true, 20, 10);
    let (is_taken, choice) = offered(&auto, Stage::Edit, blocks(8), 0);
    // Ten blocks are meshed for eight bricks, on the device either way: edited on the processor, they have to be brought.
    let micros = Duration::from_micros;
    assert_eq!(choice.estimate, Some(Estimate { cpu: micros(3 + 10 + 8), cuda: micros(3 + 10) }));
    assert!(is_taken);
    assert!(!offered(&auto, Stage::Edit, blocks(8), 8).0);
}

#[test]
fn a_device_is_given_up_for_what_does_not_pass() {
    for (fault, is_kept) in [
        (Fault::TooLarge(1_234_003), true),
        (Fault::Memory(1_234_009), true),
        (Fault::Failed("gone for good".into()), false),
    ] {
        let own = cuda(true, 20, 10);
        assert_eq!(logged(&fault.to_string()), 0);
        for _ in 0..3 {
            let mut choice = Choice::of(Stage::Mesh, 10);
            let work = |_: &mut Session| Err::<(), Fault>(fault.clone());
            let (done, _) = own.offer(&mut choice, blocks(10), |_| 0, work, |_, done| Ok(done));
            // What was lost on trying is no expectation.
            assert!(done.is_none() && !choice.is_cuda && choice.estimate.is_none());
            assert_eq!(logged(&fault.to_string()), 1, "one warning, and no other");
        }
        assert_eq!(matches!(own.state(), EngineState::Cuda(_)), is_kept, "{fault}");
        assert_eq!(offered(&own, Stage::Mesh, blocks(10), 0).0, is_kept, "{fault}");
    }
}

#[test]
fn who_panics_over_what_was_done_panics_and_the_device_is_kept() {
    let own = cuda(true, 20, 10);
    let mut choice = Choice::of(Stage::Mesh, 10);
    let then = |_: &mut Session, ()| -> Result<u32, Fault> { panic!("as planned") };
    let offer = || own.offer(&mut choice, blocks(10), |_| 0, |_| Ok(()), then);
    assert!(catch_unwind(AssertUnwindSafe(offer)).is_err());
    assert!(matches!(own.state(), EngineState::Cuda(_)));
    assert!(offered(&own, Stage::Mesh, blocks(10), 0).0);
}

#[test]
fn who_panics_while_surfaces_arrive_leaves_the_device_to_others() {
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
    let mesh = |then: &mut dyn FnMut(&dyn FreshParts)| engine.compute().mesh(&view, &blocks, &|| {}, then);
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
fn whoever_comes_while_surfaces_are_drawn_goes_on_without_the_device() {
    let own = cuda(true, 20, 10);
    let mut choice = Choice::of(Stage::Mesh, 10);
    let late = Choice { estimate: Some(Estimate::default()), ..choice };
    let draw = |_: &mut Session, ()| {
        own.learn(&late, blocks(10));
        Ok(offered(&own, Stage::Mesh, blocks(10), 0).0)
    };
    let (is_other, _) = own.offer(&mut choice, blocks(10), |_| 0, |_| Ok(()), draw);
    assert_eq!(is_other, Some(false));
    assert!(offered(&own, Stage::Mesh, blocks(10), 0).0);
}

#[test]
fn auto_knows_from_its_trial_what_both_take_and_learns_from_what_they_do() {
    let Some(device) = device() else { return };
    let (name, sizes) = (device.name(), self_test::Sizes::few(&[(1, 2.0), (4, 3.0)], Some((5, 5.0))));
    let auto = Cuda::open_with(true, Some(64 << 20), sizes, || Ok(device));
    let slot = Arc::clone(&auto.slot);
    let engine = Engine::from_cuda(auto);
    assert_eq!(engine.wait(Duration::from_secs(60)), EngineState::Cuda(name));
    assert!(!engine.figures().trial.is_zero());
    let costs = || match &*lock(&slot) {
        Place::Open(_, costs) => costs.clone(),
        _ => panic!("the device is there"),
    };
    let load = Load { rough: 80, careful: 80, missing: 9, ..blocks(80) };
    let estimates = |costs: &Costs| [costs.choose(Stage::Edit, load).0, costs.choose(Stage::Mesh, load).0];
    let before = costs();
    // More takes longer, and the largest was measured too. A card may take as long for either.
    for on in [0, 1] {
        let curves = || [&before.edit, &before.careful, &before.mesh].map(|curves| &curves[on]).into_iter();
        assert!(curves().all(|curve| 0.0 < curve.at(1) && curve.at(40) <= curve.at(4000)), "{before:?}");
        assert!(curves().any(|curve| curve.at(40) < curve.at(4000)), "{before:?}");
    }
    // Whoever does them, and looks at the other one now and then.
    for _ in 0..4 {
        (0..10).for_each(|index| compare(&mut Rng::with_seed(index), index, &engine));
    }
    let figures = engine.figures();
    assert!(figures.cpu > 40, "{figures:?}");
    assert!(
        figures.choices.iter().all(|choice| choice.estimate.is_some_and(|estimate| !estimate.cpu.is_zero()))
    );
    assert_ne!(estimates(&before), estimates(&costs()), "nothing was learnt");
}
