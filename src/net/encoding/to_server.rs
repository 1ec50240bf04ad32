//! Messages of clients.

use std::collections::BTreeMap;

use super::super::message::*;
use super::super::{ContentId, ContentTable};
use super::edits::{EDITS, put_edit};
use super::joins::{put_hello, read_hello};
use super::parts::{put_regions, read_regions, within};
use crate::format::FormatError;
use crate::format::bytes::{Reader, put_number};
use crate::format::edits::EditSequence;

const HELLO: u8 = 0;
const UNDO: u8 = 2;
const FETCH: u8 = 3;
const ACK: u8 = 4;
const GREETING: u8 = 5;
const IMAGES: u8 = 6;

impl ToServer {
    /// Encodes the message.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut to = Vec::new();
        match self {
            Self::Hello(hello) => {
                to.push(HELLO);
                put_hello(&mut to, hello);
            }
            Self::Greeting { stream, hello } => {
                to.push(GREETING);
                put_number(&mut to, *stream);
                put_hello(&mut to, hello);
            }
            Self::Edits { first, edits } => {
                to.push(EDITS);
                put_number(&mut to, *first);
                put_number(&mut to, edits.len() as u64);
                let mut coder = EditSequence::default();
                edits.iter().for_each(|edit| put_edit(&mut to, &[], edit, &mut coder));
            }
            Self::Undo { sequence, of } => {
                to.push(UNDO);
                put_number(&mut to, *sequence);
                put_number(&mut to, of.0);
            }
            Self::Fetch { number, regions } => {
                to.push(FETCH);
                put_number(&mut to, *number);
                put_regions(&mut to, regions.iter().copied(), |_, _| {});
            }
            Self::Ack { bulk, number } => {
                to.push(ACK);
                put_number(&mut to, *bulk);
                put_number(&mut to, *number);
            }
            Self::Images { images } => {
                to.push(IMAGES);
                put_number(&mut to, images.len() as u64);
                images.iter().for_each(|image| to.extend_from_slice(&image.0.to_le_bytes()));
            }
        }
        to
    }

    /// Reads a message from a client. Images, grids and prefabs are those of the table.
    ///
    /// # Errors
    /// When anything is invalid, longer than it may be, or a stamp has an image that the list lacks.
    pub fn from_bytes(bytes: &[u8], contents: &ContentTable) -> Result<Self, FormatError> {
        match Self::read(bytes, contents)? {
            (message, refused) if refused.is_empty() => Ok(message),
            _ => Err(FormatError::Invalid("name of an image, grid or prefab")),
        }
    }

    /// Reads a message from a client. Edits with content that the list lacks, and those that are beyond the limits of
    /// edits, have placeholders; their positions in the message are returned too.
    pub(in crate::net) fn read(
        bytes: &[u8],
        contents: &ContentTable,
    ) -> Result<(Self, BTreeMap<usize, Refusal>), FormatError> {
        within(bytes.len(), MAX_TO_SERVER)?;
        let (mut reader, mut refused) = (Reader(bytes), BTreeMap::new());
        let message = match reader.byte()? {
            HELLO => Self::Hello(read_hello(&mut reader)?),
            GREETING => Self::Greeting { stream: reader.number()?, hello: read_hello(&mut reader)? },
            EDITS => {
                let (first, count) = (reader.number()?, reader.count()?);
                within(count, MAX_EDITS)?;
                let (mut edits, mut coder) = (Vec::with_capacity(count), EditSequence::default());
                for index in 0..count {
                    let head = reader.byte()?;
                    let read = coder.read(head, &mut reader, contents)?;
                    let why = match read.refused {
                        Some(_) => Some(Refusal::TooLarge),
                        None => read.missing.first().map(|_| Refusal::UnknownContent),
                    };
                    refused.extend(why.map(|why| (index, why)));
                    edits.push(read.edit);
                }
                Self::Edits { first, edits }
            }
            UNDO => Self::Undo { sequence: reader.number()?, of: ClientId(reader.number()?) },
            FETCH => {
                let number = reader.number()?;
                let regions = read_regions(&mut reader, MAX_REGIONS, |_| Ok(()))?;
                Self::Fetch { number, regions: regions.into_iter().map(|(pos, ())| pos).collect() }
            }
            ACK => Self::Ack { bulk: reader.number()?, number: reader.number()? },
            IMAGES => {
                let count = reader.count()?;
                within(count, MAX_IMAGES)?;
                let image = |_| Ok(ContentId(u64::from_le_bytes(reader.array()?)));
                Self::Images { images: (0..count).map(image).collect::<Result<_, FormatError>>()? }
            }
            _ => return Err(FormatError::Invalid("tag of a message")),
        };
        reader.end()?;
        Ok((message, refused))
    }
}
