//! Settings of a server: budgets of clients, reach, undo, and how much is kept.

use std::time::Duration;

use crate::net::bucket::Rate;

/// How far from its player a client may dig: the whole shape of an edit must be within this distance, exact to a voxel.
/// It is measured from the last known position of the player, plus the distance that the player can move within the
/// latency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reach {
    /// In voxels.
    pub distance: u32,
    /// The fastest player, in voxels a second.
    pub speed: u32,
    /// The greatest latency that is allowed for.
    pub latency: Duration,
}

impl Reach {
    /// In voxels, with the slack for latency.
    pub fn allowed(&self) -> u32 {
        let slack = u128::from(self.speed) * self.latency.as_millis() / 1000;
        self.distance.saturating_add(u32::try_from(slack).unwrap_or(u32::MAX))
    }
}

/// Who may undo strokes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UndoPolicy {
    /// No player. Nothing is stored for undo.
    #[default]
    Nobody,
    /// [Administrators](super::Server::set_administrator) may undo the last stroke of any player.
    Administrators,
    /// Players may undo their own strokes, and administrators those of all players.
    Own,
}

/// What a server allows and how much it sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServerSettings {
    /// How far from its player a client may dig; `None` does not check it. Otherwise a client whose
    /// [position](super::Server::set_position) is not known may not dig.
    pub reach: Option<Reach>,
    /// The budget for a client's edits. An edit costs 20, and 1 for each brick that it reaches, or 4 if it sculpts;
    /// edits beyond the budget are refused.
    pub cost: Rate,
    /// A client is kicked once its messages, accepted or not, cost more than this factor times `cost`. An edit counts
    /// as at most a sixteenth of the burst.
    pub flood: u64,
    /// Invalid messages: a client with more is kicked.
    pub malformed: Rate,
    /// Who may undo strokes. With anything but [`UndoPolicy::Nobody`], each stroke is a separate transaction.
    pub undo: UndoPolicy,
    /// Bytes of strokes that can be undone.
    pub undo_bytes: usize,
    /// Bytes of old entries that are kept for clients that reconnect.
    pub log_bytes: usize,
    /// The most bytes of the bulk lane for each client. The lane begins at 256 KiB a second, or this rate if it is
    /// lower, and becomes faster as long as acknowledgements show that the client's connection keeps up.
    pub bulk: Rate,
    /// Bytes of each lane that a client may not have acknowledged. In the main lane, one message is sent in any case;
    /// in the bulk lane, there are more in proportion to its rate.
    pub window: u64,
    /// The maximum size in bytes of a piece of the bulk lane.
    pub piece: usize,
    /// The maximum work in an [`advance`](super::Server::advance), in costs of edits; one edit is applied in any case.
    pub work: u64,
    /// The maximum amount of work that may wait; edits beyond it are refused.
    pub waiting: u64,
    /// The time between hash checks, at which clients compare the regions that were touched with those of the server.
    pub hash_check: Duration,
}

impl Default for ServerSettings {
    /// For some 64 players who dig by hand on a server of one core.
    fn default() -> Self {
        Self {
            reach: None,
            cost: Rate { per_second: 4_000, burst: 16_000 },
            flood: 4,
            malformed: Rate { per_second: 1, burst: 20 },
            undo: UndoPolicy::Nobody,
            undo_bytes: 64 << 20,
            log_bytes: 8 << 20,
            bulk: Rate { per_second: 2 << 20, burst: 256 << 10 },
            window: 512 << 10,
            piece: 1 << 10,
            // Some 40 ms, however much comes at once; at 30 frames a second, all that 64 players may spend.
            work: 10_000,
            waiting: 6_000_000,
            hash_check: Duration::from_secs(1),
        }
    }
}
