//! Playing together: one player hosts the world, and others join it over the network.
//!
//! The ground is shared by the plugin. Inventories are each player's own; the host's is saved with the world.
//!
//! | file | subject |
//! | --- | --- |
//! | `connection.rs` | hosting, joining, and coming back |
//! | `players.rs` | where all players are, and who they are |
//! | `figures.rs` | what others look like, with their names |

#[path = "../../shared/party.rs"]
mod udp;

pub mod connection;
pub mod figures;
pub mod players;
