//! A terrain's steps through its history.

use super::history::{DeferredDrop, History};
use super::model::Terrain;
use crate::world::Memory;

impl Terrain {
    /// The steps that can be undone and redone, and their memory.
    pub fn history(&self) -> History {
        self.undo_stack.figures()
    }

    /// Limits the history to `bytes` bytes; 64 MiB by default, and 0 turns history off. If it grows beyond
    /// that, the oldest steps are dropped. A dug brick of 8x8x8 samples takes about 1.2 KB, so 64 MiB are the
    /// surface of some thousand digs of radius 8. What exceeds the budget is dropped before this returns.
    pub fn set_undo_budget(&mut self, bytes: usize) {
        drop(self.rebudget_undo(bytes));
    }

    /// Like [`Self::set_undo_budget`]; the caller may drop the excess on another thread.
    pub(crate) fn rebudget_undo(&mut self, bytes: usize) -> DeferredDrop {
        self.undo_stack.set_budget(bytes)
    }

    /// The most bytes that history may take.
    pub fn undo_budget(&self) -> usize {
        self.undo_stack.budget()
    }

    /// Clears the steps that can be undone and redone; the budget stays. Queued or running edits enter history once
    /// they are committed, and queued steps find nothing to do.
    ///
    /// ```
    /// # use bevy_burrow::prelude::*;
    /// # use glam::Vec3;
    /// # let journal = [Brush::dig(Shape::sphere(Vec3::new(32.0, 10.0, 32.0), 4.0))];
    /// let mut terrain = Terrain::new(Ground::flat(64, 64, 10.0)?, &TerrainSettings::default())?;
    /// terrain.apply(&journal);
    /// assert_eq!(terrain.history().undos, 1);
    /// // A loaded game cannot be undone.
    /// terrain.clear_history();
    /// assert_eq!(terrain.history(), History::default());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn clear_history(&mut self) {
        self.undo_stack.clear(&mut DeferredDrop::default());
        // An unfinished stroke starts a new group.
        self.queue.close_group();
    }

    /// Bytes that the terrain takes: its world, and its history.
    pub fn memory(&self) -> Memory {
        Memory { undo: self.undo_stack.figures().bytes, ..self.world.memory() }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::Ground;
    use crate::terrain::model::UNDO_BUDGET;
    use crate::terrain::{Order, Rejection, TerrainSettings};

    fn terrain() -> Terrain {
        let ground = Ground::flat(64, 64, 8.0).expect("valid");
        Terrain::new(ground, &TerrainSettings::default()).expect("valid")
    }

    fn dig(x: f32) -> Brush {
        Brush::dig(Shape::sphere(Vec3::new(x, 8.0, 30.0), 5.0))
    }

    #[test]
    fn the_excess_of_a_smaller_budget_is_returned_to_the_caller() {
        let mut terrain = terrain();
        assert_eq!(terrain.undo_budget(), UNDO_BUDGET);
        for x in [20.0, 40.0] {
            terrain.apply([dig(x)]);
        }
        assert_eq!(terrain.history().undos, 2);
        assert!(terrain.rebudget_undo(1 << 30).is_empty());
        assert_eq!((terrain.undo_budget(), terrain.history().undos), (1 << 30, 2));
        assert!(!terrain.rebudget_undo(0).is_empty());
        assert_eq!((terrain.undo_budget(), terrain.history()), (0, History::default()));
    }

    fn counts(terrain: &Terrain) -> (usize, usize) {
        let History { undos, redos, .. } = terrain.history();
        (undos, redos)
    }

    /// Runs what waits, forgets history meanwhile, and commits.
    fn clear_meanwhile(terrain: &mut Terrain) {
        let commit = terrain.begin().expect("something waits").run();
        terrain.clear_history();
        assert_eq!(terrain.history(), History::default());
        terrain.commit(commit).expect("the one under way");
    }

    #[test]
    fn cleared_history_restarts_with_the_running_transaction() {
        let mut terrain = terrain();
        terrain.set_undo_budget(1 << 30);
        terrain.apply([dig(20.0)]);
        let before = terrain.world().hash();
        terrain.submit(dig(40.0));
        clear_meanwhile(&mut terrain);
        let after = terrain.world().hash();
        assert_eq!((terrain.undo_budget(), counts(&terrain)), (1 << 30, (1, 0)));
        terrain.submit(Order::Undo);
        clear_meanwhile(&mut terrain);
        assert_eq!((terrain.world().hash(), counts(&terrain)), (before, (0, 1)));
        assert!(terrain.redo().outcome.is_ok());
        assert_eq!(terrain.world().hash(), after);
    }

    #[test]
    fn a_stroke_continued_after_history_was_cleared_is_a_step_again() {
        let mut terrain = terrain();
        terrain.apply([dig(20.0).with_stroke(1)]);
        terrain.clear_history();
        let before = terrain.world().hash();
        terrain.apply([dig(40.0).with_stroke(1)]);
        assert_eq!(counts(&terrain), (1, 0));
        assert!(terrain.undo().outcome.is_ok());
        assert_eq!((terrain.world().hash(), counts(&terrain)), (before, (0, 1)));
    }

    #[test]
    fn steps_that_wait_when_history_is_forgotten_find_nothing() {
        let mut terrain = terrain();
        terrain.apply([dig(20.0)]);
        terrain.submit(Order::Undo);
        terrain.clear_history();
        assert!(terrain.begin().is_none());
        let receipts = terrain.take_receipts();
        let outcomes: Vec<_> = receipts.into_iter().map(|receipt| receipt.outcome).collect();
        assert_eq!(outcomes, [Err(Rejection::NothingToUndo)]);
    }
}
