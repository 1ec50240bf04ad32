//! The backends that apply edits to bricks and mesh blocks: the processor, or a CUDA card.
//!
//! A [`Terrain`](crate::terrain::Terrain) has an [`Engine`], and whatever that runs on, the world is the same bit by bit.
//!
//! ```
//! use bevy_burrow::backend::{Backend, Engine};
//! use bevy_burrow::prelude::*;
//!
//! let mut terrain = Terrain::new(Ground::flat(64, 64, 10.0)?, &TerrainSettings::default())?;
//! terrain.set_engine(Engine::new(Backend::Auto));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod choice;
#[cfg(feature = "cuda")]
mod costs;
mod cpu;
#[cfg(feature = "cuda")]
mod cuda;
mod engine;
mod settings;

pub use choice::{Choice, Estimate, Stage};
pub(crate) use cpu::Cpu;
pub use engine::{Engine, EngineFigures, EngineState};
pub use settings::{CardChoice, EngineSettings};

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::edits::{EditDelta, PreparedEdits};
use crate::surface::block::Block;
use crate::surface::meshed_blocks::MeshedBlocks;
use crate::surface::vertex::WorldView;

/// What an [`Engine`] may run on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Backend {
    /// Whichever was faster lately for such a stage of a transaction; occasionally the other one, to time it again. The card is
    /// opened when transactions come that it could be worth; until then, and where there is none, the processor.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// A CUDA card for all transactions, small ones too, unless another terrain uses it. The first transaction opens it; until
    /// it is open, and where there is none, the processor.
    Cuda,
}

/// The heavy work of a transaction. All backends give the same bits.
pub(crate) trait Compute: Send + Sync {
    /// Applies edits; `each` gets what they changed, brick by brick in order of their positions, as one delta or as
    /// several, once or more often; it may take out of them what it wants.
    fn edit(&self, work: &PreparedEdits, each: &mut dyn FnMut(&mut [EditDelta]));

    /// Meshes blocks. `meanwhile` is called when there is time for other things, maybe more than once; it should only set them
    /// going. `then` gets the surfaces, by the numbers of the blocks, some of which may still be on their way; their memory is
    /// used again afterwards. Where some never came it is called once more, with all of them, and what it made before is to
    /// be forgotten.
    fn mesh(
        &self,
        view: &WorldView,
        blocks: &[Block],
        meanwhile: &(dyn Fn() + Sync),
        then: &mut dyn FnMut(&dyn MeshedBlocks),
    );
}

/// Takes a lock. Poisoning is ignored: a panicking holder leaves the value valid.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
