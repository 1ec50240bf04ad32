//! The brush: an edit that a game requests, in floats.

use std::sync::Arc;

#[cfg(feature = "plugin")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
#[cfg(feature = "plugin")]
use glam::Mat3A;
use glam::{Quat, Vec3};

use super::quantize::Shift;
use super::{AnyShape, Blend, Corridor, CustomShape, FULL_POWER, Operation, Paste, Roughness, Shape, Stamp};
use crate::ground::MaterialId;

/// A request to change the ground, in voxels of terrain space. A brush sent to the plugin as a message is in world
/// space and metres instead; each terrain transforms it into its own space.
///
/// A brush is not checked when it is made: [`Edit::quantize`](super::Edit::quantize) checks it, and reports what is
/// wrong.
///
/// # Lines of JSON
///
/// A brush is written as one flat object:
///
/// ```json
/// {"shape":"sphere","center":[8,0,8],"radius":4,"op":"dig"}
/// {"shape":"box","center":[8,0,8],"half":[2,3,2],"rotation":[0,0,0,1],"op":"add","material":3,"tag":7}
/// {"shape":"cone","base":[0,0,0],"axis":[0,9,0],"radius":4,"op":"paint","material":1,
///  "roughness":{"amplitude":1,"scale":6,"seed":5}}
/// {"shape":"sphere","center":[8,0,8],"radius":6,"op":"flatten","point":[8,0,8],"normal":[0,1,0.2],"falloff":2}
/// {"shape":"sphere","center":[8,0,8],"radius":6,"op":"smooth","strength":0.5}
/// ```
///
/// The fields are those of its [`Shape`] (a cuboid is a `box`), those of its [`Operation`] (the base of a terrace is
/// its `height`), and for operations that sculpt those of the [`Blend`]. Fields of the blend, `rotation`, `roughness`,
/// `power`, `tag` and `stroke` may be left out; other fields are refused.
///
/// With the feature `plugin` it is reflected as such a line, and so can be sent by Bevy's remote protocol.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "plugin",
    derive(bevy::reflect::Reflect),
    reflect(opaque, Clone, Debug, PartialEq, Serialize, Deserialize)
)]
pub struct Brush {
    /// Where the brush works. With a custom shape it is not used; constructors and [`transformed`](Self::transformed)
    /// set it to a box around that one.
    pub shape: Shape,
    /// A shape that takes the place of `shape`: a path, for example.
    pub custom: Option<Arc<CustomShape>>,
    /// The operation.
    pub operation: Operation,
    /// Bumps on the shape's surface; `None` for a smooth one.
    pub roughness: Option<Roughness>,
    /// Any number that the game chooses; the receipt returns it.
    pub tag: u64,
    /// The stroke: consecutive brushes of one stroke are one undo step, over any number of frames. With `None`, the
    /// brushes of one frame are a step, or those of one [`apply`](crate::terrain::Terrain::apply). A brush of another
    /// stroke in between, for example of a second player, ends the step.
    pub stroke: Option<u64>,
    /// The falloff, strength and material of operations that sculpt.
    pub blend: Blend,
    /// The greatest hardness of material that it removes at full speed, if the terrain has rules for that.
    /// [`FULL_POWER`] removes everything that can be removed.
    pub power: u8,
}

impl Brush {
    fn new(shape: impl Into<AnyShape>, operation: Operation) -> Self {
        let (shape, custom) = shape.into().parts();
        Self {
            shape,
            custom,
            operation,
            roughness: None,
            tag: 0,
            stroke: None,
            blend: Blend::default(),
            power: FULL_POWER,
        }
    }

    /// The brush of an operation, as the functions below make it.
    pub(super) fn plain(shape: impl Into<AnyShape>, operation: Operation) -> Self {
        match operation {
            Operation::Stamp { stamp } => Self::stamp(shape, stamp),
            operation => Self::new(shape, operation),
        }
    }

    /// A brush that removes ground.
    pub fn dig(shape: impl Into<AnyShape>) -> Self {
        Self::new(shape, Operation::Dig)
    }

    /// A brush that fills its shape with ground.
    pub fn add(shape: impl Into<AnyShape>, material: MaterialId) -> Self {
        Self::new(shape, Operation::Add { material })
    }

    /// A brush that changes the material of the ground in its shape.
    pub fn paint(shape: impl Into<AnyShape>, material: MaterialId) -> Self {
        Self::new(shape, Operation::Paint { material })
    }

    /// A brush that evens out its shape; `strength` is 0 to 1.
    pub fn smooth(shape: impl Into<AnyShape>, strength: f32) -> Self {
        Self::new(shape, Operation::Smooth).with_strength(strength)
    }

    /// A brush that deepens bumps and edges; `strength` is 0 to 1.
    pub fn sharpen(shape: impl Into<AnyShape>, strength: f32) -> Self {
        Self::new(shape, Operation::Sharpen).with_strength(strength)
    }

    /// A brush that flattens the surface to a plane through `point`, with air on the side that `normal` points to: for
    /// floors, walls and ceilings.
    pub fn flatten(shape: impl Into<AnyShape>, point: Vec3, normal: Vec3) -> Self {
        Self::new(shape, Operation::Flatten { point, normal })
    }

    /// A brush that makes the ground level at a height.
    pub fn level(shape: impl Into<AnyShape>, height: f32) -> Self {
        Self::new(shape, Operation::Level { height })
    }

    /// A brush that raises the ground by `amount` voxels.
    pub fn raise(shape: impl Into<AnyShape>, amount: f32) -> Self {
        Self::new(shape, Operation::Raise { amount })
    }

    /// A brush that lowers the ground by `amount` voxels.
    pub fn lower(shape: impl Into<AnyShape>, amount: f32) -> Self {
        Self::new(shape, Operation::Lower { amount })
    }

    /// A brush that gives the ground in its shape the relief of an image. It fades over a single voxel at the rim of
    /// the image and of the shape, by default.
    pub fn stamp(shape: impl Into<AnyShape>, stamp: Stamp) -> Self {
        Self::new(shape, Operation::Stamp { stamp }).with_falloff(1.0)
    }

    /// A brush that cuts slopes into steps of a height, with a tread at height 0.
    pub fn terrace(shape: impl Into<AnyShape>, step: f32) -> Self {
        Self::new(shape, Operation::Terrace { step, base: 0.0 })
    }

    /// A brush that fills its shape with ground, whose edge with the ground around is rounded by a radius of 0 to 16
    /// voxels: see [`Operation::Fill`]. Without [a material](Self::with_material) it has those of the shape, or of the
    /// ground below.
    ///
    /// ```
    /// use bevy_burrow::prelude::*;
    /// use glam::Vec3;
    ///
    /// let mut terrain = Terrain::new(Ground::flat(64, 64, 10.0)?, &TerrainSettings::default())?;
    /// // A pillar with a wide foot, and a hole with a rounded rim.
    /// let pillar = Shape::cylinder(Vec3::new(20.0, 6.0, 20.0), Vec3::Y * 20.0, 3.0);
    /// let hole = Shape::sphere(Vec3::new(44.0, 9.0, 44.0), 6.0);
    /// terrain.apply([Brush::fill(pillar, 4.0), Brush::carve(hole, 2.0)]);
    /// assert!(terrain.world().is_solid(Vec3::new(24.0, 10.5, 20.0).as_dvec3()));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn fill(shape: impl Into<AnyShape>, rounding: f32) -> Self {
        Self::new(shape, Operation::Fill).with_falloff(rounding)
    }

    /// A brush that removes ground and rounds the rim of the hole, by a radius of 0 to 16 voxels: see
    /// [`Operation::Carve`].
    pub fn carve(shape: impl Into<AnyShape>, rounding: f32) -> Self {
        Self::new(shape, Operation::Carve).with_falloff(rounding)
    }

    /// A brush that returns the ground in its shape to what it was before any edit.
    pub fn reset(shape: impl Into<AnyShape>) -> Self {
        Self::new(shape, Operation::Reset)
    }

    /// A brush that builds a road along a corridor's path, as wide as the corridor, with shoulders on both sides that
    /// slope back to the ground over `shoulder` voxels (0 to 64). See [`Operation::Road`].
    ///
    /// ```
    /// use bevy_burrow::prelude::*;
    /// use glam::Vec3;
    ///
    /// let ground = Ground::from_fn(64, 64, |x, _| 20.0 + f64::from(x % 16) * 0.5)?;
    /// let mut terrain = Terrain::new(ground, &TerrainSettings::default())?;
    /// let path = BrushPath::polyline([4.0, 60.0].map(|x| (Vec3::new(x, 23.0, 32.0), 2.5)));
    /// let road = Corridor::new(path, 8.0, 6.0);
    /// // The road, and its pavement.
    /// let receipts = terrain.apply([Brush::road(road.clone(), 3.0), Brush::paint(road, MaterialId(2))]);
    /// assert!(receipts.iter().all(|receipt| receipt.outcome.is_ok()));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn road(corridor: Corridor, shoulder: f32) -> Self {
        // A shoulder that is not a number is refused as a falloff.
        let path = corridor.path.widened(if shoulder > 0.0 { shoulder } else { 0.0 });
        Self::new(Corridor { path, ..corridor }, Operation::Road).with_falloff(shoulder)
    }

    /// A brush that pastes a prefab, all of it.
    pub fn paste(paste: Paste) -> Self {
        Self::new(paste.shape(), Operation::Paste { paste })
    }

    /// The brush with another strength, if it sculpts: 0 to 1.
    #[must_use]
    pub fn with_strength(self, strength: f32) -> Self {
        Self { blend: Blend { strength, ..self.blend }, ..self }
    }

    /// The brush with another falloff, if it sculpts: its change fades in over this many voxels.
    #[must_use]
    pub fn with_falloff(self, falloff: f32) -> Self {
        Self { blend: Blend { falloff, ..self.blend }, ..self }
    }

    /// The brush with a material for the ground that it builds, if it sculpts.
    #[must_use]
    pub fn with_material(self, material: MaterialId) -> Self {
        Self { blend: Blend { material: Some(material), ..self.blend }, ..self }
    }

    /// The brush with less than full power: materials that are harder by the terrain's rules take longer, or can't be
    /// dug.
    #[must_use]
    pub fn with_power(self, power: u8) -> Self {
        Self { power, ..self }
    }

    /// The brush with bumps on its surface.
    #[must_use]
    pub fn with_roughness(self, roughness: Roughness) -> Self {
        Self { roughness: Some(roughness), ..self }
    }

    /// The brush with a number that the game chooses; the receipt returns it.
    #[must_use]
    pub fn with_tag(self, tag: u64) -> Self {
        Self { tag, ..self }
    }

    /// The brush as part of a stroke, identified by any number that the game chooses: see [`stroke`](Self::stroke).
    #[must_use]
    pub fn with_stroke(self, stroke: u64) -> Self {
        Self { stroke: Some(stroke), ..self }
    }

    /// The brush after every point p moved to `rotation * (p * scale) + translation`: for example from world
    /// space to terrain space. Sizes and roughness grow with `scale`, which should be positive; the axes of the
    /// roughness pattern stay those of the lattice.
    ///
    /// `rotation` should have length 1. Other numbers give a brush that [`Edit::quantize`](super::Edit::quantize)
    /// refuses or that is deformed.
    #[must_use]
    pub fn transformed(&self, rotation: Quat, translation: Vec3, scale: f32) -> Self {
        self.moved(rotation, Shift::by(translation), scale)
    }

    fn moved(&self, rotation: Quat, shift: Shift, scale: f32) -> Self {
        let custom = self.custom.as_ref().map(|custom| Arc::new(custom.transformed(rotation, shift, scale)));
        Self {
            shape: match &custom {
                Some(custom) => custom.around(),
                None => self.shape.transformed(rotation, shift, scale),
            },
            custom,
            operation: self.operation.transformed(rotation, shift, scale),
            roughness: self.roughness.map(|roughness| Roughness {
                amplitude: roughness.amplitude * scale,
                scale: roughness.scale * scale,
                origin: shift.point(rotation * (roughness.origin * scale)),
                ..roughness
            }),
            tag: self.tag,
            stroke: self.stroke,
            blend: Blend { falloff: self.blend.falloff * scale, ..self.blend },
            power: self.power,
        }
    }

    /// The brush in the space of a terrain that is scaled evenly and then rotated and moved. Terrains of equal scale
    /// and rotation that lie whole voxels apart get brushes that differ by exactly that.
    #[cfg(any(test, feature = "plugin"))]
    pub(crate) fn placed_in(&self, scale: f32, rotation: Quat, translation: Vec3) -> Self {
        let (rotation, scale) = (rotation.inverse(), scale.recip());
        self.moved(rotation, Shift::into_voxels(rotation * -translation * scale), scale)
    }

    /// The brush in the space of a terrain that a parent stretches: points are transformed exactly, and sizes, which
    /// have no direction, are scaled by the cube root of the change in volume. `rotation` is that of `matrix`.
    #[cfg(feature = "plugin")]
    pub(crate) fn placed_in_stretched(&self, matrix: Mat3A, rotation: Quat, translation: Vec3) -> Self {
        let scale = matrix.determinant().abs().cbrt();
        let (back, by) = (rotation.inverse(), scale.recip());
        // The space in between does not belong to a terrain: nothing is rounded there.
        let mut brush = self.moved(back, Shift::by(back * -translation * by), by);
        // The rest of the transform into the terrain.
        let rest = matrix.inverse() * Mat3A::from_quat(rotation) * scale;
        brush.custom = brush.custom.map(|custom| Arc::new(custom.stretched(|arrow| rest * arrow)));
        brush.shape = match &brush.custom {
            Some(custom) => custom.around(),
            None => brush.shape.stretched(|arrow| rest * arrow),
        };
        brush.operation.stretch(rest);
        if let Some(roughness) = &mut brush.roughness {
            roughness.origin = rest * roughness.origin;
        }
        brush
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brush::shapes::Cone;

    #[test]
    fn transforming_moves_points_turns_axes_and_scales_sizes() {
        let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
        let brush = Brush::dig(Shape::cone(Vec3::X, Vec3::X, 3.0))
            .with_tag(7)
            .with_roughness(Roughness::new(1.0, 4.0, 9));
        let moved = brush.transformed(turn, Vec3::splat(10.0), 2.0);
        let Shape::Cone(Cone { base, axis, radius }) = moved.shape else { panic!("still a cone") };
        assert!(base.abs_diff_eq(Vec3::new(10.0, 12.0, 10.0), 1e-5), "{base}");
        assert!(axis.abs_diff_eq(Vec3::new(0.0, 2.0, 0.0), 1e-5), "{axis}");
        assert_eq!((radius, moved.tag), (6.0, 7));
        assert_eq!(moved.roughness, Some(Roughness::new(2.0, 8.0, 9).with_origin(Vec3::splat(10.0))));
    }

    #[test]
    fn neighbouring_terrains_get_the_same_brush() {
        let mut rng = fastrand::Rng::with_seed(8);
        let mut compared = 0;
        let mut place = |most: f32| Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5) * most;
        for voxel in [0.125, 0.5, 1.0, 4.0] {
            for _ in 0..400 {
                let (at, first) = (place(300.0), place(9000.0));
                let apart = (place(4000.0) / voxel).round() * voxel;
                // As far as floats allow, the terrains lie whole voxels apart.
                let corners = [first, first + apart];
                if corners[1].as_dvec3() - corners[0].as_dvec3() != apart.as_dvec3() {
                    continue;
                }
                let brush = Brush::level(Shape::capsule(at, at + place(9.0), 2.0), at.y)
                    .with_roughness(Roughness::new(1.0, 4.0, 3));
                let edits = corners
                    .map(|corner| brush.placed_in(voxel, Quat::IDENTITY, corner))
                    .map(|brush| super::super::Edit::quantize(&brush));
                // With small voxels it may lie too far away.
                let [Ok(own), Ok(other)] = edits else { continue };
                compared += 1;
                let back = Brush::from(&other).transformed(Quat::IDENTITY, apart / voxel, 1.0);
                assert_eq!(super::super::Edit::quantize(&back).unwrap(), own, "{at} in {first} and {apart}");
            }
        }
        assert!(compared > 400, "{compared}");
    }
}
