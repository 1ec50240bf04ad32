//! The encoding of edits, each as the difference from the previous one, because players move little between digs.
//!
//! The serialised form of an [`Edit`] is cut into shape, middle, what lies between, tag and stroke. Bits of a head say
//! which of them are as before; it is below 128. Reading joins them again and deserialises the result, which checks it.
//!
//! An edit with content, such as a stamp, is [`NAMED`]: it has placeholders, and the names of its content follow.
//! Earlier journals and portable worlds hold content whole.

use super::bytes::{Reader, put_bytes, put_number, put_signed};
use super::contents::{ContentTable, Resolved, named};
use super::error::FormatError;
use super::ids::ContentId;
use super::plain;
use crate::brush::Edit;

/// The shape is not of the kind before: its number follows.
const OTHER_SHAPE: u8 = 1;
/// Radius, operation and more are not as before, and follow.
const OTHER_REST: u8 = 2;
/// The tag is one more than before.
const NEXT_TAG: u8 = 4;
/// The tag's difference follows.
const OTHER_TAG: u8 = 8;
/// The stroke's difference follows.
const OTHER_STROKE: u8 = 16;
/// There is no stroke.
const NO_STROKE: u8 = 32;
/// Not a difference: the serialised edit follows.
const SERIALIZED: u8 = 64;

/// Names follow the head and the rest of an edit with placeholders. Each is 0 and 8 bytes where it comes for the first
/// time in its sequence, and else a number from 1 among those that have come.
const NAMED: u8 = 65;

/// Longer parts are never repeated by a bit, so that few bytes can't take much memory.
const LONGEST_REST: usize = 64;

/// A serialised edit, cut up.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Parts {
    shape: u8,
    at: [i32; 3],
    rest: Vec<u8>,
    tag: u64,
    stroke: Option<u64>,
}

impl Parts {
    fn of(edit: &Edit, serialized: &[u8]) -> Option<Self> {
        let mut reader = Reader(serialized);
        let shape = reader.byte().ok()?;
        let mut part = || i32::try_from(reader.signed().ok()?).ok();
        let at = [part()?, part()?, part()?];
        let (tag, stroke) = (edit.tag(), edit.stroke());
        let rest = reader.0.strip_suffix(&*plain::to_bytes(&(tag, stroke)))?.to_vec();
        let parts = Self { shape, at, rest, tag, stroke };
        (parts.joined() == serialized).then_some(parts)
    }

    fn joined(&self) -> Vec<u8> {
        let mut bytes = vec![self.shape];
        self.at.iter().for_each(|&part| put_signed(&mut bytes, part.into()));
        bytes.extend_from_slice(&self.rest);
        bytes.extend_from_slice(&plain::to_bytes(&(self.tag, self.stroke)));
        bytes
    }
}

/// Writes and reads a sequence of edits.
#[derive(Clone, Debug, Default)]
pub struct EditSequence {
    last: Parts,
    /// Names that have come.
    names: Vec<ContentId>,
    /// Whether content is written whole, in place of its name.
    is_whole: bool,
}

impl EditSequence {
    /// A sequence of edits that hold their content whole.
    pub fn whole() -> Self {
        Self { is_whole: true, ..Self::default() }
    }

    /// A sequence in which these names have come.
    #[cfg(feature = "store")]
    pub fn with_names(names: Vec<ContentId>) -> Self {
        Self { names, ..Self::default() }
    }

    /// Appends the next edit to `to`, and returns its head.
    pub fn put(&mut self, to: &mut Vec<u8>, edit: &Edit) -> u8 {
        if self.is_whole || edit.contents().next().is_none() {
            return self.put_whole(to, edit);
        }
        let (names, edit) = named(edit);
        let at = to.len();
        to.push(0);
        let head = self.put_whole(to, &edit);
        if let Some(place) = to.get_mut(at) {
            *place = head;
        }
        for name in names {
            match self.names.iter().position(|known| *known == name) {
                Some(place) => put_number(to, place as u64 + 1),
                None => {
                    put_number(to, 0);
                    to.extend_from_slice(&name.0.to_le_bytes());
                    self.names.push(name);
                }
            }
        }
        NAMED
    }

    /// Reads the next edit, whose head was read already, with the content of a table in place of names.
    pub fn read(
        &mut self,
        head: u8,
        reader: &mut Reader,
        contents: &ContentTable,
    ) -> Result<Resolved, FormatError> {
        let is_named = head == NAMED;
        if is_named && self.is_whole {
            return Err(FormatError::Invalid("head of an edit"));
        }
        let head = if is_named { reader.byte()? } else { head };
        let edit = self.read_whole(head, reader)?;
        let count = edit.contents().count();
        if !is_named {
            return match count == 0 || self.is_whole {
                true => Ok(Resolved { edit, missing: Vec::new(), refused: None }),
                false => Err(FormatError::Invalid("edit: content without a name")),
            };
        }
        if count == 0 {
            return Err(FormatError::Invalid("edit: a name without content"));
        }
        let names = (0..count).map(|_| self.read_name(reader)).collect::<Result<Vec<_>, _>>()?;
        contents.resolve(edit, &names)
    }

    fn read_name(&mut self, reader: &mut Reader) -> Result<ContentId, FormatError> {
        let Some(place) = reader.number()?.checked_sub(1) else {
            let name = ContentId(u64::from_le_bytes(reader.array()?));
            self.names.push(name);
            return Ok(name);
        };
        let name = usize::try_from(place).ok().and_then(|place| self.names.get(place));
        name.copied().ok_or(FormatError::Invalid("name of content"))
    }

    fn put_whole(&mut self, to: &mut Vec<u8>, edit: &Edit) -> u8 {
        let serialized = plain::to_bytes(edit);
        let Some(new) = Parts::of(edit, &serialized) else {
            put_bytes(to, &serialized);
            return SERIALIZED;
        };
        let (last, mut head) = (&self.last, 0);
        if new.shape != last.shape {
            head |= OTHER_SHAPE;
            to.push(new.shape);
        }
        for (new, last) in new.at.iter().zip(last.at) {
            put_signed(to, new.wrapping_sub(last).into());
        }
        if new.rest != last.rest || new.rest.len() > LONGEST_REST {
            head |= OTHER_REST;
            put_bytes(to, &new.rest);
        }
        match new.tag.wrapping_sub(last.tag) {
            0 => {}
            1 => head |= NEXT_TAG,
            more => {
                head |= OTHER_TAG;
                put_signed(to, more.cast_signed());
            }
        }
        match new.stroke {
            same if same == last.stroke => {}
            None => head |= NO_STROKE,
            Some(stroke) => {
                head |= OTHER_STROKE;
                put_signed(to, stroke.wrapping_sub(last.stroke.unwrap_or(0)).cast_signed());
            }
        }
        self.last = new;
        head
    }

    fn read_whole(&mut self, head: u8, reader: &mut Reader) -> Result<Edit, FormatError> {
        if head == SERIALIZED {
            return edit(reader.bytes()?);
        }
        if head >= SERIALIZED {
            return Err(FormatError::Invalid("head of an edit"));
        }
        let has = |bit: u8| head & bit != 0;
        let last = &mut self.last;
        if has(OTHER_SHAPE) {
            last.shape = reader.byte()?;
        }
        for part in &mut last.at {
            let step = i32::try_from(reader.signed()?).map_err(|_| FormatError::Invalid("point"))?;
            *part = part.wrapping_add(step);
        }
        if has(OTHER_REST) {
            last.rest = reader.bytes()?.to_vec();
        } else if last.rest.len() > LONGEST_REST {
            return Err(FormatError::Invalid("head of an edit"));
        }
        if has(NEXT_TAG) {
            last.tag = last.tag.wrapping_add(1);
        }
        if has(OTHER_TAG) {
            last.tag = last.tag.wrapping_add(reader.signed()?.cast_unsigned());
        }
        if has(NO_STROKE) {
            last.stroke = None;
        }
        if has(OTHER_STROKE) {
            let more = reader.signed()?.cast_unsigned();
            last.stroke = Some(last.stroke.unwrap_or(0).wrapping_add(more));
        }
        edit(&last.joined())
    }
}

/// A serialised edit, checked.
fn edit(serialized: &[u8]) -> Result<Edit, FormatError> {
    match postcard::take_from_bytes::<Edit>(serialized) {
        Ok((edit, [])) => Ok(edit),
        Ok(_) => Err(FormatError::Edit("more follows".into())),
        Err(error) => Err(FormatError::Edit(error.to_string())),
    }
}

/// Appends a single edit.
pub fn put_edit(to: &mut Vec<u8>, edit: &Edit, sequence: &mut EditSequence) {
    let at = to.len();
    to.push(0);
    let head = sequence.put(to, edit);
    if let Some(place) = to.get_mut(at) {
        *place = head;
    }
}
