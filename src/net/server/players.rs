//! Data that a server keeps for players, connected or not: a player that reconnects under the same number has the same
//! budget.

use std::time::Duration;

use glam::IVec3;

use super::pace::Pace;
use super::recent::Recent;
use super::settings::ServerSettings;
use crate::net::bucket::{Bucket, Rate};
use crate::net::message::ClientId;

/// The most players that are remembered, in addition to connected ones and administrators. A player that was forgotten
/// starts with full buckets.
const MAX_PLAYERS: usize = 1 << 14;

/// The rate of answered greetings; others wait.
const GREETINGS: Rate = Rate { per_second: 1, burst: 8 };

/// The data of a player.
pub struct Player {
    pub cost: Bucket,
    pub flood: Bucket,
    pub malformed: Bucket,
    pub greetings: Bucket,
    pub bulk: Bucket,
    pub position: Option<IVec3>,
    pub is_administrator: bool,
}

impl Player {
    fn new(settings: &ServerSettings) -> Self {
        // A full one is full at any later time.
        let full = |rate| Bucket::new(rate, Duration::ZERO);
        Self {
            cost: full(settings.cost),
            flood: full(settings.cost.times(settings.flood)),
            malformed: full(settings.malformed),
            greetings: full(GREETINGS),
            bulk: full(Pace::new(settings).rate()),
            position: None,
            is_administrator: false,
        }
    }
}

/// The data of all players.
pub struct Players {
    players: Recent<Player>,
    settings: ServerSettings,
}

impl Players {
    pub fn new(settings: ServerSettings) -> Self {
        Self { players: Recent::default(), settings }
    }

    /// A player as it is remembered, or a new one.
    pub fn player(&mut self, client: ClientId) -> &mut Player {
        self.players.get_or_insert_with(client, || Player::new(&self.settings))
    }

    /// A player, if it is remembered.
    pub fn get(&self, client: ClientId) -> Option<&Player> {
        self.players.get(client)
    }

    /// Forgets the players that have been away for the longest time, if there are too many.
    pub fn trim(&mut self, is_connected: impl Fn(ClientId) -> bool) {
        let is_kept = |client, player: &Player| player.is_administrator || is_connected(client);
        self.players.trim(MAX_PLAYERS, is_kept);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_bounded_and_keeps_who_was_there_last() {
        let mut players = Players::new(ServerSettings::default());
        players.player(ClientId(1)).is_administrator = true;
        let connected = ClientId(2);
        for id in 2..4 * MAX_PLAYERS as u64 {
            assert!(players.player(ClientId(id)).cost.spend(Duration::ZERO, 1));
            players.trim(|client| client == connected);
            assert!(players.players.len() <= MAX_PLAYERS + 2);
        }
        assert!(players.get(ClientId(1)).is_some_and(|player| player.is_administrator));
        assert!(players.get(connected).is_some() && players.get(ClientId(3)).is_none());
        let burst = ServerSettings::default().cost.burst;
        let last = ClientId(4 * MAX_PLAYERS as u64 - 1);
        assert_eq!(players.player(last).cost.left(Duration::ZERO), burst - 1, "nothing is refilled");
    }
}
