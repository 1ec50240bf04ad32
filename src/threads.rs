//! Threads for long work: transactions, colliders, and background work that may take longer.
//!
//! Bevy's task pools are shared: `AsyncComputeTaskPool` compiles pipelines and has one thread on four cores, so work of
//! seconds would block other users, and rayon's global pool belongs to the game. There are three pools, each of which
//! works first in, first out: a world that loads delays neither the transactions of another one nor the colliders that
//! bodies wait for. Their threads sleep while there is no work. [`ThreadSettings`] says how many there are.
//!
//! On platforms without threads, work is done at once.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, PoisonError, RwLock};
use std::thread;
use std::time::Duration;

use bevy::platform::cell::SyncCell;
use bevy::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// The number of threads of each of the plugin's pools, in addition to Bevy's. Insert it before the plugins, or change
/// it at any time: work under way ends on the threads that it began on.
///
/// The pools belong to the process. If several apps run in one, the settings that changed last hold for all of them.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::plugin::ThreadSettings;
/// // A game that needs most cores for itself.
/// App::new().insert_resource(ThreadSettings { transactions: 2, background: 1, ..default() });
/// ```
#[derive(Resource, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct ThreadSettings {
    /// Threads for transactions, which players wait for.
    pub transactions: usize,
    /// Threads for what may take seconds: loads, textures, saves, seam checks, freeing memory.
    pub background: usize,
    /// Threads for colliders and debris, which bodies wait for.
    pub colliders: usize,
}

impl ThreadSettings {
    /// The default on a machine with this number of cores.
    ///
    /// Transactions use all cores, as their work is short. Background work leaves a core to the frame, since it takes
    /// seconds. Colliders need few: the batches are small.
    fn on(cores: usize) -> Self {
        Self {
            transactions: cores,
            background: cores.saturating_sub(1).max(1),
            colliders: (cores / 4).clamp(1, 4),
        }
    }
}

impl Default for ThreadSettings {
    fn default() -> Self {
        Self::on(thread::available_parallelism().map_or(1, |cores| cores.get()))
    }
}

/// A pool of threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Threads {
    /// For transactions, which players wait for.
    Transactions,
    /// For everything that may take longer: loads, textures, saves, freeing memory.
    Background,
    /// For colliders and debris, which bodies wait for.
    Colliders,
}

/// Bytes of a thread's stack. A thread that waits inside one job may run another one on top of it.
const STACK: usize = 8 << 20;

/// The pools, in order of [`Threads`].
static POOLS: [Pool; 3] =
    [Pool::new("burrow transactions"), Pool::new("burrow background"), Pool::new("burrow colliders")];

/// A pool that is started when it is first used.
struct Pool {
    name: &'static str,
    state: RwLock<PoolState>,
}

#[derive(Default)]
struct PoolState {
    /// How many threads it should have; `None` before the first settings.
    count: Option<usize>,
    /// Once it was started: the threads, or `None` where there are none.
    threads: Option<Option<Arc<ThreadPool>>>,
}

impl Pool {
    const fn new(name: &'static str) -> Self {
        Self { name, state: RwLock::new(PoolState { count: None, threads: None }) }
    }

    /// Sets the number of threads. Earlier work is still done, by the earlier threads.
    fn resize(&self, count: usize) {
        let mut state = self.state.write().unwrap_or_else(PoisonError::into_inner);
        if state.count != Some(count) {
            *state = PoolState { count: Some(count), threads: None };
        }
    }

    /// The pool's threads; `None` where there are none. Until a number is set, the pool has the default number.
    fn threads(&self, default: impl FnOnce() -> usize) -> Option<Arc<ThreadPool>> {
        let state = self.state.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(threads) = &state.threads {
            return threads.clone();
        }
        drop(state);
        let mut state = self.state.write().unwrap_or_else(PoisonError::into_inner);
        let count = state.count.unwrap_or_else(default);
        state.threads.get_or_insert_with(|| self.start(count)).clone()
    }

    fn start(&self, count: usize) -> Option<Arc<ThreadPool>> {
        let name = self.name;
        let builder = ThreadPoolBuilder::new()
            .stack_size(STACK)
            .num_threads(count)
            .thread_name(move |number| format!("{name} {number}"))
            // A panic in work without a waiting caller, such as freeing memory, would otherwise end the process.
            .panic_handler(|panic| error!("background work panicked: {}", panic_message(panic.as_ref())));
        builder.build().ok().map(Arc::new)
    }
}

impl Threads {
    const ALL: [Self; 3] = [Self::Transactions, Self::Background, Self::Colliders];

    /// How many threads it should have.
    fn count(self, settings: &ThreadSettings) -> usize {
        let count = match self {
            Self::Transactions => settings.transactions,
            Self::Background => settings.background,
            Self::Colliders => settings.colliders,
        };
        count.max(1)
    }

    /// The threads of this kind; `None` where there are none.
    fn pool(self) -> Option<Arc<ThreadPool>> {
        POOLS[self as usize].threads(|| self.count(&ThreadSettings::default()))
    }

    /// Runs work on this pool.
    pub fn spawn(self, work: impl FnOnce() + Send + 'static) {
        match self.pool() {
            Some(pool) => pool.spawn_fifo(work),
            None => work(),
        }
    }
}

/// Gives the pools the number of threads that the settings say.
pub(crate) fn resize_pools(settings: Res<ThreadSettings>) {
    for pool in Threads::ALL {
        POOLS[pool as usize].resize(pool.count(&settings));
    }
}

/// Drops a large value on another thread.
pub(crate) fn free_later(waste: impl Send + 'static) {
    Threads::Background.spawn(move || drop(waste));
}

/// The message of a panic.
pub(crate) fn panic_message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("a panic without a message")
}

/// Work on one of these pools. Dropping this cancels work that has not begun; otherwise its result is dropped.
pub(crate) struct ThreadTask<T: Send + 'static> {
    result: SyncCell<Receiver<thread::Result<T>>>,
    _wanted: Arc<()>,
}

#[allow(dead_code, reason = "which of them are used depends on the features")]
impl<T: Send + 'static> ThreadTask<T> {
    /// Starts work.
    pub fn start(threads: Threads, work: impl FnOnce() -> T + Send + 'static) -> Self {
        let (sender, receiver) = sync_channel(1);
        let wanted = Arc::new(());
        let is_wanted = Arc::downgrade(&wanted);
        threads.spawn(move || {
            if is_wanted.strong_count() > 0 {
                // A panic is passed on. An error means that the result is no longer awaited.
                let _ = sender.send(catch_unwind(AssertUnwindSafe(work)));
            }
        });
        Self { result: SyncCell::new(receiver), _wanted: wanted }
    }

    /// The result once it is there, or the panic of the work; only the first call returns it.
    pub fn check(&mut self) -> Option<thread::Result<T>> {
        self.result.get().try_recv().ok()
    }

    /// The result if it is there within a time, like [`check`](Self::check).
    pub fn check_within(&mut self, time: Duration) -> Option<thread::Result<T>> {
        if time.is_zero() { self.check() } else { self.result.get().recv_timeout(time).ok() }
    }

    /// Waits for the result, on another thread than the main one; `None` if the work panicked, or the result was taken.
    pub fn wait(mut self) -> Option<T> {
        self.result.get().recv().ok()?.ok()
    }

    /// The result once it is there; resumes the panic if the work panicked.
    pub fn finish(&mut self) -> Option<T> {
        self.finish_within(Duration::ZERO)
    }

    /// The result if it is there within a time, for which this waits; resumes the panic if the work panicked.
    pub fn finish_within(&mut self, time: Duration) -> Option<T> {
        self.check_within(time).map(|result| result.unwrap_or_else(|panic| resume_unwind(panic)))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::time::Instant;

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

    /// Keeps the background threads busy until the returned value is dropped.
    fn block_background() -> impl Sized {
        let many = Threads::Background.pool().map_or(0, |pool| pool.current_num_threads());
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
    fn a_pool_that_is_resized_finishes_what_it_was_given() {
        let pool = Pool::new("burrow test");
        let threads = || pool.threads(|| 1).expect("there are threads");
        assert_eq!(threads().current_num_threads(), 1, "the default");
        let ((open, gate), (done, is_done)) = (channel::<()>(), channel());
        let later = done.clone();
        threads().spawn_fifo(move || {
            let _ = gate.recv();
            let _ = done.send(1);
        });
        threads().spawn_fifo(move || {
            let _ = later.send(2);
        });
        pool.resize(3);
        assert_eq!(threads().current_num_threads(), 3);
        assert!(is_done.try_recv().is_err());
        drop(open);
        assert_eq!(is_done.iter().collect::<Vec<_>>(), [1, 2]);
        pool.resize(3);
        assert_eq!(threads().current_num_threads(), 3);
    }

    #[test]
    fn background_work_leaves_a_core_to_the_frame() {
        for cores in 1..65 {
            let ThreadSettings { transactions, background, colliders } = ThreadSettings::on(cores);
            assert!(transactions == cores && background >= 1 && (1..=4).contains(&colliders));
            assert!(background < cores || cores == 1, "{background} of {cores}");
        }
    }

    #[test]
    fn a_panic_is_a_result() {
        let mut work = ThreadTask::start(Threads::Transactions, || -> u32 { panic!("on purpose") });
        assert!(wait(&mut work).is_err());
        assert!(work.check().is_none());
    }
}
