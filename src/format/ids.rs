//! What a frame contains, and of which world; names of content.

use std::fmt;
use std::hash::{BuildHasher, Hasher, RandomState};

use serde::{Deserialize, Serialize};

/// The content of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum Kind {
    /// Commits, one after the other.
    Journal = 1,
    /// A world without its regions.
    Checkpoint,
    /// Bricks and fields of a region.
    Region,
    /// The head of a portable world.
    Portable,
    /// The head of a packed level.
    Level,
    /// A file of a level.
    LevelFile,
    /// The differences of a region from the level below.
    RegionChange,
    /// A prefab.
    Prefab,
    /// An image of a stamp or of a grid.
    Image,
}

/// Identifies a world uniquely.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct WorldId(pub u128);

impl WorldId {
    /// A new random id. It is not a secret.
    pub fn random() -> Self {
        // Each state has keys that the system drew at random.
        let word = || u128::from(RandomState::new().build_hasher().finish());
        Self(word() << 64 | word())
    }
}

impl fmt::Display for WorldId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

/// Identifies an image or a prefab by its content.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ContentId(pub u64);
