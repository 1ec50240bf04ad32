//! When a device is opened, and what triggers it.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::backend::{Backend, EngineSettings};

/// An engine whose device cannot be opened, and the number of attempts.
fn counted(is_auto: bool) -> (Engine, Arc<AtomicUsize>) {
    let opened = Arc::new(AtomicUsize::new(0));
    let own = Arc::clone(&opened);
    let device = move |_| {
        own.fetch_add(1, Ordering::SeqCst);
        Err(Fault::NoDriver)
    };
    (Engine::from_cuda(Cuda::with_device(is_auto, limits(0), &[], device)), opened)
}

fn terrain(engine: &Engine) -> Terrain {
    let ground = Ground::flat(96, 96, 30.0).expect("valid");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    terrain.set_engine(engine.clone());
    terrain
}

fn dig(radius: f32) -> [Brush; 1] {
    [Brush::dig(Shape::sphere(glam::Vec3::new(48.0, 30.0, 48.0), radius))]
}

/// Number of threads of this process.
fn threads() -> Option<usize> {
    Some(std::fs::read_dir("/proc/self/task").ok()?.count())
}

#[test]
fn an_unused_engine_opens_no_gpu() {
    // Attempts to open a device are counted; that no thread is started that could do so later is the next test.
    for is_auto in [true, false] {
        let (engine, opened) = counted(is_auto);
        assert_eq!((engine.state(), opened.load(Ordering::SeqCst)), (EngineState::Unopened, 0));
        assert_eq!(engine.figures(), Default::default());
        drop(engine);
        assert_eq!(opened.load(Ordering::SeqCst), 0);
    }
    for backend in [Backend::Auto, Backend::Cuda] {
        assert_eq!(Engine::new(backend).state(), EngineState::Unopened);
    }
    assert_eq!(Engine::new(Backend::Cpu).state(), EngineState::Cpu);
}

/// Runs in a separate process, where no other test starts threads.
#[test]
#[ignore = "counts the threads of its process"]
fn count_threads_of_engines() {
    let before = threads();
    let engines: Vec<Engine> = (0..100).map(|_| Engine::with_settings(&EngineSettings::default())).collect();
    assert_eq!(threads(), before);
    drop(engines);
}

#[test]
fn an_unused_engine_starts_no_thread() {
    let test = "backend::cuda::tests::opening::count_threads_of_engines";
    let own = std::env::current_exe().expect("this test");
    let said =
        std::process::Command::new(own).args(["--exact", test, "--ignored"]).output().expect("it runs");
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stdout));
}

#[test]
fn small_brushes_open_no_gpu() {
    let (engine, opened) = counted(true);
    let mut terrain = terrain(&engine);
    (0..50).for_each(|_| drop(terrain.apply(dig(4.0))));
    assert_eq!((engine.state(), opened.load(Ordering::SeqCst)), (EngineState::Unopened, 0));
}

#[test]
fn a_large_transaction_opens_the_gpu_once_and_does_not_wait_for_it() {
    let (engine, opened) = counted(true);
    let mut terrain = terrain(&engine);
    for _ in 0..3 {
        let large = Brush::dig(Shape::sphere(glam::Vec3::new(48.0, 30.0, 48.0), 40.0));
        terrain.apply([large.with_roughness(Roughness::new(2.0, 3.0, 5))]);
        terrain.undo();
    }
    assert_eq!(engine.wait(Duration::from_secs(9)), EngineState::Lost(Fault::NoDriver.to_string()));
    assert_eq!(opened.load(Ordering::SeqCst), 1);
    assert_eq!(engine.figures().cuda, 0);
}

#[test]
fn an_engine_set_to_cuda_opens_the_gpu_for_its_first_transaction() {
    let (engine, opened) = counted(false);
    let mut terrain = terrain(&engine);
    // An empty transaction does not count.
    terrain.apply::<Brush>([]);
    assert_eq!(engine.state(), EngineState::Unopened);
    terrain.apply(dig(2.0));
    assert_ne!(engine.state(), EngineState::Unopened);
    engine.wait(Duration::from_secs(9));
    assert_eq!(opened.load(Ordering::SeqCst), 1);
}

#[test]
fn waiting_for_a_gpu_opens_it() {
    for is_auto in [false, true] {
        let (engine, opened) = counted(is_auto);
        assert_eq!(engine.wait(Duration::from_secs(9)), EngineState::Lost(Fault::NoDriver.to_string()));
        assert_eq!(opened.load(Ordering::SeqCst), 1);
    }
}

#[test]
fn the_gpu_that_a_game_suggests_is_opened() {
    let (said, heard) = std::sync::mpsc::channel();
    let device = move |gpu| {
        said.send(gpu).expect("the test listens");
        Err(Fault::NoDriver)
    };
    let engine = Engine::from_cuda(Cuda::with_device(true, limits(0), &[], device));
    let gpu = GpuChoice::PciBusId("0000:01:00.0".into());
    engine.suggest_gpu(gpu.clone());
    engine.wait(Duration::from_secs(9));
    assert_eq!(heard.recv(), Ok(Some(gpu)));
}
