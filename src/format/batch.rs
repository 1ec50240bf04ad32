//! The encoding of commits: the content of a frame of the journal.
//!
//! Most commits are one edit, and lead to the next revision: these begin with an odd byte, whose other bits are the
//! head of the [edit](super::edits). Others begin with 0. Each has the hash of the world that it leads to. The game's
//! data up to the last of them follows.

#[cfg(feature = "store")]
use std::collections::BTreeSet;
use std::sync::Arc;

use super::bytes::{Reader, put_bytes, put_number, put_signed};
use super::change::{put_change, read_change};
use super::contents::ContentTable;
use super::edits::{EditSequence, put_edit};
use super::error::FormatError;
#[cfg(feature = "store")]
use super::ids::ContentId;
use super::plain;
#[cfg(feature = "store")]
use crate::brush::Content;
use crate::brush::Edit;
use crate::ground::Ground;
use crate::terrain::{CommitRecord, Order};
use crate::volume::DiggingRules;

const RULES: u8 = 0;
const LOOSE: u8 = 1;
const EDIT: u8 = 2;
const CHANGE: u8 = 3;
const GROUND: u8 = 4;

/// A sequence of commits, and the game's data up to the last of them.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// Commits in order. A change is stored only with an order of [parts](Order::Parts); changes of edits are computed
    /// again.
    pub commits: Vec<CommitRecord>,
    /// Changes of the game's data, in order; `None` if it removed a key.
    pub game: Vec<(String, Option<Vec<u8>>)>,
}

impl Batch {
    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.commits.is_empty() && self.game.is_empty()
    }

    /// Encodes the batch, with the content of edits in each of them. A batch with a commit that sets
    /// another [ground](Order::Ground) is refused when it is read: a log ends there.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.put(&mut bytes, EditSequence::whole());
        bytes
    }

    fn put(&self, bytes: &mut Vec<u8>, mut edits: EditSequence) {
        put_number(bytes, self.commits.len() as u64);
        let mut revision = self.commits.first().map_or(0, |first| first.revision.wrapping_sub(1));
        put_number(bytes, revision);
        for commit in &self.commits {
            match &*commit.orders {
                [Order::Edit(edit)] if commit.revision == revision.wrapping_add(1) => {
                    let at = bytes.len();
                    put_edit(bytes, edit, &mut edits);
                    if let Some(head) = bytes.get_mut(at) {
                        *head = *head << 1 | 1;
                    }
                }
                _ => put_commit(bytes, commit, revision, &mut edits),
            }
            bytes.extend_from_slice(&commit.hash.to_le_bytes());
            revision = commit.revision;
        }
        put_number(bytes, self.game.len() as u64);
        for (key, value) in &self.game {
            put_bytes(bytes, key.as_bytes());
            bytes.push(value.is_some().into());
            value.iter().for_each(|value| put_bytes(bytes, value));
        }
    }

    /// Reads what [`encode`](Self::encode) wrote, over the ground of the world.
    ///
    /// # Errors
    /// When anything is invalid. Memory is taken by the length of `bytes`.
    pub fn decode(bytes: &[u8], ground: &Ground) -> Result<Self, FormatError> {
        let mut edits = EditReader {
            sequence: EditSequence::whole(),
            contents: &ContentTable::default(),
            is_partial: false,
        };
        Self::read(Reader(bytes), &mut edits, ground)
    }

    fn read(mut reader: Reader, edits: &mut EditReader, ground: &Ground) -> Result<Self, FormatError> {
        let (count, mut revision) = (reader.count()?, reader.number()?);
        let mut batch = Self::default();
        for _ in 0..count {
            let head = reader.byte()?;
            let commit = match head {
                0 => read_commit(&mut reader, revision, edits, ground)?,
                odd if odd & 1 == 1 => {
                    let orders = vec![Order::Edit(edits.read(head >> 1, &mut reader)?)];
                    let (revision, hash) = (revision.wrapping_add(1), u64::from_le_bytes(reader.array()?));
                    CommitRecord { number: 0, revision, hash, orders, change: Arc::default() }
                }
                _ => return Err(FormatError::Invalid("commit")),
            };
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

/// With names in place of content, as journals have it.
#[cfg(feature = "store")]
impl Batch {
    /// Encodes the batch like [`encode`](Self::encode), but with names in the place of content: all names come first,
    /// where [`names`](Self::names) finds them.
    pub(crate) fn encode_named(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let names: Vec<ContentId> =
            self.contents().map(|(name, _)| name).collect::<BTreeSet<_>>().into_iter().collect();
        put_number(&mut bytes, names.len() as u64);
        names.iter().for_each(|name| bytes.extend_from_slice(&name.0.to_le_bytes()));
        self.put(&mut bytes, EditSequence::with_names(names));
        bytes
    }

    /// The content of its edits, each as often as an edit has it.
    pub(crate) fn contents(&self) -> impl Iterator<Item = (ContentId, Content<'_>)> {
        let orders = self.commits.iter().flat_map(|commit| &commit.orders);
        let edits = orders.filter_map(Order::edit);
        edits.flat_map(|edit| edit.contents()).map(|content| (ContentId::of_content(content), content))
    }

    /// A table of the content of its edits.
    pub(crate) fn table(&self) -> ContentTable {
        let mut contents = ContentTable::default();
        self.contents().for_each(|(_, content)| contents.add_content(content));
        contents
    }

    /// The names with which the bytes of [`encode_named`](Self::encode_named) begin.
    pub(crate) fn names(bytes: &[u8]) -> Result<Vec<ContentId>, FormatError> {
        read_names(&mut Reader(bytes))
    }

    /// Reads what [`encode_named`](Self::encode_named) wrote, with the content of a table in place of names.
    ///
    /// # Errors
    /// When anything is invalid, or [`FormatError::ContentMissing`].
    pub(crate) fn decode_named(
        bytes: &[u8],
        ground: &Ground,
        contents: &ContentTable,
    ) -> Result<Self, FormatError> {
        let mut reader = Reader(bytes);
        let sequence = EditSequence::with_names(read_names(&mut reader)?);
        Self::read(reader, &mut EditReader { sequence, contents, is_partial: false }, ground)
    }

    /// Reads what [`encode_named`](Self::encode_named) wrote, with placeholders in place of content.
    pub(crate) fn decode_without_content(bytes: &[u8], ground: &Ground) -> Result<Self, FormatError> {
        let mut reader = Reader(bytes);
        let sequence = EditSequence::with_names(read_names(&mut reader)?);
        let mut edits = EditReader { sequence, contents: &ContentTable::default(), is_partial: true };
        Self::read(reader, &mut edits, ground)
    }
}

/// Reads the edits of a batch.
struct EditReader<'a> {
    sequence: EditSequence,
    contents: &'a ContentTable,
    /// Whether edits without their content are accepted.
    is_partial: bool,
}

impl EditReader<'_> {
    fn read(&mut self, head: u8, reader: &mut Reader) -> Result<Edit, FormatError> {
        let resolved = self.sequence.read(head, reader, self.contents)?;
        if self.is_partial { Ok(resolved.edit) } else { resolved.whole() }
    }
}

#[cfg(feature = "store")]
fn read_names(reader: &mut Reader) -> Result<Vec<ContentId>, FormatError> {
    let count = reader.count()?;
    (0..count).map(|_| Ok(ContentId(u64::from_le_bytes(reader.array()?)))).collect()
}

/// Appends a commit of any kind but for its hash.
fn put_commit(to: &mut Vec<u8>, commit: &CommitRecord, before: u64, edits: &mut EditSequence) {
    to.push(0);
    put_signed(to, commit.revision.wrapping_sub(before).cast_signed());
    put_number(to, commit.orders.len() as u64);
    for order in &commit.orders {
        match order {
            Order::Rules(rules) => {
                to.push(RULES);
                put_bytes(to, &plain::to_bytes(&rules.as_deref()));
            }
            Order::Loose(loose) => {
                to.push(LOOSE);
                put_bytes(to, &plain::to_bytes(loose));
            }
            Order::Edit(edit) => {
                to.push(EDIT);
                put_edit(to, edit, edits);
            }
            Order::Ground(ground) => {
                to.push(GROUND);
                to.extend_from_slice(&ground.hash().to_le_bytes());
            }
            // The commit's change follows once, after all orders.
            Order::Undo | Order::Redo | Order::Parts { .. } => to.push(CHANGE),
        }
    }
    if commit.has_change() {
        put_change(to, &commit.change);
    }
}

/// Reads what [`put_commit`] appended after its 0, and the hash.
fn read_commit(
    reader: &mut Reader,
    before: u64,
    edits: &mut EditReader,
    ground: &Ground,
) -> Result<CommitRecord, FormatError> {
    let revision = before.wrapping_add(reader.signed()?.cast_unsigned());
    let mut orders = Vec::new();
    for _ in 0..reader.count()? {
        orders.push(match reader.byte()? {
            RULES => {
                let rules: Option<DiggingRules> = plain::from_bytes(reader.bytes()?, "set of rules")?;
                Order::Rules(rules.map(Arc::new))
            }
            LOOSE => {
                let loose = plain::from_bytes(reader.bytes()?, "search for loose pieces")?;
                Order::Loose(loose)
            }
            EDIT => {
                let head = reader.byte()?;
                Order::Edit(edits.read(head, reader)?)
            }
            // Its change and hash follow.
            CHANGE => Order::Parts { change: Arc::default(), hash: None },
            GROUND => return Err(FormatError::Invalid("commit: it sets another ground, which no log holds")),
            _ => return Err(FormatError::Invalid("order of a commit")),
        });
    }
    let mut commit = CommitRecord { number: 0, revision, hash: 0, orders, change: Arc::default() };
    if commit.has_change() {
        commit.change = Arc::new(read_change(reader, ground)?);
    }
    commit.hash = u64::from_le_bytes(reader.array()?);
    for order in &mut commit.orders {
        if let Order::Parts { change, hash } = order {
            (*change, *hash) = (Arc::clone(&commit.change), Some(commit.hash));
        }
    }
    Ok(commit)
}
