//! Threads for long work: transactions, and background work that may take longer.
//!
//! Bevy's task pools are shared: `AsyncComputeTaskPool` compiles pipelines and has one thread on four cores, so work
//! of seconds would block other users, and rayon's global pool belongs to the game. There are two pools, so that a world that
//! loads does not delay the transactions of another one. Their threads sleep while there is no work.
//!
//! On platforms without threads, work is done at once.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, OnceLock};
use std::thread;

use bevy::platform::cell::SyncCell;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// A pool of threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Threads {
    /// For transactions, which players wait for.
    Transactions,
    /// For everything that may take longer: loads, colliders, textures, freeing memory.
    Background,
}

/// Bytes of a thread's stack. A thread that waits inside one job may run another one on top of it.
const STACK: usize = 8 << 20;

impl Threads {
    /// The pool, with as many threads as rayon's own has; `None` where there are none.
    fn pool(self) -> Option<&'static ThreadPool> {
        static TRANSACTIONS: OnceLock<Option<ThreadPool>> = OnceLock::new();
        static BACKGROUND: OnceLock<Option<ThreadPool>> = OnceLock::new();
        let (pool, name) = match self {
            Self::Transactions => (&TRANSACTIONS, "burrow transactions"),
            Self::Background => (&BACKGROUND, "burrow background"),
        };
        let build = || {
            ThreadPoolBuilder::new()
                .stack_size(STACK)
                .thread_name(move |number| format!("{name} {number}"))
                .build()
                .ok()
        };
        pool.get_or_init(build).as_ref()
    }

    /// Runs work on this pool.
    pub fn spawn(self, work: impl FnOnce() + Send + 'static) {
        match self.pool() {
            Some(pool) => pool.spawn_fifo(work),
            None => work(),
        }
    }
}

/// Drops a large value on another thread.
pub(crate) fn free_later(waste: impl Send + 'static) {
    Threads::Background.spawn(move || drop(waste));
}

/// Work on one of these pools. Dropping this cancels work that has not begun; otherwise its result is dropped.
pub(crate) struct ThreadTask<T: Send + 'static> {
    result: SyncCell<Receiver<thread::Result<T>>>,
    _wanted: Arc<()>,
}

impl<T: Send + 'static> ThreadTask<T> {
    /// Starts work.
    pub fn start(threads: Threads, work: impl FnOnce() -> T + Send + 'static) -> Self {
        let (sender, receiver) = sync_channel(1);
        let wanted = Arc::new(());
        let is_wanted = Arc::downgrade(&wanted);
        threads.spawn(move || {
            if is_wanted.strong_count() > 0 {
                // A panic is passed on. An error means that nobody waits any more.
                let _ = sender.send(catch_unwind(AssertUnwindSafe(work)));
            }
        });
        Self { result: SyncCell::new(receiver), _wanted: wanted }
    }

    /// The result once it is there, or the panic of the work; only the first call returns it.
    pub fn check(&mut self) -> Option<thread::Result<T>> {
        self.result.get().try_recv().ok()
    }

    /// The result once it is there; resumes the panic if the work panicked.
    pub fn finish(&mut self) -> Option<T> {
        self.check().map(|result| result.unwrap_or_else(|panic| resume_unwind(panic)))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::time::{Duration, Instant};

    use bevy::prelude::*;

    use super::*;
    use crate::ground::Ground;
    use crate::plugin::TerrainPlugin;
    use crate::terrain::{Terrain, TerrainSettings};

    fn wait<T: Send>(work: &mut ThreadTask<T>) -> thread::Result<T> {
        let start = Instant::now();
        loop {
            if let Some(result) = work.check() {
                return result;
            }
            assert!(start.elapsed() < Duration::from_secs(60), "it never comes");
            thread::sleep(Duration::from_millis(1));
        }
    }

    /// Keeps the threads of the background busy until what it returns is dropped.
    fn block_background() -> impl Sized {
        let many = Threads::Background.pool().map_or(0, ThreadPool::current_num_threads);
        let (mut gate, (begun, begins)) = (Vec::new(), channel());
        for _ in 0..many {
            let (sender, receiver) = channel::<()>();
            gate.push(sender);
            let begun = begun.clone();
            Threads::Background.spawn(move || {
                begun.send(()).expect("somebody waits for it");
                // Returns an error once the gate is dropped.
                let _ = receiver.recv();
            });
        }
        (0..many).for_each(|_| begins.recv().expect("it begins"));
        gate
    }

    #[test]
    fn transactions_do_not_wait_for_loads() {
        let gate = block_background();
        let mut load = ThreadTask::start(Threads::Background, || 2);
        assert_eq!(wait(&mut ThreadTask::start(Threads::Transactions, || 3)).unwrap(), 3);
        assert!(load.check().is_none());
        drop(gate);
        assert_eq!(wait(&mut load).unwrap(), 2);
    }

    #[test]
    fn the_world_of_a_terrain_that_goes_is_freed_on_another_thread() {
        let ground = Ground::flat(64, 64, 8.0).unwrap();
        let terrain = Terrain::new(ground, &TerrainSettings::default()).unwrap();
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, TerrainPlugin));
        let terrain = app.world_mut().spawn(terrain).id();
        app.update();
        let world = Arc::downgrade(&app.world().get::<Terrain>(terrain).unwrap().snapshot());
        assert_eq!(world.strong_count(), 1);
        let gate = block_background();
        app.world_mut().despawn(terrain);
        assert_eq!(world.strong_count(), 1, "freed on the main thread");
        drop(gate);
        let start = Instant::now();
        while world.strong_count() > 0 {
            assert!(start.elapsed() < Duration::from_secs(60), "it is never freed");
            thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn a_panic_is_a_result() {
        let mut work = ThreadTask::start(Threads::Transactions, || -> u32 { panic!("on purpose") });
        assert!(wait(&mut work).is_err());
        assert!(work.check().is_none());
    }
}
