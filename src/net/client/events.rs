//! Events and statistics of a client.

use super::super::message::{ClientId, KickReason, Refusal};
use crate::lattice::RegionPos;
use crate::terrain::{Applied, LoosePiece, Receipt, ReturnedPiece};

/// An event for the game.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ClientEvent {
    /// The server has welcomed the client: from now on edits are sent.
    Welcomed {
        /// Who the client is.
        client: ClientId,
        /// How far from its player it may dig, in voxels; `None` if that is not checked.
        reach: Option<u32>,
    },
    /// The ground around the player has arrived.
    Playable,
    /// The whole world has arrived, and the client follows the log.
    Joined,
    /// An edit of the player is shown with the predicted result.
    Predicted(Receipt),
    /// The server has ordered an edit of the player, with this result for all players. Inventories should follow this.
    Confirmed {
        /// The edit's tag.
        tag: u64,
        /// The result; `None` if the client was disconnected when the edit was ordered.
        receipt: Option<Receipt>,
    },
    /// An edit of the player was refused, and is no longer shown.
    Refused {
        /// The edit's tag.
        tag: u64,
        /// The reason; `None` if it could not be sent or applied, or the client was disconnected when it was refused.
        why: Option<Refusal>,
    },
    /// An undo by this client succeeded, with the restored parts. They have no tags, because the log does not contain
    /// tags of edits. Inventories should follow this. `None` if the client was disconnected when it happened.
    Undone(Option<Applied>),
    /// An undo was refused. `None` if the request could not be sent, or the client was disconnected when it was
    /// refused.
    UndoRefused(Option<Refusal>),
    /// An edit of another player or of the server.
    RemoteEdit {
        /// The author of the edit.
        author: ClientId,
        /// The result. Its tag is 0.
        receipt: Receipt,
    },
    /// Pieces of ground were cut off or are ground again, in what is shown from the next
    /// [change](super::Client::take_shown) on. Whatever a game makes of pieces should follow this, and not the receipts
    /// of edits: predictions may have been wrong, the server may refuse an edit, and other players undo theirs.
    PiecesChanged {
        /// The tag of the edit that cut pieces off.
        tag: u64,
        /// Pieces that were cut off.
        found: Vec<LoosePiece>,
        /// Pieces that had been cut off, and are ground again.
        returned: Vec<ReturnedPiece>,
    },
    /// Everything up to this number is saved on the server.
    Durable(u64),
    /// These regions differed from the server's, and were fetched. This indicates a bug in the plugin, or faulty
    /// hardware.
    Repaired(Vec<RegionPos>),
    /// The server has removed the client.
    Kicked(KickReason),
}

/// Statistics of a client.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClientFigures {
    /// Entries that were applied.
    pub applied: u64,
    /// Hash checks at which all hashes were compared.
    pub hash_checks: u64,
    /// Regions that differed from the server's, and were fetched.
    pub repairs: u64,
    /// Times that entries were missing.
    pub gaps: u64,
    /// Invalid messages.
    pub malformed: u64,
    /// How often pending edits were predicted: at first, and again if other edits changed samples that they read.
    pub drafts: u64,
    /// The number of edits in these predictions.
    pub drafted: u64,
}
