//! Entries of the log, one by one and in messages.

use super::super::message::{ClientId, Entry};
use super::super::{ContentId, ContentTable};
use super::edits::put_edit;
use super::parts::{flag, read_rules};
use crate::format::bytes::{Reader, put_bytes, put_number};
use crate::format::change::{put_change, read_change};
use crate::format::contents::Resolved;
use crate::format::edits::EditSequence;
use crate::format::{FormatError, plain};
use crate::ground::Ground;
use crate::terrain::Order;

/// The tag of a message with entries.
pub(super) const ENTRIES: u8 = 2;

/// Heads of edits are smaller.
const RULES: u8 = 128;
const LOOSE: u8 = 129;
const PARTS: u8 = 130;
const HASH_CHECK: u8 = 131;

pub(super) fn put_entry(to: &mut Vec<u8>, entry: &Entry, coder: &mut EditSequence) {
    let Entry::Order { by, order } = entry else { return to.push(HASH_CHECK) };
    match order {
        Order::Edit(edit) => {
            let (author, sequence) = by.unwrap_or((ClientId::SERVER, 0));
            put_edit(to, &[author.0, sequence], edit, coder);
        }
        Order::Rules(rules) => {
            to.push(RULES);
            put_bytes(to, &plain::to_bytes(&rules.as_deref()));
        }
        Order::Loose(loose) => {
            to.push(LOOSE);
            put_bytes(to, &plain::to_bytes(loose));
        }
        Order::Parts { change, .. } => {
            to.extend([PARTS, by.is_some().into()]);
            if let Some((client, sequence)) = by {
                put_number(to, client.0);
                put_number(to, *sequence);
            }
            put_change(to, change);
        }
        // Steps through history are sent as the parts that they restore, and all machines have one ground.
        Order::Undo | Order::Redo | Order::Ground(_) => to.push(HASH_CHECK),
    }
}

/// The encoded size of a single entry.
pub(in crate::net) fn entry_bytes(entry: &Entry) -> usize {
    let mut bytes = Vec::new();
    put_entry(&mut bytes, entry, &mut EditSequence::default());
    bytes.len()
}

/// Writes entries as they are ordered into one message.
#[derive(Debug, Default)]
pub(in crate::net) struct EntryWriter {
    bytes: Vec<u8>,
    count: u64,
    coder: EditSequence,
}

impl EntryWriter {
    pub fn put(&mut self, entry: &Entry) {
        put_entry(&mut self.bytes, entry, &mut self.coder);
        self.count += 1;
    }

    /// The number of entries.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The number of bytes.
    pub fn len(&self) -> usize {
        self.bytes.len()
    }

    /// The message, if there are entries. `last` is the number of the last one.
    pub fn message(&self, last: u64) -> Option<Vec<u8>> {
        let first = last.checked_sub(self.count)? + 1;
        let mut message = vec![ENTRIES];
        put_number(&mut message, first);
        put_number(&mut message, self.count);
        message.extend(&self.bytes);
        (self.count > 0).then_some(message)
    }
}

pub(super) fn read_entry(
    reader: &mut Reader,
    ground: &Ground,
    contents: &ContentTable,
    coder: &mut EditSequence,
) -> Result<(Entry, Vec<ContentId>), FormatError> {
    let entry = match reader.byte()? {
        RULES => Entry::of_server(Order::Rules(read_rules(reader.bytes()?)?)),
        LOOSE => {
            let loose = plain::from_bytes(reader.bytes()?, "search for loose pieces")?;
            Entry::of_server(Order::Loose(loose))
        }
        PARTS => {
            let by = match flag(reader)? {
                true => Some((ClientId(reader.number()?), reader.number()?)),
                false => None,
            };
            Entry::Order { by, order: Order::parts(read_change(reader, ground)?, None) }
        }
        HASH_CHECK => Entry::HashCheck,
        head => {
            let (author, sequence) = (ClientId(reader.number()?), reader.number()?);
            let Resolved { edit, missing, refused } = coder.read(head, reader, contents)?;
            if let Some(error) = refused {
                return Err(FormatError::Edit(error.to_string()));
            }
            return Ok((Entry::of(author, sequence, Order::Edit(edit)), missing));
        }
    };
    Ok((entry, Vec::new()))
}
