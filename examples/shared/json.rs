//! JSON files that people edit by hand.

use serde::de::{DeserializeOwned, Error};

/// Reads JSON as editors save it: with a byte order mark or without.
pub fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, serde_json::Error> {
    if bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF") {
        return Err(serde_json::Error::custom("the file is in UTF-16: save it as UTF-8"));
    }
    serde_json::from_slice(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes))
}
