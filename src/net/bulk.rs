//! The bulk lane: a sequence of messages as one stream of bytes, which the server cuts into pieces according to its
//! limits.

use super::ContentTable;
use super::message::{MAX_TO_CLIENT, ToClient};
use crate::format::FormatError;
use crate::format::bytes::{Reader, put_bytes};
use crate::ground::Ground;

/// Appends a message to a stream.
pub(super) fn put_message(to: &mut Vec<u8>, message: &[u8]) {
    put_bytes(to, message);
}

/// Joins pieces to messages.
#[derive(Clone, Debug, Default)]
pub struct BulkReader {
    bytes: Vec<u8>,
    received: u64,
}

impl BulkReader {
    /// Adds the bytes of a [`ToClient::Piece`].
    pub fn add(&mut self, piece: &[u8]) {
        self.bytes.extend_from_slice(piece);
        self.received += piece.len() as u64;
    }

    /// Received bytes, as they are [acknowledged](super::ToServer::Ack).
    pub fn received(&self) -> u64 {
        self.received
    }

    /// The next complete message. It is never a piece itself.
    ///
    /// # Errors
    /// When it is invalid: the next call reads the message after it. Or when it is longer than a message may be: then
    /// nothing more can be read.
    pub fn next(
        &mut self,
        ground: &Ground,
        contents: &ContentTable,
    ) -> Result<Option<ToClient>, FormatError> {
        let Some(message) = self.next_bytes()? else { return Ok(None) };
        match ToClient::from_bytes(&message, ground, contents)? {
            ToClient::Piece(_) => Err(FormatError::Invalid("piece inside a stream")),
            message => Ok(Some(message)),
        }
    }

    /// The bytes of the next complete message.
    pub(super) fn next_bytes(&mut self) -> Result<Option<Vec<u8>>, FormatError> {
        let mut reader = Reader(&self.bytes);
        let length = match reader.number() {
            Ok(length) => length,
            Err(FormatError::Truncated) => return Ok(None),
            Err(error) => return Err(error),
        };
        if length > MAX_TO_CLIENT as u64 {
            return Err(FormatError::TooLarge { length, limit: MAX_TO_CLIENT as u64 });
        }
        let Ok(message) = reader.take(length as usize) else { return Ok(None) };
        let (message, left) = (message.to_vec(), reader.0.len());
        self.bytes.drain(..self.bytes.len() - left);
        Ok(Some(message))
    }
}
