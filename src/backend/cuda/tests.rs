//! The device against the processor, bit by bit, and whatever can go wrong with it.
//!
//! A card is used where there is one, else the emulator. `BURROW_WORLDS` says how many random worlds.

use std::sync::Mutex;
use std::time::Duration;

use fastrand::Rng;

use super::device::{Device, Fault, HostMemory, Kernel};
use super::driver::Card;
use super::emulator::Emulator;
use super::mapped::Mapped;
use super::*;
use crate::backend::Engine;
use crate::prelude::*;
use crate::terrain::Drawn;
use crate::terrain::World;

#[path = "../../../tests/worlds/mod.rs"]
pub(super) mod worlds;

/// A device to test, if there is any.
pub(super) fn device() -> Option<Box<dyn Device>> {
    match Card::open() {
        Ok(card) => Some(Box::new(card)),
        Err(_) => Some(Box::new(Emulator::start()?)),
    }
}

/// An engine that does everything on a device, small as it may be.
fn engine(device: Box<dyn Device>, budget: usize) -> Engine {
    let engine = Engine::from_cuda(Cuda::open_with(false, Some(budget), &[(4, 3.0)], || Ok(device)));
    engine.wait(Duration::from_secs(60));
    engine
}

/// Everything that is drawn, as bits.
fn drawn(world: &World) -> Vec<(Drawn, Vec<u8>, Vec<u32>)> {
    let bits = |vertex: &crate::surface::Vertex| {
        let mut bytes = Vec::with_capacity(32);
        vertex.position.to_array().iter().for_each(|part| bytes.extend(part.to_le_bytes()));
        vertex.normal.to_array().iter().for_each(|part| bytes.extend(part.to_bits().to_le_bytes()));
        bytes.extend(vertex.materials.ids);
        bytes.extend(vertex.materials.weights);
        bytes
    };
    let all = world.drawn();
    all.map(|(drawn, mesh)| (drawn, mesh.vertices.iter().flat_map(bits).collect(), mesh.indices)).collect()
}

/// The same brushes on the processor and on an engine, in the same transactions.
fn compare(rng: &mut Rng, index: u64, engine: &Engine) {
    let seed = rng.u64(..);
    let (ground, chunk_size) = worlds::random_ground(&mut Rng::with_seed(seed), index);
    let settings = TerrainSettings { chunk_size, ..Default::default() };
    let ground = Arc::new(ground);
    let mut expected = Terrain::new(Arc::clone(&ground), &settings).expect("valid settings");
    let mut found = Terrain::new(Arc::clone(&ground), &settings).expect("valid settings");
    found.set_engine(engine.clone());
    for _ in 0..rng.u32(1..5) {
        let brush = |rng: &mut Rng| match rng.u32(0..4) {
            0 => worlds::random_brush_at_a_face(rng, &ground, chunk_size),
            _ => worlds::random_brush(rng, &ground),
        };
        let brushes: Vec<Brush> = (0..rng.u32(1..6)).map(|_| brush(rng)).collect();
        assert_eq!(expected.apply(&brushes), found.apply(&brushes), "world {index}");
    }
    assert_same(expected.world(), found.world(), index);
}

/// Worlds are the same, bit by bit.
fn assert_same(expected: &World, found: &World, index: u64) {
    assert_eq!(expected.hash(), found.hash(), "world {index}");
    assert!(drawn(expected) == drawn(found), "world {index}");
    // What bricks hold, bits and materials included; and as much memory.
    let bricks = |world: &World| {
        let mut all: Vec<_> =
            world.bricks().map(|(pos, brick)| (pos.0.to_array(), trial::contents(brick))).collect();
        all.sort_unstable();
        all
    };
    assert!(bricks(expected) == bricks(found), "world {index}");
    assert_eq!(expected.memory().samples, found.memory().samples, "world {index}");
    assert_eq!(expected.memory().materials, found.memory().materials, "world {index}");
}

#[test]
fn worlds_of_a_device_are_those_of_the_processor() {
    let Some(device) = device() else { return };
    let (name, engine) = (device.name(), engine(device, 64 << 20));
    assert_eq!(engine.state(), EngineState::Cuda(name));
    let mut rng = Rng::with_seed(11);
    let worlds = worlds::world_count(40);
    (0..worlds).for_each(|index| compare(&mut rng, index, &engine));
    let figures = engine.figures();
    assert!(matches!(engine.state(), EngineState::Cuda(_)), "{:?}", engine.state());
    assert!(figures.cuda > figures.cpu * 20, "{figures:?}");
    println!("{worlds} worlds, {} stages on the device", figures.cuda);
}

/// A device that fails when it is told to.
struct Faulty {
    own: Box<dyn Device>,
    /// Calls to go until it fails, and how; for lack of memory, only calls that ask for some.
    plan: Arc<Mutex<Option<(u32, Fault)>>>,
}

/// A fault that is a panic.
const PANIC: Fault = Fault::SelfTest;

impl Faulty {
    fn call(&self) -> Result<(), Fault> {
        if matches!(&*lock(&self.plan), Some((_, Fault::Memory(_)))) { Ok(()) } else { self.ask() }
    }

    fn ask(&self) -> Result<(), Fault> {
        let mut plan = lock(&self.plan);
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

impl Device for Faulty {
    fn name(&self) -> String {
        self.own.name()
    }
    fn free_memory(&mut self) -> usize {
        self.own.free_memory()
    }
    fn alloc(&mut self, bytes: usize) -> Result<u64, Fault> {
        self.ask()?;
        self.own.alloc(bytes)
    }
    fn free(&mut self, address: u64) {
        self.own.free(address);
    }
    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault> {
        self.ask()?;
        self.own.alloc_host(bytes)
    }
    fn upload(&mut self, from: &dyn HostMemory, bytes: std::ops::Range<usize>, to: u64) -> Result<(), Fault> {
        self.call()?;
        self.own.upload(from, bytes, to)
    }
    fn download(
        &mut self,
        from: u64,
        to: &mut dyn HostMemory,
        bytes: std::ops::Range<usize>,
    ) -> Result<(), Fault> {
        self.call()?;
        self.own.download(from, to, bytes)
    }
    fn copy(&mut self, from: u64, to: u64, bytes: usize) -> Result<(), Fault> {
        self.call()?;
        self.own.copy(from, to, bytes)
    }
    fn launch(&mut self, kernel: Kernel, blocks: u32, params: &[u8]) -> Result<(), Fault> {
        self.call()?;
        self.own.launch(kernel, blocks, params)
    }
    fn wait(&mut self) -> Result<(), Fault> {
        self.call()?;
        self.own.wait()
    }
}

/// Keeps what is logged.
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

#[test]
fn a_device_that_fails_at_any_call_is_given_up_with_one_warning_and_nothing_is_lost() {
    log::set_logger(&LOG).expect("no other test logs");
    log::set_max_level(log::LevelFilter::Warn);
    let mut lost = 0;
    for calls in 0..40 {
        let Some(own) = device() else { return };
        let plan = Arc::new(Mutex::new(None));
        let engine = engine(Box::new(Faulty { own, plan: Arc::clone(&plan) }), 64 << 20);
        assert!(matches!(engine.state(), EngineState::Cuda(_)));
        let name = format!("CUDA_ERROR_LAUNCH_FAILED after {calls}.");
        *lock(&plan) = Some((calls, Fault::Failed(name.clone())));
        let mut rng = Rng::with_seed(u64::from(calls));
        (0..2).for_each(|index| compare(&mut rng, index, &engine));
        let is_lost = matches!(engine.state(), EngineState::Lost(_));
        let warnings = lock(&LOG.0).iter().filter(|line| line.contains(&name)).count();
        assert_eq!(warnings, usize::from(is_lost), "after {calls} calls");
        lost += warnings;
    }
    // Two worlds may take fewer calls than the last ones here wait for.
    assert!(lost > 20, "{lost}");
}

#[test]
fn ground_is_made_by_the_processor_where_a_device_fails() {
    // Two slices, the second one short.
    let (width, depth, noise) = (1030, 1020, NoiseHeights { octaves: 1, ..NoiseHeights::default() });
    let expected = Ground::from_noise(width, depth, &noise);
    let mut failed = 0;
    for calls in 0..13 {
        let Some(own) = device() else { return };
        let plan = Arc::new(Mutex::new(None));
        let engine = engine(Box::new(Faulty { own, plan: Arc::clone(&plan) }), 64 << 20);
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
    let engine = engine(Box::new(Faulty { own, plan: Arc::clone(&plan) }), 64 << 20);
    // Memory of the host twice, then of the device.
    for calls in 0..3 {
        *lock(&plan) = Some((calls, Fault::Memory(1 << 20)));
        assert_eq!(engine.ground_from_noise(70, 50, &noise), expected, "after {calls} calls");
        assert_eq!(lock(&plan).take(), Some((0, Fault::Memory(1 << 20))), "after {calls} calls");
        assert_eq!(engine.ground_from_noise(70, 50, &noise), expected, "after {calls} calls");
        assert!(matches!(engine.state(), EngineState::Cuda(_)));
    }
}

#[test]
fn ground_that_can_not_be_made_gives_the_same_error_on_a_device() {
    let Some(device) = device() else { return };
    let (name, engine) = (device.name(), engine(device, 64 << 20));
    let good = NoiseHeights::default();
    for (width, noise) in [
        (0, good),
        (u32::MAX, good),
        (40, NoiseHeights { octaves: 17, ..good }),
        (40, NoiseHeights { scale: 0.5, ..good }),
        (40, NoiseHeights { base: f64::INFINITY, ..good }),
        (40, NoiseHeights { base: 32_768.0, ..good }),
    ] {
        let expected = Ground::from_noise(width, 30, &noise);
        assert!(expected.is_err());
        assert_eq!(engine.ground_from_noise(width, 30, &noise), expected);
    }
    // Refused heights are no fault of the device.
    assert_eq!(engine.state(), EngineState::Cuda(name));
}

#[test]
fn a_device_that_can_not_be_opened_is_no_device() {
    for fault in [
        Fault::NoDriver,
        Fault::NoDevice("CUDA_ERROR_NO_DEVICE".into()),
        Fault::OldDevice(6, 1),
        Fault::Refused("CUDA_ERROR_UNSUPPORTED_PTX_VERSION".into()),
        Fault::Memory(1 << 30),
    ] {
        let text = fault.to_string();
        let engine = Engine::from_cuda(Cuda::open_with(false, None, trial::FULL, move || Err(fault)));
        assert_eq!(engine.wait(Duration::from_secs(9)), EngineState::Lost(text));
        compare(&mut Rng::with_seed(3), 3, &engine);
    }
}

/// What the test below starts in a process of its own.
#[test]
#[ignore = "looks at the machine's driver"]
fn tell_what_the_driver_says() {
    let engine = Engine::new(crate::backend::Backend::Cuda);
    println!("state: {:?}", engine.wait(Duration::from_secs(30)));
    compare(&mut Rng::with_seed(3), 3, &engine);
}

/// A driver's library that knows errors only, each with its code.
#[test]
fn a_driver_without_a_device_is_no_device() {
    let folder = std::env::temp_dir().join(format!("burrow-driver-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for the library");
    for (code, name) in [(100, "CUDA_ERROR_NO_DEVICE"), (35, "CUDA_ERROR_INSUFFICIENT_DRIVER")] {
        let source = format!(
            "int cuInit(unsigned flags) {{ (void)flags; return {code}; }}\n\
             int cuGetErrorName(int code, const char** name) {{ (void)code; *name = \"{name}\"; return 0; }}\n"
        );
        std::fs::write(folder.join("driver.c"), source).expect("a source file");
        let cc = std::process::Command::new("cc")
            .args(["-shared", "-fPIC", "-o", "libcuda.so", "driver.c"])
            .current_dir(&folder)
            .status();
        if !cc.is_ok_and(|status| status.success()) {
            println!("no C compiler for a driver's library");
            break;
        }
        std::fs::copy(folder.join("libcuda.so"), folder.join("libcuda.so.1")).expect("a copy");
        let said = std::process::Command::new(std::env::current_exe().expect("this test"))
            .args(["--exact", "backend::cuda::tests::tell_what_the_driver_says", "--ignored", "--nocapture"])
            .env("LD_LIBRARY_PATH", &folder)
            .output()
            .expect("this test can be started again");
        let text = String::from_utf8_lossy(&said.stdout).into_owned();
        assert!(said.status.success(), "{text}{}", String::from_utf8_lossy(&said.stderr));
        assert!(text.contains(&format!("Lost(\"there is no CUDA device: {name}\")")), "{text}");
    }
    std::fs::remove_dir_all(&folder).expect("the folder can go");
}

#[test]
fn a_device_that_computes_something_else_is_not_trusted() {
    /// Turns a bit of every read.
    struct Liar(Box<dyn Device>);
    impl Device for Liar {
        fn name(&self) -> String {
            self.0.name()
        }
        fn free_memory(&mut self) -> usize {
            self.0.free_memory()
        }
        fn alloc(&mut self, bytes: usize) -> Result<u64, Fault> {
            self.0.alloc(bytes)
        }
        fn free(&mut self, address: u64) {
            self.0.free(address);
        }
        fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault> {
            self.0.alloc_host(bytes)
        }
        fn upload(
            &mut self,
            from: &dyn HostMemory,
            bytes: std::ops::Range<usize>,
            to: u64,
        ) -> Result<(), Fault> {
            self.0.upload(from, bytes, to)
        }
        fn download(
            &mut self,
            from: u64,
            to: &mut dyn HostMemory,
            bytes: std::ops::Range<usize>,
        ) -> Result<(), Fault> {
            self.0.download(from, to, bytes.clone())?;
            // The last bit of a density, of a normal or of a hash.
            if bytes.len() > 1000 {
                to.bytes_mut()[bytes][512] ^= 1;
            }
            Ok(())
        }
        fn copy(&mut self, from: u64, to: u64, bytes: usize) -> Result<(), Fault> {
            self.0.copy(from, to, bytes)
        }
        fn launch(&mut self, kernel: Kernel, blocks: u32, params: &[u8]) -> Result<(), Fault> {
            self.0.launch(kernel, blocks, params)
        }
        fn wait(&mut self) -> Result<(), Fault> {
            self.0.wait()
        }
    }
    // A card writes to the host's memory without a copy, so only the emulator can be made to lie here.
    let Some(emulator) = Emulator::start() else { return };
    let engine = engine(Box::new(Liar(Box::new(emulator))), 64 << 20);
    assert_eq!(engine.state(), EngineState::Lost(Fault::SelfTest.to_string()));
}

#[test]
fn a_small_budget_is_kept_and_nothing_is_lost() {
    let Some(device) = device() else { return };
    // Bricks for a handful of brushes; larger transactions go to the processor.
    let engine = engine(device, 1 << 20);
    let mut rng = Rng::with_seed(5);
    (0..worlds::world_count(40) / 4).for_each(|index| compare(&mut rng, index, &engine));
    let ball = |x: f32, z: f32, radius| vec![Brush::dig(Shape::sphere(glam::Vec3::new(x, 30.0, z), radius))];
    let mut transactions = vec![ball(80.0, 80.0, 45.0)];
    for i in 0..24 {
        transactions.push(ball(10.0 + (i % 6 * 28) as f32, 12.0 + (i / 6 * 44) as f32, 6.0));
    }
    transactions.insert(12, ball(70.0, 90.0, 50.0));
    compare_on(Ground::flat(160, 160, 30.0).expect("valid"), 32, &[&engine], &transactions);
    let figures = engine.figures();
    assert!(figures.cuda > 0, "{figures:?}");
    // What the processor took is not expected of it, where the card was tried before.
    let mut given_up =
        figures.choices.iter().filter(|choice| !choice.is_cuda && choice.amount > 0).peekable();
    assert!(given_up.peek().is_some() && given_up.all(|choice| choice.estimate.is_none()), "{figures:?}");
}

#[test]
fn a_device_that_panics_is_given_up_and_nothing_is_lost() {
    for calls in [0, 3, 9] {
        let Some(own) = device() else { return };
        let plan = Arc::new(Mutex::new(None));
        let engine = engine(Box::new(Faulty { own, plan: Arc::clone(&plan) }), 64 << 20);
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
        let engine = engine(Box::new(Faulty { own, plan: Arc::clone(&plan) }), 64 << 20);
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

/// Transactions on the processor and on engines that take turns, on ground that is given.
fn compare_on(ground: Ground, chunk_size: u32, engines: &[&Engine], transactions: &[Vec<Brush>]) {
    let settings = TerrainSettings { chunk_size, ..Default::default() };
    let ground = Arc::new(ground);
    let [mut expected, mut found] =
        [0, 1].map(|_| Terrain::new(Arc::clone(&ground), &settings).expect("valid settings"));
    for (number, brushes) in transactions.iter().enumerate() {
        found.set_engine(engines[number % engines.len()].clone());
        assert_eq!(expected.apply(brushes), found.apply(brushes), "transaction {number}");
        assert_same(expected.world(), found.world(), number as u64);
    }
    for engine in engines {
        assert!(matches!(engine.state(), EngineState::Cuda(_)), "{:?}", engine.state());
    }
}

/// An engine whose kernels write short lists to the host's memory, as those of a card do.
fn mapped() -> Option<Engine> {
    Some(engine(Box::new(Mapped::new(Box::new(Emulator::start()?))), 64 << 20))
}

#[test]
fn kernels_that_reach_the_hosts_memory_make_the_same_worlds() {
    let Some(engine) = mapped() else { return };
    let mut rng = Rng::with_seed(12);
    (0..worlds::world_count(40) / 2).for_each(|index| compare(&mut rng, index, &engine));
    assert!(matches!(engine.state(), EngineState::Cuda(_)), "{:?}", engine.state());
}

#[test]
fn a_brick_all_of_whose_materials_are_gone_is_the_processors() {
    let Some(device) = device() else { return };
    let engine = engine(device, 64 << 20);
    let sphere = |radius| Shape::sphere(glam::Vec3::new(48.0, 80.0, 48.0), radius);
    let transactions = [
        vec![Brush::add(sphere(24.0), MaterialId(3))],
        vec![Brush::dig(sphere(25.0))],
        vec![Brush::paint(sphere(30.0), MaterialId(3)), Brush::dig(sphere(26.0))],
        vec![Brush::add(sphere(20.0), MaterialId::GROUND)],
    ];
    compare_on(Ground::flat(96, 96, 40.0).expect("valid"), 32, &[&engine], &transactions);
}

#[test]
fn short_and_long_transactions_take_turns() {
    let small = |i: i32| {
        let center = glam::Vec3::new(20.0 + 7.0 * i as f32, 30.0, 30.0);
        [Brush::dig(Shape::sphere(center, 5.0)), Brush::add(Shape::sphere(center, 3.0), MaterialId(i as u8))]
    };
    let large = |y: f32| {
        let half = glam::Vec3::new(44.0, 13.0, 40.0);
        let center = glam::Vec3::new(60.0, y, 60.0);
        let cuboid = Shape::Cuboid { center, half, rotation: Default::default() };
        Brush::dig(cuboid).with_roughness(Roughness::new(2.0, 3.0, 5))
    };
    // Many edits of few bricks: short lists that overflow.
    let many = |n: i32| (0..n).flat_map(|i| small(i % 9)).collect::<Vec<_>>();
    let transactions = [
        small(0).to_vec(),
        many(150),
        small(1).to_vec(),
        vec![large(20.0)],
        small(2).to_vec(),
        many(40),
        vec![],
        vec![large(10.0), large(30.0)],
        vec![Brush::dig(Shape::sphere(glam::Vec3::splat(-900.0), 5.0))],
        small(3).to_vec(),
    ];
    for engine in [mapped(), device().map(|device| engine(device, 64 << 20))] {
        let Some(engine) = engine else { return };
        let ground = || Ground::from_fn(120, 120, |x, z| 30.0 + f64::from(x * z % 7)).expect("valid");
        compare_on(ground(), 32, &[&engine], &transactions);
        let rule = MaterialRule { overlay: MaterialId(2), height: (0.0, 33.0), ..Default::default() };
        let control = MaterialControl::Rules { base: MaterialId(1), rules: vec![rule] };
        let ground = ground().with_materials(&control).expect("valid");
        compare_on(ground, 25, &[&engine], &transactions);
    }
}

#[test]
fn engines_take_turns_with_the_same_bricks() {
    let Some(first) = mapped() else { return };
    let Some(second) = device() else { return };
    let second = engine(second, 1 << 20);
    let mut rng = Rng::with_seed(21);
    let (ground, chunk_size) = worlds::random_ground(&mut rng, 3);
    let transactions: Vec<Vec<Brush>> =
        (0..24).map(|_| (0..3).map(|_| worlds::random_brush(&mut rng, &ground)).collect()).collect();
    compare_on(ground, chunk_size, &[&first, &second], &transactions);
}

#[test]
fn a_high_cliff_at_the_end_of_the_lattice_is_the_processors() {
    let Some(device) = device() else { return };
    let engine = engine(device, 64 << 20);
    let top = f64::from(crate::lattice::LIMIT);
    let low = top - 1500.0;
    let ground = Ground::from_fn(24, 20, |x, _| if x < 20 { low } else { top }).expect("valid");
    let at = |x: f32, y: f64, z: f32| glam::Vec3::new(x, y as f32, z);
    let transactions = [
        vec![Brush::dig(Shape::sphere(at(21.0, top - 700.0, 8.0), 4.0))],
        vec![Brush::add(Shape::sphere(at(24.0, top, 20.0), 6.0), MaterialId(4))],
        vec![Brush::paint(Shape::sphere(at(21.0, low, 0.0), 9.0), MaterialId(1))],
    ];
    compare_on(ground, 8, &[&engine], &transactions);
}

#[test]
fn what_a_card_does_not_know_is_the_processors_in_the_same_transaction() {
    let Some(first) = mapped() else { return };
    let Some(second) = device() else { return };
    let second = engine(second, 64 << 20);
    let mut rng = Rng::with_seed(31);
    for index in 0..worlds::world_count(40) / 4 {
        let (ground, chunk_size) = worlds::random_ground(&mut rng, index);
        let brushes = |rng: &mut Rng| (0..5).map(|_| worlds::any_random_brush(rng, &ground)).collect();
        let transactions: Vec<Vec<Brush>> = (0..4).map(|_| brushes(&mut rng)).collect();
        compare_on(ground, chunk_size, &[&first, &second], &transactions);
    }
    let stages = |engine: &Engine, stage| {
        let choices = engine.figures().choices;
        let of = |is_cuda| {
            let is = |choice: &&crate::backend::Choice| choice.stage == stage && choice.is_cuda == is_cuda;
            choices.iter().filter(is).count()
        };
        (of(true), of(false))
    };
    for engine in [&first, &second] {
        let (on_card, on_processor) = stages(engine, Stage::Edit);
        assert!(on_card > 0 && on_processor > 0, "{on_card} {on_processor}");
        assert!(stages(engine, Stage::Mesh).0 > 0, "meshes go to the card");
    }
}
