//! Gives entries their numbers, and sends them.

use super::{FULL_MESSAGE, Later, MAX_EVENTS, Ordered, Server, ServerEvent};
use crate::brush::Edit;
use crate::net::message::{ClientId, Entry, Lane, ToClient};
use crate::terrain::Order;

impl Server {
    pub(super) fn order_edit(&mut self, author: ClientId, sequence: u64, edit: Edit, cost: u64) {
        let labels = (edit.tag(), edit.stroke());
        let entry = Entry::of(author, sequence, Order::Edit(edit.with_labels(0, None)));
        self.enter(Ordered { entry, labels, cost });
    }

    /// Gives an entry the next number.
    pub(super) fn order(&mut self, entry: Entry) {
        self.enter(Ordered { entry, labels: (0, None), cost: 0 });
    }

    pub(super) fn enter(&mut self, ordered: Ordered) {
        self.waiting_cost += ordered.cost;
        if self.later.is_empty() {
            self.number(ordered);
        } else {
            self.later.push_back(Later::Entry(ordered));
        }
    }

    pub(super) fn number(&mut self, ordered: Ordered) {
        self.epoch.number += 1;
        self.figures.ordered += 1;
        self.writer.put(&ordered.entry);
        self.log.push(&ordered.entry);
        #[cfg(feature = "store")]
        if let Some(saved) = &mut self.saved_log {
            saved.push(self.epoch.number, &ordered.entry);
        }
        self.waiting.push_back(ordered);
        if self.writer.len() >= FULL_MESSAGE {
            self.flush();
        }
    }

    /// Sends ordered entries to all clients that have everything before them, and room for them.
    pub(super) fn flush(&mut self) {
        let (last, writer) = (self.epoch.number, std::mem::take(&mut self.writer));
        let Some(message) = writer.message(last) else { return };
        let before = last - writer.count();
        for (client, session) in &mut self.sessions {
            if session.has_joined()
                && session.order.sent() == before
                && session.order.send(last, message.len())
            {
                self.figures.main_bytes += message.len() as u64;
                self.outgoing.push((*client, Lane::Main, message.clone()));
            }
        }
    }

    pub(super) fn send(&mut self, client: ClientId, message: &ToClient) {
        let bytes = message.to_bytes();
        self.figures.main_bytes += bytes.len() as u64;
        self.outgoing.push((client, Lane::Main, bytes));
    }

    /// Sends a message to all clients that have joined, after all ordered entries.
    pub(super) fn send_to_all(&mut self, message: &ToClient) {
        self.flush();
        let bytes = message.to_bytes();
        for (client, session) in &self.sessions {
            if session.has_joined() {
                self.figures.main_bytes += bytes.len() as u64;
                self.outgoing.push((*client, Lane::Main, bytes.clone()));
            }
        }
    }

    pub(super) fn report(&mut self, event: ServerEvent) {
        if self.events.len() == MAX_EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }
}
