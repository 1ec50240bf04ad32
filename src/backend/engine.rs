//! What a terrain runs its transactions on.

use std::collections::VecDeque;
use std::fmt;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use web_time::Instant;

use super::{Backend, CardChoice, Choice, Compute, Cpu, EngineSettings, Stage, lock};
use crate::edits::{EditDelta, PreparedEdits};
use crate::ground::{Ground, GroundError, NoiseHeights};
use crate::surface::block::Block;
use crate::surface::meshed_blocks::MeshedBlocks;
use crate::surface::vertex::WorldView;

#[cfg(feature = "cuda")]
use super::cuda::Cuda;
#[cfg(feature = "cuda")]
use std::sync::atomic::{AtomicBool, Ordering};

/// What transactions run on; clones share it, and so may any number of terrains.
///
/// A new engine costs nothing. A card is opened when a transaction comes that it could be worth, in the background, and
/// compared with the processor bit by bit before it is used, which takes some tenths of a second. One that fails, then or
/// later, is given up with one warning, and the processor goes on; no edit is lost.
#[derive(Clone)]
pub struct Engine(Arc<Shared>);

struct Shared {
    #[cfg(feature = "cuda")]
    cuda: Option<Cuda>,
    /// Whether it was logged that a ground's own function keeps a world from the card.
    #[cfg(feature = "cuda")]
    has_told: AtomicBool,
    figures: Mutex<EngineFigures>,
}

impl fmt::Debug for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Engine").field("state", &self.state()).finish_non_exhaustive()
    }
}

/// Choices that are remembered.
const REMEMBERED: usize = 64;

/// What an engine has to run on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EngineState {
    /// The processor.
    Cpu,
    /// The processor, as no transaction came yet that wants a card.
    Unopened,
    /// The processor, while a card is being opened.
    Opening,
    /// A card of this name, beside the processor.
    Cuda(String),
    /// The processor, because a card could not be used, or can't be used any longer.
    Lost(String),
}

/// What an engine did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EngineFigures {
    /// How long it took to open a card and to compare it with the processor bit by bit, in the background before it was used.
    /// Zero until it has passed, and where there is no card that did.
    pub opening: Duration,
    /// Bytes that are allocated on the card now.
    pub device_memory: usize,
    /// Bytes of pinned memory of the host, which the card copies from and to.
    pub pinned_memory: usize,
    /// Stages of transactions done on the processor.
    pub cpu: u64,
    /// Stages of transactions done on a card.
    pub cuda: u64,
    /// The latest ones, newest last.
    pub choices: VecDeque<Choice>,
}

impl Default for Engine {
    /// The processor.
    fn default() -> Self {
        Self::new(Backend::Cpu)
    }
}

impl Engine {
    /// An engine. Without the feature `cuda` all of them run on the processor.
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
            has_told: AtomicBool::default(),
            figures: Mutex::default(),
        }))
    }

    /// Says which card to open where the settings leave it open ([`CardChoice::Default`]) and none is open yet: for games,
    /// the renderer's own. If CUDA has no such card, the first one is opened.
    pub fn suggest_card(&self, card: CardChoice) {
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.0.cuda {
            cuda.suggest(card);
        }
        #[cfg(not(feature = "cuda"))]
        let _ = card;
    }

    #[cfg(all(test, feature = "cuda"))]
    pub(super) fn from_cuda(cuda: Cuda) -> Self {
        Self(Arc::new(Shared {
            cuda: Some(cuda),
            has_told: AtomicBool::default(),
            figures: Mutex::default(),
        }))
    }

    /// What it has to run on now.
    pub fn state(&self) -> EngineState {
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.0.cuda {
            return cuda.state();
        }
        EngineState::Cpu
    }

    /// Opens the card now, and waits until it is known whether it can be used, but no longer than that. Tools and benchmarks
    /// want this.
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

    /// What it did so far.
    pub fn figures(&self) -> EngineFigures {
        let figures = lock(&self.0.figures).clone();
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.0.cuda {
            let ([device_memory, pinned_memory], opening) = (cuda.memory(), cuda.opening());
            return EngineFigures { opening, device_memory, pinned_memory, ..figures };
        }
        figures
    }

    /// Frees memory of the card, and pinned memory, that was not needed in the last half minute; does nothing while the card is
    /// in use. Every transaction does the same, so this is for games in which there may be none for long. May take some
    /// milliseconds, so not on the main thread.
    pub fn trim(&self) {
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.0.cuda {
            cuda.trim();
        }
    }

    /// Ground of `width` x `depth` cells from noise: the same, bit by bit, as [`Ground::from_noise`] makes.
    ///
    /// The card makes it if it is open and free; with [`Backend::Auto`] only from 2^18 columns on, as small worlds are made
    /// faster than a card gets ready for them. In all other cases, and where the card fails, the processor makes it. To have
    /// the card make the first world, [`wait`](Self::wait) until it is open.
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
    /// The card, if it can give the same materials as the processor.
    #[cfg(feature = "cuda")]
    fn cuda_for(&self, ground: &Ground) -> Option<&Cuda> {
        let cuda = self.cuda.as_ref()?;
        if !ground.has_material_fn() {
            return Some(cuda);
        }
        if !self.has_told.swap(true, Ordering::Relaxed) {
            log::warn!(
                "bevy_burrow does without CUDA where the ground's materials are a function of the game's own"
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
        if let Some(cuda) = self.cuda_for(work.base.ground()) {
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
        meanwhile: &(dyn Fn() + Sync),
        then: &mut dyn FnMut(&dyn MeshedBlocks),
    ) {
        let (start, mut choice) = (Instant::now(), Choice::of(Stage::Mesh, blocks.len()));
        let mut took = Duration::ZERO;
        let mut then = |parts: &dyn MeshedBlocks| {
            took = start.elapsed();
            then(parts);
        };
        #[cfg(feature = "cuda")]
        if let Some(cuda) = self.cuda_for(view.samples.ground()) {
            let attempt = cuda.mesh(view, blocks, &mut choice, meanwhile, &mut then);
            if attempt.done.is_none() {
                Cpu.mesh(view, blocks, meanwhile, &mut then);
            }
            choice.took = took + attempt.done.unwrap_or_default();
            cuda.learn(&choice, &attempt);
            return self.remember(choice);
        }
        Cpu.mesh(view, blocks, meanwhile, &mut then);
        choice.took = took;
        self.remember(choice);
    }
}
