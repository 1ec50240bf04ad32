//! Files of prefabs: they come back as they were, and any damage is noticed.

use bevy_burrow::format::FormatError;
use bevy_burrow::prelude::*;
use fastrand::Rng;

use crate::laws::{edited, some_box};
use crate::worlds::world_count;

fn prefab(seed: u64) -> Prefab {
    let mut rng = Rng::with_seed(seed);
    let terrain = edited(&mut rng, seed);
    let samples = some_box(&mut rng, terrain.world());
    terrain.world().copy(samples, samples.max).expect("it lies in the world")
}

/// A count from the environment, or the default.
fn damage_count() -> usize {
    std::env::var("BURROW_DAMAGE").ok().and_then(|count| count.parse().ok()).unwrap_or(2000)
}

#[test]
fn a_prefab_comes_back_from_its_file() {
    for seed in 0..world_count(20) {
        let prefab = prefab(seed);
        let file = prefab.to_bytes();
        let read = Prefab::from_bytes(&file).expect("its own file");
        assert_eq!((&read, read.hash()), (&prefab, prefab.hash()));
        assert_eq!(read.to_bytes(), file, "equal prefabs give equal bytes");
    }
}

#[test]
fn any_damage_of_a_file_is_refused() {
    let file = prefab(3).to_bytes();
    for length in 0..file.len().min(3000) {
        assert!(Prefab::from_bytes(&file[..length]).is_err(), "cut off after {length}");
    }
    let mut rng = Rng::with_seed(4);
    for _ in 0..damage_count() {
        let mut bytes = file.clone();
        for _ in 0..rng.usize(1..5) {
            let at = rng.usize(..bytes.len());
            match rng.u32(0..4) {
                0 => bytes[at] ^= 1 << rng.u32(0..8),
                1 => bytes[at] = rng.u8(..),
                2 => drop(bytes.remove(at)),
                _ => bytes.insert(at, rng.u8(..)),
            }
        }
        assert!(bytes == file || Prefab::from_bytes(&bytes).is_err());
    }
    assert_eq!(Prefab::from_bytes(b""), Err(FormatError::Magic));
    assert_eq!(Prefab::from_bytes(b"no prefab at all"), Err(FormatError::Magic));
}

#[test]
fn serialised_bytes_of_any_content_are_read_or_refused_without_a_panic() {
    let mut rng = Rng::with_seed(5);
    let good = serde_json::to_string(&prefab(6)).expect("serialised");
    for _ in 0..damage_count() {
        let mut bytes = good.clone().into_bytes();
        for _ in 0..rng.usize(1..4) {
            let at = rng.usize(..bytes.len());
            bytes[at] = b"0123456789-,[]"[rng.usize(..14)];
        }
        // Whatever could be read is a prefab that can be written.
        if let Ok(read) = serde_json::from_slice::<Prefab>(&bytes) {
            assert_eq!(Prefab::from_bytes(&read.to_bytes()), Ok(read));
        }
    }
}
