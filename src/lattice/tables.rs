//! Hash tables: what they cost.

use rustc_hash::FxHashMap;

/// Bytes of a hash table: its buckets, and one byte for each to find them by.
pub(crate) fn table_bytes<K, V>(table: &FxHashMap<K, V>) -> usize {
    // One bucket of eight stays free, in small tables one in all; a last group of control bytes stands twice.
    let buckets = match table.capacity() {
        0 => return 0,
        few @ 1..8 => few + 1,
        many => many / 7 * 8,
    };
    buckets * (size_of::<(K, V)>() + 1) + 16
}
