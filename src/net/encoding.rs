//! The encoding of messages: a tag, then integers of [variable length](crate::format::bytes), edits as
//! differences from the previous one in the message, bricks as in saves.
//!
//! Reading any bytes gives a message or a [`FormatError`]: nothing panics, and memory is bounded by the length of
//! the input, which has its own limits.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::message::*;
use super::{StampId, Stamps};
use crate::brush::Edit;
use crate::format::bytes::{Reader, put_bytes, put_number};
use crate::format::change::{put_change, read_change};
use crate::format::contents::{Resolved, put_image, read_image};
use crate::format::edits::EditSequence;
use crate::format::fields::{point, put_point};
use crate::format::prefab::packed_prefab;
use crate::format::{FormatError, WorldId, decode_region, encode_region, plain, read_prefab};
use crate::ground::Ground;
use crate::lattice::RegionPos;
use crate::terrain::Order;
use crate::volume::DiggingRules;

const HELLO: u8 = 0;
const EDITS: u8 = 1;
const UNDO: u8 = 2;
const FETCH: u8 = 3;
const ACK: u8 = 4;
const GREETING: u8 = 5;
const IMAGES: u8 = 6;

const WELCOME: u8 = 0;
const KICKED: u8 = 1;
const ENTRIES: u8 = 2;
const FAILED: u8 = 3;
const REFUSED: u8 = 4;
const HASHES: u8 = 5;
const TABLE: u8 = 6;
const REGION: u8 = 7;
const DURABLE: u8 = 8;
pub(super) const PIECE: u8 = 9;
/// The tag of a compressed message.
const PACKED: u8 = 10;
/// Most bytes of a compressed message after decompression, so that few bytes can't take much memory.
const MAX_PACKED: usize = 64 << 10;
const STREAM: u8 = 11;
const GREET: u8 = 12;
const IMAGE: u8 = 13;
const PREFAB: u8 = 14;

/// Heads of edits are smaller.
const RULES: u8 = 128;
const LOOSE: u8 = 129;
const PARTS: u8 = 130;
const MARK: u8 = 131;

const LOG: u8 = 0;
const REGIONS: u8 = 1;
const COMPARE: u8 = 2;

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
    Refusal::UnknownStamp,
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

impl ToServer {
    /// Its bytes.
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

    /// Reads a message from a client. Images of stamps are those of the list.
    ///
    /// # Errors
    /// When anything is invalid, longer than it may be, or a stamp has an image that the list lacks.
    pub fn from_bytes(bytes: &[u8], stamps: &Stamps) -> Result<Self, FormatError> {
        match Self::read(bytes, stamps)? {
            (message, refused) if refused.is_empty() => Ok(message),
            _ => Err(FormatError::Invalid("image of a stamp")),
        }
    }

    /// Reads a message from a client. Edits with content that the list lacks, and those that are beyond the limits of
    /// edits, have placeholders; their positions in the message are returned too.
    pub(super) fn read(
        bytes: &[u8],
        stamps: &Stamps,
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
                for place in 0..count {
                    let head = reader.byte()?;
                    let read = coder.read(head, &mut reader, stamps)?;
                    let why = match read.refused {
                        Some(_) => Some(Refusal::TooLarge),
                        None => read.missing.first().map(|_| Refusal::UnknownStamp),
                    };
                    refused.extend(why.map(|why| (place, why)));
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
                let image = |_| Ok(StampId(u64::from_le_bytes(reader.array()?)));
                Self::Images { images: (0..count).map(image).collect::<Result<_, FormatError>>()? }
            }
            _ => return Err(FormatError::Invalid("tag of a message")),
        };
        reader.end()?;
        Ok((message, refused))
    }
}

fn put_hello(to: &mut Vec<u8>, hello: &Hello) {
    put_number(to, hello.protocol.into());
    put_number(to, hello.simulation.into());
    to.extend_from_slice(&hello.ground.to_le_bytes());
    put_number(to, hello.chunk_size.into());
    put_point(to, hello.place);
    to.push(hello.epoch.is_some().into());
    hello.epoch.iter().for_each(|epoch| put_epoch(to, epoch));
}

fn read_hello(reader: &mut Reader) -> Result<Hello, FormatError> {
    Ok(Hello {
        protocol: small(reader)?,
        simulation: small(reader)?,
        ground: u64::from_le_bytes(reader.array()?),
        chunk_size: small(reader)?,
        place: point(reader)?,
        epoch: if flag(reader)? { Some(epoch(reader)?) } else { None },
    })
}

impl ToClient {
    /// Its bytes.
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
            Self::Kicked(why) => to.extend([KICKED, place_in(&KICKS, why)]),
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
                to.extend([REFUSED, place_in(&REFUSALS, why)]);
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

    /// Reads a message from a server, for a world over this ground. Images of stamps are those of the list.
    ///
    /// # Errors
    /// When anything is invalid, longer than it may be, or a stamp has an image that the list lacks.
    pub fn from_bytes(bytes: &[u8], ground: &Ground, stamps: &Stamps) -> Result<Self, FormatError> {
        match Self::read(bytes, ground, stamps)? {
            (message, missing) if missing.is_empty() => Ok(message),
            _ => Err(FormatError::Invalid("image of a stamp")),
        }
    }

    /// Reads a message from a server. Stamps whose images the list lacks get another image; the names of these are
    /// returned too.
    pub(super) fn read(
        bytes: &[u8],
        ground: &Ground,
        stamps: &Stamps,
    ) -> Result<(Self, BTreeSet<StampId>), FormatError> {
        within(bytes.len(), MAX_TO_CLIENT)?;
        let (mut reader, mut missing) = (Reader(bytes), BTreeSet::new());
        let message = match reader.byte()? {
            WELCOME => Self::Welcome(read_welcome(&mut reader)?),
            KICKED => Self::Kicked(match reader.byte()? {
                REFUSED_BY_GAME => KickReason::Refused(small(&mut reader)?),
                place => at_place(&KICKS, place)?,
            }),
            ENTRIES => {
                let (first, count) = (reader.number()?, reader.count()?);
                if first.checked_add(count as u64).is_none() {
                    return Err(FormatError::Invalid("number of an entry"));
                }
                let (mut entries, mut coder) = (Vec::new(), EditSequence::default());
                for _ in 0..count {
                    let (entry, unknown) = read_entry(&mut reader, ground, stamps, &mut coder)?;
                    missing.extend(unknown);
                    entries.push(entry);
                }
                Self::Entries(Entries { first, entries })
            }
            FAILED => Self::Failed { number: reader.number()? },
            REFUSED => {
                let why = at_place(&REFUSALS, reader.byte()?)?;
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
                return Self::read(&message, ground, stamps);
            }
            PIECE => Self::Piece(std::mem::take(&mut reader.0).to_vec()),
            STREAM => Self::Stream { stream: reader.number()? },
            GREET => Self::Greet,
            IMAGE => Self::Image(read_image(&mut reader)?),
            PREFAB => Self::Prefab(Arc::new(read_prefab(std::mem::take(&mut reader.0))?)),
            _ => return Err(FormatError::Invalid("tag of a message")),
        };
        reader.end()?;
        Ok((message, missing))
    }
}

fn within(length: usize, limit: usize) -> Result<(), FormatError> {
    if length <= limit {
        Ok(())
    } else {
        Err(FormatError::TooLarge { length: length as u64, limit: limit as u64 })
    }
}

fn small(reader: &mut Reader) -> Result<u32, FormatError> {
    u32::try_from(reader.number()?).map_err(|_| FormatError::Invalid("number"))
}

fn flag(reader: &mut Reader) -> Result<bool, FormatError> {
    match reader.byte()? {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(FormatError::Invalid("flag")),
    }
}

fn place_in<T: PartialEq>(all: &[T], one: &T) -> u8 {
    debug_assert!(all.contains(one), "a reason without a number");
    all.iter().position(|other| other == one).unwrap_or_default() as u8
}

fn at_place<T: Copy>(all: &[T], place: u8) -> Result<T, FormatError> {
    all.get(usize::from(place)).copied().ok_or(FormatError::Invalid("reason"))
}

/// Appends an edit; `before` stands between its head and the rest.
fn put_edit(to: &mut Vec<u8>, before: &[u64], edit: &Edit, coder: &mut EditSequence) {
    let at = to.len();
    to.push(0);
    before.iter().for_each(|&number| put_number(to, number));
    let head = coder.put(to, edit);
    if let Some(place) = to.get_mut(at) {
        *place = head;
    }
}

fn put_entry(to: &mut Vec<u8>, entry: &Entry, coder: &mut EditSequence) {
    let Entry::Order { by, order } = entry else { return to.push(MARK) };
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
        Order::Undo | Order::Redo | Order::Ground(_) => to.push(MARK),
    }
}

/// The encoded size of a single entry.
pub(super) fn entry_bytes(entry: &Entry) -> usize {
    let mut bytes = Vec::new();
    put_entry(&mut bytes, entry, &mut EditSequence::default());
    bytes.len()
}

/// Writes entries as they are ordered into one message.
#[derive(Debug, Default)]
pub(super) struct OrderWriter {
    bytes: Vec<u8>,
    count: u64,
    coder: EditSequence,
}

impl OrderWriter {
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

/// Writes edits of a client into messages that a server reads: of at most [`MAX_EDITS`] edits and [`MAX_TO_SERVER`] bytes.
#[derive(Debug, Default)]
pub(super) struct EditWriter {
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

/// Compresses a message to a client, if that makes it shorter.
pub(super) fn pack(message: &[u8]) -> Vec<u8> {
    if message.len() > MAX_PACKED {
        return message.to_vec();
    }
    let mut packed = vec![PACKED];
    put_number(&mut packed, message.len() as u64);
    packed.extend(lz4_flex::block::compress(message));
    if packed.len() < message.len() { packed } else { message.to_vec() }
}

/// Decompresses a message.
fn unpack(reader: &mut Reader) -> Result<Vec<u8>, FormatError> {
    let length = reader.number()?;
    let packed = std::mem::take(&mut reader.0);
    if length > MAX_PACKED as u64 {
        return Err(FormatError::TooLarge { length, limit: MAX_PACKED as u64 });
    }
    let message = lz4_flex::block::decompress(packed, length as usize);
    message
        .ok()
        .filter(|message| message.len() as u64 == length)
        .ok_or(FormatError::Invalid("packed message"))
}

fn read_entry(
    reader: &mut Reader,
    ground: &Ground,
    stamps: &Stamps,
    coder: &mut EditSequence,
) -> Result<(Entry, Vec<StampId>), FormatError> {
    let entry = match reader.byte()? {
        RULES => Entry::of_server(Order::Rules(read_rules(reader.bytes()?)?.map(Arc::new))),
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
        MARK => Entry::HashCheck,
        head => {
            let (author, sequence) = (ClientId(reader.number()?), reader.number()?);
            let Resolved { edit, missing, refused } = coder.read(head, reader, stamps)?;
            if let Some(error) = refused {
                return Err(FormatError::Edit(error.to_string()));
            }
            return Ok((Entry::of(author, sequence, Order::Edit(edit)), missing));
        }
    };
    Ok((entry, Vec::new()))
}

fn read_rules(bytes: &[u8]) -> Result<Option<DiggingRules>, FormatError> {
    let rules: Option<DiggingRules> = plain::from_bytes(bytes, "rules")?;
    match rules.as_ref().map_or(Ok(()), DiggingRules::check) {
        Ok(()) => Ok(rules),
        Err(_) => Err(FormatError::Invalid("rules")),
    }
}

fn put_epoch(to: &mut Vec<u8>, epoch: &Epoch) {
    to.extend_from_slice(&epoch.world.0.to_le_bytes());
    to.extend_from_slice(&epoch.run.to_le_bytes());
    put_number(to, epoch.number);
}

fn epoch(reader: &mut Reader) -> Result<Epoch, FormatError> {
    let world = WorldId(u128::from_le_bytes(reader.array()?));
    Ok(Epoch { world, run: u64::from_le_bytes(reader.array()?), number: reader.number()? })
}

fn put_welcome(to: &mut Vec<u8>, welcome: &Welcome) {
    put_number(to, welcome.client.0);
    put_epoch(to, &welcome.epoch);
    put_number(to, welcome.sequence);
    put_number(to, welcome.left);
    // No distance is as great as `u32::MAX + 1`.
    put_number(to, welcome.reach.map_or(0, |reach| u64::from(reach) + 1));
    welcome.cost.iter().for_each(|&number| put_number(to, number));
    match &welcome.join {
        Join::Log { failed } => {
            to.push(LOG);
            put_number(to, failed.len() as u64);
            let mut last = 0;
            for &number in failed {
                put_number(to, number.wrapping_sub(last));
                last = number;
            }
        }
        Join::Regions { regions, state } => {
            to.push(REGIONS);
            put_number(to, (*regions).into());
            put_rule_state(to, state);
        }
        Join::Compare { state } => {
            to.push(COMPARE);
            put_rule_state(to, state);
        }
    }
}

fn read_welcome(reader: &mut Reader) -> Result<Welcome, FormatError> {
    let (client, epoch) = (ClientId(reader.number()?), epoch(reader)?);
    let (sequence, left) = (reader.number()?, reader.number()?);
    let reach = match reader.number()? {
        0 => None,
        more => Some(u32::try_from(more - 1).map_err(|_| FormatError::Invalid("reach"))?),
    };
    let cost = [reader.number()?, reader.number()?];
    let join = match reader.byte()? {
        LOG => {
            let (mut failed, mut last) = (Vec::new(), 0_u64);
            for _ in 0..reader.count()? {
                last = last.wrapping_add(reader.number()?);
                failed.push(last);
            }
            Join::Log { failed }
        }
        REGIONS => Join::Regions { regions: small(reader)?, state: read_rule_state(reader)? },
        COMPARE => Join::Compare { state: read_rule_state(reader)? },
        _ => return Err(FormatError::Invalid("way to join")),
    };
    Ok(Welcome { client, epoch, sequence, reach, cost, left, join })
}

fn put_rule_state(to: &mut Vec<u8>, state: &RuleState) {
    put_bytes(to, &plain::to_bytes(&state.rules));
    put_bytes(to, &plain::to_bytes(&state.loose));
    put_number(to, state.next_field);
}

fn read_rule_state(reader: &mut Reader) -> Result<Box<RuleState>, FormatError> {
    let rules = read_rules(reader.bytes()?)?;
    let loose = plain::from_bytes(reader.bytes()?, "search for loose pieces")?;
    Ok(Box::new(RuleState { rules, loose, next_field: reader.number()? }))
}

/// Appends regions, each as the difference from the previous one, and a value for each.
fn put_regions(
    to: &mut Vec<u8>,
    regions: impl ExactSizeIterator<Item = RegionPos>,
    mut beside: impl FnMut(&mut Vec<u8>, usize),
) {
    put_number(to, regions.len() as u64);
    let mut last = glam::IVec3::ZERO;
    for (at, region) in regions.enumerate() {
        put_point(to, region.0.wrapping_sub(last));
        last = region.0;
        beside(to, at);
    }
}

fn read_regions<T>(
    reader: &mut Reader,
    most: usize,
    mut beside: impl FnMut(&mut Reader) -> Result<T, FormatError>,
) -> Result<Vec<(RegionPos, T)>, FormatError> {
    let count = reader.count()?;
    within(count, most)?;
    let (mut regions, mut last) = (Vec::new(), glam::IVec3::ZERO);
    for _ in 0..count {
        last = last.wrapping_add(point(reader)?);
        regions.push((RegionPos(last), beside(reader)?));
    }
    Ok(regions)
}

fn put_hashes(to: &mut Vec<u8>, tag: u8, number: u64, hashes: &RegionHashes) {
    to.push(tag);
    put_number(to, number);
    let hash = |to: &mut Vec<u8>, at: usize| {
        let hash = hashes.get(at).map_or(0, |(_, hash)| *hash);
        to.extend_from_slice(&hash.to_le_bytes());
    };
    put_regions(to, hashes.iter().map(|(pos, _)| *pos), hash);
}

fn read_hashes(reader: &mut Reader) -> Result<RegionHashes, FormatError> {
    read_regions(reader, usize::MAX, |reader| reader.array().map(u64::from_le_bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::FormatError;

    /// A message of `count` marks.
    fn marks(count: usize) -> Vec<u8> {
        ToClient::Entries(Entries { first: 1, entries: vec![Entry::HashCheck; count] }).to_bytes()
    }

    fn read(bytes: &[u8]) -> Result<ToClient, FormatError> {
        ToClient::from_bytes(bytes, &Ground::flat(8, 8, 4.0).expect("a valid ground"), &Stamps::default())
    }

    #[test]
    fn packed_messages_are_what_they_were() {
        for count in [0, 1, 5, 1000, MAX_PACKED - 10, MAX_PACKED + 10] {
            let message = marks(count);
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
            packed.extend(lz4_flex::block::compress(&marks(1000)));
            packed
        };
        let length = marks(1000).len() as u64;
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
