//! The folders of saved worlds: made, named, copied and found again.

use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::ui::texts;

/// The files in a world's folder with its name, and which is locked while it is open.
const INFO: &str = "world.json";
const LOCK: &str = "lock";

/// The program's folder among the user's: on Linux below the one that a variable names, or below this one at home.
pub fn user_folder(variable: &str, at_home: &str) -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).filter(|folder| !folder.is_empty()).map(PathBuf::from);
    let all = if cfg!(windows) {
        folder("APPDATA")
    } else if cfg!(target_os = "macos") {
        folder("HOME").map(|home| home.join("Library/Application Support"))
    } else {
        folder(variable).or_else(|| folder("HOME").map(|home| home.join(at_home)))
    };
    Some(all?.join("bevy_burrow"))
}

/// The folder with the user's worlds; `None` on machines without a folder for data.
#[derive(Resource, Clone, Debug, Default)]
pub struct WorldsFolder(pub Option<PathBuf>);

impl WorldsFolder {
    /// The one in the user's folder of data.
    pub fn of_user() -> Self {
        Self(user_folder("XDG_DATA_HOME", ".local/share").map(|data| data.join("worlds")))
    }

    /// The folder of the world of this name; where the name is a path, that.
    pub fn named(&self, name: &str) -> Option<PathBuf> {
        let is_path = name.contains(std::path::is_separator);
        if is_path { Some(name.into()) } else { Some(self.0.as_ref()?.join(name)) }
    }

    /// The worlds in it, those saved last first.
    pub fn worlds(&self) -> Vec<FoundWorld> {
        let Some(Ok(entries)) = self.0.as_ref().map(std::fs::read_dir) else { return Vec::new() };
        let found = entries.flatten().filter_map(|entry| {
            let folder = entry.path();
            let saved =
                std::fs::metadata(folder.join("journal")).and_then(|journal| journal.modified()).ok()?;
            Some(FoundWorld { folder, saved })
        });
        let mut worlds: Vec<FoundWorld> = found.collect();
        worlds.sort_by_key(|world| std::cmp::Reverse(world.saved));
        worlds
    }

    /// The world that was played last, of those that are closed.
    pub fn latest(&self) -> Option<PathBuf> {
        self.worlds().into_iter().map(|world| world.folder).find(|folder| is_closed(folder))
    }

    /// The name of a world that nobody has begun.
    pub fn new_name(&self) -> Option<String> {
        let all = self.0.as_ref()?;
        (1..).map(|number| format!("world {number}")).find(|name| !all.join(name).exists())
    }

    /// Makes a folder for a new world, with a number where others have its name.
    ///
    /// # Errors
    /// If the folder can't be written.
    pub fn create(&self, name: &str, seed: u32) -> io::Result<PathBuf> {
        let no_folder = || io::Error::new(io::ErrorKind::NotFound, texts::NO_FOLDER);
        create(self.0.as_ref().ok_or_else(no_folder)?, name, seed)
    }

    /// Makes a folder for a new world with a new name.
    ///
    /// # Errors
    /// If the folder can't be written.
    pub fn create_next(&self) -> io::Result<PathBuf> {
        self.create(&self.new_name().unwrap_or_default(), 0)
    }
}

fn create(all: &Path, name: &str, seed: u32) -> io::Result<PathBuf> {
    let safe: String =
        name.trim().chars().map(|c| if c.is_alphanumeric() || " -_".contains(c) { c } else { '_' }).collect();
    let safe = if safe.is_empty() { "world".into() } else { safe };
    let mut folders = numbered(&safe).map(|folder| all.join(folder));
    let folder = folders.find(|folder| !folder.exists()).ok_or(io::ErrorKind::AlreadyExists)?;
    std::fs::create_dir_all(&folder)?;
    WorldInfo { name: None, seed }.write(&folder)?;
    rename(&folder, name)?;
    Ok(folder)
}

/// `hill`, `hill 2`, `hill 3` and so on.
fn numbered(name: &str) -> impl Iterator<Item = String> {
    std::iter::once(String::from(name)).chain((2..).map(move |number| format!("{name} {number}")))
}

/// What is known of a world without opening it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
struct WorldInfo {
    /// The folder's name without one.
    name: Option<String>,
    seed: u32,
}

impl WorldInfo {
    fn read(folder: &Path) -> Self {
        let text = std::fs::read(folder.join(INFO)).unwrap_or_default();
        serde_json::from_slice(&text).unwrap_or_default()
    }

    fn write(&self, folder: &Path) -> io::Result<()> {
        let draft = folder.join("world.draft.json");
        std::fs::write(&draft, serde_json::to_vec_pretty(self)?)?;
        std::fs::rename(draft, folder.join(INFO))
    }
}

/// A world in the user's folder.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundWorld {
    pub folder: PathBuf,
    /// When it was saved last.
    pub saved: SystemTime,
}

/// The seed of a world's ground.
pub fn seed(folder: &Path) -> u32 {
    WorldInfo::read(folder).seed
}

/// The name of a world.
pub fn name(folder: &Path) -> String {
    WorldInfo::read(folder).name.unwrap_or_else(|| name_of_folder(folder))
}

fn name_of_folder(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into()
}

/// Gives a world another name, with a number where another one in the same folder has that. Its folder stays where it is.
///
/// # Errors
/// If the folder can't be written.
pub fn rename(folder: &Path, name: &str) -> io::Result<()> {
    let all = folder.parent().and_then(|all| std::fs::read_dir(all).ok());
    let all = all.into_iter().flatten().flatten().map(|entry| entry.path());
    let others: Vec<String> = all.filter(|other| other != folder).map(|other| self::name(&other)).collect();
    let name = if name.trim().is_empty() { name_of_folder(folder) } else { name.trim().into() };
    let name = numbered(&name).find(|name| !others.contains(name));
    WorldInfo { name, ..WorldInfo::read(folder) }.write(folder)
}

/// Copies a world that is closed, and names the copy after it. A copy that fails leaves nothing.
///
/// # Errors
/// If its files can't be read, or the copy can't be written.
pub fn duplicate(folder: &Path, name: &str) -> io::Result<()> {
    let all = folder.parent().ok_or(io::ErrorKind::NotFound)?;
    let copy = create(all, &format!("{name} {}", texts::COPY), WorldInfo::read(folder).seed)?;
    let copied = copy_files(folder, &copy);
    if copied.is_err() {
        std::fs::remove_dir_all(&copy)?;
    }
    copied
}

/// Copies all but the name, which the copy has already, and the lock.
fn copy_files(from: &Path, to: &Path) -> io::Result<()> {
    std::fs::create_dir_all(to)?;
    for entry in std::fs::read_dir(from)? {
        let entry = entry?;
        let copy = to.join(entry.file_name());
        match entry.file_type()?.is_dir() {
            true => copy_files(&entry.path(), &copy)?,
            false if entry.file_name() == LOCK || entry.file_name() == INFO => {}
            false => drop(std::fs::copy(entry.path(), copy)?),
        }
    }
    Ok(())
}

/// Whether nobody has this world open.
pub fn is_closed(folder: &Path) -> bool {
    let lock = std::fs::File::open(folder.join(LOCK));
    lock.map_or(true, |lock| lock.try_lock_shared().is_ok())
}

/// Where painted textures are kept from one start to the next.
pub fn folder_of_textures() -> Option<PathBuf> {
    Some(WorldsFolder::of_user().0?.with_file_name("textures"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_folder_among_the_worlds_and_a_path_is_itself() {
        let worlds = WorldsFolder(Some("all".into()));
        assert_eq!(worlds.named("here/there"), Some("here/there".into()));
        assert_eq!(worlds.named("mine"), Some("all/mine".into()));
        assert_eq!(WorldsFolder(None).named("mine"), None);
    }

    #[test]
    fn worlds_are_made_named_copied_and_told_apart() {
        let all = std::env::temp_dir().join(format!("digger_worlds_{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&all);
        let folder = all.join("first");
        std::fs::create_dir_all(folder.join("journal")).expect("a folder");
        std::fs::write(folder.join("journal").join("1"), b"edits").expect("a file");
        std::fs::write(folder.join(LOCK), b"").expect("a file");
        // As an older version left it.
        assert_eq!((name(&folder).as_str(), WorldInfo::read(&folder).seed), ("first", 0));
        WorldInfo { name: None, seed: 7 }.write(&folder).expect("written");
        rename(&folder, " My hill ").expect("written");
        assert_eq!((name(&folder).as_str(), WorldInfo::read(&folder).seed), ("My hill", 7));
        rename(&folder, "").expect("written");
        assert_eq!(name(&folder), "first");
        duplicate(&folder, "first").expect("copied");
        let copy = all.join("first copy");
        assert_eq!(std::fs::read(copy.join("journal").join("1")).expect("copied"), b"edits");
        assert_eq!((name(&copy).as_str(), WorldInfo::read(&copy).seed), ("first copy", 7));
        assert!(!copy.join(LOCK).exists());
        assert!(is_closed(&folder) && is_closed(&copy));
        let lock = std::fs::File::create(folder.join(LOCK)).expect("a file");
        lock.try_lock().expect("free");
        assert!(!is_closed(&folder), "it is open");
        std::fs::remove_dir_all(&all).expect("removed");
    }

    #[test]
    fn no_two_worlds_have_the_same_name() {
        let all = std::env::temp_dir().join(format!("digger_names_{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&all);
        let worlds = WorldsFolder(Some(all.clone()));
        let [first, second, other] =
            ["Hill", "Hill", "Mound"].map(|name| worlds.create(name, 0).expect("a world"));
        assert_eq!([&first, &second].map(|folder| name(folder)), ["Hill", "Hill 2"]);
        rename(&other, "Hill").expect("renamed");
        assert_eq!(name(&other), "Hill 3");
        rename(&other, "Hill 3").expect("renamed");
        assert_eq!(name(&other), "Hill 3", "it has that name itself");
        for expected in ["Hill copy", "Hill copy 2"] {
            duplicate(&first, "Hill").expect("copied");
            assert_eq!(name(&all.join(expected)), expected);
        }
        std::fs::remove_dir_all(&all).expect("removed");
    }

    #[cfg(unix)]
    #[test]
    fn a_copy_that_fails_leaves_no_world() {
        let all = std::env::temp_dir().join(format!("digger_half_{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&all);
        let folder = all.join("first");
        std::fs::create_dir_all(folder.join("journal")).expect("a folder");
        std::os::unix::fs::symlink("nowhere", folder.join("broken")).expect("a link");
        assert!(duplicate(&folder, "first").is_err());
        let left = std::fs::read_dir(&all).expect("a folder").flatten().map(|entry| entry.path());
        assert_eq!(left.collect::<Vec<_>>(), [folder]);
        std::fs::remove_dir_all(&all).expect("removed");
    }
}
