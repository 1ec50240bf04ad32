//! CUDA backend: the fields stay on the GPU, one launch edits or meshes all dirty bricks, and only used output is
//! copied back.
//!
//! ```text
//! edits  -> jobs, missing bricks ---one copy--->  edit kernel: one thread block per brick
//!           bricks, effects      <--what changed-
//! blocks -> windows of bricks    ---one copy--->  mesh kernel: one thread block per block
//!           vertices, indices    <--what is used-
//! ```
//!
//! Stencil edits (sculpting, and edits under rules) have their own kernel, which reads windows of neighbouring
//! bricks. They are launched batch by batch, as on the CPU: a batch sees on the device what the previous one
//! changed. Fills and carves need distances to the surface, which `surface_start` and `surface_spread` compute
//! before. After a fault, the batches that have come back are kept and the CPU does the rest.
//!
//! - [`device`](self::device) is the interface of a device; `driver` implements it for a GPU.
//! - [`session`](self::session) keeps bricks and heights on the device within a budget; `cache` assigns and evicts
//!   their slots.
//! - [`edit`](self::edit) and [`mesh`](self::mesh) pack jobs and unpack results; `layout` defines the format of
//!   both. `surfaces` reads the meshes in place.
//! - `heights` computes new ground from noise.
//! - `self_test` compares the device with the CPU before its results are used.
//! - `memory` enforces the memory budgets of the settings.
//!
//! A thread opens the GPU when a stage first wants it. A session serves one transaction at a time. A transaction
//! that finds it in use runs on the CPU, so only the task that uses the device ever waits for it. The session stays
//! locked until the surfaces in its memory are assembled.
#![allow(unsafe_code)]

mod cache;
mod device;
mod driver;
mod edit;
mod heights;
mod layout;
mod lists;
mod memory;
mod mesh;
mod self_test;
mod session;
mod staging;
mod surfaces;
mod windows;

#[cfg(test)]
mod async_copies;
#[cfg(test)]
mod emulator_process;
#[cfg(test)]
mod kernel_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod zero_copy;

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, TryLockError};
use std::time::Duration;

use web_time::Instant;

use super::costs::{Costs, Load};
use super::settings::{EngineSettings, GpuChoice};
use super::{Backend, Choice, EngineState, lock};
use crate::edits::{EditDelta, PreparedEdits};
use crate::surface::block::Block;
use crate::surface::meshed_blocks::MeshedBlocks;
use crate::surface::vertex::WorldView;
use device::{Device, Fault};
use memory::{Limits, Usage};
use session::Session;
use surfaces::Surfaces;

/// A GPU as an alternative to the CPU. It is opened on first use.
pub(super) struct Cuda {
    /// Whether the faster of the two is used. Otherwise the GPU is used whenever possible.
    is_auto: bool,
    /// Opens the device; `None` once opening has begun.
    pending: Mutex<Option<PendingDevice>>,
    /// The GPU that the game suggests if the settings leave the choice open.
    suggested: Mutex<Option<GpuChoice>>,
    shared: Arc<Shared>,
    /// Measured costs of both, for [`Backend::Auto`].
    costs: Mutex<Costs>,
    /// Whether it was logged that a stage was too large for the device.
    has_warned: AtomicBool,
}

/// State shared by the thread that opens the device and those that use it.
struct Shared {
    /// Locked while the device is used. `None` until it is open, and after it is lost.
    session: Mutex<Option<Box<Session>>>,
    /// The outcome of opening, readable at any time.
    state: Mutex<EngineState>,
    /// Duration of opening and of the self-test, once the test has passed.
    opening: OnceLock<Duration>,
    usage: Arc<Usage>,
}

/// How a device is opened.
struct PendingDevice {
    device: Box<dyn FnOnce(Option<GpuChoice>) -> Result<Box<dyn Device>, Fault> + Send>,
    limits: Limits,
    /// What the self-test compares.
    sizes: self_test::Sizes,
}

/// The outcome of a stage that was offered to the device.
pub(super) struct Attempt<T> {
    /// The device's result; `None` if the CPU has to do the stage.
    pub done: Option<T>,
    load: Load,
    /// Whether the device started on it.
    was_tried: bool,
    /// Whether host memory was allocated for it.
    has_grown: bool,
}

/// Locks a mutex unless it is locked already. Poisoning is ignored, as in `lock`.
fn try_lock<T>(mutex: &Mutex<T>) -> Option<MutexGuard<'_, T>> {
    match mutex.try_lock() {
        Ok(guard) => Some(guard),
        Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
        Err(TryLockError::WouldBlock) => None,
    }
}

impl Cuda {
    /// The GPU that the settings choose, not opened yet.
    pub fn new(settings: &EngineSettings) -> Self {
        let gpu = settings.gpu.clone();
        let device = move |suggested: Option<GpuChoice>| -> Result<Box<dyn Device>, Fault> {
            Ok(Box::new(driver::Gpu::open(&gpu, suggested.as_ref())?))
        };
        let limits = Limits::new(settings);
        Self::with_device(settings.backend == Backend::Auto, limits, self_test::FULL, device)
    }

    /// A device that is not opened yet.
    fn with_device(
        is_auto: bool,
        limits: Limits,
        sizes: self_test::Sizes,
        device: impl FnOnce(Option<GpuChoice>) -> Result<Box<dyn Device>, Fault> + Send + 'static,
    ) -> Self {
        Self {
            is_auto,
            pending: Mutex::new(Some(PendingDevice { device: Box::new(device), limits, sizes })),
            suggested: Mutex::default(),
            shared: Arc::new(Shared {
                session: Mutex::default(),
                state: Mutex::new(EngineState::Unopened),
                opening: OnceLock::new(),
                usage: Arc::default(),
            }),
            costs: Mutex::default(),
            has_warned: AtomicBool::default(),
        }
    }

    /// Opens the device in the background, unless that has begun already.
    pub fn open(&self) {
        let mut pending = lock(&self.pending);
        let Some(own) = pending.take() else { return };
        *lock(&self.shared.state) = EngineState::Opening;
        drop(pending);
        let (shared, suggested) = (Arc::clone(&self.shared), lock(&self.suggested).take());
        let open = move || {
            let start = Instant::now();
            match guarded(|| own.open(suggested, &shared.usage)) {
                Ok(session) => {
                    let name = session.name();
                    shared.opening.get_or_init(|| start.elapsed());
                    // Keep the lock, so that the session cannot be lost before the state says that it is open.
                    let mut place = lock(&shared.session);
                    *place = Some(Box::new(session));
                    *lock(&shared.state) = EngineState::Cuda(name);
                }
                Err(fault) => shared.disable(&mut lock(&shared.session), &fault),
            }
        };
        let thread = std::thread::Builder::new().name("burrow-cuda".into()).spawn(open);
        if let Err(error) = thread {
            self.shared.disable(&mut lock(&self.shared.session), &Fault::Failed(error.to_string()));
        }
    }

    /// Suggests a GPU if the settings leave the choice open.
    pub fn suggest(&self, gpu: GpuChoice) {
        *lock(&self.suggested) = Some(gpu);
    }

    pub fn state(&self) -> EngineState {
        lock(&self.shared.state).clone()
    }

    /// Duration of opening the device and of its self-test; zero until the test has passed.
    pub fn opening(&self) -> Duration {
        self.shared.opening.get().copied().unwrap_or_default()
    }

    /// Bytes on the device and of pinned memory.
    pub fn memory(&self) -> [usize; 2] {
        self.shared.usage.bytes()
    }

    /// Frees memory that was not needed recently, unless the device is in use.
    pub fn trim(&self) {
        if let Some(mut place) = try_lock(&self.shared.session)
            && let Some(session) = &mut *place
        {
            let trimmed = guarded(|| session.trim(Instant::now()));
            trimmed.unwrap_or_else(|fault| self.handle_fault(&mut place, &fault));
        }
    }

    /// Runs a stage on the device if it is open, free and chosen; otherwise the CPU has to do it. `on_done` uses the
    /// result while it is still in the session's memory. If the result does not arrive completely, the output of
    /// `on_done` is discarded.
    ///
    /// The lock is held until `on_done` returns. Meanwhile `on_done` may run other tasks of its thread pool, even on
    /// this thread. That cannot deadlock: other callers only try the lock, and continue without the device.
    fn attempt_stage<T, R>(
        &self,
        choice: &mut Choice,
        load: Load,
        missing: impl FnOnce(&Session) -> usize,
        work: impl FnOnce(&mut Session) -> Result<T, Fault>,
        on_done: impl FnOnce(&mut Session, T) -> Result<R, Fault>,
    ) -> Attempt<R> {
        let mut attempt = Attempt { done: None, load, was_tried: false, has_grown: false };
        if load.amount == 0 {
            return attempt;
        }
        if !self.is_auto {
            self.open();
        }
        // Never block here: the holder may take long, and its work may need this thread.
        let Some(mut place) = try_lock(&self.shared.session) else { return attempt };
        let Some(session) = &mut *place else { return attempt };
        let trimmed = guarded(|| session.trim(Instant::now()));
        if let Err(fault) = trimmed {
            self.handle_fault(&mut place, &fault);
            return attempt;
        }
        // Decide first without counting missing data: uploads only make the device slower, so most small
        // transactions end here.
        if !self.is_chosen(choice, load) {
            return attempt;
        }
        choice.missing = missing(session);
        attempt.load.is_cold = choice.missing > choice.amount / 2;
        if !self.is_chosen(choice, attempt.load) {
            return attempt;
        }
        attempt.was_tried = true;
        let allocated = self.shared.usage.host_allocations();
        let done = guarded(|| work(session));
        attempt.has_grown = self.shared.usage.host_allocations() != allocated;
        let times = session.times();
        // A panic in `on_done` is the caller's and no fault of the device.
        match done.and_then(|done| on_done(session, done)) {
            Ok(made) => {
                choice.is_cuda = true;
                [choice.device, choice.kernel] = times;
                attempt.done = Some(made);
            }
            Err(fault) => {
                // The time lost on the attempt is not the CPU's.
                choice.estimate = None;
                self.handle_fault(&mut place, &fault);
            }
        }
        attempt
    }

    /// Whether the device does this stage.
    fn is_chosen(&self, choice: &mut Choice, load: Load) -> bool {
        if !self.is_auto {
            return true;
        }
        let (estimate, is_chosen) = lock(&self.costs).choose(load);
        choice.estimate = Some(estimate);
        is_chosen
    }

    /// Handles a fault with one warning. Gives the device up unless the request was merely too large.
    fn handle_fault(&self, place: &mut Option<Box<Session>>, fault: &Fault) {
        if !fault.is_passing() {
            self.shared.disable(place, fault);
        } else if !self.has_warned.swap(true, Ordering::Relaxed) {
            log::warn!(
                "bevy_burrow falls back to the CPU for work that is too large for the CUDA device: {fault}"
            );
        }
    }

    /// Records how long a stage took, and opens the device if such stages could be worth it.
    pub fn learn<T>(&self, choice: &Choice, attempt: &Attempt<T>) {
        if !self.is_auto || choice.amount == 0 {
            return;
        }
        let &Attempt { load, was_tried, has_grown, .. } = attempt;
        let mut costs = lock(&self.costs);
        // After a failed attempt, all of the time counts as the device's.
        let is_chosen = choice.estimate.is_some() || was_tried;
        costs.learn(load, was_tried, is_chosen, choice.took, has_grown && choice.is_cuda);
        let is_wanted = !was_tried && costs.may_be_worth_a_gpu(load);
        drop(costs);
        if is_wanted {
            self.open();
        }
    }

    /// Applies edits on the device, if it is chosen.
    pub fn edit(&self, work: &PreparedEdits, choice: &mut Choice) -> Attempt<EditDelta> {
        let load = Load::of_edits(work);
        let missing = |session: &Session| session.missing_edits(work);
        self.attempt_stage(choice, load, missing, |session| session.edit(work), |_, delta| Ok(delta))
    }

    /// Meshes blocks on the device, if it is chosen. `on_done` gets the surfaces; the result is how long it waited for
    /// them. Without a result the CPU has to mesh the blocks, and the caller must discard what `on_done` produced.
    pub fn mesh(
        &self,
        view: &WorldView,
        blocks: &[Block],
        choice: &mut Choice,
        overlap: &(dyn Fn() + Sync),
        on_done: &mut dyn FnMut(&dyn MeshedBlocks),
    ) -> Attempt<Duration> {
        let load = Load::of_blocks(blocks.len());
        let missing = |session: &Session| session.missing_blocks(view, blocks);
        let work = |session: &mut Session| session.mesh(view, blocks, overlap);
        self.attempt_stage(choice, load, missing, work, |session, meshed| {
            let Session { meshes, device, .. } = session;
            let surfaces = Surfaces::new(meshes, view, blocks, meshed);
            let drawn = catch_unwind(AssertUnwindSafe(|| on_done(&surfaces)));
            // `on_done` may not have waited for all surfaces. Even after a panic the session must stay usable.
            let is_over = surfaces.arrival.is_over();
            let waited = surfaces.arrival.end();
            let ended = if is_over { Ok(()) } else { guarded(|| device.wait()) };
            drawn.unwrap_or_else(|panic| resume_unwind(panic));
            ended.and(waited)
        })
    }
}

/// Calls a device. A panic counts as a fault, so that the CPU finishes the transaction.
fn guarded<T>(work: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    let failed = |_| Err(Fault::Failed("panic while it was used".into()));
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(failed)
}

impl PendingDevice {
    /// Opens the device and runs its self-test.
    fn open(self, suggested: Option<GpuChoice>, usage: &Arc<Usage>) -> Result<Session, Fault> {
        let device = (self.device)(suggested)?;
        let (device, records) = self.limits.enforce(device, usage);
        let mut session = Session::new(device, records)?;
        self_test::run(&mut session, self.sizes)?;
        session.forget();
        Ok(session)
    }
}

impl Shared {
    /// Gives the device up, with one warning.
    fn disable(&self, place: &mut Option<Box<Session>>, fault: &Fault) {
        *place = None;
        *lock(&self.state) = EngineState::Lost(fault.to_string());
        log::warn!("bevy_burrow continues without CUDA: {fault}");
    }
}
