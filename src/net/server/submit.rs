//! Orders of the game's server itself.

use super::Server;
use crate::brush::BrushError;
use crate::net::encoding::entry_bytes;
use crate::net::message::{ClientId, Entry, MAX_TO_CLIENT};
use crate::terrain::{Order, OrderKind, Request};
use crate::volume::{DiggingRules, RulesError};

/// Why a [server](Server::submit) rejected an order of its game. Nothing was ordered.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OrderError {
    /// The brush or edit is not valid.
    #[error(transparent)]
    Brush(#[from] BrushError),
    /// The rules are not valid.
    #[error(transparent)]
    Rules(#[from] RulesError),
    /// The edit holds an image, grid or prefab that clients can't read, because it is not in the server's
    /// [content table](Server::contents_mut).
    #[error(
        "an image, grid or prefab of the edit is not in the content table: add it with `Server::contents_mut` first"
    )]
    UnknownContent,
    /// Parts take more bytes than a message may.
    #[error("the parts take {length} bytes, but the limit is {limit}: split them and submit each separately")]
    TooLarge {
        /// Their encoded size in bytes.
        length: u64,
        /// The maximum.
        limit: u64,
    },
    /// A step through history: the server has none, only the last strokes of players.
    #[error(
        "a server has no history, so it can't {0}: let players undo their strokes with \
         `ServerSettings::undo`, or submit the parts to restore"
    )]
    Step(OrderKind),
    /// Another ground: all machines of a shared world have the same.
    #[error(
        "the ground of a shared world can't be changed: start another server with a terrain on the new ground"
    )]
    Ground,
}

impl Server {
    /// Orders an edit, rules, settings of loose pieces, or the replacement of parts, without the checks of clients'
    /// edits. The author of an edit is [`ClientId::SERVER`]. A hash of [parts](Order::Parts) is neither sent nor
    /// compared.
    ///
    /// # Errors
    /// When the order is not valid, when clients could not read it, and when it can't be shared.
    pub fn submit(&mut self, order: impl Into<Request>) -> Result<(), OrderError> {
        match order.into().into_order()? {
            Order::Edit(edit) => {
                if !self.contents.can_send(&edit) {
                    return Err(OrderError::UnknownContent);
                }
                self.order_edit(ClientId::SERVER, 0, edit, 0);
            }
            Order::Rules(rules) => {
                rules.as_deref().map_or(Ok(()), DiggingRules::check)?;
                let rules = rules.filter(|rules| !rules.is_empty());
                self.order(Entry::of_server(Order::Rules(rules)));
            }
            Order::Loose(settings) => self.order(Entry::of_server(Order::Loose(settings))),
            Order::Parts { change, .. } => {
                let entry = Entry::of_server(Order::parts(change, None));
                let (length, limit) = (entry_bytes(&entry) as u64, MAX_TO_CLIENT as u64 / 2);
                if length > limit {
                    return Err(OrderError::TooLarge { length, limit });
                }
                self.order(entry);
            }
            Order::Undo => return Err(OrderError::Step(OrderKind::Undo)),
            Order::Redo => return Err(OrderError::Step(OrderKind::Redo)),
            Order::Ground(_) => return Err(OrderError::Ground),
        }
        Ok(())
    }
}
