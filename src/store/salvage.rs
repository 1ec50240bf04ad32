//! What can still be read of a damaged database: its records are found by their magic, wherever they lie in the file.

use super::format::frame;

/// The records with their keys, valid or not.
pub(super) fn records(bytes: &[u8]) -> Vec<(Vec<u8>, Vec<u8>)> {
    let magic = &frame::MAGIC;
    let starts = bytes.windows(magic.len()).enumerate().filter(|(_, window)| window == magic);
    let record = |start: usize| {
        let rest = &bytes[start..];
        let peeked = frame::peek(rest)?;
        Some((peeked.key.to_vec(), rest.get(..peeked.length)?.to_vec()))
    };
    starts.filter_map(|(start, _)| record(start)).collect()
}
