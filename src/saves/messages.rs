//! Messages about saved worlds.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use bevy::prelude::*;

use crate::store::{StoreError, StoreWarning};

/// Saves at once, and makes a checkpoint: for example when a level ends, or before a menu closes the game. Without it,
/// everything is saved too, within the loss window. A [`WorldSaved`] follows once everything that was committed or put
/// before is durable.
#[derive(Message, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SaveNow {
    /// The terrain's entity; `None` for every saved world.
    pub terrain: Option<Entity>,
}

/// A saved world was read or created; or the reason why it could not be: then the terrain stays as it is, and is not
/// saved.
#[derive(Message, Clone, Debug)]
pub struct WorldOpened {
    /// The terrain's entity.
    pub terrain: Entity,
    /// The revision that the world is at; 0 for a new one.
    pub outcome: Result<u64, Arc<StoreError>>,
}

/// The terrain would survive a crash, up to a revision. It is sent whenever a later revision has become durable, also
/// while each frame commits more, and after another terrain has replaced the saved one.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorldSaved {
    /// The terrain's entity.
    pub terrain: Entity,
    /// The last revision that is durable.
    pub revision: u64,
}

/// A problem with a saved world to show to the player or operator: the disk is full, a region was damaged. Play
/// continues, and saving is retried.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct StoreWarningFound {
    /// The terrain's entity.
    pub terrain: Entity,
    /// The warning.
    pub warning: StoreWarning,
}

/// A saved world is closed, so that its folder can be opened, copied or removed.
#[derive(Message, Clone, Debug)]
pub struct WorldClosed {
    /// The terrain's entity, which may be gone.
    pub terrain: Entity,
    /// The world's folder.
    pub path: PathBuf,
    /// Why it was closed.
    pub because: ClosedBecause,
    /// The last saved revision; or the reason why not everything was saved.
    pub outcome: Result<u64, Arc<StoreError>>,
}

/// The reason why a saved world was closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ClosedBecause {
    /// The [`SavedWorld`](super::SavedWorld) was removed or replaced, or its entity despawned.
    #[default]
    Removed,
    /// A [`Terrain`](crate::terrain::Terrain) over another ground, or of another size, was put in place of its own. Its
    /// `SavedWorld` was removed, and nothing was written of that terrain: insert another `SavedWorld` with it to save
    /// that.
    OtherTerrain,
    /// The terrain is shared from now on, and the server saves what players share. The `SavedWorld` was removed.
    Shared,
}

impl fmt::Display for ClosedBecause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Removed => "it was removed",
            Self::OtherTerrain => "a terrain over another ground, or of another size, is in its place",
            Self::Shared => "its terrain is shared",
        })
    }
}
