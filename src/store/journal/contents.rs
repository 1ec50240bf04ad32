//! The images and prefabs that frames of the journal name, each in a file next to the segments. It is written and made
//! durable before the first frame that names it, and removed when no segment names it any more.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::sync::{Mutex, PoisonError};

use crate::format::contents::{ContentTable, content_file};
use crate::format::ids::ContentId;
use crate::store::files::{Files, Opening, quarantine, read_file};

/// The folder of the journal.
pub(in crate::store) const FOLDER: &str = "journal";

/// How the names of such files end.
const ENDING: &str = ".content";

fn file_name(name: ContentId) -> String {
    format!("{:016x}{ENDING}", name.0)
}

fn path(name: ContentId) -> String {
    format!("{FOLDER}/{}", file_name(name))
}

/// The content whose file has this name.
fn name_of(file: &str) -> Option<ContentId> {
    let name = ContentId(u64::from_str_radix(file.strip_suffix(ENDING)?, 16).ok()?);
    (file_name(name) == file).then_some(name)
}

/// Whether a file holds the content of its name.
fn is_valid(files: &dyn Files, name: ContentId) -> bool {
    let bytes = read_file(files, &path(name));
    bytes.is_ok_and(|read| ContentTable::default().add_file(name, &read.bytes))
}

/// Makes the content of these names durable, unless it is in `written` and still there.
pub(super) fn write(
    files: &dyn Files,
    contents: &ContentTable,
    written: &mut BTreeSet<ContentId>,
) -> io::Result<()> {
    let mut is_new = false;
    for name in contents.names() {
        let path = path(name);
        if written.contains(&name) && files.exists(&path)? {
            continue;
        }
        files.create_folder(FOLDER)?;
        if !files.exists(&path)? || !is_valid(files, name) {
            write_file(files, &path, &content_file(contents, name))?;
        } else {
            // A killed process may not have synced it.
            files.open(&path, Opening::Existing)?.sync()?;
        }
        written.insert(name);
        is_new = true;
    }
    if is_new { files.sync_folder(FOLDER) } else { Ok(()) }
}

/// Writes a file, in place of what an interrupted process left there or what was damaged.
fn write_file(files: &dyn Files, path: &str, bytes: &[u8]) -> io::Result<()> {
    if files.exists(path)? {
        files.remove(path)?;
    }
    let written = files.open(path, Opening::New).and_then(|file| {
        file.write_at(0, bytes)?;
        file.sync()
    });
    if written.is_err() {
        drop(files.remove(path));
    }
    written
}

/// Removes the files of all other content.
pub(super) fn retain(
    files: &dyn Files,
    needed: &BTreeSet<ContentId>,
    written: &mut BTreeSet<ContentId>,
) -> io::Result<()> {
    for name in files.list(FOLDER)?.iter().filter_map(|file| name_of(file)) {
        if !needed.contains(&name) {
            written.remove(&name);
            match files.remove(&path(name)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
    }
    Ok(())
}

/// The content that was found of a world's journal. It is decoded where a frame is.
#[derive(Debug, Default)]
pub(in crate::store) struct FoundContents {
    files: BTreeMap<ContentId, Box<[u8]>>,
    /// Why files can't be read at the moment.
    errors: BTreeMap<ContentId, io::Error>,
    decoded: Mutex<ContentTable>,
}

impl FoundContents {
    /// Reads the files of these names. Those that are missing or damaged are found out where a frame needs them.
    pub fn read(files: &dyn Files, names: BTreeSet<ContentId>) -> Self {
        let mut found = Self::default();
        for name in names {
            match read_file(files, &path(name)) {
                Ok(read) => drop(found.files.insert(name, read.bytes.into_boxed_slice())),
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => drop(found.errors.insert(name, error)),
            }
        }
        found
    }

    /// Takes out the reason why the file of one of these names can't be read at the moment.
    pub fn take_error(&mut self, names: &BTreeSet<ContentId>) -> Option<io::Error> {
        let name = *self.errors.keys().find(|name| names.contains(name))?;
        self.errors.remove(&name)
    }

    /// Puts the files of these names into quarantine, as they are: copies, as others may need them too. One that can't be
    /// read is moved unless it is among the `needed` ones, which stay.
    pub fn keep_aside(
        &self,
        files: &dyn Files,
        names: &BTreeSet<ContentId>,
        needed: &BTreeSet<ContentId>,
    ) -> io::Result<()> {
        for name in names {
            if let Some(bytes) = self.files.get(name) {
                quarantine::copy(files, &file_name(*name), bytes)?;
            } else if self.errors.contains_key(name) && !needed.contains(name) {
                quarantine::file(files, &path(*name))?;
            }
        }
        Ok(())
    }

    /// A table with the content of these names, as far as it is there and not damaged.
    pub fn table(&self, names: &[ContentId]) -> ContentTable {
        let mut decoded = self.decoded.lock().unwrap_or_else(PoisonError::into_inner);
        for name in names {
            if let Some(bytes) = self.files.get(name)
                && !decoded.has(*name)
            {
                decoded.add_file(*name, bytes);
            }
        }
        decoded.clone()
    }
}
