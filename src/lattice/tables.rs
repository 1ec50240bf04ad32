//! Hash tables: what they cost, and when they give it back.

use std::hash::Hash;

use rustc_hash::FxHashMap;

/// Bytes of a hash table: its buckets, and one byte for each to find them by.
pub(crate) fn table_bytes<K, V>(table: &FxHashMap<K, V>) -> usize {
    // One bucket of eight stays free, in small tables one in all; a last group of control bytes stands twice. Where
    // entries were removed, some buckets may count as taken until the table grows: their number is a power of two.
    let least = match table.capacity() {
        0 => return 0,
        few @ 1..8 => few + 1,
        many => many * 8 / 7,
    };
    least.next_power_of_two() * (size_of::<(K, V)>() + 1) + 16
}

/// Gives back what a hash table has too much of, once less than a quarter is left of what it can hold.
pub(crate) fn give_back<K: Eq + Hash, V>(table: &mut FxHashMap<K, V>) {
    if table.len() < table.capacity() / 4 {
        table.shrink_to_fit();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_that_empties_gives_back_what_it_held() {
        let mut table: FxHashMap<[i32; 3], i32> = (0..1792).map(|i| ([i % 7, i / 7, -i], i)).collect();
        let full = table_bytes(&table);
        assert_eq!(full, 2048 * 17 + 16);
        for i in 0..1792 {
            table.remove(&[i % 7, i / 7, -i]);
            give_back(&mut table);
            assert!(table_bytes(&table) <= (full * table.len() / 200).max(full / 100), "{i} are gone");
        }
    }
}
