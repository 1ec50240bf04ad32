//! Compressed messages to clients.

use crate::format::FormatError;
use crate::format::bytes::{Reader, put_number};

/// The tag of a compressed message.
pub(super) const PACKED: u8 = 10;
/// The maximum size in bytes of a compressed message after decompression, so that few bytes can't take much memory.
pub(super) const MAX_PACKED: usize = 64 << 10;

/// Compresses a message to a client, if that makes it shorter.
pub(in crate::net) fn pack(message: &[u8]) -> Vec<u8> {
    if message.len() > MAX_PACKED {
        return message.to_vec();
    }
    let mut packed = vec![PACKED];
    put_number(&mut packed, message.len() as u64);
    packed.extend(lz4_flex::block::compress(message));
    if packed.len() < message.len() { packed } else { message.to_vec() }
}

/// Decompresses a message.
pub(super) fn unpack(reader: &mut Reader) -> Result<Vec<u8>, FormatError> {
    let length = reader.number()?;
    let packed = std::mem::take(&mut reader.0);
    if length > MAX_PACKED as u64 {
        return Err(FormatError::TooLarge { length, limit: MAX_PACKED as u64 });
    }
    let message = lz4_flex::block::decompress(packed, length as usize);
    message
        .ok()
        .filter(|message| message.len() as u64 == length)
        .ok_or(FormatError::Invalid("packed message"))
}
