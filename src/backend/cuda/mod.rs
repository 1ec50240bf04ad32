//! CUDA: fields kept on a card, edits applied there, one launch for all that is dirty, and only what is used comes back.
//!
//! ```text
//! edits  -> jobs, missing bricks ---one copy--->  edit kernel: a block for each brick
//!           bricks, receipts     <--what changed-
//! blocks -> windows of bricks    ---one copy--->  mesh kernel: a block for each block
//!           vertices, indices    <--what is used-
//! ```
//!
//! Edits that look around, sculpting ones and those that rules bear on, take a kernel of their own, which gets windows of
//! bricks too. They come run by run, as the processor takes them: what one run changed is on the device already when the
//! next one reads it. A fault in the middle leaves the runs that came back as they are, and the processor does the rest.
//!
//! - [`device`](self::device) says what is asked of a device; `driver` asks a card.
//! - [`session`](self::session) keeps bricks and heights on it, with a budget; `slots` says where, and which go first.
//! - [`edit`](self::edit) and [`mesh`](self::mesh) pack the jobs and unpack the results; `layout` is the form of both.
//!   Surfaces are not unpacked: whoever draws them takes them from where they arrived, by `surfaces`.
//! - `heights` makes new ground of noise.
//! - `trial` compares the device with the processor, and measures both.
//!
//! A session belongs to one transaction at a time. One that finds it taken by another terrain's does its work on the
//! processor, so nobody ever waits for the device but the task that uses it. It is held until surfaces are drawn, which lie
//! in its memory.

mod cache;
mod device;
mod driver;
mod edit;
mod heights;
#[cfg(all(feature = "interop", target_os = "linux"))]
pub mod interop;
mod layout;
mod lists;
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
use super::{Choice, EngineState, lock};
use crate::surface::block::Block;
use crate::surface::fresh::FreshParts;
use crate::surface::vertex::WorldView;
use crate::volume::{EditWork, Ledger};
use device::{Device, Fault};
use session::Session;

/// A card beside the processor.
pub(super) struct Cuda {
    /// Is the faster of both taken? Else the card is, whenever it can be.
    is_auto: bool,
    slot: Arc<Mutex<Place>>,
    /// What became of opening it, to be asked at any time.
    state: Arc<Mutex<EngineState>>,
    /// How long the trial took, when it is over.
    trial: Arc<OnceLock<Duration>>,
    /// Was it said that something was too much for the card?
    has_passed: AtomicBool,
}

/// Where the session is.
enum Place {
    Opening,
    Open(Box<Session>, Box<Costs>),
    Lost,
}

/// Of a device's free memory, the part that bricks and ground may take.
const SHARE: usize = 4;
/// And the most of it.
const MOST: usize = 1 << 30;

/// The same, unless somebody else has it now. Who panicked with it had what is in it to read, and changed nothing.
fn try_lock<T>(mutex: &Mutex<T>) -> Option<MutexGuard<'_, T>> {
    match mutex.try_lock() {
        Ok(guard) => Some(guard),
        Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
        Err(TryLockError::WouldBlock) => None,
    }
}

impl Cuda {
    /// Opens the first card, in the background.
    pub fn open(is_auto: bool) -> Self {
        Self::open_with(is_auto, None, self_test::FULL, || Ok(Box::new(driver::Card::open()?)))
    }

    /// Opens some device, in the background; bricks and ground may take so many bytes of it.
    fn open_with(
        is_auto: bool,
        budget: Option<usize>,
        sizes: self_test::Sizes,
        device: impl FnOnce() -> Result<Box<dyn Device>, Fault> + Send + 'static,
    ) -> Self {
        let own = Self {
            is_auto,
            slot: Arc::new(Mutex::new(Place::Opening)),
            state: Arc::new(Mutex::new(EngineState::Opening)),
            trial: Arc::default(),
            has_passed: AtomicBool::default(),
        };
        let (slot, state, took) = (Arc::clone(&own.slot), Arc::clone(&own.state), Arc::clone(&own.trial));
        let open = move || {
            let open = || {
                let mut device = device()?;
                let budget = budget.unwrap_or_else(|| (device.free_memory() / SHARE).min(MOST));
                let mut session = Session::new(device, budget)?;
                let start = Instant::now();
                let costs = self_test::run(&mut session, sizes)?;
                took.get_or_init(|| start.elapsed());
                session.forget();
                Ok((session, costs))
            };
            match guarded(open) {
                Ok((session, costs)) => {
                    let name = session.name();
                    // Nobody may lose it before it is said to be there.
                    let mut place = lock(&slot);
                    *place = Place::Open(Box::new(session), Box::new(costs));
                    *lock(&state) = EngineState::Cuda(name);
                }
                Err(fault) => lose(&mut lock(&slot), &state, &fault),
            }
        };
        let thread = std::thread::Builder::new().name("burrow-cuda".into()).spawn(open);
        if let Err(error) = thread {
            lose(&mut lock(&own.slot), &own.state, &Fault::Failed(error.to_string()));
        }
        own
    }

    pub fn state(&self) -> EngineState {
        lock(&self.state).clone()
    }

    /// How long the card was tried out; zero until it has passed.
    pub fn trial(&self) -> Duration {
        self.trial.get().copied().unwrap_or_default()
    }

    /// Does a stage on the card if that is there, free and chosen; else the processor has to do it. `then` makes something
    /// of what was done, while it still lies in the session's memory. What it made of things that the card did not bring in
    /// the end is lost.
    ///
    /// So the lock is held until `then` is through, which may run other tasks of its thread pool meanwhile, even on this
    /// thread. That can't block: whoever else wants the session tries the lock and goes on without.
    fn offer<T, R>(
        &self,
        choice: &mut Choice,
        mut load: Load,
        missing: impl FnOnce(&Session) -> usize,
        work: impl FnOnce(&mut Session) -> Result<T, Fault>,
        then: impl FnOnce(&mut Session, T) -> Result<R, Fault>,
    ) -> (Option<R>, Load) {
        // Whoever holds it may be busy for long; and a thread that waits here could be the one that has to finish that.
        let Some(mut place) = try_lock(&self.slot) else { return (None, load) };
        let Place::Open(session, costs) = &mut *place else { return (None, load) };
        let mut is_chosen = |load: Load| {
            let (estimate, is_chosen) = costs.choose(choice.stage, load);
            (choice.missing, choice.estimate) = (load.missing, Some(estimate));
            load.amount > 0 && (is_chosen || !self.is_auto)
        };
        // Whatever is missing only makes the card slower, so small transactions need not look for it.
        if !is_chosen(load) {
            return (None, load);
        }
        load.missing = missing(session);
        if !is_chosen(load) {
            return (None, load);
        }
        let done = guarded(|| work(session));
        let times = session.times();
        // A panic in `then` is the caller's, and no fault of the device's.
        match done.and_then(|done| then(session, done)) {
            Ok(made) => {
                choice.is_cuda = true;
                [choice.device, choice.kernel] = times;
                (Some(made), load)
            }
            Err(fault) => {
                // What was lost on trying is not the processor's time to be learnt from.
                choice.estimate = None;
                costs.fail(choice.stage, load);
                self.meet(&mut place, &fault);
                (None, load)
            }
        }
    }

    /// Gives the card up, unless it is fine and only what was asked too much for it; either way with one warning.
    fn meet(&self, place: &mut Place, fault: &Fault) {
        if !fault.is_passing() {
            lose(place, &self.state, fault);
        } else if !self.has_passed.swap(true, Ordering::Relaxed) {
            log::warn!("bevy_burrow does without CUDA what is too much for the device: {fault}");
        }
    }

    /// Takes in how long a stage took.
    pub fn learn(&self, choice: &Choice, load: Load) {
        if choice.estimate.is_some()
            && let Some(mut place) = try_lock(&self.slot)
            && let Place::Open(_, costs) = &mut *place
        {
            costs.learn(choice.stage, load, choice.is_cuda, choice.took);
        }
    }

    /// Applies edits on the card, if that is chosen.
    pub fn edit(&self, work: &EditWork, choice: &mut Choice) -> (Option<Ledger>, Load) {
        let load = Load::of_edits(work);
        let missing = |session: &Session| session.missing_edits(work);
        self.offer(choice, load, missing, |session| session.edit(work), |_, ledger| Ok(ledger))
    }

    /// Meshes blocks on the card, if that is chosen: says for how long `then` waited for their surfaces, which it got. `None`
    /// where the processor has to mesh them, and what `then` made of some that never came has to be forgotten.
    pub fn mesh(
        &self,
        view: &WorldView,
        blocks: &[Block],
        choice: &mut Choice,
        meanwhile: &(dyn Fn() + Sync),
        then: &mut dyn FnMut(&dyn FreshParts),
    ) -> (Option<Duration>, Load) {
        let load = Load { amount: blocks.len(), ..Load::default() };
        let missing = |session: &Session| session.missing_blocks(view, blocks);
        let work = |session: &mut Session| session.mesh(view, blocks, meanwhile);
        self.offer(choice, load, missing, work, |session, meshed| {
            let Session { meshes, device, .. } = session;
            let surfaces = meshes.surfaces(view, blocks, meshed);
            let drawn = catch_unwind(AssertUnwindSafe(|| then(&surfaces)));
            // Whoever needed no more than some of them did not wait for all; and who panicked leaves the session to others.
            let is_over = surfaces.arrival.is_over();
            let waited = surfaces.arrival.end();
            let ended = if is_over { Ok(()) } else { guarded(|| device.wait()) };
            drawn.unwrap_or_else(|panic| resume_unwind(panic));
            ended.and(waited)
        })
    }
}

/// Does something with a device, whose driver may do anything: a panic is a fault, and somebody finishes the transaction.
fn guarded<T>(work: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    let failed = |_| Err(Fault::Failed("panic while it was used".into()));
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(failed)
}

/// Gives the card up, with the one warning.
fn lose(place: &mut Place, state: &Mutex<EngineState>, fault: &Fault) {
    *place = Place::Lost;
    *lock(state) = EngineState::Lost(fault.to_string());
    log::warn!("bevy_burrow goes on without CUDA: {fault}");
}
