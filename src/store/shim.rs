//! Stands in for the format room.
#![allow(missing_docs, dead_code)]
use std::collections::BTreeMap;
use std::sync::Arc;

use crate::ground::{Ground, MaterialId};
use crate::lattice::{BrickPos, ChunkPos, RegionPos};
use crate::terrain::{CommitRecord, LogEntry, LooseSettings, TerrainSettings, WorldChange};
use crate::volume::{Brick, DiggingRules, Field, FieldId, Fields};
use glam::IVec3;

pub mod frame {
    use xxhash_rust::xxh3::xxh3_64;
    pub const MAGIC: [u8; 4] = *b"BRW1";
    pub const SCHEMA: u32 = 1;
    #[derive(Clone, Copy, PartialEq, Eq, Debug)]
    #[repr(u8)]
    pub enum Kind {
        Journal = 1,
        Checkpoint,
        Region,
    }
    #[derive(Clone, Copy, PartialEq, Eq, Debug)]
    pub struct WorldId(pub u128);
    impl WorldId {
        pub fn random() -> Self {
            use std::hash::{BuildHasher, Hasher};
            let new = || std::collections::hash_map::RandomState::new().build_hasher().finish();
            Self(u128::from(new()) << 64 | u128::from(new()))
        }
    }
    #[derive(Debug)]
    pub struct FormatError(pub String);
    impl FormatError {
        pub fn newer_schema(&self) -> Option<u32> {
            None
        }
    }
    impl std::fmt::Display for FormatError {
        fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str(&self.0)
        }
    }
    pub struct Opened {
        pub revision: u64,
        pub ground_hash: u64,
        pub payload: Vec<u8>,
    }
    pub struct Peeked {
        pub world: WorldId,
        pub key: Vec<u8>,
        pub length: usize,
    }
    pub fn seal(
        kind: Kind,
        world: WorldId,
        key: &[u8],
        revision: u64,
        ground: u64,
        payload: &[u8],
    ) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        out.push(kind as u8);
        out.extend(world.0.to_le_bytes());
        out.push(key.len() as u8);
        out.extend(key);
        out.extend(revision.to_le_bytes());
        out.extend(ground.to_le_bytes());
        let packed = lz4_flex::compress_prepend_size(payload);
        out.extend((packed.len() as u32).to_le_bytes());
        out.extend(packed);
        let hash = xxh3_64(&out);
        out.extend(hash.to_le_bytes());
        out
    }
    fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
        Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
    }
    fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
        Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
    }
    pub fn peek(bytes: &[u8]) -> Option<Peeked> {
        if bytes.get(..4)? != MAGIC {
            return None;
        }
        let world = WorldId(u128::from_le_bytes(*bytes.get(5..)?.first_chunk()?));
        let len = *bytes.get(21)? as usize;
        let key = bytes.get(22..22 + len)?.to_vec();
        let packed = u32_at(bytes, 22 + len + 16)? as usize;
        Some(Peeked { world, key, length: 22 + len + 16 + 4 + packed + 8 })
    }
    pub fn open(
        bytes: &[u8],
        kind: Kind,
        world: WorldId,
        key: &[u8],
        limit: usize,
    ) -> Result<Opened, FormatError> {
        let bad = |what: &str| FormatError(what.into());
        let peeked = peek(bytes).ok_or_else(|| bad("magic"))?;
        if peeked.length != bytes.len() {
            return Err(bad("length"));
        }
        let (body, hash) = bytes.split_at(bytes.len() - 8);
        if xxh3_64(body).to_le_bytes() != hash {
            return Err(bad("checksum"));
        }
        if body[4] != kind as u8 || peeked.world != world || peeked.key != key {
            return Err(bad("other record"));
        }
        let at = 22 + key.len();
        let read = || {
            let raw = u32_at(body, at + 20)? as usize;
            (raw <= limit).then_some(())?;
            let payload = lz4_flex::decompress_size_prepended(body.get(at + 20..)?).ok()?;
            Some(Opened { revision: u64_at(body, at)?, ground_hash: u64_at(body, at + 8)?, payload })
        };
        read().ok_or_else(|| bad("content"))
    }
}

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Metadata {
    pub settings: TerrainSettings,
    pub revision: u64,
    pub hash: u64,
    pub next_field: u64,
    pub rules: Option<DiggingRules>,
    pub loose: Option<LooseSettings>,
    pub simulation: u32,
    pub ground: u64,
    pub game: Vec<(String, Vec<u8>)>,
}

type RawBrick = ([i32; 3], Option<([u64; 8], Vec<i16>, Option<Vec<u8>>)>);
type RawField = ([i32; 3], Vec<(u64, [i32; 3], [i32; 3], u64)>);

fn raw_brick(pos: BrickPos, brick: Option<&Brick>) -> RawBrick {
    (
        pos.0.to_array(),
        brick.map(|brick| {
            let samples: Vec<_> = crate::volume::layers::indices(brick.edited()).collect();
            let densities = samples.iter().map(|&i| brick.samples()[i].distance().unwrap() as i16).collect();
            let materials = brick.materials().map(|all| samples.iter().map(|&i| all[i].0).collect());
            (*brick.edited(), densities, materials)
        }),
    )
}

fn brick_of(raw: RawBrick, ground: &Ground) -> Option<(BrickPos, Option<Arc<Brick>>)> {
    let pos = BrickPos(IVec3::from_array(raw.0));
    let Some((edited, densities, materials)) = raw.1 else { return Some((pos, None)) };
    let materials: Option<Vec<MaterialId>> = materials.map(|all| all.into_iter().map(MaterialId).collect());
    Some((pos, Some(Arc::new(Brick::restored(ground, pos, &edited, &densities, materials.as_deref())?))))
}

fn raw_fields(chunk: ChunkPos, fields: &Fields) -> RawField {
    let of = |f: &Field| (f.id.0, f.bounds.min.to_array(), f.bounds.max.to_array(), f.revision);
    ([chunk.x, chunk.y, chunk.z], fields.iter().map(of).collect())
}

fn fields_of((chunk, raw): RawField) -> Option<(ChunkPos, Fields)> {
    let [x, y, z] = chunk;
    let of = |(id, min, max, revision): (u64, [i32; 3], [i32; 3], u64)| Field {
        id: FieldId(id),
        bounds: crate::lattice::LatticeBox { min: min.into(), max: max.into() },
        revision,
    };
    Some((ChunkPos { x, y, z }, Fields::restored(raw.into_iter().map(of).collect())?))
}

pub fn encode_region(
    bricks: &BTreeMap<BrickPos, Arc<Brick>>,
    fields: &BTreeMap<ChunkPos, Fields>,
) -> Vec<u8> {
    let bricks: Vec<RawBrick> = bricks.iter().map(|(p, b)| raw_brick(*p, Some(b))).collect();
    let fields: Vec<RawField> = fields.iter().map(|(c, f)| raw_fields(*c, f)).collect();
    postcard::to_stdvec(&(bricks, fields)).unwrap()
}

type Parts = (Vec<(BrickPos, Arc<Brick>)>, Vec<(ChunkPos, Fields)>);

pub fn decode_region(bytes: &[u8], _at: RegionPos, ground: &Ground) -> Result<Parts, frame::FormatError> {
    let bad = || frame::FormatError("region".into());
    let (bricks, fields): (Vec<RawBrick>, Vec<RawField>) = postcard::from_bytes(bytes).map_err(|_| bad())?;
    let bricks = bricks.into_iter().map(|raw| brick_of(raw, ground).and_then(|(p, b)| Some((p, b?))));
    let bricks = bricks.collect::<Option<Vec<_>>>().ok_or_else(bad)?;
    let fields = fields.into_iter().map(fields_of).collect::<Option<Vec<_>>>().ok_or_else(bad)?;
    Ok((bricks, fields))
}

#[derive(serde::Serialize, serde::Deserialize)]
enum RawEntry {
    Rules(Option<DiggingRules>),
    Loose(Option<LooseSettings>),
    Edit(Vec<u8>),
    Change(Vec<RawBrick>, Vec<RawField>, u64),
}

#[derive(serde::Serialize, serde::Deserialize)]
struct RawCommit(u64, u64, Vec<RawEntry>);

#[derive(Default, Debug)]
pub struct Batch {
    pub commits: Vec<CommitRecord>,
    pub game: Vec<(String, Option<Vec<u8>>)>,
}

impl Batch {
    pub fn is_empty(&self) -> bool {
        self.commits.is_empty() && self.game.is_empty()
    }
    pub fn encode(&self) -> Vec<u8> {
        let commits: Vec<RawCommit> = self
            .commits
            .iter()
            .map(|record| {
                let entry = |entry: &LogEntry| match entry {
                    LogEntry::Rules(rules) => RawEntry::Rules(rules.as_deref().cloned()),
                    LogEntry::Loose(loose) => RawEntry::Loose(*loose),
                    LogEntry::Edit(edit) => RawEntry::Edit(postcard::to_stdvec(edit).unwrap()),
                    LogEntry::Change => RawEntry::Change(
                        record.change.bricks.iter().map(|(p, b)| raw_brick(*p, b.as_deref())).collect(),
                        record.change.fields.iter().map(|(c, f)| raw_fields(*c, f)).collect(),
                        record.change.next_field,
                    ),
                };
                RawCommit(record.revision, record.hash, record.entries.iter().map(entry).collect())
            })
            .collect();
        postcard::to_stdvec(&(commits, &self.game)).unwrap()
    }
    pub fn summary(
        bytes: &[u8],
    ) -> Result<(Option<(u64, u64)>, Vec<(String, Option<Vec<u8>>)>), frame::FormatError> {
        let bad = || frame::FormatError("batch".into());
        let (raw, game): (Vec<RawCommit>, _) = postcard::from_bytes(bytes).map_err(|_| bad())?;
        Ok((raw.last().map(|raw| (raw.0, raw.1)), game))
    }
    pub fn decode(bytes: &[u8], ground: &Ground) -> Result<Self, frame::FormatError> {
        let bad = || frame::FormatError("batch".into());
        let (raw, game): (Vec<RawCommit>, _) = postcard::from_bytes(bytes).map_err(|_| bad())?;
        let mut commits = Vec::new();
        for RawCommit(revision, hash, raw) in raw {
            let (mut entries, mut change) = (Vec::new(), WorldChange::default());
            for entry in raw {
                entries.push(match entry {
                    RawEntry::Rules(rules) => LogEntry::Rules(rules.map(Arc::new)),
                    RawEntry::Loose(loose) => LogEntry::Loose(loose),
                    RawEntry::Edit(edit) => LogEntry::Edit(postcard::from_bytes(&edit).map_err(|_| bad())?),
                    RawEntry::Change(bricks, fields, next_field) => {
                        let bricks = bricks.into_iter().map(|raw| brick_of(raw, ground));
                        change.bricks = bricks.collect::<Option<_>>().ok_or_else(bad)?;
                        change.fields =
                            fields.into_iter().map(fields_of).collect::<Option<_>>().ok_or_else(bad)?;
                        change.next_field = next_field;
                        LogEntry::Change
                    }
                });
            }
            commits.push(CommitRecord { revision, hash, entries, change });
        }
        Ok(Self { commits, game })
    }
}
