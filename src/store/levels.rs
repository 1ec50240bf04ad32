//! Levels in folders and packed files: what designers sculpt, and games ship.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use super::error::StoreError;
use super::format::FormatError;
use super::format::level::{self, Level, LevelFiles};
use super::format::limits::Limits;
use crate::ground::Ground;
use crate::terrain::{RestoreError, Terrain};

/// Why no terrain can be made of a level.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreLevelError {
    /// A file is damaged, or none of a level.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// It does not fit the ground, or its settings are out of range.
    #[error(transparent)]
    Restore(#[from] RestoreError),
}

impl Level {
    /// The level that a terrain is now, without history and what waits.
    pub fn of(terrain: &Terrain) -> Self {
        Self::new(terrain.parts(), terrain.voxel_size(), Default::default(), terrain.world().ground())
    }

    /// A terrain of this level over a ground, which should be the one that it was made on.
    ///
    /// # Errors
    /// When settings or rules are out of range, or when its bricks do not fit the ground.
    pub fn terrain(&self, ground: impl Into<Arc<Ground>>) -> Result<Terrain, RestoreError> {
        Terrain::restore(ground, &self.settings, self.parts())
    }
}

/// Writes a level to a folder, one file for each region, so that version control stores and shows what changed. Files that are as
/// they should be are left alone, and those of regions that hold nothing any more are removed. Nothing else in the folder is
/// touched.
///
/// # Errors
/// When a file can't be written.
pub fn save_level(folder: impl AsRef<Path>, level: &Level) -> Result<(), StoreError> {
    let folder = folder.as_ref();
    let files = level::write_level(level)?;
    fs::create_dir_all(folder).map_err(StoreError::files("creating the level's folder"))?;
    for (name, bytes) in &files {
        let path = folder.join(name);
        if fs::read(&path).is_ok_and(|old| old == *bytes) {
            continue;
        }
        // A crash leaves the old file or the new one.
        let new = path.with_extension("new");
        let write = || {
            fs::write(&new, bytes)?;
            fs::File::open(&new)?.sync_all()?;
            fs::rename(&new, &path)
        };
        write().map_err(StoreError::files("writing the level"))?;
    }
    let entries = fs::read_dir(folder).map_err(StoreError::files("reading the level's folder"))?;
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if level::region_of_name(&name).is_some() && !files.contains_key(&name) {
            fs::remove_file(entry.path())
                .map_err(StoreError::files("removing a region that is empty now"))?;
        }
    }
    Ok(())
}

/// Reads the files of a level: of a folder, or of a packed file.
///
/// # Errors
/// When there is no level, or when its files can't be read.
pub fn read_level_files(path: impl AsRef<Path>) -> Result<LevelFiles, StoreError> {
    let path = path.as_ref();
    let read = StoreError::files("reading the level");
    if !path.is_dir() {
        let size = fs::metadata(path).map_err(StoreError::files("reading the level"))?.len();
        let limit = Limits::FORMAT.packed_level as u64;
        if size > limit {
            return Err(FormatError::TooLarge { length: size, limit }.into());
        }
        return Ok(level::unpack_level(&fs::read(path).map_err(read)?)?);
    }
    let mut files = LevelFiles::new();
    for entry in fs::read_dir(path).map_err(read)?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name == level::LEVEL_JSON || level::region_of_name(&name).is_some() {
            let bytes = fs::read(entry.path()).map_err(StoreError::files("reading the level"))?;
            files.insert(name, bytes);
        }
    }
    Ok(files)
}

/// Reads a level over its ground, from a folder or from a packed file.
///
/// # Errors
/// When there is no level, when its files can't be read, and when they are damaged.
pub fn load_level(path: impl AsRef<Path>, ground: &Ground) -> Result<Level, StoreError> {
    Ok(level::read_level(&read_level_files(path)?, ground)?)
}
