//! Gives up edits and undos that the server has not answered.

use super::outbox::Outbox;
use super::{Client, ClientEvent};

impl Client {
    /// Gives up edits and undos that the server will not answer any more: edits are no longer shown after the next
    /// [`advance`](Self::advance), and all of them are reported as refused.
    pub fn give_up(&mut self) {
        let numbers: Vec<u64> = self.replica.pending().map(|(number, _)| number).collect();
        numbers.iter().for_each(|number| self.refuse_pieces(*number));
        let pending: Vec<_> =
            numbers.into_iter().filter_map(|number| self.replica.take_back(number)).collect();
        for edit in pending.into_iter().chain(std::mem::take(&mut self.early)) {
            self.events.push(ClientEvent::Refused { tag: edit.tag(), why: None });
        }
        self.outbox = Outbox::new([0; 2], 0, self.now);
        for _ in std::mem::take(&mut self.undos) {
            self.events.push(ClientEvent::UndoRefused(None));
        }
    }
}
