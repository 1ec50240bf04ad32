//! Data that would be too large to read is not written, and all other data is.

use fastrand::Rng;

use super::{count, worlds};
use crate::format::FormatError;
use crate::format::level::{self, Level};
use crate::format::limits::Limits;
use crate::format::portable::{self, write_portable};

/// Limits some of which are near these sizes.
fn random_limits(rng: &mut Rng, sizes: &[usize]) -> Limits {
    let mut near = || match rng.u32(0..3) {
        0 => 1 << 30,
        _ => (rng.choice(sizes).copied().unwrap_or(0) + rng.usize(0..3)).saturating_sub(1),
    };
    Limits { head: near(), region: near(), journal: near(), level_file: near(), packed_level: near() }
}

/// Asserts that it is written exactly if it can be read. Returns whether it was written.
fn agree<W, R>(written: Result<W, FormatError>, read: Result<R, FormatError>) -> bool {
    let is_too_large = |why: &FormatError| match why {
        FormatError::TooLarge { length, limit } => length > limit,
        // A level says in which file.
        FormatError::File { why, .. } => why.contains("bytes, but"),
        _ => false,
    };
    match (written, read) {
        (Ok(_), Ok(_)) => true,
        (Err(written), Err(read)) if is_too_large(&written) && is_too_large(&read) => false,
        (written, read) => panic!("writing: {:?}, reading: {:?}", written.err(), read.err()),
    }
}

#[test]
fn what_is_written_within_limits_is_what_can_be_read_within_them() {
    let mut outcomes = [[0; 2]; 3];
    for seed in 0..count("BURROW_WORLDS", 4) {
        let (ground, mut rng) = (worlds::hills(96), Rng::with_seed(seed));
        let mut terrain = worlds::eventful(&ground, 30, seed);
        let game = [("inventory".to_owned(), vec![7; rng.usize(0..4000)])].into();
        let level = Level::new(terrain.parts(), 1.0, game, &ground);
        let world = worlds::portable(&mut terrain, &ground);
        let files = level.to_files().unwrap();
        let (file, packed) = (write_portable(&world).unwrap(), Level::pack_files(&files).unwrap());
        let mut sizes: Vec<usize> = world.regions.values().map(|region| region.encode().len()).collect();
        sizes.extend(world.journal.iter().map(|batch| batch.encode().len()));
        sizes.extend(files.values().map(Vec::len));
        sizes.extend([0, packed.len(), 13 * files.len(), 9 * (sizes.len() + 2)]);
        for _ in 0..100 {
            let limits = random_limits(&mut rng, &sizes);
            let agreed = [
                agree(
                    portable::write_within(&world, &limits),
                    portable::read_within(&file, &ground, &limits),
                ),
                agree(level::write_within(&level, &limits), level::read_within(&files, &ground, &limits)),
                agree(level::pack_within(&files, &limits), level::unpack_within(&packed, &limits)),
            ];
            agreed.iter().zip(&mut outcomes).for_each(|(is_ok, counts)| counts[usize::from(*is_ok)] += 1);
        }
    }
    assert!(outcomes.iter().flatten().all(|count| *count > 0), "{outcomes:?}");
}
