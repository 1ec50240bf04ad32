//! Quarantine: a folder for copies of damaged parts. Nothing there is ever overwritten or removed.

use std::io;

use super::interface::{Files, Opening};

/// The folder of damaged parts.
const FOLDER: &str = "quarantine";

/// A path in the folder that no file has.
fn free(files: &dyn Files, name: &str) -> io::Result<String> {
    files.create_folder(FOLDER)?;
    let taken = files.list(FOLDER)?;
    // Above all others, so that their numbers say which is the latest.
    let last = taken.iter().filter_map(|taken| number(taken, name)).max().unwrap_or(0);
    let mut next = (last + 1..).map(|number| format!("{name}.{number}"));
    let free = next.find(|name| !taken.contains(name)).unwrap_or_default();
    Ok(format!("{FOLDER}/{free}"))
}

/// The number of a file in the folder that had this name.
fn number(taken: &str, name: &str) -> Option<u64> {
    let number: u64 = taken.strip_prefix(name)?.strip_prefix('.')?.parse().ok()?;
    // Nobody counts further.
    (number <= u32::MAX.into() && format!("{name}.{number}") == taken).then_some(number)
}

/// The files in the folder that had this name, the latest first.
pub(in crate::store) fn of(files: &dyn Files, name: &str) -> io::Result<Vec<String>> {
    let mut numbers: Vec<u64> = files.list(FOLDER)?.iter().filter_map(|taken| number(taken, name)).collect();
    numbers.sort_unstable();
    Ok(numbers.into_iter().rev().map(|number| format!("{FOLDER}/{name}.{number}")).collect())
}

/// Keeps a copy of damaged bytes; returns its path.
pub(in crate::store) fn copy(files: &dyn Files, name: &str, bytes: &[u8]) -> io::Result<String> {
    let path = free(files, name)?;
    let file = files.open(&path, Opening::New)?;
    file.write_at(0, bytes)?;
    file.sync()?;
    files.sync_folder(FOLDER)?;
    Ok(path)
}

/// Moves a damaged file aside; returns its new path.
pub(in crate::store) fn file(files: &dyn Files, path: &str) -> io::Result<String> {
    let name = path.rsplit('/').next().unwrap_or(path);
    let to = free(files, name)?;
    files.rename(path, &to)?;
    files.sync_folder(FOLDER)?;
    files.sync_folder(path.rsplit_once('/').map_or("", |(folder, _)| folder))?;
    Ok(to)
}
