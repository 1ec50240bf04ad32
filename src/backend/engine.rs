//! The engine that runs a terrain's transactions.

use std::collections::VecDeque;
use std::fmt;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use web_time::Instant;

use super::{Backend, Choice, Compute, Cpu, EngineSettings, EngineState, GpuChoice, Stage, lock};
use crate::edits::{EditDelta, PreparedEdits};
use crate::ground::{Ground, GroundError, NoiseHeights};
use crate::surface::block::Block;
use crate::surface::meshed_blocks::MeshedBlocks;
use crate::surface::vertex::WorldView;

#[cfg(feature = "cuda")]
use super::cuda::Cuda;
#[cfg(feature = "cuda")]
use std::sync::atomic::{AtomicBool, Ordering};

/// Runs transactions. Clones share one engine, and any number of terrains may share it too.
///
/// A new engine costs nothing. It opens a GPU in the background, once a transaction is large enough to
/// benefit, and compares its results with the CPU's bit by bit before using it; this takes some tenths of a
/// second. If the GPU fails, then or later, the engine logs one warning and continues on the CPU; no edit is
/// lost.
#[derive(Clone)]
pub struct Engine(Arc<Shared>);

struct Shared {
    #[cfg(feature = "cuda")]
    cuda: Option<Cuda>,
    /// Whether the warning was logged that a ground with a material function can't use the GPU.
    #[cfg(feature = "cuda")]
    has_warned: AtomicBool,
    figures: Mutex<EngineFigures>,
}

impl fmt::Debug for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Engine").field("state", &self.state()).finish_non_exhaustive()
    }
}

/// Number of choices that are remembered.
const REMEMBERED: usize = 64;

/// Statistics of an engine.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EngineFigures {
    /// Time to open the GPU and to compare it with the CPU bit by bit, in the background. Zero until the
    /// comparison has succeeded.
    pub opening: Duration,
    /// Bytes of GPU memory that are allocated now.
    pub device_memory: usize,
    /// Bytes of pinned host memory, which the GPU copies from and to.
    pub pinned_memory: usize,
    /// Number of stages run on the CPU.
    pub cpu: u64,
    /// Number of stages run on the GPU.
    pub cuda: u64,
    /// The latest choices, newest last.
    pub choices: VecDeque<Choice>,
}

impl Default for Engine {
    /// The CPU.
    fn default() -> Self {
        Self::new(Backend::Cpu)
    }
}

impl Engine {
    /// An engine with default settings. Without the feature `cuda` every engine runs on the CPU.
    pub fn new(backend: Backend) -> Self {
        Self::with_settings(&EngineSettings { backend, ..EngineSettings::default() })
    }

    /// An engine with these settings.
    pub fn with_settings(settings: &EngineSettings) -> Self {
        #[cfg(not(feature = "cuda"))]
        let _ = settings;
        Self(Arc::new(Shared {
            #[cfg(feature = "cuda")]
            cuda: (settings.backend != Backend::Cpu).then(|| Cuda::new(settings)),
            #[cfg(feature = "cuda")]
            has_warned: AtomicBool::default(),
            figures: Mutex::default(),
        }))
    }

    /// Suggests a GPU, such as the one that renders. It is used if the settings do not choose one
    /// ([`GpuChoice::Default`]) and none is open yet. If CUDA does not list it, the first GPU is opened.
    pub fn suggest_gpu(&self, gpu: GpuChoice) {
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.0.cuda {
            cuda.suggest(gpu);
        }
        #[cfg(not(feature = "cuda"))]
        let _ = gpu;
    }

    #[cfg(all(test, feature = "cuda"))]
    pub(super) fn from_cuda(cuda: Cuda) -> Self {
        Self(Arc::new(Shared {
            cuda: Some(cuda),
            has_warned: AtomicBool::default(),
            figures: Mutex::default(),
        }))
    }

    /// What the engine runs on now.
    pub fn state(&self) -> EngineState {
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.0.cuda {
            return cuda.state();
        }
        EngineState::Cpu
    }

    /// Opens the GPU now, and waits at most `longest` until it is known whether the GPU can be used. For
    /// tools and benchmarks.
    pub fn wait(&self, longest: Duration) -> EngineState {
        let start = Instant::now();
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.0.cuda {
            cuda.open();
        }
        while self.state() == EngineState::Opening && start.elapsed() < longest {
            std::thread::sleep(Duration::from_millis(2));
        }
        self.state()
    }

    /// Statistics since the engine was made.
    pub fn figures(&self) -> EngineFigures {
        let figures = lock(&self.0.figures).clone();
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.0.cuda {
            let ([device_memory, pinned_memory], opening) = (cuda.memory(), cuda.opening());
            return EngineFigures { opening, device_memory, pinned_memory, ..figures };
        }
        figures
    }

    /// Frees GPU memory and pinned memory that was not needed in the last half minute; does nothing while the
    /// GPU is in use. Every transaction does this too, so call it only in games that may have no transactions
    /// for long. May take some milliseconds, so do not call it on the main thread.
    pub fn trim(&self) {
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.0.cuda {
            cuda.trim();
        }
    }

    /// Makes ground of `width` x `depth` cells from noise, equal bit by bit to [`Ground::from_noise`].
    ///
    /// The GPU computes it if it is open and idle; with [`Backend::Auto`] only from 2^18 columns on, because
    /// the CPU is faster for small worlds. In all other cases, and if the GPU fails, the CPU computes it. To
    /// compute the first world on the GPU, [`wait`](Self::wait) until it is open.
    ///
    /// # Errors
    /// Those of [`Ground::from_noise`].
    ///
    /// ```
    /// use bevy_burrow::backend::{Backend, Engine};
    /// use bevy_burrow::prelude::*;
    ///
    /// let noise = NoiseHeights { kind: NoiseKind::Ridged, amplitude: 80.0, ..NoiseHeights::default() };
    /// let ground = Engine::new(Backend::Auto).ground_from_noise(300, 200, &noise)?;
    /// assert_eq!(ground, Ground::from_noise(300, 200, &noise)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn ground_from_noise(
        &self,
        width: u32,
        depth: u32,
        noise: &NoiseHeights,
    ) -> Result<Ground, GroundError> {
        #[cfg(feature = "cuda")]
        if let Some(ground) = self.0.cuda.as_ref().and_then(|cuda| cuda.ground(width, depth, noise)) {
            return Ok(ground);
        }
        Ground::from_noise(width, depth, noise)
    }

    pub(crate) fn compute(&self) -> &dyn Compute {
        &*self.0
    }
}

impl Shared {
    /// The GPU, unless the ground's materials can only be computed on the CPU.
    #[cfg(feature = "cuda")]
    fn cuda_for(&self, ground: &Ground) -> Option<&Cuda> {
        let cuda = self.cuda.as_ref()?;
        if !ground.has_material_fn() {
            return Some(cuda);
        }
        if !self.has_warned.swap(true, Ordering::Relaxed) {
            log::warn!(
                "bevy_burrow does not use CUDA for grounds whose materials are a function of the game"
            );
        }
        None
    }

    fn remember(&self, choice: Choice) {
        let mut figures = lock(&self.figures);
        if choice.is_cuda {
            figures.cuda += 1
        } else {
            figures.cpu += 1
        }
        if figures.choices.len() == REMEMBERED {
            figures.choices.pop_front();
        }
        figures.choices.push_back(choice);
    }
}

impl Compute for Shared {
    fn edit(&self, work: &PreparedEdits, each: &mut dyn FnMut(&mut [EditDelta])) {
        let (start, mut choice) = (Instant::now(), Choice::of(Stage::Edit, work.jobs().len()));
        #[cfg(feature = "cuda")]
        let is_for_cpu = work.edits.iter().any(|edit| edit.is_for_cpu());
        #[cfg(feature = "cuda")]
        if let Some(cuda) = self.cuda_for(work.base.ground()).filter(|_| !is_for_cpu) {
            let mut attempt = cuda.edit(work, &mut choice);
            match attempt.done.take() {
                Some(delta) => each(&mut [delta]),
                None => Cpu.edit(work, each),
            }
            choice.took = start.elapsed();
            cuda.learn(&choice, &attempt);
            return self.remember(choice);
        }
        Cpu.edit(work, each);
        choice.took = start.elapsed();
        self.remember(choice);
    }

    fn mesh(
        &self,
        view: &WorldView,
        blocks: &[Block],
        overlap: &(dyn Fn() + Sync),
        on_done: &mut dyn FnMut(&dyn MeshedBlocks),
    ) {
        let (start, mut choice) = (Instant::now(), Choice::of(Stage::Mesh, blocks.len()));
        let mut took = Duration::ZERO;
        let mut on_done = |parts: &dyn MeshedBlocks| {
            took = start.elapsed();
            on_done(parts);
        };
        #[cfg(feature = "cuda")]
        if let Some(cuda) = self.cuda_for(view.samples.ground()) {
            let attempt = cuda.mesh(view, blocks, &mut choice, overlap, &mut on_done);
            if attempt.done.is_none() {
                Cpu.mesh(view, blocks, overlap, &mut on_done);
            }
            choice.took = took + attempt.done.unwrap_or_default();
            cuda.learn(&choice, &attempt);
            return self.remember(choice);
        }
        Cpu.mesh(view, blocks, overlap, &mut on_done);
        choice.took = took;
        self.remember(choice);
    }
}
