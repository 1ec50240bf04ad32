//! Stores whose owner was dropped: they are closed on other threads, and only an exiting app waits for them.

use std::sync::mpsc::{Receiver, TryRecvError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::components::EXIT_WAIT;
use crate::store::ClosingStore;

/// The abandoned stores of an app. Clones share them.
#[derive(Clone, Default)]
pub(crate) struct AbandonedStores(Arc<Mutex<State>>);

#[derive(Default)]
struct State {
    stores: Vec<Abandoned>,
    /// Whether the app has ended, so that nothing will wait for a store that is abandoned now.
    has_ended: bool,
}

/// A store that another thread closes as soon as it has passed the last commits to it.
struct Abandoned {
    coming: Receiver<ClosingStore>,
    store: Option<ClosingStore>,
}

impl AbandonedStores {
    /// Adds a store that arrives later; nothing if the sender is dropped.
    pub fn add(&self, coming: Receiver<ClosingStore>) {
        let abandoned = Abandoned { coming, store: None };
        let mut state = self.lock();
        if state.has_ended {
            drop(state);
            abandoned.wait(Instant::now() + EXIT_WAIT);
        } else {
            state.stores.push(abandoned);
        }
    }

    /// Logs the warnings of stores, and forgets those that are closed.
    pub fn poll(&self) {
        self.lock().stores.retain_mut(|abandoned| !abandoned.is_done());
    }

    /// Waits once, until all stores are closed or the deadline passes.
    pub fn wait(&self, end: Instant) {
        let stores = std::mem::take(&mut self.lock().stores);
        stores.into_iter().for_each(|abandoned| abandoned.wait(end));
    }

    /// From now on, adding a store blocks until it is closed.
    pub fn end(&self) {
        self.lock().has_ended = true;
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Abandoned {
    fn is_done(&mut self) -> bool {
        if self.store.is_none() {
            match self.coming.try_recv() {
                Ok(store) => self.store = Some(store),
                Err(why) => return why == TryRecvError::Disconnected,
            }
        }
        let Some(store) = &self.store else { return false };
        let outcome = store.outcome();
        for warning in store.take_warnings() {
            warn!("a world that is no longer served: {warning}");
        }
        if let Some(Err(why)) = &outcome {
            error!("not everything is saved in a world that is no longer served: {why}");
        }
        outcome.is_some()
    }

    fn wait(mut self, end: Instant) {
        let left = || end.saturating_duration_since(Instant::now());
        if self.store.is_none() {
            self.store = self.coming.recv_timeout(left()).ok();
        }
        if let Some(store) = &self.store {
            // The reason is logged below.
            let _ = store.wait(left());
        }
        if !self.is_done() {
            error!("a world that is no longer served was not saved within {} s", EXIT_WAIT.as_secs());
        }
    }
}
