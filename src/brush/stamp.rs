//! Stamps: images that a brush presses onto the ground.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use glam::{IVec3, Quat, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use super::quantize::{
    check_point, check_size, check_turn, in_range, matrix, point, restored_point, restored_turn, size, turn,
    voxels,
};
use super::{BrushError, is_default};
use crate::ground::GreyImage;
use crate::lattice::ONE;

/// An image that gives the surface its relief: black lies on the stamp's plane, white `height` above it.
///
/// The stamp's own axes are the image's columns (x), up (y) and the image's rows (z); without a rotation, they are
/// those of the terrain, and the image lies as a [`Ground`](crate::ground::Ground) made of it would.
///
/// The surface is the image, interpolated linearly between its samples, to within 1/8 voxel in each lattice column that
/// the brush covers with full weight: heights are rounded to 1/256 voxel, and the rest is marching cubes between
/// voxels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stamp {
    /// The image, 2 to 256 samples a side.
    #[serde(with = "image")]
    pub image: Arc<GreyImage>,
    /// The middle of the image.
    pub center: Vec3,
    /// From the stamp's axes to those of the terrain; of length 1. It may be left out in a line of JSON.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rotation: Quat,
    /// The image's sides in voxels, along its columns and its rows. Nothing changes outside the image.
    pub size: Vec2,
    /// Height of white above black, in voxels; -256 to 256.
    pub height: f32,
}

impl Stamp {
    /// An image pressed down along the y axis.
    pub fn new(image: impl Into<Arc<GreyImage>>, center: Vec3, size: Vec2, height: f32) -> Self {
        Self { image: image.into(), center, rotation: Quat::IDENTITY, size, height }
    }

    /// The stamp with its plane turned.
    #[must_use]
    pub fn with_rotation(self, rotation: Quat) -> Self {
        Self { rotation, ..self }
    }

    /// The stamp on a plane: its up becomes `normal`, by the shortest turn. A normal of no direction leaves it as it
    /// is.
    #[must_use]
    pub fn onto(self, normal: Vec3) -> Self {
        match normal.try_normalize() {
            Some(normal) => self.with_rotation(Quat::from_rotation_arc(Vec3::Y, normal)),
            None => self,
        }
    }
}

/// The minimum and maximum number of samples along a side of an image.
const SIDES: (u32, u32) = (2, 256);

/// The maximum height.
const HEIGHT: f32 = 256.0;

/// The name that errors use for the length they report, which is half of the stamp's.
const HALF: &str = "half the stamp size";

/// The samples of an image.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct ImageSamples(#[serde(with = "image")] pub(super) Arc<GreyImage>);

/// An image as an object: `width`, `height`, and `samples` from 0 to 65535, row by row.
mod image {
    use super::{Arc, BrushError, Deserialize, GreyImage, Serialize};

    #[derive(Serialize, Deserialize)]
    #[serde(rename = "Image", deny_unknown_fields)]
    struct Image {
        width: u32,
        height: u32,
        samples: Vec<u16>,
    }

    pub fn serialize<S: serde::Serializer>(image: &GreyImage, to: S) -> Result<S::Ok, S::Error> {
        let (width, height) = (image.width(), image.height());
        Image { width, height, samples: image.samples().to_vec() }.serialize(to)
    }

    pub fn deserialize<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Arc<GreyImage>, D::Error> {
        let Image { width, height, samples } = Image::deserialize(from)?;
        let actual = samples.len();
        let image = GreyImage::from_samples(width, height, samples).map_err(|_| BrushError::StampSamples {
            width,
            height,
            actual,
        });
        image.map(Arc::new).map_err(serde::de::Error::custom)
    }
}

/// What the samples are counts, not how finely they were once stored.
impl PartialEq for ImageSamples {
    fn eq(&self, other: &Self) -> bool {
        let of = |relief: &Self| (relief.0.width(), relief.0.height());
        of(self) == of(other) && self.0.samples() == other.0.samples()
    }
}

impl Eq for ImageSamples {}

impl Hash for ImageSamples {
    fn hash<H: Hasher>(&self, state: &mut H) {
        (self.0.width(), self.0.height(), self.0.samples()).hash(state);
    }
}

fn check_sides(width: u32, height: u32) -> Result<(), BrushError> {
    let (least, most) = SIDES;
    let is_fine = [width, height].iter().all(|side| (least..=most).contains(side));
    if is_fine { Ok(()) } else { Err(BrushError::StampSize { width, height, least, most }) }
}

impl ImageSamples {
    /// The grey at a place, in 1/256 of a step between samples; 65535 * 2^16 for white.
    fn at(&self, x: i64, y: i64) -> i64 {
        let cell = |at: i64, side: u32| {
            let first = (at >> 8).clamp(0, i64::from(side) - 2);
            (first as u32, (at - (first << 8)).clamp(0, 256))
        };
        let grey = |x: u32, y: u32| i64::from(self.0.grey(x, y));
        let ((x, right), (y, down)) = (cell(x, self.0.width()), cell(y, self.0.height()));
        let along = |y: u32| grey(x, y) * (256 - right) + grey(x + 1, y) * right;
        along(y) * (256 - down) + along(y + 1) * down
    }
}

/// A [`Stamp`] in integers.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct QuantizedStamp {
    center: [i32; 3],
    rotation: [i16; 4],
    half: [i32; 2],
    height: i32,
    relief: ImageSamples,
}

impl QuantizedStamp {
    pub fn quantize(stamp: &Stamp) -> Result<Self, BrushError> {
        check_sides(stamp.image.width(), stamp.image.height())?;
        Ok(Self {
            center: point("stamp center", stamp.center)?,
            rotation: turn(stamp.rotation)?,
            half: [size(HALF, stamp.size.x / 2.0)?, size(HALF, stamp.size.y / 2.0)?],
            height: in_range("stamp height", stamp.height, -HEIGHT, HEIGHT)?,
            relief: ImageSamples(Arc::clone(&stamp.image)),
        })
    }

    pub fn image(&self) -> &Arc<GreyImage> {
        &self.relief.0
    }

    pub fn image_mut(&mut self) -> &mut Arc<GreyImage> {
        &mut self.relief.0
    }

    pub fn check(&self) -> Result<(), BrushError> {
        check_sides(self.relief.0.width(), self.relief.0.height())?;
        check_point("stamp center", self.center)?;
        check_turn(self.rotation)?;
        self.half.into_iter().try_for_each(|half| check_size(HALF, half))?;
        in_range("stamp height", voxels(self.height), -HEIGHT, HEIGHT)?;
        Ok(())
    }

    /// The brush's own numbers again.
    pub fn stamp(&self) -> Stamp {
        Stamp {
            image: Arc::clone(&self.relief.0),
            center: restored_point(self.center),
            rotation: restored_turn(self.rotation),
            size: 2.0 * Vec2::from_array(self.half.map(voxels)),
            height: voxels(self.height),
        }
    }

    /// Half the shorter side.
    pub fn deep(&self) -> i32 {
        self.half[0].min(self.half[1])
    }

    /// Distance of a lattice point outside the image, negative inside, and its height above the relief; in
    /// 1/256 voxel.
    pub fn at(&self, at: IVec3) -> (i32, i32) {
        let (rows, squared) = matrix(self.rotation);
        let from = at.as_i64vec3() * i64::from(ONE) - IVec3::from_array(self.center).as_i64vec3();
        let [right, up, down] = [0, 1, 2].map(|i| {
            let along = rows[0][i] * from.x + rows[1][i] * from.y + rows[2][i] * from.z;
            (along + squared / 2).div_euclid(squared)
        });
        let half = self.half.map(i64::from);
        let beside = (right.abs() - half[0]).max(down.abs() - half[1]);
        let place = |at: i64, half: i64, side: u32| (at + half) * (i64::from(side) - 1) * 256 / (2 * half);
        let column = place(right, half[0], self.relief.0.width());
        let row = place(down, half[1], self.relief.0.height());
        let white = 65535 << 16;
        let relief = (self.relief.at(column, row) * i64::from(self.height) + white / 2).div_euclid(white);
        let far = |value: i64| value.clamp(-(1 << 25), 1 << 25) as i32;
        (far(beside), far(up - relief))
    }
}

/// A stamp as plain numbers, for the GPU.
#[cfg(feature = "cuda")]
pub(crate) struct StampParams<'a> {
    pub center: [i32; 3],
    /// Rows of the rotation's matrix, and what to divide them by.
    pub rows: [[i64; 3]; 3],
    pub squared: i64,
    pub half: [i32; 2],
    pub height: i32,
    pub image: &'a GreyImage,
}

#[cfg(feature = "cuda")]
impl QuantizedStamp {
    /// All parameters of [`QuantizedStamp::at`].
    pub(super) fn constants(&self) -> StampParams<'_> {
        let &Self { center, rotation, half, height, .. } = self;
        let (rows, squared) = matrix(rotation);
        StampParams { center, rows, squared, half, height, image: &self.relief.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Stamp {
        let samples = (0..12).map(|i| (i % 4) * 21845).collect();
        let image = GreyImage::from_samples(4, 3, samples).unwrap();
        Stamp::new(image, Vec3::new(10.0, 5.0, 20.0), Vec2::new(6.0, 8.0), 3.0)
    }

    #[test]
    fn a_ramp_rises_along_its_columns() {
        let quantized = QuantizedStamp::quantize(&ramp()).unwrap();
        for (x, height) in [(7, 0), (8, 128), (10, 384), (12, 640), (13, 768)] {
            for z in [16, 20, 24] {
                let (beside, above) = quantized.at(IVec3::new(x, 5, z));
                assert!(beside <= 0 && (above + height).abs() <= 1, "{x} {z}: {above}");
            }
        }
        assert_eq!(quantized.at(IVec3::new(15, 5, 20)).0, 512);
        assert_eq!(quantized.at(IVec3::new(10, 5, 25)).0, 256);
    }

    #[test]
    fn a_stamp_is_as_deep_as_half_its_shorter_side() {
        for (size, deep) in [(Vec2::new(6.0, 8.0), 768), (Vec2::new(8.0, 6.0), 768), (Vec2::splat(5.0), 640)]
        {
            assert_eq!(QuantizedStamp::quantize(&Stamp { size, ..ramp() }).unwrap().deep(), deep, "{size}");
        }
    }

    #[test]
    fn a_stamp_on_a_wall_looks_along_its_normal() {
        let quantized = QuantizedStamp::quantize(&ramp().onto(Vec3::X)).unwrap();
        let middle = quantized.at(IVec3::new(10, 5, 20)).1;
        assert_eq!(quantized.at(IVec3::new(12, 5, 20)).1, middle + 512);
    }

    #[test]
    fn the_stamp_comes_back_from_its_integers() {
        let stamp = ramp();
        assert_eq!(QuantizedStamp::quantize(&stamp).unwrap().stamp(), stamp);
        let turned = ramp().onto(Vec3::new(0.3, 0.9, -0.2));
        let quantized = QuantizedStamp::quantize(&turned).unwrap();
        assert_eq!(QuantizedStamp::quantize(&quantized.stamp()).unwrap(), quantized);
    }

    #[test]
    fn stamps_that_are_too_small_or_too_large_are_refused_by_half_their_size() {
        let error = |size| QuantizedStamp::quantize(&Stamp { size, ..ramp() }).unwrap_err();
        let (what, least, most) = (HALF, 0.25, 1024.0);
        let small = BrushError::TooSmall { what, value: 0.125, least };
        assert_eq!([error(Vec2::new(0.25, 4.0)), error(Vec2::new(4.0, 0.25))], [small; 2]);
        assert_eq!(error(Vec2::new(4.0, 2050.0)), BrushError::TooLarge { what, value: 1025.0, most });
        assert!(matches!(error(Vec2::new(f32::NAN, 4.0)), BrushError::NotFinite { .. }));
        assert!(QuantizedStamp::quantize(&Stamp { size: Vec2::new(0.5, 2048.0), ..ramp() }).is_ok());
    }

    #[test]
    fn images_of_other_sizes_are_refused() {
        for (width, height) in [(1, 9), (9, 1), (257, 2), (2, 257)] {
            let image = GreyImage::from_samples(width, height, vec![0; (width * height) as usize]).unwrap();
            let error = QuantizedStamp::quantize(&Stamp { image: image.into(), ..ramp() }).unwrap_err();
            assert!(matches!(error, BrushError::StampSize { .. }), "{error}");
        }
        let quantized = QuantizedStamp::quantize(&ramp()).unwrap();
        let json = serde_json::to_string(&quantized).unwrap();
        assert_eq!(serde_json::from_str::<QuantizedStamp>(&json).unwrap(), quantized);
        for (from, to, message) in [
            (r#""width":4"#, r#""width":5"#, "takes 15 samples, but 12"),
            (r#""width":4"#, r#""width":4000000000"#, "takes 12000000000 samples, but 12"),
            (r#""width":4"#, r#""width":0"#, "takes 0 samples, but 12"),
        ] {
            let error =
                serde_json::from_str::<QuantizedStamp>(&json.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
