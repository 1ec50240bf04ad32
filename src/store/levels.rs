//! Saves and loads levels, in folders and packed files.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::error::StoreError;
use crate::format::FormatError;
use crate::format::level::{self, Level, LevelFiles};
use crate::format::limits::Limits;
use crate::ground::Ground;
use crate::terrain::{RestoreError, Terrain, World, WorldParts};

/// The reason why no terrain can be made from a level.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreLevelError {
    /// A file is damaged, or does not belong to a level.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The level does not fit the ground, or its settings are out of range.
    #[error(transparent)]
    Restore(#[from] RestoreError),
}

impl Level {
    /// The present state of a terrain as a level, without history and waiting edits.
    pub fn of(terrain: &Terrain) -> Self {
        Self::of_parts(terrain.parts(), terrain.voxel_size(), terrain.world())
    }

    /// The level of a world whose parts these are.
    pub(crate) fn of_parts(parts: WorldParts, voxel_size: f32, world: &World) -> Self {
        Self::new(parts, voxel_size, Default::default(), world.ground())
    }

    /// A terrain from this level over a ground, which should be the one that the level was made on.
    ///
    /// # Errors
    /// When settings or rules are out of range, or when its bricks do not fit the ground.
    pub fn terrain(&self, ground: impl Into<Arc<Ground>>) -> Result<Terrain, RestoreError> {
        Terrain::restore(ground, &self.settings, self.parts())
    }

    /// Writes the level to a folder, one file for each region, so that version control stores and shows the changes.
    /// Unchanged files are not written, and files of regions that became empty are removed. Nothing else in the folder
    /// is touched.
    ///
    /// After a crash the folder holds the old level or the new one: new files are complete before the first of the old
    /// ones is touched, and [`load`](Self::load) reads new files that have not replaced the old ones yet.
    ///
    /// # Errors
    /// When a file can't be written, or the folder has no name.
    pub fn save(&self, folder: impl AsRef<Path>) -> Result<(), StoreError> {
        let folder = folder.as_ref();
        if folder.as_os_str().is_empty() {
            let why = io::Error::new(io::ErrorKind::InvalidInput, "the folder has no name");
            return Err(StoreError::files("creating the level's folder")(why));
        }
        let files = self.to_files()?;
        fs::create_dir_all(folder).map_err(StoreError::files("creating the level's folder"))?;
        Pending::finish(folder)?;
        Pending::prepare(folder, &files)?;
        Pending::finish(folder)
    }

    /// Reads a level over its ground, from a folder or from a packed file.
    ///
    /// # Errors
    /// When there is no level, when its files can't be read, and when they are damaged.
    pub fn load(path: impl AsRef<Path>, ground: &Ground) -> Result<Self, StoreError> {
        Ok(Self::from_files(&read_level_files(path)?, ground)?)
    }
}

/// The file that lists the remaining steps of a save.
const PENDING: &str = "level.pending";

/// The remaining steps of a save: all new files are there, and durable.
#[derive(Default, Serialize, Deserialize)]
struct Pending {
    /// Files with a new version next to them that may not have replaced them yet.
    changed: BTreeSet<String>,
    /// Files of regions that hold nothing any more.
    removed: BTreeSet<String>,
}

impl Pending {
    /// The steps that a crash left undone in a folder.
    fn read(folder: &Path) -> Result<Option<Self>, StoreError> {
        let bytes = match fs::read(folder.join(PENDING)) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            bytes => bytes.map_err(StoreError::files("reading the level"))?,
        };
        let why = |why: String| FormatError::File { name: PENDING.into(), why };
        let pending: Self = serde_json::from_slice(&bytes).map_err(|error| why(error.to_string()))?;
        match pending.changed.iter().chain(&pending.removed).find(|name| !is_of_level(name)) {
            Some(name) => Err(why(format!("`{name}` is not a file of a level")).into()),
            None => Ok(Some(pending)),
        }
    }

    /// Writes new files next to the old ones, and a list of the remaining steps.
    fn prepare(folder: &Path, files: &LevelFiles) -> Result<(), StoreError> {
        let mut pending = Self::default();
        for (name, bytes) in files {
            let path = folder.join(name);
            if fs::read(&path).is_ok_and(|old| old == *bytes) {
                continue;
            }
            write_durably(&new_of(&path), bytes).map_err(StoreError::files("writing the level"))?;
            pending.changed.insert(name.clone());
        }
        let entries = fs::read_dir(folder).map_err(StoreError::files("reading the level's folder"))?;
        let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
        let is_gone = |name: &String| level::region_of_name(name).is_some() && !files.contains_key(name);
        pending.removed = names.filter(is_gone).collect();
        if pending.changed.is_empty() && pending.removed.is_empty() {
            return Ok(());
        }
        let json = serde_json::to_vec_pretty(&pending).map_err(|error| {
            StoreError::from(FormatError::File { name: PENDING.into(), why: error.to_string() })
        })?;
        let path = folder.join(PENDING);
        let enter = || {
            write_durably(&new_of(&path), &json)?;
            sync_folder(folder)?;
            fs::rename(new_of(&path), &path)?;
            sync_folder(folder)
        };
        enter().map_err(StoreError::files("writing the level"))
    }

    /// Finishes the remaining steps.
    fn finish(folder: &Path) -> Result<(), StoreError> {
        let Some(pending) = Self::read(folder)? else { return Ok(()) };
        let finish = || {
            for path in pending.changed.iter().map(|name| folder.join(name)) {
                is_done(fs::rename(new_of(&path), &path))?;
            }
            for name in &pending.removed {
                is_done(fs::remove_file(folder.join(name)))?;
            }
            sync_folder(folder)?;
            fs::remove_file(folder.join(PENDING))?;
            sync_folder(folder)
        };
        finish().map_err(StoreError::files("putting the level's files in place"))
    }
}

/// A step that was done before a crash need not be done again.
fn is_done(step: io::Result<()>) -> io::Result<()> {
    match step {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        step => step,
    }
}

fn is_of_level(name: &str) -> bool {
    name == level::LEVEL_JSON || level::region_of_name(name).is_some()
}

/// The path of the file that replaces another one.
fn new_of(path: &Path) -> PathBuf {
    let mut new = path.as_os_str().to_owned();
    new.push(".new");
    new.into()
}

fn write_durably(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = fs::File::create(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

fn sync_folder(folder: &Path) -> io::Result<()> {
    // Windows has no way to, and needs none.
    if cfg!(unix) { fs::File::open(folder)?.sync_all() } else { Ok(()) }
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
        return Ok(Level::unpack_files(&fs::read(path).map_err(read)?)?);
    }
    let pending = Pending::read(path)?.unwrap_or_default();
    let names = fs::read_dir(path).map_err(read)?.flatten();
    let names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let is_there = |name: &String| is_of_level(name) && !pending.removed.contains(name);
    let mut names: BTreeSet<String> = names.filter(is_there).collect();
    names.extend(pending.changed.iter().cloned());
    let mut files = LevelFiles::new();
    for name in names {
        let (old, new) = (path.join(&name), new_of(&path.join(&name)));
        let is_new = pending.changed.contains(&name) && new.exists();
        let bytes = fs::read(if is_new { new } else { old });
        files.insert(name, bytes.map_err(StoreError::files("reading the level"))?);
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::terrain::TerrainSettings;

    /// Copies of a folder at each step of saving a level.
    fn steps(folder: &Path, new: &Level) -> Vec<LevelFiles> {
        let mut seen = vec![read_level_files(folder).unwrap()];
        Pending::prepare(folder, &new.to_files().unwrap()).unwrap();
        seen.push(read_level_files(folder).unwrap());
        let pending = Pending::read(folder).unwrap().unwrap();
        for path in pending.changed.iter().map(|name| folder.join(name)) {
            fs::rename(new_of(&path), &path).unwrap();
            seen.push(read_level_files(folder).unwrap());
        }
        for name in &pending.removed {
            fs::remove_file(folder.join(name)).unwrap();
            seen.push(read_level_files(folder).unwrap());
        }
        Pending::finish(folder).unwrap();
        seen.push(read_level_files(folder).unwrap());
        seen
    }

    #[test]
    fn a_crash_leaves_the_old_level_or_the_new_one() {
        let ground = Arc::new(Ground::flat(200, 200, 4.0).unwrap());
        let level = |places: &[f32]| {
            let mut terrain = Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).unwrap();
            let dig = |&x: &f32| Brush::dig(Shape::sphere(Vec3::new(x, 4.0, x), 9.0));
            terrain.apply(places.iter().map(dig));
            Level::of(&terrain)
        };
        let (old, new) = (level(&[30.0, 100.0]), level(&[100.0, 101.0, 170.0]));
        assert!(
            old.save("").is_err() && !new_of(Path::new(level::LEVEL_JSON)).exists(),
            "a folder without a name"
        );
        let folder = std::env::temp_dir().join(format!("bevy_burrow_level_{}", std::process::id()));
        drop(fs::remove_dir_all(&folder));
        old.save(&folder).unwrap();
        let [before, after] = [&old, &new].map(|own| own.to_files().unwrap());
        let seen = steps(&folder, &new);
        assert!(seen.len() > 5 && seen[0] == before);
        assert!(seen[1..].iter().all(|own| *own == after));
        let left = fs::read_dir(&folder).unwrap().flatten().count();
        assert_eq!(left, after.len(), "nothing is left over");
        // The next save finishes an interrupted one.
        Pending::prepare(&folder, &before).unwrap();
        new.save(&folder).unwrap();
        assert_eq!(read_level_files(&folder).unwrap(), after);
        fs::remove_dir_all(&folder).unwrap();
    }
}
