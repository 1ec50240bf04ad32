//! Stamps and their images in a record.

use glam::{Quat, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use super::RecordError;
use crate::brush::Stamp;
use crate::ground::GreyImage;

/// A stamp as an object of a [`BrushRecord`](super::BrushRecord).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "they are those of a stamp")]
pub struct StampRecord {
    pub image: ImageRecord,
    pub center: [f32; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f32; 4]>,
    pub size: [f32; 2],
    pub height: f32,
}

/// The image of a [`StampRecord`]: grey samples, 0 to 65535, row by row.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "they are those of an image")]
pub struct ImageRecord {
    pub width: u32,
    pub height: u32,
    pub samples: Vec<u16>,
}

impl TryFrom<&StampRecord> for Stamp {
    type Error = RecordError;

    fn try_from(record: &StampRecord) -> Result<Self, RecordError> {
        let ImageRecord { width, height, samples } = &record.image;
        let image =
            GreyImage::from_samples(*width, *height, samples.clone()).map_err(|_| RecordError::Image)?;
        let center = Vec3::from_array(record.center);
        let stamp = Self::new(image, center, Vec2::from_array(record.size), record.height);
        Ok(stamp.with_rotation(record.rotation.map_or(Quat::IDENTITY, Quat::from_array)))
    }
}

impl From<&Stamp> for StampRecord {
    fn from(stamp: &Stamp) -> Self {
        let image = &stamp.image;
        let samples = image.samples().to_vec();
        Self {
            image: ImageRecord { width: image.width(), height: image.height(), samples },
            center: stamp.center.to_array(),
            rotation: (stamp.rotation != Quat::IDENTITY).then(|| stamp.rotation.to_array()),
            size: stamp.size.to_array(),
            height: stamp.height,
        }
    }
}
