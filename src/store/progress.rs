//! The progress of opening a world, for a progress bar.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// The progress of opening or creating a world. Clones share one state: give one to
/// [`StoreOptions::progress`](super::StoreOptions::progress), and read the other from the thread that draws the
/// progress bar.
///
/// A handle is for one world: the share never falls.
#[derive(Clone, Debug, Default)]
pub struct Progress(Arc<AtomicU32>);

/// Clones of one handle are equal.
impl PartialEq for Progress {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Progress {
    /// The finished share, 0 to 1, in proportion to time. It is 1 once the world can be played, and stays
    /// where it was if it can't be opened.
    pub fn share(&self) -> f32 {
        f32::from_bits(self.0.load(Ordering::Relaxed))
    }

    /// Raises the share to this, if it is lower.
    fn raise(&self, share: f32) {
        // Numbers that are not negative have the order of their bits.
        self.0.fetch_max(share.clamp(0.0, 1.0).to_bits(), Ordering::Relaxed);
    }
}

/// The work that is left until a share is reached, in units of one kind. Nobody needs to watch.
#[derive(Debug)]
pub(super) struct Work<'a> {
    progress: Option<&'a Progress>,
    from: f32,
    to: f32,
    total: u64,
    done: AtomicU64,
}

impl<'a> Work<'a> {
    /// Work of `total` units that advances the progress from its present share to `to`.
    pub fn until(progress: Option<&'a Progress>, to: f32, total: u64) -> Self {
        let from = progress.map_or(0.0, Progress::share);
        Self { progress, from, to, total, done: AtomicU64::new(0) }
    }

    /// Adds finished units.
    pub fn advance(&self, units: u64) {
        let Some(progress) = self.progress else { return };
        let done = self.done.fetch_add(units, Ordering::Relaxed).saturating_add(units);
        let share = done.min(self.total) as f32 / self.total.max(1) as f32;
        progress.raise(self.from + (self.to - self.from) * share);
    }

    /// All units are done.
    pub fn finish(self) {
        if let Some(progress) = self.progress {
            progress.raise(self.to);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_leads_from_share_to_share_and_never_back() {
        let progress = Progress::default();
        let work = Work::until(Some(&progress), 0.5, 4);
        let shares = [1, 1, 1, 1, 9].map(|units| {
            work.advance(units);
            progress.share()
        });
        assert_eq!(shares, [0.125, 0.25, 0.375, 0.5, 0.5]);
        // What has to be done again does not move it.
        let again = Work::until(Some(&progress), 0.25, 2);
        again.advance(1);
        again.finish();
        assert!((progress.share() - 0.5).abs() < 1e-6);
        // Nothing to do is done at once, and threads take part in any order.
        Work::until(Some(&progress), 0.75, 0).finish();
        let work = Work::until(Some(&progress), 1.0, 800);
        std::thread::scope(|scope| {
            (0..8).for_each(|_| drop(scope.spawn(|| (0..100).for_each(|_| work.advance(1)))));
        });
        assert_eq!(progress.share().to_bits(), 1f32.to_bits());
    }
}
