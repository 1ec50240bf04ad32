//! Salvages records of a damaged database by searching for their magic number in the whole file.

use crate::format::{FormatError, frame};

/// How often the bytes of a file may be looked at: nested records are invalid, but each has to be tried.
const MAX_PASSES: usize = 8;

/// Calls `take` with the key and the bytes of each record that may be one. Where it is, records that overlap it are
/// none.
pub(super) fn records(bytes: &[u8], mut take: impl FnMut(&[u8], &[u8]) -> Result<(), FormatError>) {
    let magic = &frame::MAGIC;
    // Made so that files of others take no more time or memory than they have bytes.
    let mut budget = bytes.len().saturating_mul(MAX_PASSES);
    let mut at = 0;
    while let Some(found) = bytes.get(at..).and_then(|rest| find(rest, magic)) {
        let start = at + found;
        at = start + 1;
        let Some(peeked) = bytes.get(start..).and_then(frame::peek) else { continue };
        let Some(record) = bytes.get(start..start + peeked.length).filter(|own| own.len() <= budget) else {
            continue;
        };
        budget -= record.len();
        if take(peeked.key, record).is_ok() {
            at = start + record.len();
        }
    }
}

fn find(bytes: &[u8], magic: &[u8]) -> Option<usize> {
    bytes.windows(magic.len()).position(|window| window == magic)
}
