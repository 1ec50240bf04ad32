//! What a terrain runs its transactions on.

use std::sync::Arc;
use std::time::Duration;

use super::{Backend, Choice, Compute, Cpu};
use crate::surface::block::{Block, Parts};
use crate::surface::vertex::WorldView;
use crate::volume::{EditWork, Ledger};

#[cfg(feature = "cuda")]
use super::cuda::Cuda;

/// What transactions run on; clones share it, and so may any number of terrains.
///
/// A card is opened and measured in the background, which takes some tenths of a second. One that fails, then or later, is
/// given up with one warning, and the processor goes on; no edit is lost.
#[derive(Clone)]
pub struct Engine(Arc<Shared>);

struct Shared {
    #[cfg(feature = "cuda")]
    cuda: Option<Cuda>,
}

/// What an engine has to run on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EngineState {
    /// The processor.
    Cpu,
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
    /// Stages of transactions done on the processor.
    pub cpu: u64,
    /// Stages of transactions done on a card.
    pub cuda: u64,
    /// The latest ones, newest last.
    pub choices: Vec<Choice>,
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
        #[cfg(not(feature = "cuda"))]
        let _ = backend;
        Self(Arc::new(Shared {
            #[cfg(feature = "cuda")]
            cuda: (backend != Backend::Cpu).then(|| Cuda::open(backend == Backend::Auto)),
        }))
    }

    #[cfg(all(test, feature = "cuda"))]
    pub(super) fn from_cuda(cuda: Cuda) -> Self {
        Self(Arc::new(Shared { cuda: Some(cuda) }))
    }

    /// What it has to run on now.
    pub fn state(&self) -> EngineState {
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.0.cuda {
            return cuda.state();
        }
        EngineState::Cpu
    }

    /// Waits until it is known whether a card can be used, but no longer than that. Tools and benchmarks want this.
    pub fn wait(&self, longest: Duration) -> EngineState {
        let start = web_time::Instant::now();
        while self.state() == EngineState::Opening && start.elapsed() < longest {
            std::thread::sleep(Duration::from_millis(2));
        }
        self.state()
    }

    /// What it did so far. Without a card nothing is counted.
    pub fn figures(&self) -> EngineFigures {
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.0.cuda {
            return cuda.figures();
        }
        EngineFigures::default()
    }

    pub(crate) fn compute(&self) -> &dyn Compute {
        &*self.0
    }
}

impl Compute for Shared {
    fn edit(&self, work: &EditWork, each: &mut dyn FnMut(Ledger)) {
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.cuda {
            return cuda.edit(work, each);
        }
        Cpu.edit(work, each);
    }

    fn mesh(&self, view: &WorldView, blocks: &[Block], then: &mut dyn FnMut(&[Parts])) {
        #[cfg(feature = "cuda")]
        if let Some(cuda) = &self.cuda {
            return cuda.mesh(view, blocks, then);
        }
        Cpu.mesh(view, blocks, then);
    }
}
