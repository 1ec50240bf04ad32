//! TIFF files whose white is 0 (`WhiteIsZero`), read as if black were 0: samples as they are stored.

use std::io::{self, Read, Seek, SeekFrom};

/// The tag of how samples become colours.
const PHOTOMETRIC: u64 = 262;

/// Entries of a directory that are searched. They are sorted by tag, so the one that is sought is among the first.
const ENTRIES: u64 = 4096;

/// A TIFF in which `WhiteIsZero` is replaced by `BlackIsZero` while it is read. The decoder would otherwise exchange
/// black and white, for floats with rounding, and refuse signed samples.
pub(super) struct BlackIsZero<R> {
    file: R,
    at: u64,
    /// The place of the byte to replace.
    replaced: Option<u64>,
}

impl<R: Read + Seek> BlackIsZero<R> {
    pub fn new(mut file: R) -> io::Result<Self> {
        // Damages are left to the decoder, which says what they are.
        let replaced = find(&mut file).unwrap_or(None);
        file.rewind()?;
        Ok(Self { file, at: 0, replaced })
    }

    /// Whether the file's white is 0.
    pub fn is_white_zero(&self) -> bool {
        self.replaced.is_some()
    }
}

impl<R: Read> Read for BlackIsZero<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(bytes)?;
        if let Some(index) = self.replaced.and_then(|place| place.checked_sub(self.at))
            && index < count as u64
        {
            bytes[index as usize] = 1;
        }
        self.at += count as u64;
        Ok(count)
    }
}

impl<R: Seek> Seek for BlackIsZero<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.file.seek(to)?;
        Ok(self.at)
    }
}

/// The place of the lowest byte of the first image's photometric interpretation, if that is `WhiteIsZero`, which is 0.
fn find(file: &mut (impl Read + Seek)) -> io::Result<Option<u64>> {
    let mut header = [0; 4];
    file.read_exact(&mut header)?;
    let is_big_endian = header[0] == b'M';
    let number = |bytes: &[u8]| -> u64 {
        let add = |number: u64, &byte: &u8| number << 8 | u64::from(byte);
        if is_big_endian { bytes.iter().fold(0, add) } else { bytes.iter().rev().fold(0, add) }
    };
    let mut read = |at: u64, size: u64| -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(at))?;
        file.take(size).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    // Sizes of an offset, of the number of entries, and of an entry.
    let (offset, count, entry) = if number(&header[2..]) == 43 { (8, 8, 20) } else { (4, 2, 12) };
    let directory = number(&read(offset, offset)?);
    let entries = number(&read(directory, count)?).min(ENTRIES);
    let first = directory.saturating_add(count);
    let bytes = read(first, entries * entry)?;
    let mut all = (0..).zip(bytes.chunks_exact(entry as usize));
    let Some((index, found)) = all.find(|(_, found)| number(&found[..2]) == PHOTOMETRIC) else {
        return Ok(None);
    };
    let size = match number(&found[2..4]) {
        1 => 1,
        3 => 2,
        4 => 4,
        _ => return Ok(None),
    };
    let start = 4 + offset as usize;
    let is_white_zero = number(&found[start..start + size]) == 0;
    let lowest = if is_big_endian { size - 1 } else { 0 };
    Ok(is_white_zero.then_some(first + index * entry + (start + lowest) as u64))
}
