//! The edit: a brush in integers, which the world applies.

use std::sync::Arc;

use glam::IVec3;
use serde::{Deserialize, Serialize};

use super::blend::QuantizedBlend;
use super::content::{Content, ContentMut};
use super::paste::{PasteSource, QuantizedPaste};
use super::quantize::voxels;
use super::quantized_operation::QuantizedOperation;
use super::roughness::QuantizedRoughness;
use super::sculpt_kernel::SculptKernel;
use super::shapes::QuantizedShape;
use super::{
    BAND, Blend, Brush, BrushError, CustomShape, Evaluator, FULL_POWER, Kind, Operation, Prefab, Roughness,
    Shape, ShapeGrid, rounding,
};
use crate::ground::GreyImage;
use crate::lattice::{LatticeBox, ONE};

/// Diagonal of a brick of 8 voxels, rounded up, in 1/256 voxel.
const BRICK_DIAGONAL: i32 = 14 * ONE;

/// A brush in integers: the same edit changes the same samples to the same bits on every machine.
///
/// An edit is always within the limits of [the module's table](super): [`quantize`](Self::quantize) checks them, and so
/// does deserialising, which fails with the message of the [`BrushError`]. Both drop roughness of amplitude 0, which
/// has no bumps.
///
/// # Format
///
/// Serialised edits are kept in journals and sent over networks, so their form is stable: names, order and meaning of
/// fields and variants stay, and new variants come after the old. Any format of serde's will do. In JSON:
///
/// ```json
/// {"shape":{"sphere":{"center":[256,0,-512],"radius":1024}},"operation":{"add":{"material":3}},"blend":null,
///  "power":255,"roughness":{"amplitude":128,"scale":1024,"seed":7},"tag":0,"stroke":null}
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "Unchecked")]
pub struct Edit {
    pub(super) shape: QuantizedShape,
    pub(super) operation: QuantizedOperation,
    /// `None` unless the operation sculpts.
    blend: Option<QuantizedBlend>,
    power: u8,
    #[serde(with = "super::roughness::optional")]
    roughness: Option<QuantizedRoughness>,
    tag: u64,
    stroke: Option<u64>,
}

/// An edit as it comes from a file or a network.
#[derive(Deserialize)]
#[serde(rename = "Edit", deny_unknown_fields)]
struct Unchecked {
    shape: QuantizedShape,
    operation: QuantizedOperation,
    #[serde(default)]
    blend: Option<QuantizedBlend>,
    #[serde(default = "full_power")]
    power: u8,
    #[serde(default, with = "super::roughness::optional")]
    roughness: Option<QuantizedRoughness>,
    tag: u64,
    #[serde(default)]
    stroke: Option<u64>,
}

fn full_power() -> u8 {
    FULL_POWER
}

/// Checks what concerns shape, operation and blend together.
fn check_together(
    shape: &QuantizedShape,
    operation: &Operation,
    blend: Option<QuantizedBlend>,
) -> Result<(), BrushError> {
    match operation {
        Operation::Road if shape.road().is_none() => Err(BrushError::NoCorridor),
        Operation::Fill | Operation::Carve
            if blend.is_some_and(|blend| blend.falloff > rounding::MAX * ONE) =>
        {
            let most = rounding::MAX as f32;
            let value = blend.map_or(0.0, |blend| voxels(blend.falloff));
            Err(BrushError::OutOfBounds { what: "falloff", value, least: 0.0, most })
        }
        // `stamp_image` names one image.
        Operation::Stamp { .. } if shape.grid().is_some() => Err(BrushError::StampInGrid),
        _ => Ok(()),
    }
}

impl Edit {
    /// Rounds a brush to integers, halves to even, and checks it.
    ///
    /// Roughness of amplitude 0 is dropped. A rotation and its negative give the same edit.
    ///
    /// # Errors
    ///
    /// A [`BrushError`] where a number is not finite or beyond the limits of [the module's table](super).
    pub fn quantize(brush: &Brush) -> Result<Self, BrushError> {
        let roughness = brush.roughness.as_ref().map(QuantizedRoughness::quantize).transpose()?;
        let sculpts = brush.operation.is_sculpting();
        let shape = match &brush.custom {
            Some(custom) => QuantizedShape::quantize_custom(custom)?,
            None => QuantizedShape::quantize(&brush.shape)?,
        };
        let blend = sculpts.then(|| QuantizedBlend::quantize(&brush.blend)).transpose()?;
        check_together(&shape, &brush.operation, blend)?;
        Ok(Self {
            shape,
            operation: QuantizedOperation::quantize(&brush.operation)?,
            blend,
            power: brush.power,
            roughness: roughness.filter(|roughness| roughness.amplitude != 0),
            tag: brush.tag,
            stroke: brush.stroke,
        })
    }

    /// Checks the edit against the same limits as [`quantize`](Self::quantize). Deserialising has done so already.
    ///
    /// # Errors
    ///
    /// A [`BrushError`] that says which limit is broken.
    pub fn check(&self) -> Result<(), BrushError> {
        self.shape.check()?;
        self.operation.check()?;
        check_together(&self.shape, &self.operation.operation(), self.blend)?;
        if self.blend.is_some() != (self.kind() == Kind::Sculpt) {
            return Err(BrushError::Blend);
        }
        self.blend.map_or(Ok(()), QuantizedBlend::check)?;
        self.roughness.map_or(Ok(()), |roughness| roughness.check())
    }

    /// The shape in floats, as in a brush. For a custom shape, the box around it.
    pub fn shape(&self) -> Shape {
        self.shape.shape().parts().0
    }

    /// The custom shape, if it has one, in floats as in a brush.
    pub fn custom_shape(&self) -> Option<Arc<CustomShape>> {
        self.shape.shape().parts().1
    }

    /// Bumps on the shape's surface, in floats as in a brush.
    pub fn roughness(&self) -> Option<Roughness> {
        self.roughness.map(|roughness| roughness.roughness())
    }

    /// The operation, in floats as in a brush.
    pub fn operation(&self) -> Operation {
        self.operation.operation()
    }

    /// The blend, if the edit sculpts.
    pub fn blend(&self) -> Option<Blend> {
        self.blend.map(QuantizedBlend::blend)
    }

    /// The greatest hardness of material that it removes at full speed.
    pub fn power(&self) -> u8 {
        self.power
    }

    /// The kind of its operation.
    pub(crate) fn kind(&self) -> Kind {
        self.operation.kind()
    }

    /// The kernel that computes new samples, if it sculpts.
    pub(crate) fn sculptor(&self) -> Option<SculptKernel> {
        self.blend.map(|blend| SculptKernel::new(&self.operation, blend, &self.shape))
    }

    /// The brush's tag.
    pub fn tag(&self) -> u64 {
        self.tag
    }

    /// The stroke that the brush was part of.
    pub fn stroke(&self) -> Option<u64> {
        self.stroke
    }

    /// The edit with another tag, as part of another stroke or of none. It changes the same samples.
    #[must_use]
    pub fn with_labels(self, tag: u64, stroke: Option<u64>) -> Self {
        Self { tag, stroke, ..self }
    }

    /// The image of the stamp, or the image that holds the samples of a [`ShapeGrid`](super::ShapeGrid); `None` if the
    /// edit has neither.
    pub fn stamp_image(&self) -> Option<&Arc<GreyImage>> {
        self.shape.grid().map(ShapeGrid::image).or_else(|| self.operation.stamp_image())
    }

    /// The edit with another image, if it is a stamp or its shape is a grid; otherwise as it is.
    ///
    /// # Errors
    /// When the image has a size that no stamp may have, or holds no grid, or one that is too large at this scale.
    pub fn with_stamp_image(mut self, image: Arc<GreyImage>) -> Result<Self, BrushError> {
        for place in self.contents_mut() {
            match place {
                ContentMut::Grid(grid) => *grid = ShapeGrid::in_image(Arc::clone(&image)),
                ContentMut::Image(own) => *own = Arc::clone(&image),
                ContentMut::Prefab(_) => {}
            }
        }
        self.check()?;
        Ok(self)
    }

    /// The prefab, if it pastes one.
    pub fn prefab(&self) -> Option<&Arc<Prefab>> {
        self.operation.prefab()
    }

    /// Everything that a name can stand for, in the order in which names are written.
    #[cfg_attr(not(feature = "format"), allow(dead_code, reason = "for messages and journals"))]
    pub(crate) fn contents(&self) -> impl Iterator<Item = Content<'_>> {
        self.shape.grid().map(Content::Grid).into_iter().chain(self.operation.content())
    }

    /// The places of [`contents`](Self::contents), in the same order. The edit has to be [checked](Self::check) once
    /// they have other content.
    pub(crate) fn contents_mut(&mut self) -> impl Iterator<Item = ContentMut<'_>> {
        self.shape.grid_mut().map(ContentMut::Grid).into_iter().chain(self.operation.content_mut())
    }

    /// The samples that it pastes, if it does.
    pub(crate) fn paste_source(&self) -> Option<PasteSource<'_>> {
        self.operation.paste().map(|paste| paste.source())
    }

    /// A box around every sample that the edit may change: the shape, its roughness and [`BAND`] (rule 6), or the
    /// radius of a fill or a carve if that is greater. A paste changes no samples outside its prefab; if the prefab
    /// lies outside the shape, the box is a single point.
    ///
    /// At the rim of the lattice the box reaches beyond its [limits](super#limits) by at most some thousand
    /// voxels; the world cuts it.
    pub fn reach(&self) -> LatticeBox {
        let grow = self.band();
        let (low, high) = self.shape.bounds();
        let own = LatticeBox {
            min: (low - grow + (ONE - 1)).div_euclid(IVec3::splat(ONE)),
            max: (high + grow) >> 8,
        };
        match self.operation.paste().map(QuantizedPaste::bounds) {
            Some(pasted) => {
                own.intersection(pasted).unwrap_or(LatticeBox::point(pasted.min.clamp(own.min, own.max)))
            }
            None => own,
        }
    }

    /// Whether it certainly changes none of these samples: of a path, whose box is mostly empty, also those far from
    /// its pieces.
    pub(crate) fn misses(&self, samples: LatticeBox) -> bool {
        let Some(samples) = self.reach().intersection(samples) else { return true };
        self.max_bricks().is_some() && self.evaluator().is_out_of_reach(samples)
    }

    /// Distance outside the shape up to which samples may change.
    fn band(&self) -> i32 {
        // Two more units for the rounding of the distance.
        self.shape_band() + self.roughness.map_or(0, |roughness| roughness.amplitude) + 2
    }

    /// Distance outside the rough shape up to which samples may change.
    pub(crate) fn shape_band(&self) -> i32 {
        let rounding = self.blend.and_then(|blend| self.operation.rounding(blend.falloff));
        rounding.map_or(BAND, |rounding| rounding.radius.max(BAND))
    }

    /// At least the number of bricks that the edit may change, where that is known to be much less than the bricks in
    /// its [`reach`](Self::reach).
    pub(crate) fn max_bricks(&self) -> Option<u64> {
        // Every point of a brick that is reached lies within its diagonal.
        let volume = self.shape.volume_within(self.band() + BRICK_DIAGONAL)?;
        Some((volume / f64::from(8 * ONE).powi(3)).ceil() as u64)
    }

    /// The edit's signed distance function, ready to evaluate.
    pub fn evaluator(&self) -> Evaluator {
        Evaluator::new(&self.shape, self.roughness, self.shape_band())
    }
}

/// A brush for this edit: quantising it gives the edit again, except that the rotation of a box and the normal of a
/// plane may be rounded once more.
impl From<&Edit> for Brush {
    fn from(edit: &Edit) -> Self {
        let (shape, custom) = edit.shape.shape().parts();
        Self {
            shape,
            custom,
            operation: edit.operation(),
            roughness: edit.roughness(),
            tag: edit.tag(),
            stroke: edit.stroke(),
            blend: edit.blend().unwrap_or_default(),
            power: edit.power(),
        }
    }
}

impl TryFrom<&Brush> for Edit {
    type Error = BrushError;

    fn try_from(brush: &Brush) -> Result<Self, BrushError> {
        Self::quantize(brush)
    }
}

impl TryFrom<Unchecked> for Edit {
    type Error = BrushError;

    fn try_from(of: Unchecked) -> Result<Self, BrushError> {
        let Unchecked { shape, operation, blend, power, roughness, tag, stroke } = of;
        let edit = Self { shape, operation, blend, power, roughness, tag, stroke };
        edit.check()?;
        Ok(Self { roughness: roughness.filter(|roughness| roughness.amplitude != 0), ..edit })
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec2, Vec3};

    use super::super::{Roughness, Shape, Stamp};
    use super::*;
    use crate::ground::{GreyImage, MaterialId};
    use crate::lattice::LIMIT;

    fn error(shape: Shape) -> BrushError {
        Edit::quantize(&Brush::dig(shape)).unwrap_err()
    }

    #[test]
    fn every_limit_is_refused_by_its_name() {
        let (at, up) = (Vec3::ZERO, Vec3::Y);
        assert!(matches!(error(Shape::sphere(at, -3.0)), BrushError::TooSmall { value: -3.0, .. }));
        for radius in [0.0, -0.0, f32::MIN_POSITIVE / 4.0, 0.24, -1e30] {
            assert!(matches!(error(Shape::sphere(at, radius)), BrushError::TooSmall { what: "radius", .. }));
        }
        assert!(matches!(error(Shape::sphere(at, f32::NAN)), BrushError::NotFinite { what: "radius", .. }));
        assert!(matches!(error(Shape::sphere(at * f32::NAN, 1.0)), BrushError::NotFinite { .. }));
        assert!(matches!(error(Shape::sphere(at, 1e30)), BrushError::TooLarge { what: "radius", .. }));
        assert!(matches!(error(Shape::sphere(at, 300.0)), BrushError::TooLarge { what: "volume", .. }));
        assert!(matches!(
            error(Shape::cuboid(at, Vec3::new(513.0, 1.0, 1.0))),
            BrushError::TooLarge { what: "box", .. }
        ));
        assert!(matches!(
            error(Shape::cuboid(at, Vec3::new(3.0, 0.0, 1.0))),
            BrushError::TooSmall { what: "half", .. }
        ));
        let far = Vec3::new(0.0, LIMIT as f32 + 0.5, 0.0);
        assert!(matches!(error(Shape::sphere(far, 1.0)), BrushError::OutOfRange { what: "center", .. }));
        let rim = Vec3::new(0.0, LIMIT as f32, 0.0);
        assert!(matches!(error(Shape::cone(rim, up, 1.0)), BrushError::OutOfRange { what: "end", .. }));
        assert!(matches!(error(Shape::cone(at, up * 0.2, 1.0)), BrushError::ZeroAxis { .. }));
        assert!(matches!(error(Shape::cylinder(at, at, 1.0)), BrushError::ZeroAxis { length: 0.0, .. }));
        assert!(matches!(error(Shape::capsule(-rim, rim, 1.0)), BrushError::TooLarge { what: "box", .. }));
        for length in [0.0, 0.98, 1.02, 1e30] {
            let shape = Shape::turned_cuboid(at, Vec3::ONE, Quat::IDENTITY * length);
            assert!(matches!(error(shape), BrushError::ZeroRotation { .. }));
        }
    }

    #[test]
    fn what_is_just_within_the_limits_is_accepted() {
        let rim = Vec3::splat(LIMIT as f32);
        for shape in [
            Shape::sphere(rim, 0.25),
            Shape::sphere(-rim, 200.0),
            Shape::capsule(Vec3::ZERO, Vec3::ZERO, 1.0),
            Shape::capsule(Vec3::ZERO, Vec3::splat(1000.0), 0.25),
            Shape::cuboid(Vec3::ZERO, Vec3::new(512.0, 10.0, 10.0)),
            Shape::turned_cuboid(Vec3::ZERO, Vec3::ONE, Quat::from_xyzw(0.0, 1.009, 0.0, 0.0)),
        ] {
            Edit::quantize(&Brush::dig(shape)).unwrap().check().unwrap();
        }
    }

    #[test]
    fn a_rotation_and_its_negative_are_one_edit() {
        for q in [Quat::from_xyzw(0.5, -0.5, 0.5, -0.5), Quat::from_xyzw(0.0, 0.0, -1.0, 0.0)] {
            let of = |q| Edit::quantize(&Brush::dig(Shape::turned_cuboid(Vec3::ZERO, Vec3::ONE, q))).unwrap();
            assert_eq!(of(q), of(-q));
        }
    }

    #[test]
    fn the_documented_form_is_the_form() {
        let brush = Brush::add(Shape::sphere(Vec3::new(1.0, 0.0, -2.0), 4.0), MaterialId(3));
        let edit = Edit::quantize(&brush.with_roughness(Roughness::new(0.5, 4.0, 7))).unwrap();
        let json = r#"{"shape":{"sphere":{"center":[256,0,-512],"radius":1024}},"operation":{"add":{"material":3}},"blend":null,"power":255,"roughness":{"amplitude":128,"scale":1024,"seed":7},"tag":0,"stroke":null}"#;
        assert_eq!(serde_json::to_string(&edit).unwrap(), json);
        assert_eq!(serde_json::from_str::<Edit>(json).unwrap(), edit);
    }

    #[test]
    fn the_form_of_every_operation_stays() {
        let image = GreyImage::from_samples(2, 2, vec![0, 1, 2, 65535]).unwrap();
        let shape = Shape::sphere(Vec3::ZERO, 2.0);
        let stamp = Stamp::new(image, Vec3::X, Vec2::new(4.0, 6.0), 3.0);
        let blend = r#"{"strength":256,"falloff":1024,"material":null}"#;
        let stamped = r#"{"stamp":{"stamp":{"center":[256,0,0],"rotation":[0,0,0,32767],"half":[512,768],"height":768,"relief":{"width":2,"height":2,"samples":[0,1,2,65535]}}}}"#;
        for (brush, operation, blend, power) in [
            (Brush::dig(shape), r#""dig""#, "null", 255),
            (Brush::dig(shape).with_power(40), r#""dig""#, "null", 40),
            (Brush::paint(shape, MaterialId(2)), r#"{"paint":{"material":2}}"#, "null", 255),
            (Brush::smooth(shape, 0.5), r#""smooth""#, &blend.replace("256", "128"), 255),
            (Brush::sharpen(shape, 1.0), r#""sharpen""#, blend, 255),
            (
                Brush::flatten(shape, Vec3::X, Vec3::Y * 5.0),
                r#"{"flatten":{"point":[256,0,0],"normal":[0,32767,0]}}"#,
                blend,
                255,
            ),
            (Brush::level(shape, -2.0), r#"{"level":{"height":-512}}"#, blend, 255),
            (
                Brush::raise(shape, 0.5).with_material(MaterialId(9)),
                r#"{"raise":{"amount":128}}"#,
                &blend.replace("null", "9"),
                255,
            ),
            (Brush::lower(shape, 64.0), r#"{"lower":{"amount":16384}}"#, blend, 255),
            (Brush::stamp(shape, stamp), stamped, &blend.replace("1024", "256"), 255),
            (Brush::terrace(shape, 3.0).with_power(7), r#"{"terrace":{"step":768,"base":0}}"#, blend, 7),
        ] {
            let edit = Edit::quantize(&brush).unwrap();
            let json = serde_json::to_string(&edit).unwrap();
            let expected = format!(
                r#"{{"shape":{{"sphere":{{"center":[0,0,0],"radius":512}}}},"operation":{operation},"blend":{blend},"power":{power},"roughness":null,"tag":0,"stroke":null}}"#
            );
            assert_eq!(json, expected);
            assert_eq!(serde_json::from_str::<Edit>(&json).unwrap(), edit);
        }
    }

    #[test]
    fn sculpting_beyond_its_limits_is_refused_by_its_name() {
        let shape = Shape::sphere(Vec3::ZERO, 2.0);
        let error = |brush: Brush| Edit::quantize(&brush).unwrap_err().to_string();
        for (brush, message) in [
            (Brush::smooth(shape, 1.01), "`strength` is 1.01, but it must be 0 to 1"),
            (Brush::smooth(shape, f32::NAN), "`strength` must be finite"),
            (Brush::raise(shape, 1.0).with_falloff(64.5), "`falloff` is 64.5, but it must be 0 to 64"),
            (Brush::raise(shape, -1.0), "`amount` is -1, but it must be 0 to 64"),
            (Brush::lower(shape, f32::INFINITY), "`amount` must be finite"),
            (Brush::level(shape, 40_000.0), "`height` is 40000, but it must be -32768 to 32768"),
            (Brush::flatten(shape, Vec3::ZERO, Vec3::ZERO), "`normal` is 0 long"),
            (Brush::flatten(shape, Vec3::ZERO, Vec3::NAN), "`normal` must be finite"),
            (Brush::flatten(shape, Vec3::X * 1e9, Vec3::Y), "beyond +-262144"),
            (Brush::terrace(shape, 0.5), "`step` is 0.5, but it must be 1 to 256"),
        ] {
            assert!(error(brush.clone()).contains(message), "{}", error(brush));
        }
    }

    #[test]
    fn sculpting_from_outside_is_checked() {
        let parse = |operation: &str, blend: &str| {
            let json = format!(
                r#"{{"shape":{{"sphere":{{"center":[0,0,0],"radius":64}}}},"operation":{operation},"blend":{blend},"power":1,"roughness":null,"tag":1,"stroke":null}}"#
            );
            serde_json::from_str::<Edit>(&json).map_err(|error| error.to_string())
        };
        let blend = r#"{"strength":256,"falloff":1024,"material":null}"#;
        parse(r#""smooth""#, blend).unwrap();
        for (operation, blend, message) in [
            (r#""smooth""#, &*blend.replace("256", "257"), "`strength`"),
            (r#""smooth""#, &blend.replace("1024", "-1"), "`falloff`"),
            (r#""smooth""#, "null", "a `blend` belongs"),
            (r#""dig""#, blend, "a `blend` belongs"),
            (r#"{"raise":{"amount":-2147483648}}"#, blend, "`amount`"),
            (r#"{"level":{"height":2147483647}}"#, blend, "`height`"),
            (r#"{"terrace":{"step":0,"base":0}}"#, blend, "`step`"),
            (r#"{"terrace":{"step":256,"base":-2147483648}}"#, blend, "`base`"),
            (r#"{"flatten":{"point":[0,0,0],"normal":[0,0,0]}}"#, blend, "`normal`"),
            (r#"{"flatten":{"point":[0,0,0],"normal":[-32768,-32768,9]}}"#, blend, "`normal`"),
        ] {
            let error = parse(operation, blend).unwrap_err();
            assert!(error.contains(message), "{operation}: {error}");
        }
    }

    #[test]
    fn roughness_without_bumps_is_none_wherever_it_comes_from() {
        let plain = Brush::dig(Shape::sphere(Vec3::ZERO, 2.0));
        let rough = plain.clone().with_roughness(Roughness::new(0.0, 4.0, 7));
        let edit = Edit::quantize(&plain).unwrap();
        assert_eq!(Edit::quantize(&rough).unwrap(), edit);
        let json = serde_json::to_string(&edit).unwrap();
        let read = |roughness: &str| {
            let field = format!(r#""roughness":{roughness}"#);
            serde_json::from_str::<Edit>(&json.replacen(r#""roughness":null"#, &field, 1))
        };
        assert_eq!(read(r#"{"amplitude":0,"scale":1024,"seed":7}"#).unwrap(), edit);
        assert!(read(r#"{"amplitude":0,"scale":0,"seed":7}"#).is_err());
    }

    #[test]
    fn a_paste_reaches_its_prefab_within_its_shape() {
        use super::super::{Paste, PrefabSample};
        let mut rng = fastrand::Rng::with_seed(4);
        let air = PrefabSample {
            density: 9,
            material: MaterialId::GROUND,
            is_edited: true,
            has_stored_material: false,
        };
        let (mut samples, mut widest) = (0, 0);
        for _ in 0..150 {
            let size = IVec3::new(rng.i32(1..9), rng.i32(1..9), rng.i32(1..9));
            let anchor = IVec3::new(rng.i32(-9..20), rng.i32(-9..20), rng.i32(-9..20));
            let prefab =
                Prefab::new(size, anchor, 0, std::iter::repeat_n(air, size.element_product() as usize))
                    .unwrap();
            let mut place = |most: f32| Vec3::new(rng.f32(), rng.f32(), rng.f32()) * most - most / 2.0;
            let (at, turn) = (place(40.0), Quat::from_scaled_axis(place(6.0)));
            let paste = Paste { mirror: rng.bool(), scale: 0.3 + rng.f32() * 2.0, ..Paste::new(prefab, at) };
            let paste = if rng.bool() { paste.rotated(turn) } else { paste.turned_about_y(rng.i32(..)) };
            // All of the world, but for a corner.
            let shape = Shape::sphere(Vec3::ZERO, 180.0);
            let edit = Edit::quantize(&Brush { operation: Operation::Paste { paste }, ..Brush::dig(shape) })
                .unwrap();
            let (reach, source) = (edit.reach(), edit.paste_source().unwrap());
            for point in reach.grown(3).points() {
                let is_pasted = source.sample(point).is_some();
                assert!(!is_pasted || reach.contains(point), "{point} is beyond {reach:?}");
                samples += u64::from(is_pasted);
            }
            widest = widest.max(reach.size().max_element());
        }
        assert!(samples > 2000 && widest < 60, "{samples} samples, {widest} voxels");
    }

    #[test]
    fn edits_from_outside_are_checked() {
        let parse = |shape: &str| {
            let json = format!(
                r#"{{"shape":{shape},"operation":"dig","blend":null,"power":255,"roughness":null,"tag":1,"stroke":null}}"#
            );
            serde_json::from_str::<Edit>(&json).map_err(|error| error.to_string())
        };
        parse(r#"{"sphere":{"center":[0,0,0],"radius":64}}"#).unwrap();
        for (shape, message) in [
            (
                r#"{"sphere":{"center":[0,0,0],"radius":-2147483648}}"#,
                "`radius` is -8388608 voxels, but the minimum is 0.25",
            ),
            (r#"{"sphere":{"center":[0,-2147483648,0],"radius":64}}"#, "beyond +-32768 voxels"),
            (r#"{"cone":{"base":[0,0,0],"axis":[-2147483648,0,0],"radius":64}}"#, "the maximum is 1024"),
            (r#"{"cuboid":{"center":[0,0,0],"half":[64,64,64],"rotation":[0,0,0,0]}}"#, "length 0"),
            (r#"{"cuboid":{"center":[0,0,0],"half":[64,64,64],"rotation":[0,0,0,-32767]}}"#, "wrong sign"),
            (r#"{"ball":{}}"#, "unknown variant `ball`"),
        ] {
            let error = parse(shape).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }
}
