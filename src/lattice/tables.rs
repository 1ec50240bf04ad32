//! Hash tables: how many bytes they take, and when they shrink.

use std::hash::Hash;

use rustc_hash::FxHashMap;

/// Bytes of a hash table: its buckets, and one byte for each to find them by.
pub(crate) fn table_bytes<K, V>(table: &FxHashMap<K, V>) -> usize {
    // One bucket of eight stays free, in small tables a single one, and the first group of control bytes is repeated at
    // the end. Removed entries may still occupy buckets until the table grows. The number of buckets is a power of two.
    let least = match table.capacity() {
        0 => return 0,
        few @ 1..8 => few + 1,
        many => many * 8 / 7,
    };
    least.next_power_of_two() * (size_of::<(K, V)>() + 1) + 16
}

/// Shrinks a hash table once it is less than a quarter full.
pub(crate) fn shrink_if_sparse<K: Eq + Hash, V>(table: &mut FxHashMap<K, V>) {
    if table.len() < table.capacity() / 4 {
        table.shrink_to_fit();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_that_empties_shrinks() {
        let mut table: FxHashMap<[i32; 3], i32> = (0..1792).map(|i| ([i % 7, i / 7, -i], i)).collect();
        let full = table_bytes(&table);
        assert_eq!(full, 2048 * 17 + 16);
        for i in 0..1792 {
            table.remove(&[i % 7, i / 7, -i]);
            shrink_if_sparse(&mut table);
            assert!(table_bytes(&table) <= (full * table.len() / 200).max(full / 100), "{i} are gone");
        }
    }
}
