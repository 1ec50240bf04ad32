//! Converts a world to a single `.burrow` file or to bytes, and back.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::error::StoreError;
use crate::format::frame::WorldId;
use crate::format::portable::{PortableWorld, read_portable, write_portable};
use crate::format::{FormatError, Metadata};
use crate::ground::Ground;
use crate::terrain::{Terrain, TerrainSettings};

/// A world that was read from a `.burrow` file: it is whole, and depends on no folder.
#[derive(Debug)]
pub struct WorldFile {
    /// The terrain. Nothing is meshed, and there is no history.
    pub terrain: Terrain,
    /// The id of the world that it is a copy of.
    pub world: WorldId,
    /// The game's data, by key.
    pub game: BTreeMap<String, Vec<u8>>,
    /// Whether the ground differs from the one that it was saved with. Edited samples are unchanged in any case.
    pub is_base_changed: bool,
}

impl WorldFile {
    /// Converts a terrain's world to bytes, with the game's data by key. Equal worlds under one id give equal bytes.
    /// Neither the ground nor history are part of it.
    ///
    /// # Errors
    /// [`StoreError::TooLarge`] when it could not be read again: data of the game's and 13 bytes for each region may
    /// take 256 MiB.
    pub fn to_bytes(
        terrain: &Terrain,
        world: WorldId,
        game: &BTreeMap<String, Vec<u8>>,
    ) -> Result<Vec<u8>, StoreError> {
        let (parts, ground) = (terrain.parts(), terrain.world().ground());
        let metadata = Metadata {
            settings: TerrainSettings { chunk_size: parts.chunk_size, voxel_size: terrain.voxel_size() },
            hash: terrain.world().hash(),
            simulation: Terrain::SIMULATION,
            ground: ground.hash(),
            game: game.iter().map(|(key, bytes)| (key.clone(), bytes.clone())).collect(),
            ..Metadata::default()
        };
        Ok(write_portable(&PortableWorld::new(world, metadata, parts, ground))?)
    }

    /// Reads the bytes of [`to_bytes`](Self::to_bytes), over the world's ground or over another one.
    ///
    /// # Errors
    /// When they are damaged or do not belong to a world, when a newer version wrote them, and when they do not fit the
    /// ground.
    pub fn from_bytes(bytes: &[u8], ground: impl Into<Arc<Ground>>) -> Result<Self, StoreError> {
        let ground = ground.into();
        let portable = read_portable(bytes, &ground)?;
        let metadata = &portable.metadata;
        let is_base_changed = metadata.ground != ground.hash();
        let (hash, is_known) =
            (metadata.hash, !is_base_changed && metadata.simulation == Terrain::SIMULATION);
        let terrain = Terrain::restore(ground, &metadata.settings, portable.parts())?;
        if is_known && terrain.world().hash() != hash {
            return Err(StoreError::Unreadable("it has another hash than it says".into()));
        }
        let (world, game) = (portable.world, portable.metadata.game.into_iter().collect());
        Ok(Self { terrain, world, game, is_base_changed })
    }
}

impl From<FormatError> for StoreError {
    fn from(error: FormatError) -> Self {
        match error {
            FormatError::Newer { found, known } => Self::Newer { found, known },
            FormatError::TooLarge { length, limit } => Self::TooLarge { length, limit },
            error => Self::Unreadable(error.to_string()),
        }
    }
}
