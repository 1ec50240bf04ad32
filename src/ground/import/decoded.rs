//! What decoders return: samples, and what the file says about them.

use super::error::ImportError;
use super::kind::{HeightFormat, SampleKind};
use super::report::ImportNote;

/// A decoded file.
pub(super) struct Decoded {
    pub format: HeightFormat,
    pub sample: SampleKind,
    pub width: u32,
    pub height: u32,
    /// Row by row from the top.
    pub samples: Vec<f32>,
    /// The value of voids that the file declares.
    pub no_data: Option<f64>,
    pub spacing: Option<[f64; 2]>,
    pub origin: Option<[f64; 2]>,
    /// What turns values into heights: a factor, and what is added then.
    pub value_scale: Option<[f64; 2]>,
    pub notes: Vec<ImportNote>,
}

impl Decoded {
    /// A file of which nothing is known but its samples.
    pub fn new(
        format: HeightFormat,
        sample: SampleKind,
        (width, height): (u32, u32),
        samples: Vec<f32>,
    ) -> Self {
        Self {
            format,
            sample,
            width,
            height,
            samples,
            no_data: None,
            spacing: None,
            origin: None,
            value_scale: None,
            notes: Vec::new(),
        }
    }
}

/// Memory for this many samples.
pub(super) fn reserve(samples: u64) -> Result<Vec<f32>, ImportError> {
    let refused = || ImportError::Memory { bytes: samples.saturating_mul(4) };
    let mut memory = Vec::new();
    memory.try_reserve_exact(usize::try_from(samples).map_err(|_| refused())?).map_err(|_| refused())?;
    Ok(memory)
}

/// A damaged file.
pub(super) fn damaged(format: HeightFormat, reason: impl ToString) -> ImportError {
    ImportError::Damaged { format, reason: reason.to_string() }
}
