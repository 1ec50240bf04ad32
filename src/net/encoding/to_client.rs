//! Messages of servers.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::super::message::*;
use super::super::{ContentId, ContentTable};
use super::entries::{ENTRIES, put_entry, read_entry};
use super::joins::{put_welcome, read_welcome};
use super::packed::{PACKED, unpack};
use super::parts::{at_index, index_of, put_hashes, read_hashes, small, within};
use crate::brush::Prefab;
use crate::format::bytes::{Reader, put_number};
use crate::format::contents::{put_image, read_image};
use crate::format::edits::EditSequence;
use crate::format::fields::{point, put_point};
use crate::format::prefab::packed_prefab;
use crate::format::{FormatError, decode_region, encode_region};
use crate::ground::Ground;
use crate::lattice::RegionPos;

const WELCOME: u8 = 0;
const KICKED: u8 = 1;
const FAILED: u8 = 3;
const REFUSED: u8 = 4;
const HASHES: u8 = 5;
const TABLE: u8 = 6;
const REGION: u8 = 7;
const DURABLE: u8 = 8;
pub(in crate::net) const PIECE: u8 = 9;
const STREAM: u8 = 11;
const GREET: u8 = 12;
const IMAGE: u8 = 13;
const PREFAB: u8 = 14;

const REFUSALS: [Refusal; 10] = [
    Refusal::TooFar,
    Refusal::Cost,
    Refusal::Forbidden,
    Refusal::OutsideWorld,
    Refusal::Overloaded,
    Refusal::Nothing,
    Refusal::Touched,
    Refusal::TooLarge,
    Refusal::NotJoined,
    Refusal::UnknownContent,
];

const KICKS: [KickReason; 8] = [
    KickReason::Protocol,
    KickReason::Simulation,
    KickReason::Ground,
    KickReason::ChunkSize,
    KickReason::Malformed,
    KickReason::Flood,
    KickReason::ByGame,
    KickReason::ConnectedAgain,
];
/// The tag of a reason chosen by the game.
const REFUSED_BY_GAME: u8 = 255;

impl ToClient {
    /// Encodes the message.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut to = Vec::new();
        match self {
            Self::Welcome(welcome) => {
                to.push(WELCOME);
                put_welcome(&mut to, welcome);
            }
            Self::Kicked(KickReason::Refused(reason)) => {
                to.extend([KICKED, REFUSED_BY_GAME]);
                put_number(&mut to, (*reason).into());
            }
            Self::Kicked(why) => to.extend([KICKED, index_of(&KICKS, why)]),
            Self::Entries(Entries { first, entries }) => {
                to.push(ENTRIES);
                put_number(&mut to, *first);
                put_number(&mut to, entries.len() as u64);
                let mut coder = EditSequence::default();
                entries.iter().for_each(|entry| put_entry(&mut to, entry, &mut coder));
            }
            Self::Failed { number } => {
                to.push(FAILED);
                put_number(&mut to, *number);
            }
            Self::Refused { sequence, why } => {
                to.extend([REFUSED, index_of(&REFUSALS, why)]);
                put_number(&mut to, *sequence);
            }
            Self::Hashes { number, regions } => put_hashes(&mut to, HASHES, *number, regions),
            Self::Table { number, regions } => put_hashes(&mut to, TABLE, *number, regions),
            Self::Region(content) => {
                to.push(REGION);
                put_number(&mut to, content.number);
                put_point(&mut to, content.pos.0);
                put_number(&mut to, content.left.into());
                put_number(&mut to, content.next_field);
                let (bricks, fields) = (content.bricks.iter(), content.fields.iter());
                to.extend(encode_region(bricks.map(|(p, b)| (p, b)), fields.map(|(c, f)| (c, f))));
            }
            Self::Durable { number } => {
                to.push(DURABLE);
                put_number(&mut to, *number);
            }
            Self::Piece(bytes) => {
                to.push(PIECE);
                to.extend_from_slice(bytes);
            }
            Self::Stream { stream } => {
                to.push(STREAM);
                put_number(&mut to, *stream);
            }
            Self::Greet => to.push(GREET),
            Self::Image(image) => {
                to.push(IMAGE);
                put_image(&mut to, image);
            }
            Self::Prefab(prefab) => {
                to.push(PREFAB);
                to.extend_from_slice(packed_prefab(prefab));
            }
        }
        to
    }

    /// Reads a message from a server, for a world over this ground. Images, grids and prefabs are those of the table.
    ///
    /// # Errors
    /// When anything is invalid, longer than it may be, or a stamp has an image that the list lacks.
    pub fn from_bytes(bytes: &[u8], ground: &Ground, contents: &ContentTable) -> Result<Self, FormatError> {
        match Self::read(bytes, ground, contents)? {
            (message, missing) if missing.is_empty() => Ok(message),
            _ => Err(FormatError::Invalid("name of an image, grid or prefab")),
        }
    }

    /// Reads a message from a server. Edits whose contents the table lacks get placeholders; the names of what is
    /// missing are returned too.
    pub(in crate::net) fn read(
        bytes: &[u8],
        ground: &Ground,
        contents: &ContentTable,
    ) -> Result<(Self, BTreeSet<ContentId>), FormatError> {
        within(bytes.len(), MAX_TO_CLIENT)?;
        let (mut reader, mut missing) = (Reader(bytes), BTreeSet::new());
        let message = match reader.byte()? {
            WELCOME => Self::Welcome(read_welcome(&mut reader)?),
            KICKED => Self::Kicked(match reader.byte()? {
                REFUSED_BY_GAME => KickReason::Refused(small(&mut reader)?),
                index => at_index(&KICKS, index)?,
            }),
            ENTRIES => {
                let (first, count) = (reader.number()?, reader.count()?);
                if first.checked_add(count as u64).is_none() {
                    return Err(FormatError::Invalid("number of an entry"));
                }
                let (mut entries, mut coder) = (Vec::new(), EditSequence::default());
                for _ in 0..count {
                    let (entry, unknown) = read_entry(&mut reader, ground, contents, &mut coder)?;
                    missing.extend(unknown);
                    entries.push(entry);
                }
                Self::Entries(Entries { first, entries })
            }
            FAILED => Self::Failed { number: reader.number()? },
            REFUSED => {
                let why = at_index(&REFUSALS, reader.byte()?)?;
                Self::Refused { sequence: reader.number()?, why }
            }
            HASHES => Self::Hashes { number: reader.number()?, regions: read_hashes(&mut reader)? },
            TABLE => Self::Table { number: reader.number()?, regions: read_hashes(&mut reader)? },
            REGION => {
                let (number, pos) = (reader.number()?, RegionPos(point(&mut reader)?));
                let (left, next_field) = (small(&mut reader)?, reader.number()?);
                let (bricks, fields) = decode_region(std::mem::take(&mut reader.0), pos, ground)?;
                Self::Region(RegionContent { number, pos, left, next_field, bricks, fields })
            }
            DURABLE => Self::Durable { number: reader.number()? },
            PACKED => {
                let message = unpack(&mut reader)?;
                if message.first() == Some(&PACKED) {
                    return Err(FormatError::Invalid("message that is packed twice"));
                }
                return Self::read(&message, ground, contents);
            }
            PIECE => Self::Piece(std::mem::take(&mut reader.0).to_vec()),
            STREAM => Self::Stream { stream: reader.number()? },
            GREET => Self::Greet,
            IMAGE => Self::Image(read_image(&mut reader)?),
            PREFAB => Self::Prefab(Arc::new(Prefab::from_bytes(std::mem::take(&mut reader.0))?)),
            _ => return Err(FormatError::Invalid("tag of a message")),
        };
        reader.end()?;
        Ok((message, missing))
    }
}

#[cfg(test)]
mod tests {
    use super::super::packed::{MAX_PACKED, pack};
    use super::*;
    use crate::format::FormatError;

    /// A message of `count` hash checks.
    fn hash_checks(count: usize) -> Vec<u8> {
        ToClient::Entries(Entries { first: 1, entries: vec![Entry::HashCheck; count] }).to_bytes()
    }

    fn read(bytes: &[u8]) -> Result<ToClient, FormatError> {
        ToClient::from_bytes(
            bytes,
            &Ground::flat(8, 8, 4.0).expect("a valid ground"),
            &ContentTable::default(),
        )
    }

    #[test]
    fn packed_messages_are_what_they_were() {
        for count in [0, 1, 5, 1000, MAX_PACKED - 10, MAX_PACKED + 10] {
            let message = hash_checks(count);
            let packed = pack(&message);
            assert!(packed.len() <= message.len());
            assert_eq!(packed.len() < message.len(), (1000..=MAX_PACKED).contains(&count), "{count}");
            assert_eq!(read(&packed).expect("a message").to_bytes(), message);
        }
    }

    #[test]
    fn packed_messages_that_are_too_long_or_packed_twice_are_refused() {
        let with_length = |length: u64| {
            let mut packed = vec![PACKED];
            put_number(&mut packed, length);
            packed.extend(lz4_flex::block::compress(&hash_checks(1000)));
            packed
        };
        let length = hash_checks(1000).len() as u64;
        assert!(read(&with_length(length)).is_ok());
        for wrong in [0, length - 1, length + 1, MAX_PACKED as u64] {
            assert!(matches!(read(&with_length(wrong)), Err(FormatError::Invalid(_))), "{wrong}");
        }
        let too_long = read(&with_length(MAX_PACKED as u64 + 1));
        assert!(matches!(too_long, Err(FormatError::TooLarge { .. })), "{too_long:?}");
        let mut twice = vec![PACKED];
        put_number(&mut twice, with_length(length).len() as u64);
        twice.extend(lz4_flex::block::compress(&with_length(length)));
        assert!(matches!(read(&twice), Err(FormatError::Invalid(_))));
    }
}
