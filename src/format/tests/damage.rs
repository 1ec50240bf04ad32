//! Damage: flips, cuts, swaps and stale records are detected; nothing is ever silently different.

use fastrand::Rng;

use super::{compare, count, worlds};
use crate::format::FormatError;
use crate::format::frame::{self, Kind, WorldId, seal};
use crate::format::level::Level;
use crate::format::portable::{read_portable, write_portable};

/// Changes bytes somehow; they may stay the same.
pub fn damage(rng: &mut Rng, bytes: &mut Vec<u8>) {
    let length = bytes.len();
    let at = |rng: &mut Rng| rng.usize(0..length.max(1));
    if length == 0 {
        bytes.push(rng.u8(..));
        return;
    }
    match rng.u8(..7) {
        0 | 1 => bytes[at(rng)] ^= 1 << rng.u8(..8),
        2 => bytes.truncate(at(rng)),
        3 => {
            let (a, b) = (at(rng), at(rng));
            bytes.swap(a, b);
        }
        4 => {
            let (from, to) = (at(rng), at(rng));
            let count = rng.usize(1..64).min(length - from.max(to));
            bytes.copy_within(from..from + count, to);
        }
        5 => {
            let at = at(rng);
            bytes.insert(at, rng.u8(..));
        }
        _ => {
            let from = at(rng);
            let count = rng.usize(1..9).min(length - from);
            let value = rng.choice([0u8, 255, 127, 128]).unwrap_or(0);
            bytes[from..from + count].fill(value);
        }
    }
}

#[test]
fn damaged_files_are_told() {
    let ground = worlds::hills(96);
    let mut terrain = worlds::eventful(&ground, 12, 1);
    let saved = worlds::portable(&mut terrain, &ground);
    let file = write_portable(&saved).unwrap();
    let files = Level::new(terrain.parts(), 1.0, Default::default(), &ground).to_files().unwrap();
    let packed = Level::pack_files(&files).unwrap();
    let (key, world) = (*b"a key", WorldId(7));
    let sealed = seal(Kind::Region, world, &key, 9, 11, &packed);
    let mut rng = Rng::with_seed(count("BURROW_SEED", 1));
    let mut told = 0;
    for _ in 0..count("BURROW_DAMAGE", 3000) {
        let times = rng.u8(1..4);
        let mut damaged = |bytes: &[u8]| {
            let mut bytes = bytes.to_vec();
            (0..times).for_each(|_| damage(&mut rng, &mut bytes));
            bytes
        };
        match read_portable(&damaged(&file), &ground) {
            Ok(read) => assert!(compare::portables(&read, &saved)),
            Err(_) => told += 1,
        }
        match Level::unpack_files(&damaged(&packed)) {
            Ok(read) => assert_eq!(read, files),
            Err(_) => told += 1,
        }
        match frame::open(&damaged(&sealed), Kind::Region, world, &key, 1 << 30) {
            Ok(opened) => {
                assert_eq!((opened.revision, opened.ground_hash, &opened.payload), (9, 11, &packed));
            }
            Err(_) => told += 1,
        }
    }
    println!("damage of {told} files was detected");
}

#[test]
fn a_frame_is_no_other_frame() {
    let world = WorldId(5);
    let sealed = seal(Kind::Region, world, b"here", 3, 4, &[7; 1000]);
    let open = |bytes: &[u8], kind, world, key: &[u8], limit| frame::open(bytes, kind, world, key, limit);
    assert_eq!(open(&sealed, Kind::Region, world, b"here", 1000).unwrap().payload, [7; 1000]);
    let limit = FormatError::TooLarge { length: 1000, limit: 999 };
    assert_eq!(open(&sealed, Kind::Region, world, b"here", 999), Err(limit));
    let kind = FormatError::Kind { found: 3, expected: Kind::Journal };
    assert_eq!(open(&sealed, Kind::Journal, world, b"here", 1000), Err(kind));
    let other = FormatError::World { found: world, expected: WorldId(6) };
    assert_eq!(open(&sealed, Kind::Region, WorldId(6), b"here", 1000), Err(other));
    assert_eq!(open(&sealed, Kind::Region, world, b"there", 1000), Err(FormatError::Key));
    assert_eq!(open(b"PNG", Kind::Region, world, b"here", 1000), Err(FormatError::Magic));
    let longer = [&*sealed, b"more"].concat();
    let peeked = frame::peek(&longer).unwrap();
    assert_eq!((peeked.world, peeked.key, peeked.length), (world, &b"here"[..], sealed.len()));
}

#[test]
fn a_newer_schema_is_refused_by_its_number_and_damage_is_not_taken_for_one() {
    let mut newer = seal(Kind::Region, WorldId(5), b"here", 3, 4, b"content");
    newer[4] = 9;
    let open = |bytes: &[u8]| frame::open(bytes, Kind::Region, WorldId(5), b"here", 1000).unwrap_err();
    assert_eq!(open(&newer), FormatError::Checksum);
    let body = newer.len() - 8;
    let checksum = xxhash_rust::xxh3::xxh3_64(&newer[..body]);
    newer[body..].copy_from_slice(&checksum.to_le_bytes());
    assert_eq!(open(&newer), FormatError::Newer { found: 9, known: frame::SCHEMA });
    assert_eq!(open(&newer).newer_schema(), Some(9));
    assert!(open(&newer).to_string().contains("schema 9"));
    assert_eq!(frame::peek(&newer), None);
}

#[test]
fn a_frame_that_declares_much_takes_no_memory() {
    // 1 GB declared by 7 packed bytes, with a right checksum.
    let mut sealed = seal(Kind::Region, WorldId(5), b"", 0, 0, &[0; 200]);
    let length = sealed.iter().position(|&byte| byte == 200).unwrap();
    sealed.splice(length..length + 2, [128, 128, 128, 128, 4]);
    let body = sealed.len() - 8;
    let checksum = xxhash_rust::xxh3::xxh3_64(&sealed[..body]);
    sealed.truncate(body);
    sealed.extend_from_slice(&checksum.to_le_bytes());
    let mut opened = None;
    let memory = allocation_counter::measure(|| {
        opened = Some(frame::open(&sealed, Kind::Region, WorldId(5), b"", usize::MAX));
    });
    assert_eq!(opened, Some(Err(FormatError::Invalid("length"))));
    assert!(memory.bytes_max < 1000);
}
