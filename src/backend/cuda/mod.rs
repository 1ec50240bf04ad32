//! CUDA: fields kept on a card, edits applied there, one launch for all that is dirty, and only what is used comes back.
//!
//! ```text
//! edits  -> jobs, missing bricks ---one copy--->  edit kernel: a block for each brick
//!           bricks, receipts     <--what changed-
//! blocks -> windows of bricks    ---one copy--->  mesh kernel: a block for each block
//!           vertices, indices    <--what is used-
//! ```
//!
//! Stencil edits (those that sculpt, and those under rules) take a kernel of their own, which reads windows of neighbouring
//! bricks. They are launched batch by batch, as on the processor: what one batch changed is on the device when the next one
//! reads it. After a fault, batches that have come back are kept, and the processor does the rest.
//!
//! - [`device`](self::device) says what is asked of a device; `driver` asks a card.
//! - [`session`](self::session) keeps bricks and heights on it, with a budget; `cache` says where, and which go first.
//! - [`edit`](self::edit) and [`mesh`](self::mesh) pack the jobs and unpack the results; `layout` is the form of both.
//!   Surfaces are not unpacked but read where they arrived, by `surfaces`.
//! - `heights` makes new ground of noise.
//! - `self_test` compares the device with the processor, before anything that it makes is used.
//! - `memory` keeps to the budgets of the settings.
//!
//! The card is opened by a thread of its own when a stage first wants it. A session serves one transaction at a time. A
//! transaction that finds it in use runs on the processor, so only the task that uses the device ever waits for it. The
//! session is held until the surfaces, which lie in its memory, are assembled.
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
mod emulator;
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
use super::settings::{CardChoice, EngineSettings};
use super::{Backend, Choice, EngineState, lock};
use crate::edits::{EditDelta, PreparedEdits};
use crate::surface::block::Block;
use crate::surface::meshed_blocks::MeshedBlocks;
use crate::surface::vertex::WorldView;
use device::{Device, Fault};
use memory::{Limits, Usage};
use session::Session;
use surfaces::Surfaces;

/// A card beside the processor. It is opened when it is first wanted.
pub(super) struct Cuda {
    /// Is the faster of both taken? Else the card is, whenever it can be.
    is_auto: bool,
    /// Opens the device; nothing once that has begun.
    pending: Mutex<Option<PendingDevice>>,
    /// The card that the game suggests where the settings leave it open.
    suggested: Mutex<Option<CardChoice>>,
    shared: Arc<Shared>,
    /// What both took, with [`Backend::Auto`].
    costs: Mutex<Costs>,
    /// Was it said that something was too much for the card?
    has_passed: AtomicBool,
}

/// What the thread that opens a device has in common with those that use it.
struct Shared {
    /// Locked while the device is used. `None` until it is open, and after it is lost.
    session: Mutex<Option<Box<Session>>>,
    /// What became of opening it, to be asked at any time.
    state: Mutex<EngineState>,
    /// How long opening and the self-test took, once it has passed.
    opening: OnceLock<Duration>,
    usage: Arc<Usage>,
}

/// How a device is opened.
struct PendingDevice {
    device: Box<dyn FnOnce(Option<CardChoice>) -> Result<Box<dyn Device>, Fault> + Send>,
    limits: Limits,
    /// What is compared before it is used.
    sizes: self_test::Sizes,
}

/// What became of a stage that the card was asked to do.
pub(super) struct Attempt<T> {
    /// What the card made of it; else the processor has to do it.
    pub done: Option<T>,
    load: Load,
    /// Did the card begin?
    was_tried: bool,
    /// Was memory of the host allocated for the card?
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
    /// The card of these settings, which is not opened yet.
    pub fn new(settings: &EngineSettings) -> Self {
        let card = settings.card.clone();
        let device = move |suggested: Option<CardChoice>| -> Result<Box<dyn Device>, Fault> {
            Ok(Box::new(driver::Card::open(&card, suggested.as_ref())?))
        };
        let limits = Limits::new(settings);
        Self::with_device(settings.backend == Backend::Auto, limits, self_test::FULL, device)
    }

    /// Some device, which is not opened yet.
    fn with_device(
        is_auto: bool,
        limits: Limits,
        sizes: self_test::Sizes,
        device: impl FnOnce(Option<CardChoice>) -> Result<Box<dyn Device>, Fault> + Send + 'static,
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
            has_passed: AtomicBool::default(),
        }
    }

    /// Opens the device in the background, unless that was begun before.
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
                    // Locked, so that it is not lost before the state says that it is open.
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

    /// Says which card to open where the settings leave it open.
    pub fn suggest(&self, card: CardChoice) {
        *lock(&self.suggested) = Some(card);
    }

    pub fn state(&self) -> EngineState {
        lock(&self.shared.state).clone()
    }

    /// How long opening the card and its self-test took; zero until it has passed.
    pub fn opening(&self) -> Duration {
        self.shared.opening.get().copied().unwrap_or_default()
    }

    /// Bytes on the device and of pinned memory.
    pub fn memory(&self) -> [usize; 2] {
        self.shared.usage.bytes()
    }

    /// Frees what was not needed lately, unless the card is in use.
    pub fn trim(&self) {
        if let Some(mut place) = try_lock(&self.shared.session)
            && let Some(session) = &mut *place
        {
            let trimmed = guarded(|| session.trim(Instant::now()));
            trimmed.unwrap_or_else(|fault| self.handle_fault(&mut place, &fault));
        }
    }

    /// Does a stage on the card if that is there, free and chosen; else the processor has to do it. `then` makes something
    /// of what was done, while it still lies in the session's memory. What it made of things that the card did not bring in
    /// the end is lost.
    ///
    /// So the lock is held until `then` is through, which may run other tasks of its thread pool meanwhile, even on this
    /// thread. That can't deadlock: others only try the lock, and go on without the card.
    fn attempt_stage<T, R>(
        &self,
        choice: &mut Choice,
        load: Load,
        missing: impl FnOnce(&Session) -> usize,
        work: impl FnOnce(&mut Session) -> Result<T, Fault>,
        then: impl FnOnce(&mut Session, T) -> Result<R, Fault>,
    ) -> Attempt<R> {
        let mut attempt = Attempt { done: None, load, was_tried: false, has_grown: false };
        if load.amount == 0 {
            return attempt;
        }
        if !self.is_auto {
            self.open();
        }
        // The holder may take long, and this thread could be the one that has to finish its work.
        let Some(mut place) = try_lock(&self.shared.session) else { return attempt };
        let Some(session) = &mut *place else { return attempt };
        let trimmed = guarded(|| session.trim(Instant::now()));
        if let Err(fault) = trimmed {
            self.handle_fault(&mut place, &fault);
            return attempt;
        }
        // Uploads only make the card slower, so small transactions need not look for what is missing.
        if !self.is_chosen(choice, load) {
            return attempt;
        }
        choice.missing = missing(session);
        attempt.load.is_cold = choice.missing > load.amount / 2;
        if !self.is_chosen(choice, attempt.load) {
            return attempt;
        }
        attempt.was_tried = true;
        let allocated = self.shared.usage.host_allocations();
        let done = guarded(|| work(session));
        attempt.has_grown = self.shared.usage.host_allocations() != allocated;
        let times = session.times();
        // A panic in `then` is the caller's, and no fault of the device's.
        match done.and_then(|done| then(session, done)) {
            Ok(made) => {
                choice.is_cuda = true;
                [choice.device, choice.kernel] = times;
                attempt.done = Some(made);
            }
            Err(fault) => {
                // What was lost on trying is not the processor's time.
                choice.estimate = None;
                self.handle_fault(&mut place, &fault);
            }
        }
        attempt
    }

    /// Is a stage the card's?
    fn is_chosen(&self, choice: &mut Choice, load: Load) -> bool {
        if !self.is_auto {
            return true;
        }
        let (estimate, is_chosen) = lock(&self.costs).choose(load);
        choice.estimate = Some(estimate);
        is_chosen
    }

    /// Gives the card up, unless it is fine and only what was asked too much for it; either way with one warning.
    fn handle_fault(&self, place: &mut Option<Box<Session>>, fault: &Fault) {
        if !fault.is_passing() {
            self.shared.disable(place, fault);
        } else if !self.has_passed.swap(true, Ordering::Relaxed) {
            log::warn!("bevy_burrow does without CUDA what is too much for the device: {fault}");
        }
    }

    /// Takes in how long a stage took, and opens the card where such stages could be worth it.
    pub fn learn<T>(&self, choice: &Choice, attempt: &Attempt<T>) {
        if !self.is_auto || choice.amount == 0 {
            return;
        }
        let &Attempt { load, was_tried, has_grown, .. } = attempt;
        let mut costs = lock(&self.costs);
        // Where the card failed, all of the time is its own.
        let is_chosen = choice.estimate.is_some() || was_tried;
        costs.learn(load, was_tried, is_chosen, choice.took, has_grown && choice.is_cuda);
        let is_wanted = !was_tried && costs.could_be_worth_a_card(load);
        drop(costs);
        if is_wanted {
            self.open();
        }
    }

    /// Applies edits on the card, if that is chosen.
    pub fn edit(&self, work: &PreparedEdits, choice: &mut Choice) -> Attempt<EditDelta> {
        let load = Load::of_edits(work);
        let missing = |session: &Session| session.missing_edits(work);
        self.attempt_stage(choice, load, missing, |session| session.edit(work), |_, delta| Ok(delta))
    }

    /// Meshes blocks on the card, if that is chosen: says for how long `then` waited for their surfaces, which it got. `None`
    /// where the processor has to mesh them, and what `then` made of some that never came has to be forgotten.
    pub fn mesh(
        &self,
        view: &WorldView,
        blocks: &[Block],
        choice: &mut Choice,
        meanwhile: &(dyn Fn() + Sync),
        then: &mut dyn FnMut(&dyn MeshedBlocks),
    ) -> Attempt<Duration> {
        let load = Load::of_blocks(blocks.len());
        let missing = |session: &Session| session.missing_blocks(view, blocks);
        let work = |session: &mut Session| session.mesh(view, blocks, meanwhile);
        self.attempt_stage(choice, load, missing, work, |session, meshed| {
            let Session { meshes, device, .. } = session;
            let surfaces = Surfaces::new(meshes, view, blocks, meshed);
            let drawn = catch_unwind(AssertUnwindSafe(|| then(&surfaces)));
            // `then` may not have waited for all surfaces, and after a panic the session must stay usable.
            let is_over = surfaces.arrival.is_over();
            let waited = surfaces.arrival.end();
            let ended = if is_over { Ok(()) } else { guarded(|| device.wait()) };
            drawn.unwrap_or_else(|panic| resume_unwind(panic));
            ended.and(waited)
        })
    }
}

/// Calls a device. A panic counts as a fault, so that the processor finishes the transaction.
fn guarded<T>(work: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    let failed = |_| Err(Fault::Failed("panic while it was used".into()));
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(failed)
}

impl PendingDevice {
    /// Opens the device and compares it with the processor.
    fn open(self, suggested: Option<CardChoice>, usage: &Arc<Usage>) -> Result<Session, Fault> {
        let device = (self.device)(suggested)?;
        let (device, records) = self.limits.enforce(device, usage);
        let mut session = Session::new(device, records)?;
        self_test::run(&mut session, self.sizes)?;
        session.forget();
        Ok(session)
    }
}

impl Shared {
    /// Gives the card up, with the one warning.
    fn disable(&self, place: &mut Option<Box<Session>>, fault: &Fault) {
        *place = None;
        *lock(&self.state) = EngineState::Lost(fault.to_string());
        log::warn!("bevy_burrow goes on without CUDA: {fault}");
    }
}
