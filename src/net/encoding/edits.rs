//! Edits as differences from the previous one, and messages with the edits of a client.

use super::super::message::{MAX_EDITS, MAX_TO_SERVER};
use crate::brush::Edit;
use crate::format::bytes::put_number;
use crate::format::edits::EditSequence;

/// The tag of a message with edits.
pub(super) const EDITS: u8 = 1;

/// Appends an edit; `before` stands between its head and the rest.
pub(super) fn put_edit(to: &mut Vec<u8>, before: &[u64], edit: &Edit, coder: &mut EditSequence) {
    let at = to.len();
    to.push(0);
    before.iter().for_each(|&number| put_number(to, number));
    let head = coder.put(to, edit);
    if let Some(place) = to.get_mut(at) {
        *place = head;
    }
}

/// Writes edits of a client into messages that a server reads: of at most [`MAX_EDITS`] edits and [`MAX_TO_SERVER`]
/// bytes.
#[derive(Debug, Default)]
pub(in crate::net) struct EditWriter {
    first: u64,
    count: u64,
    bytes: Vec<u8>,
    coder: EditSequence,
}

impl EditWriter {
    /// Bytes before the edits: a tag and two numbers.
    const HEAD: usize = 1 + 10 + 10;

    /// Adds an edit; returns the message before it, if the edit does not fit in or does not follow on it.
    pub fn put(&mut self, sequence: u64, edit: &Edit) -> Option<Vec<u8>> {
        let has_room = self.count < MAX_EDITS as u64 && sequence == self.first.wrapping_add(self.count);
        let mut before = if has_room { None } else { self.finish() };
        let at = self.bytes.len();
        put_edit(&mut self.bytes, &[], edit, &mut self.coder);
        if at > 0 && self.bytes.len() > MAX_TO_SERVER - Self::HEAD {
            self.bytes.truncate(at);
            before = self.finish();
            put_edit(&mut self.bytes, &[], edit, &mut self.coder);
        }
        if self.count == 0 {
            self.first = sequence;
        }
        self.count += 1;
        before
    }

    /// The message with the edits added since the last one, if there are any.
    pub fn finish(&mut self) -> Option<Vec<u8>> {
        let Self { first, count, bytes, .. } = std::mem::take(self);
        let mut message = vec![EDITS];
        put_number(&mut message, first);
        put_number(&mut message, count);
        message.extend(bytes);
        (count > 0).then_some(message)
    }
}
