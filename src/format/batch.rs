//! The encoding of commits: the content of a frame of the journal.
//!
//! Most commits are one edit, and lead to the next revision: these begin with an odd byte, whose other bits are the
//! head of the [edit](super::edits). Others begin with 0. Each has the hash of the world that it leads to. The game's
//! data up to the last of them follows.

use std::sync::Arc;

use super::bytes::{Reader, put_bytes, put_number, put_signed};
use super::change::{put_change, read_change};
use super::edits::{EditSequence, put_edit, read_edit};
use super::error::FormatError;
use super::plain;
use crate::ground::Ground;
use crate::terrain::{CommitRecord, LogEntry, Order, Patch};
use crate::volume::DiggingRules;

const RULES: u8 = 0;
const LOOSE: u8 = 1;
const EDIT: u8 = 2;
const CHANGE: u8 = 3;
const GROUND: u8 = 4;

/// A sequence of commits, and the game's data up to the last of them.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// Commits in order. Their changes count where they have an entry [`LogEntry::Change`]; edits lead to theirs again.
    pub commits: Vec<CommitRecord>,
    /// Changes of the game's data, in order; `None` if it removed a key.
    pub game: Vec<(String, Option<Vec<u8>>)>,
}

impl Batch {
    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.commits.is_empty() && self.game.is_empty()
    }

    /// Its bytes. Those of a commit that sets another [ground](Order::Ground) can't be read again: a log ends there.
    pub fn encode(&self) -> Vec<u8> {
        let (mut bytes, mut edits) = (Vec::new(), EditSequence::default());
        put_number(&mut bytes, self.commits.len() as u64);
        let mut revision = self.commits.first().map_or(0, |first| first.revision.wrapping_sub(1));
        put_number(&mut bytes, revision);
        for commit in &self.commits {
            match &*commit.entries {
                [LogEntry::Order(Order::Edit(edit))] if commit.revision == revision.wrapping_add(1) => {
                    let at = bytes.len();
                    put_edit(&mut bytes, edit, &mut edits);
                    if let Some(head) = bytes.get_mut(at) {
                        *head = *head << 1 | 1;
                    }
                }
                _ => put_commit(&mut bytes, commit, revision, &mut edits),
            }
            bytes.extend_from_slice(&commit.hash.to_le_bytes());
            revision = commit.revision;
        }
        put_number(&mut bytes, self.game.len() as u64);
        for (key, value) in &self.game {
            put_bytes(&mut bytes, key.as_bytes());
            bytes.push(value.is_some().into());
            value.iter().for_each(|value| put_bytes(&mut bytes, value));
        }
        bytes
    }

    /// Reads what [`encode`](Self::encode) wrote, over the ground of the world.
    ///
    /// # Errors
    /// When anything is invalid. Memory is taken by the length of `bytes`.
    pub fn decode(bytes: &[u8], ground: &Ground) -> Result<Self, FormatError> {
        let (mut reader, mut edits) = (Reader(bytes), EditSequence::default());
        let (count, mut revision) = (reader.count()?, reader.number()?);
        let mut batch = Self::default();
        for _ in 0..count {
            let head = reader.byte()?;
            let mut commit = match head {
                0 => read_commit(&mut reader, revision, &mut edits, ground)?,
                odd if odd & 1 == 1 => {
                    let entries = vec![LogEntry::Order(Order::Edit(edits.read(head >> 1, &mut reader)?))];
                    let (revision, change) = (revision.wrapping_add(1), Patch::default());
                    CommitRecord { revision, hash: 0, entries, change }
                }
                _ => return Err(FormatError::Invalid("commit")),
            };
            commit.hash = u64::from_le_bytes(reader.array()?);
            revision = commit.revision;
            batch.commits.push(commit);
        }
        for _ in 0..reader.count()? {
            let key = String::from_utf8(reader.bytes()?.to_vec()).map_err(|_| FormatError::Invalid("key"))?;
            let value = match reader.byte()? {
                0 => None,
                1 => Some(reader.bytes()?.to_vec()),
                _ => return Err(FormatError::Invalid("value")),
            };
            batch.game.push((key, value));
        }
        reader.end()?;
        Ok(batch)
    }
}

/// Appends a commit of any kind but for its hash.
fn put_commit(to: &mut Vec<u8>, commit: &CommitRecord, before: u64, edits: &mut EditSequence) {
    to.push(0);
    put_signed(to, commit.revision.wrapping_sub(before).cast_signed());
    put_number(to, commit.entries.len() as u64);
    for entry in &commit.entries {
        match entry {
            LogEntry::Order(Order::Rules(rules)) => {
                to.push(RULES);
                put_bytes(to, &plain::to_bytes(&rules.as_deref()));
            }
            LogEntry::Order(Order::Loose(loose)) => {
                to.push(LOOSE);
                put_bytes(to, &plain::to_bytes(loose));
            }
            LogEntry::Order(Order::Edit(edit)) => {
                to.push(EDIT);
                put_edit(to, edit, edits);
            }
            LogEntry::Change => to.push(CHANGE),
            LogEntry::Order(Order::Ground(ground)) => {
                to.push(GROUND);
                to.extend_from_slice(&ground.hash().to_le_bytes());
            }
            // The log keeps these as changes.
            LogEntry::Order(Order::Undo | Order::Redo | Order::Parts { .. }) => to.push(CHANGE),
        }
    }
    if commit.has_change() {
        put_change(to, &commit.change);
    }
}

/// Reads what [`put_commit`] appended after its 0.
fn read_commit(
    reader: &mut Reader,
    before: u64,
    edits: &mut EditSequence,
    ground: &Ground,
) -> Result<CommitRecord, FormatError> {
    let revision = before.wrapping_add(reader.signed()?.cast_unsigned());
    let mut entries = Vec::new();
    for _ in 0..reader.count()? {
        entries.push(match reader.byte()? {
            RULES => {
                let rules: Option<DiggingRules> = plain::from_bytes(reader.bytes()?, "set of rules")?;
                LogEntry::Order(Order::Rules(rules.map(Arc::new)))
            }
            LOOSE => {
                let loose = plain::from_bytes(reader.bytes()?, "search for loose pieces")?;
                LogEntry::Order(Order::Loose(loose))
            }
            EDIT => LogEntry::Order(Order::Edit(read_edit(reader, edits)?)),
            CHANGE => LogEntry::Change,
            GROUND => return Err(FormatError::Invalid("commit: it sets another ground, which no log holds")),
            _ => return Err(FormatError::Invalid("entry of a commit")),
        });
    }
    let mut commit = CommitRecord { revision, hash: 0, entries, change: Patch::default() };
    if commit.has_change() {
        commit.change = read_change(reader, ground)?;
    }
    Ok(commit)
}
