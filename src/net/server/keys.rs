//! The keys under which a server keeps its own data in a store.

use crate::store::Store;

/// The prefix of a server's keys in a store, next to the game's data. No person would choose it for a key.
pub const RESERVED: &str = "\u{1}bevy_burrow/net/";

/// The prefix of the keys of earlier versions.
const FORMER: &str = "net/";

/// Below these, the key under which a store keeps the number of the last entry that its world holds.
pub const NUMBER: &str = "number";

/// The prefix of a server's keys in a store. If a present version has saved there, keys with the former prefix belong
/// to the game.
pub fn prefix(store: &Store) -> &'static str {
    if store.get(&format!("{RESERVED}{NUMBER}")).is_some() { RESERVED } else { FORMER }
}
