//! Memory of device and host stays within its limits, and is freed when no longer needed.

use super::*;

fn ground() -> Arc<Ground> {
    Arc::new(Ground::from_fn(160, 160, |x, z| 30.0 + f64::from(x * z % 7)).expect("valid"))
}

fn large() -> Brush {
    let half = glam::Vec3::new(60.0, 12.0, 60.0);
    let cuboid = Brush::dig(Shape::cuboid(glam::Vec3::new(80.0, 26.0, 80.0), half));
    cuboid.with_roughness(Roughness::new(2.0, 3.0, 5))
}

fn small(number: usize) -> Brush {
    Brush::dig(Shape::sphere(glam::Vec3::new(20.0 + 6.0 * number as f32, 22.0, 70.0), 4.0))
}

/// Two equal worlds, one edited on the CPU and one on an engine.
struct Pair {
    expected: Terrain,
    found: Terrain,
    engine: Engine,
}

impl Pair {
    fn new(cuda: Cuda) -> Self {
        let engine = Engine::from_cuda(cuda);
        assert!(matches!(engine.wait(Duration::from_secs(60)), EngineState::Cuda(_)), "{:?}", engine.state());
        let ground = ground();
        let [expected, mut found] = [0, 1]
            .map(|_| Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid settings"));
        found.set_engine(engine.clone());
        Self { expected, found, engine }
    }

    /// Applies a brush to both; returns the bytes allocated on the device and of host memory.
    fn play(&mut self, brush: Brush) -> [usize; 2] {
        assert_eq!(self.expected.apply([&brush]), self.found.apply([&brush]));
        self.memory()
    }

    /// Applies small brushes.
    fn play_small(&mut self, numbers: std::ops::Range<usize>) -> [usize; 2] {
        numbers.map(|number| self.play(small(number))).last().unwrap_or_default()
    }

    fn memory(&self) -> [usize; 2] {
        let figures = self.engine.figures();
        [figures.device_memory, figures.pinned_memory]
    }

    fn end(self) {
        assert_same(self.expected.world(), self.found.world(), 0);
        assert!(matches!(self.engine.state(), EngineState::Cuda(_)), "{:?}", self.engine.state());
    }
}

/// A device that frees memory after one stage without it.
fn hasty(device: Box<dyn Device>) -> (Pair, Arc<Shared>) {
    let cuda = cuda(device, limits(64 << 20));
    let shared = Arc::clone(&cuda.shared);
    let pair = Pair::new(cuda);
    lock(&shared.session).as_mut().expect("it is open").keep = Duration::ZERO;
    (pair, shared)
}

#[test]
fn memory_shrinks_after_a_large_transaction() {
    let devices =
        [device(), Emulator::start().map(|own| Box::new(ZeroCopy::new(Box::new(own))) as Box<dyn Device>)];
    for device in devices {
        let Some(device) = device else { return };
        let (mut pair, _) = hasty(device);
        let before = pair.play_small(0..4);
        let most = pair.play(large());
        assert!(most[0] + most[1] > before[0] + before[1] + (4 << 20), "{before:?}, {most:?}");
        let after = pair.play_small(4..10);
        // Bricks stay. Everything else is about as large as before.
        assert!(after[1] <= before[1] + (1 << 20), "{before:?}, {most:?}, {after:?}");
        assert!(after[0] <= before[0] + (1 << 20), "{before:?}, {most:?}, {after:?}");
        // It can grow again.
        pair.play(large());
        pair.end();
    }
}

#[test]
fn a_device_that_is_not_used_gives_its_bricks_back_and_gets_them_again() {
    let Some(device) = device() else { return };
    let (mut pair, shared) = hasty(device);
    pair.play(large());
    // Nothing is freed before its time.
    lock(&shared.session).as_mut().expect("it is open").keep = Duration::from_secs(3600);
    let full = pair.memory();
    (0..3).for_each(|_| pair.engine.trim());
    assert_eq!(pair.memory(), full);
    lock(&shared.session).as_mut().expect("it is open").keep = Duration::ZERO;
    (0..3).for_each(|_| pair.engine.trim());
    let left = pair.memory();
    assert!(left[0] < 2 << 20 && left[1] < 4 << 20, "{full:?}, {left:?}");
    pair.play_small(0..4);
    assert!(pair.engine.figures().choices.iter().all(|choice| choice.is_cuda || choice.amount == 0));
    pair.end();
}

#[test]
fn no_more_is_allocated_than_the_settings_allow() {
    for budget in [[8 << 20, 64 << 20], [64 << 20, 2 << 20], [6 << 20, 2 << 20]] {
        let Some(device) = device() else { return };
        let limits = Limits { device: Some(budget[0]), records: None, host: budget[1] };
        let mut pair = Pair::new(cuda(device, limits));
        for number in 0..8 {
            let brush = if number % 4 == 2 { large() } else { small(number) };
            let memory = pair.play(brush);
            assert!(memory[0] <= budget[0] && memory[1] <= budget[1], "{memory:?} of {budget:?}");
        }
        let figures = pair.engine.figures();
        assert!(figures.cuda > 0 && figures.cpu > 0, "{budget:?}: {figures:?}");
        pair.end();
    }
}

#[test]
fn a_device_that_is_lost_has_nothing_left() {
    let Some(device) = device() else { return };
    let cuda = cuda(device, limits(64 << 20));
    let shared = Arc::clone(&cuda.shared);
    let mut pair = Pair::new(cuda);
    assert!(pair.play(small(0)).iter().all(|bytes| *bytes > 0));
    shared.disable(&mut lock(&shared.session), &Fault::Failed("as planned".into()));
    assert_eq!(pair.memory(), [0, 0]);
}
