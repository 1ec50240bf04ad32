//! Values without a special encoding, written by `postcard`.

use serde::{Deserialize, Serialize};

use super::error::FormatError;

/// The bytes of a value.
pub fn to_bytes<T: Serialize + ?Sized>(value: &T) -> Vec<u8> {
    // It fails for sequences of unknown length and maps of such only, which no record holds; reading nothing is an
    // error.
    postcard::to_stdvec(value).unwrap_or_default()
}

/// The value of bytes, all of which it takes.
pub fn from_bytes<'a, T: Deserialize<'a>>(bytes: &'a [u8], what: &'static str) -> Result<T, FormatError> {
    match postcard::take_from_bytes(bytes) {
        Ok((value, [])) => Ok(value),
        _ => Err(FormatError::Invalid(what)),
    }
}
