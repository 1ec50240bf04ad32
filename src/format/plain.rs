//! Values without a special encoding, written by `postcard`.

use serde::{Deserialize, Serialize};

use super::error::FormatError;

/// The bytes of a value.
pub fn to_bytes<T: Serialize + ?Sized>(value: &T) -> Vec<u8> {
    // It fails only for sequences and maps of unknown length, which no record contains; empty bytes fail to decode.
    postcard::to_stdvec(value).unwrap_or_default()
}

/// Decodes a value that must use all of the bytes.
pub fn from_bytes<'a, T: Deserialize<'a>>(bytes: &'a [u8], what: &'static str) -> Result<T, FormatError> {
    match postcard::take_from_bytes(bytes) {
        Ok((value, [])) => Ok(value),
        _ => Err(FormatError::Invalid(what)),
    }
}
