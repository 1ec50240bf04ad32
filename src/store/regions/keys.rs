//! Keys of the records in the database.

use glam::IVec3;

use crate::lattice::RegionPos;

/// The keys of the checkpoint, which is stored twice: without it, intact regions could not be distinguished from older
/// ones.
pub(in crate::store) const CHECKPOINTS: [&[u8]; 2] = [b"c", b"d"];

/// The content of a record.
pub(in crate::store) enum Key {
    Checkpoint,
    Region(RegionPos),
}

impl Key {
    /// The content of the record with this key.
    pub fn of(key: &[u8]) -> Option<Self> {
        if CHECKPOINTS.contains(&key) {
            return Some(Self::Checkpoint);
        }
        let at: &[u8; 12] = key.strip_prefix(b"r")?.try_into().ok()?;
        let [x, y, z] = [0, 4, 8].map(|from| i32::from_be_bytes(std::array::from_fn(|byte| at[from + byte])));
        Some(Self::Region(RegionPos(IVec3::new(x, y, z))))
    }
}

/// The key of a region's record.
pub(in crate::store) fn region(at: RegionPos) -> Vec<u8> {
    let mut key = vec![b'r'];
    at.0.to_array().iter().for_each(|part| key.extend_from_slice(&part.to_be_bytes()));
    key
}

/// A region's name in messages and file names.
pub(in crate::store) fn name(at: RegionPos) -> String {
    format!("{} {} {}", at.0.x, at.0.y, at.0.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_is_found_by_its_key() {
        for at in [IVec3::ZERO, IVec3::new(-1, 7, i32::MIN), IVec3::MAX] {
            let key = region(RegionPos(at));
            assert!(matches!(Key::of(&key), Some(Key::Region(found)) if found.0 == at));
            assert!(Key::of(&key[1..]).is_none());
        }
    }
}
