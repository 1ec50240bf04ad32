//! Threads for what takes its time: transactions, and whatever may take longer.
//!
//! Bevy's task pools are shared: `AsyncComputeTaskPool` compiles pipelines and has one thread on four cores, so synchronous
//! work of seconds would keep others waiting there, and rayon's own pool is the game's. What is done here nobody else waits
//! for. There are two pools, so that a world that loads does not keep the transactions of another one waiting; their threads
//! sleep unless there is work.
//!
//! Where there are no threads, work is done at once.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, OnceLock};
use std::thread;

use bevy::platform::cell::SyncCell;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Whose work it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Threads {
    /// Of transactions, which somebody waits for.
    Transactions,
    /// Of whatever may take longer: loads, colliders, textures, memory that is freed.
    Background,
}

/// Bytes of a thread's stack: who waits within one piece of work may do another one meanwhile, on top of it.
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

    /// Does something there.
    pub fn spawn(self, work: impl FnOnce() + Send + 'static) {
        match self.pool() {
            Some(pool) => pool.spawn_fifo(work),
            None => work(),
        }
    }
}

/// Frees on another thread what takes its time to free.
pub(crate) fn free_later(waste: impl Send + 'static) {
    Threads::Background.spawn(move || drop(waste));
}

/// Work on such a thread. If it has not begun when this is dropped, it never does; else its result is dropped.
pub(crate) struct ThreadTask<T: Send + 'static> {
    result: SyncCell<Receiver<thread::Result<T>>>,
    _wanted: Arc<()>,
}

impl<T: Send + 'static> ThreadTask<T> {
    /// Starts it.
    pub fn start(threads: Threads, work: impl FnOnce() -> T + Send + 'static) -> Self {
        let (sender, receiver) = sync_channel(1);
        let wanted = Arc::new(());
        let is_wanted = Arc::downgrade(&wanted);
        threads.spawn(move || {
            if is_wanted.strong_count() > 0 {
                // Whoever waits hears of a panic; if nobody does, the result goes.
                let _ = sender.send(catch_unwind(AssertUnwindSafe(work)));
            }
        });
        Self { result: SyncCell::new(receiver), _wanted: wanted }
    }

    /// The result, once, if it is there: that the work panicked is one, too.
    pub fn check(&mut self) -> Option<thread::Result<T>> {
        self.result.get().try_recv().ok()
    }

    /// The same; panics as the work did.
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
    fn hold_background() -> impl Sized {
        let many = Threads::Background.pool().map_or(0, ThreadPool::current_num_threads);
        let (mut gate, (begun, begins)) = (Vec::new(), channel());
        for _ in 0..many {
            let (hold, held) = channel::<()>();
            gate.push(hold);
            let begun = begun.clone();
            Threads::Background.spawn(move || {
                begun.send(()).expect("somebody waits for it");
                // An error: what was held on to is gone.
                let _ = held.recv();
            });
        }
        (0..many).for_each(|_| begins.recv().expect("it begins"));
        gate
    }

    #[test]
    fn transactions_do_not_wait_for_loads() {
        let held = hold_background();
        let mut load = ThreadTask::start(Threads::Background, || 2);
        assert_eq!(wait(&mut ThreadTask::start(Threads::Transactions, || 3)).unwrap(), 3);
        assert!(load.check().is_none());
        drop(held);
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
        let held = hold_background();
        app.world_mut().despawn(terrain);
        assert_eq!(world.strong_count(), 1, "freed on the main thread");
        drop(held);
        let start = Instant::now();
        while world.strong_count() > 0 {
            assert!(start.elapsed() < Duration::from_secs(60), "it is never freed");
            thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn a_panic_is_a_result() {
        let mut work = ThreadTask::start(Threads::Transactions, || -> u32 { panic!("as it was told") });
        assert!(wait(&mut work).is_err());
        assert!(work.check().is_none());
    }
}
