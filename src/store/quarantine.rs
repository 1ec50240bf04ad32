//! Damaged parts are copied or moved aside. Nothing there is ever overwritten or removed.

use std::io;

use super::files::{Files, Opening};

/// The folder of damaged parts.
pub(super) const FOLDER: &str = "quarantine";

/// A path in the folder that no file has.
fn free(files: &dyn Files, name: &str) -> io::Result<String> {
    files.create_folder(FOLDER)?;
    let taken = files.list(FOLDER)?;
    let numbered = (1..).map(|number: u64| format!("{name}.{number}"));
    let free = numbered.into_iter().find(|name| !taken.contains(name)).unwrap_or_else(|| name.into());
    Ok(format!("{FOLDER}/{free}"))
}

/// Keeps a copy of damaged bytes; returns its path.
pub(super) fn copy(files: &dyn Files, name: &str, bytes: &[u8]) -> io::Result<String> {
    let path = free(files, name)?;
    let file = files.open(&path, Opening::New)?;
    file.write_at(0, bytes)?;
    file.sync()?;
    files.sync_folder(FOLDER)?;
    Ok(path)
}

/// Moves a damaged file aside; returns its new path.
pub(super) fn file(files: &dyn Files, path: &str) -> io::Result<String> {
    let name = path.rsplit('/').next().unwrap_or(path);
    let to = free(files, name)?;
    files.rename(path, &to)?;
    files.sync_folder(FOLDER)?;
    files.sync_folder(path.rsplit_once('/').map_or("", |(folder, _)| folder))?;
    Ok(to)
}
