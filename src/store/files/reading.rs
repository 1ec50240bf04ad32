//! Reads files with unreadable parts, such as bad sectors.

use std::io;
use std::ops::Range;

use super::interface::{Files, OpenFile, Opening};

/// Bytes that are read at once, and bytes of a sector: the smallest part that is given up.
const BLOCK: usize = 64 << 10;
const SECTOR: usize = 512;

/// Sectors after which the disk counts as broken, not as one with bad sectors: each may take seconds.
const MAX_BAD: usize = 256;

/// The bytes of a file.
#[derive(Debug, Default)]
pub(in crate::store) struct FileBytes {
    /// The bytes, with zeros where they can't be read.
    pub bytes: Vec<u8>,
    /// Where bytes can't be read.
    pub unreadable: Vec<Range<usize>>,
}

impl FileBytes {
    /// How many bytes can't be read.
    pub fn unreadable_bytes(&self) -> usize {
        self.unreadable.iter().map(ExactSizeIterator::len).sum()
    }
}

/// Reads all of a file that can be read.
///
/// # Errors
/// When there is no such file, when it must not be read, and when the disk no longer answers: bad sectors are
/// damage, a missing disk is not.
pub(in crate::store) fn read_file(files: &dyn Files, path: &str) -> io::Result<FileBytes> {
    let error = match files.read(path) {
        Ok(bytes) => return Ok(FileBytes { bytes, unreadable: Vec::new() }),
        Err(error) if is_refused(&error) => return Err(error),
        Err(error) => error,
    };
    let file = files.open(path, Opening::Existing)?;
    let length = usize::try_from(file.length()?).map_err(|_| io::Error::from(io::ErrorKind::FileTooLarge))?;
    let mut read = FileBytes { bytes: vec![0; length], unreadable: Vec::new() };
    let mut bad = 0;
    for start in (0..length).step_by(BLOCK) {
        let block = start..length.min(start + BLOCK);
        if fill(&*file, &mut read.bytes, block.clone()) {
            continue;
        }
        for start in block.clone().step_by(SECTOR) {
            let sector = start..block.end.min(start + SECTOR);
            if fill(&*file, &mut read.bytes, sector.clone()) {
                continue;
            }
            bad += 1;
            if bad > MAX_BAD {
                return Err(error);
            }
            match read.unreadable.last_mut().filter(|last| last.end == sector.start) {
                Some(last) => last.end = sector.end,
                None => read.unreadable.push(sector),
            }
        }
    }
    // What could be read at first still can, if the disk is there.
    let mut again = [0];
    let is_readable = |at: &usize| read.unreadable.iter().all(|range| !range.contains(at));
    let sample = (0..length).step_by(SECTOR).find(is_readable);
    match sample.map(|at| file.read_at(at as u64, &mut again)) {
        Some(Ok(())) => Ok(read),
        _ => Err(error),
    }
}

/// Whether an error says that a file must not be read, or is not there, whatever the state of the disk.
pub(in crate::store) fn is_refused(error: &io::Error) -> bool {
    use io::ErrorKind::{IsADirectory, NotFound, PermissionDenied, WouldBlock};
    matches!(error.kind(), IsADirectory | NotFound | PermissionDenied | WouldBlock)
}

/// Reads a part of a file into its place.
fn fill(file: &dyn OpenFile, bytes: &mut [u8], range: Range<usize>) -> bool {
    let Some(part) = bytes.get_mut(range.clone()) else { return false };
    let is_read = file.read_at(range.start as u64, part).is_ok();
    if !is_read {
        part.fill(0);
    }
    is_read
}
