//! The store's thread, and stores that are being closed.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::shared::{SavePoint, Shared};
use crate::store::error::{StoreError, StoreWarning};

/// The interval at which waiting for a closing store checks its state.
const LOOK: Duration = Duration::from_millis(1);

/// The thread of a store. It ends once all senders are gone.
#[derive(Debug)]
pub(in crate::store) struct StoreThread(JoinHandle<()>);

impl StoreThread {
    /// Starts it. If the work panics, that is reported.
    pub fn start(shared: Arc<Shared>, work: impl FnOnce() + Send + 'static) -> Result<Self, StoreError> {
        let thread = std::thread::Builder::new().name("burrow store".into());
        let guarded = move || {
            if let Err(panic) = catch_unwind(AssertUnwindSafe(work)) {
                let why = message_of(&*panic);
                shared.set_failing(Some(&why));
                shared.report_warning(StoreWarning::Ended(why));
            }
        };
        thread.spawn(guarded).map(Self).map_err(StoreError::files("starting the store's thread"))
    }

    pub fn is_done(&self) -> bool {
        self.0.is_finished()
    }
}

/// The message of a panic.
fn message_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or(panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("no reason is known").to_owned()
}

/// A [`Store`](crate::store::Store) that is being [closed](crate::store::Store::close). If this is dropped, its thread
/// still finishes, and the world stays locked until then.
#[derive(Debug)]
pub struct ClosingStore {
    shared: Arc<Shared>,
    thread: Option<StoreThread>,
    /// The point up to which everything should be durable.
    point: SavePoint,
    /// Whether everything was sent to the thread.
    is_given: bool,
}

impl ClosingStore {
    pub(in crate::store) fn new(
        shared: Arc<Shared>,
        thread: Option<StoreThread>,
        point: SavePoint,
        is_given: bool,
    ) -> Self {
        Self { shared, thread, point, is_given }
    }

    /// Whether the world is closed, so that it can be opened again.
    pub fn is_done(&self) -> bool {
        self.thread.as_ref().is_none_or(StoreThread::is_done)
    }

    /// The revision up to which everything was saved, once the world is closed; `None` before.
    pub fn outcome(&self) -> Option<Result<u64, StoreError>> {
        self.is_done().then(|| {
            let is_saved = self.is_given && self.shared.durable() >= Some(self.point);
            if is_saved {
                return Ok(self.point.revision());
            }
            let why = self.shared.failing().unwrap_or_else(|| "the disk did not answer".into());
            Err(StoreError::NotSaved(why))
        })
    }

    /// Waits until the world is closed, but no longer than this. Returns the revision up to which everything was saved.
    ///
    /// # Errors
    /// When something could not be saved; [`StoreError::TimedOut`] when the disk does not answer in time.
    pub fn wait(&self, wait: Duration) -> Result<u64, StoreError> {
        let end = Instant::now().checked_add(wait);
        loop {
            if let Some(outcome) = self.outcome() {
                return outcome;
            }
            if end.is_some_and(|end| end <= Instant::now()) {
                return Err(StoreError::TimedOut);
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Warnings since the last call, to show to a player or an operator.
    pub fn take_warnings(&self) -> Vec<StoreWarning> {
        self.shared.take_warnings()
    }
}
