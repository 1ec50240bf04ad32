//! Decoders get any bytes, and valid ones that were changed: they never panic, never take much memory, and what they
//! accept is written and read again as the same. `BURROW_FUZZ` is the number of runs of each.

use allocation_counter::measure;
use fastrand::Rng;

use super::damage::damage;
use super::{compare, count, round_trips, worlds};
use crate::brush::Edit;
use crate::format::bytes::Reader;
use crate::format::contents::ContentTable;
use crate::format::edits::{EditSequence, put_edit};
use crate::format::frame::{self, Kind, WorldId};
use crate::format::level::Level;
use crate::format::limits::Limits;
use crate::format::portable::{read_portable, write_portable};
use crate::format::{Batch, Metadata, container, decode_region, encode_region};
use crate::ground::{GreyImage, ImageLimits};
use crate::lattice::RegionPos;

/// Bytes that a decoder may take besides what it makes of each byte of its input.
const ANYWAY: u64 = 4 << 20;

/// Runs a decoder on random bytes and on changed valid ones. `decode` says whether it accepts them; it may take
/// `factor` bytes of memory for each of its input.
fn fuzz(name: &str, valid: &[Vec<u8>], factor: u64, mut decode: impl FnMut(&[u8]) -> bool) {
    let mut rng = Rng::with_seed(count("BURROW_SEED", 1));
    let (runs, mut accepted, mut most) = (count("BURROW_FUZZ", 2000), 0, 0);
    let started = std::time::Instant::now();
    for run in 0..runs {
        let mut bytes = match (run % 8, valid.len()) {
            (0, _) | (_, 0) => (0..rng.usize(0..300)).map(|_| rng.u8(..)).collect(),
            (_, many) => valid[rng.usize(0..many)].clone(),
        };
        (0..rng.u8(0..5)).for_each(|_| damage(&mut rng, &mut bytes));
        let memory = measure(|| accepted += u64::from(decode(&bytes))).bytes_max;
        assert!(memory < ANYWAY + factor * bytes.len() as u64, "{name}: {memory} bytes for {}", bytes.len());
        most = most.max(memory);
    }
    println!("{name}: {runs} runs, {accepted} accepted, {most} bytes at most, {:?}", started.elapsed());
    assert!(valid.iter().all(|bytes| decode(bytes)), "{name}: a valid input is refused");
}

#[test]
fn regions() {
    let ground = worlds::hills(64);
    let terrain = worlds::eventful(&ground, 6, 4);
    let at = terrain.world().regions().next().unwrap();
    let bricks: Vec<_> = terrain.world().bricks_in(at).collect();
    let piece = |bricks: &[_]| encode_region(bricks.iter().map(|(pos, brick)| (pos, *brick)), []);
    let parts = terrain.parts();
    let fields = encode_region([], parts.change.fields.iter().map(|(chunk, fields)| (chunk, fields)));
    let valid: Vec<_> = bricks.chunks(9).map(piece).chain([piece(&bricks), fields]).collect();
    fuzz("region", &valid, 400, |bytes| {
        let Ok((bricks, fields)) = decode_region(bytes, at, &ground) else { return false };
        let of = |(bricks, fields): &(Vec<_>, Vec<_>)| {
            encode_region(bricks.iter().map(|(p, b)| (p, b)), fields.iter().map(|(c, f)| (c, f)))
        };
        let first = (bricks, fields);
        let again = decode_region(&of(&first), at, &ground).unwrap();
        assert!(compare::lists(&first.0, &again.0) && first.1 == again.1);
        true
    });
    // Wherever the region is.
    let mut rng = Rng::with_seed(5);
    for _ in 0..count("BURROW_FUZZ", 2000).min(10_000) {
        let at = RegionPos([rng.i32(..), rng.i32(..), rng.i32(..)].map(|at| at >> rng.u8(..32)).into());
        drop(decode_region(&valid[0], at, &ground));
    }
}

#[test]
fn journals() {
    let ground = worlds::hills(64);
    let log = worlds::eventful(&ground, 30, 4).take_log();
    let valid: Vec<_> = worlds::batches(&log, 3).iter().map(Batch::encode).collect();
    fuzz("journal", &valid, 800, |bytes| {
        let Ok(batch) = Batch::decode(bytes, &ground) else { return false };
        assert!(compare::batches(&Batch::decode(&batch.encode(), &ground).unwrap(), &batch));
        true
    });
}

#[test]
fn edits() {
    let edits = round_trips::all_edits();
    let mut contents = ContentTable::default();
    edits.iter().flat_map(|edit| edit.contents()).for_each(|content| contents.add_content(content));
    for of in [EditSequence::default, EditSequence::whole] {
        let encode = |edits: &[Edit]| {
            let (mut bytes, mut sequence) = (Vec::new(), of());
            edits.iter().for_each(|edit| put_edit(&mut bytes, edit, &mut sequence));
            bytes
        };
        let read = |reader: &mut Reader, sequence: &mut EditSequence| {
            let head = reader.byte()?;
            sequence.read(head, reader, &contents)?.whole()
        };
        let valid: Vec<_> = edits.chunks(5).map(encode).collect();
        fuzz("edit", &valid, 200, |bytes| {
            let (mut reader, mut sequence, mut all) = (Reader(bytes), of(), Vec::new());
            while !reader.0.is_empty() {
                let Ok(edit) = read(&mut reader, &mut sequence) else { return false };
                assert_eq!(edit.check(), Ok(()));
                all.push(edit);
            }
            let (again, mut sequence) = (encode(&all), of());
            let mut reader = Reader(&again);
            all.iter().all(|edit| read(&mut reader, &mut sequence).as_ref() == Ok(edit))
        });
    }
}

#[test]
fn metadata() {
    let game = vec![("key".into(), vec![1, 2, 3])];
    let valid = [Metadata { revision: 3, game, ..Metadata::default() }.encode()];
    fuzz("metadata", &valid, 100, |bytes| {
        Metadata::decode(bytes).is_ok_and(|read| {
            // NaN is not equal to itself; its bytes are.
            Metadata::decode(&read.encode()).unwrap().encode() == read.encode()
        })
    });
}

#[test]
fn frames() {
    let valid = [frame::seal(Kind::Region, WorldId(1), b"key", 3, 4, &[9; 500])];
    fuzz("frame", &valid, 300, |bytes| {
        let _ = frame::peek(bytes);
        frame::open(bytes, Kind::Region, WorldId(1), b"key", 1 << 20).is_ok()
    });
}

const LIMIT: usize = Limits::FORMAT.head;

/// The file with a correct checksum for its changed head, and with its old frames.
fn resealed(file: &[u8], kind: Kind, own: &[u8]) -> Vec<u8> {
    let container = container::read(kind, file, LIMIT).unwrap();
    let frames: Vec<Vec<u8>> = container.frames.iter().map(|frame| frame.to_vec()).collect();
    container::write(kind, container.world, own, &frames, LIMIT).unwrap()
}

#[test]
fn portable_files() {
    let ground = worlds::hills(64);
    let mut terrain = worlds::eventful(&ground, 5, 4);
    let file = write_portable(&worlds::portable(&mut terrain, &ground)).unwrap();
    let read = |file: &[u8]| match read_portable(file, &ground) {
        Ok(portable) => {
            assert!(compare::portables(
                &read_portable(&write_portable(&portable).unwrap(), &ground).unwrap(),
                &portable
            ));
            true
        }
        Err(_) => false,
    };
    fuzz("portable file", std::slice::from_ref(&file), 800, read);
    let own = container::read(Kind::Portable, &file, LIMIT).unwrap().data;
    fuzz("portable head", &[own], 10_000, |own| {
        let file = resealed(&file, Kind::Portable, own);
        // NaN as a voxel size is not equal to itself.
        read_portable(&file, &ground).is_ok_and(|read| {
            let again = write_portable(&read).unwrap();
            write_portable(&read_portable(&again, &ground).unwrap()).unwrap() == again
        })
    });
}

#[test]
fn levels() {
    let ground = worlds::hills(64);
    let terrain = worlds::eventful(&ground, 5, 4);
    let files = Level::new(terrain.parts(), 1.0, Default::default(), &ground).to_files().unwrap();
    let packed = Level::pack_files(&files).unwrap();
    fuzz("packed level", &[packed], 800, |bytes| Level::unpack_files(bytes).is_ok());
    for (name, file) in &files {
        fuzz(name, std::slice::from_ref(file), 800, |bytes| {
            let mut files = files.clone();
            files.insert(name.clone(), bytes.to_vec());
            let Ok(level) = Level::from_files(&files, &ground) else { return false };
            let Ok(written) = level.to_files() else { return true };
            let again = Level::from_files(&written, &ground);
            again.is_ok_and(|again| compare::regions(&again.regions, &level.regions))
        });
    }
}

#[test]
fn heightmaps() {
    let samples: Vec<u16> = (0..35u32).map(|at| (at * at * 40_503) as u16).collect();
    let mut valid = Vec::new();
    for wide in [false, true] {
        let mut file = std::io::Cursor::new(Vec::new());
        let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(7, 5, samples.clone()).unwrap();
        let image = image::DynamicImage::from(image);
        let image = if wide { image } else { image.to_luma8().into() };
        image.write_to(&mut file, image::ImageFormat::Png).unwrap();
        valid.push(file.into_inner());
    }
    let limits = ImageLimits { max_alloc_bytes: 1 << 20, ..ImageLimits::default() };
    fuzz("heightmap", &valid, 800, |bytes| GreyImage::decode_png(bytes, &limits).is_ok());
}
