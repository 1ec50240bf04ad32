//! What a client tells the game, and what it counts.

use super::super::message::{ClientId, Kick, Refusal};
use crate::lattice::RegionPos;
use crate::terrain::{LoosePiece, Receipt, Restored, ReturnedPiece};

/// What a game may want to know.
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
    /// The ground around the player is there.
    Playable,
    /// All of the world is there, and the client follows the order.
    Joined,
    /// An edit of the player's is shown, as far as the client can tell now.
    Predicted(Receipt),
    /// The server has ordered an edit of the player's: this is what it came to for all. Inventories should follow this.
    Confirmed {
        /// The edit's tag.
        tag: u64,
        /// What it came to; `None` where the client was away when that happened.
        receipt: Option<Receipt>,
    },
    /// An edit of the player's is not done, and no longer shown.
    Refused {
        /// The edit's tag.
        tag: u64,
        /// Why; `None` where it could not be sent or applied, or the client was away when that was told.
        why: Option<Refusal>,
    },
    /// A stroke was taken back that this client asked for: what that put back, without tags, as the order does not tell whose
    /// edits they were. Inventories should follow this. `None` where the client was away when that happened.
    Undone(Option<Restored>),
    /// A stroke is not taken back. `None` where that could not be asked for, or the client was away when the reason was told.
    UndoRefused(Option<Refusal>),
    /// An edit of somebody else's.
    Others {
        /// Whose.
        author: ClientId,
        /// What it came to. Its tag is 0.
        receipt: Receipt,
    },
    /// Pieces of ground were cut off or are ground again, in what is shown from the next [change](super::Client::take_shown) on. Whatever a
    /// game makes of pieces should follow this, and not the receipts of edits: predictions may have been wrong, the server may refuse
    /// an edit, and other players undo theirs.
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
    /// These regions differed from the server's, and were fetched. This is a bug: of the plugin's or of a machine.
    Repaired(Vec<RegionPos>),
    /// The client has to go.
    Kicked(Kick),
}

/// What a client has counted so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClientFigures {
    /// Entries that were applied.
    pub applied: u64,
    /// Marks at which all hashes were compared.
    pub marks: u64,
    /// Regions that differed from the server's, and were fetched.
    pub repairs: u64,
    /// Times that entries were missing.
    pub gaps: u64,
    /// Messages that meant nothing.
    pub malformed: u64,
    /// Times that edits which the server had not answered were worked out, at first and where others met what they read.
    pub drafts: u64,
    /// The edits that were worked out at these times, in all.
    pub drafted: u64,
}
