//! The backends that apply edits to bricks and mesh blocks: the CPU, or a CUDA GPU.
//!
//! A [`Terrain`](crate::terrain::Terrain) has an [`Engine`]. The world is the same, bit by bit, on every
//! backend.
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
mod state;

#[doc(hidden)]
pub use choice::{Choice, Estimate, Stage};
pub(crate) use cpu::Cpu;
pub use engine::{Engine, EngineFigures};
pub use settings::{EngineSettings, GpuChoice};
pub use state::EngineState;

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::edits::{EditDelta, PreparedEdits};
use crate::surface::block::Block;
use crate::surface::meshed_blocks::MeshedBlocks;
use crate::surface::vertex::WorldView;

/// The devices that an [`Engine`] may run on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Backend {
    /// The backend that was recently faster for such a stage of a transaction; occasionally the other one, to
    /// time it again. The GPU is opened once transactions are large enough to benefit; until then, and
    /// without a GPU, the CPU.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// A CUDA GPU for all transactions, even small ones, unless another terrain is using it. The first
    /// transaction opens it; until it is open, and without a GPU, the CPU.
    Cuda,
}

/// The heavy work of a transaction. All backends give equal bits.
pub(crate) trait Compute: Send + Sync {
    /// Applies edits. `each` receives the changes by brick, in order of their positions, as one or several
    /// deltas, in one or several calls; it may move data out of them.
    fn edit(&self, work: &PreparedEdits, each: &mut dyn FnMut(&mut [EditDelta]));

    /// Meshes blocks. `overlap` is called while the backend waits, possibly more than once; it should only
    /// start other work. `on_done` receives the surfaces, by block number; some may still be in transfer, and
    /// their memory is reused afterwards. If some transfer fails, it is called again with all surfaces, and
    /// must discard its earlier result.
    fn mesh(
        &self,
        view: &WorldView,
        blocks: &[Block],
        overlap: &(dyn Fn() + Sync),
        on_done: &mut dyn FnMut(&dyn MeshedBlocks),
    );
}

/// Takes a lock. Poisoning is ignored: a panicking holder leaves the value valid.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
