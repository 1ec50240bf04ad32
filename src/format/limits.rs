//! Limits on the unpacked size of parts of files. Writers obey them too, so that every written file can be read again.

use super::error::FormatError;

/// The most bytes of each part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// The head of a file: a world without its regions, or the list of a level's files.
    pub head: usize,
    /// A region. 512 bricks and their fields take less.
    pub region: usize,
    /// A frame of commits.
    pub journal: usize,
    /// A file of a packed level.
    pub level_file: usize,
    /// A packed level as it is stored.
    pub packed_level: usize,
}

impl Limits {
    /// The limits of the format.
    pub const FORMAT: Self = Self {
        head: 256 << 20,
        region: 8 << 20,
        journal: 256 << 20,
        level_file: 64 << 20,
        packed_level: 1 << 30,
    };
}

/// Content that can be read again within a limit.
pub(super) fn within(content: Vec<u8>, limit: usize) -> Result<Vec<u8>, FormatError> {
    check(&content, limit)?;
    Ok(content)
}

/// Checks that content can be read again within a limit.
pub(super) fn check(content: &[u8], limit: usize) -> Result<(), FormatError> {
    let (length, most) = (content.len() as u64, limit as u64);
    if length > most { Err(FormatError::TooLarge { length, limit: most }) } else { Ok(()) }
}
