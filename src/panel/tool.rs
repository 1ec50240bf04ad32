//! The current brush: the panel's left column sets it, and games read it.

use std::ops::RangeInclusive;

use bevy::prelude::*;

use super::lengths::RADIUS;
use super::texts;
pub use super::tool_content::{StampImage, ToolModel, ToolPrefab};
use super::tool_operation::ToolOperation;
use crate::brush::{
    Brush, BrushPath, Corridor, FULL_POWER, GridShape, Operation, Paste, PrefabError, Roughness, Shape,
};
use crate::ground::MaterialId;
use crate::lattice::LatticeBox;
use crate::plugin::TerrainHit;
use crate::terrain::Terrain;

/// The current brush, in metres of world space. The panel and the game may change it. A size that
/// the game sets is not clamped: a brush with one that is out of range is rejected. The game turns it into
/// brushes:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// # use bevy_burrow::panel::{BrushTool, pointer_is_free};
/// fn sculpt(tool: Res<BrushTool>, terrains: Terrains, eye: Single<&Transform, With<Camera>>, mut brushes: MessageWriter<Brush>) {
///     if let Some(hit) = terrains.raycast(Ray3d::new(eye.translation, eye.forward()), 200.0) {
///         brushes.write(tool.brush_at(&hit));
///     }
/// }
/// # App::new().add_systems(Update, sculpt.before(BurrowSystems::Collect).run_if(pointer_is_free));
/// ```
#[derive(Resource, Reflect, Clone, Debug, PartialEq)]
#[reflect(Resource, Default)]
pub struct BrushTool {
    /// The operation.
    pub operation: ToolOperation,
    /// The shape.
    pub shape: ToolShape,
    /// Radius of all shapes except boxes. For a torus, the distance from its centre to the centre of the tube.
    pub radius: f32,
    /// Radius of a torus's tube, limited to `radius`.
    pub tube: f32,
    /// Half extents of a box.
    pub half: Vec3,
    /// Length of cylinders and cones. For capsules, the distance between the centres of the two ends.
    pub length: f32,
    /// The direction of its axis.
    pub align: ToolAlign,
    /// Rotation about its axis in degrees. Only affects boxes, models, stamps and what is pasted.
    pub turn: f32,
    /// How deep it is placed: at -1 it rests on the ground, at 0 its centre is on the surface, at 1 it is just
    /// below the surface.
    pub sink: f32,
    /// The [`MaterialId`] to add or paint.
    pub material: u8,
    /// Whether ground that sculpting adds also has that material, instead of the one below.
    pub is_of_material: bool,
    /// Sculpting only: strength of one stroke, 0 to 1.
    pub strength: f32,
    /// Sculpting only: width in metres over which the effect fades in, from the border inwards.
    pub falloff: f32,
    /// Radius in metres of the edges of what is merged or carved.
    pub rounding: f32,
    /// Metres to raise or lower, or the height of a stamp.
    pub amount: f32,
    /// Target height for levelling, in metres of world space.
    pub level: f32,
    /// Height of terraces, in metres.
    pub step: f32,
    /// The image for stamping.
    #[reflect(ignore)]
    pub stamp: StampImage,
    /// The shape of [`ToolShape::Model`].
    #[reflect(ignore)]
    pub model: ToolModel,
    /// What is pasted.
    #[reflect(ignore)]
    pub prefab: ToolPrefab,
    /// Whether pastes are mirrored.
    pub is_mirrored: bool,
    /// The points of a path that are set already, in world space; a brush adds its own place as the last one. At most
    /// [`PATH_POINTS`].
    pub points: Vec<Vec3>,
    /// Whether a path is a curve without kinks.
    pub is_smooth: bool,
    /// Power against the hardness of materials, see [`Brush::power`]; 255 digs everything.
    pub power: u8,
    /// Whether its surface is rough.
    pub is_rough: bool,
    /// Height of the bumps, in metres.
    pub bump: f32,
    /// Width of the bumps, in metres.
    pub bump_width: f32,
    /// Seed of the bumps.
    pub seed: u32,
    /// Brushes per second while a button is held. The game's timer uses it.
    pub rate: f32,
}

impl Default for BrushTool {
    fn default() -> Self {
        Self {
            operation: ToolOperation::Dig,
            shape: ToolShape::Sphere,
            radius: 4.0,
            tube: 1.2,
            half: Vec3::splat(4.0),
            length: 8.0,
            align: ToolAlign::Upright,
            turn: 0.0,
            sink: 0.0,
            material: 0,
            is_of_material: false,
            strength: 0.6,
            falloff: 3.0,
            rounding: 2.0,
            amount: 2.0,
            level: 0.0,
            step: 4.0,
            stamp: StampImage::default(),
            model: ToolModel::default(),
            prefab: ToolPrefab::default(),
            is_mirrored: false,
            points: Vec::new(),
            is_smooth: true,
            power: FULL_POWER,
            is_rough: false,
            bump: 0.5,
            bump_width: 4.0,
            seed: 1,
            rate: 8.0,
        }
    }
}

/// The maximum number of points that a path of a [`BrushTool`] has before its last one.
pub const PATH_POINTS: usize = 255;

/// The shape of a [`BrushTool`].
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Default)]
pub enum ToolShape {
    /// A ball.
    #[default]
    Sphere,
    /// A box.
    Box,
    /// A cylinder with flat ends.
    Cylinder,
    /// A cylinder with round ends.
    Capsule,
    /// A cone on its base.
    Cone,
    /// A ring.
    Torus,
    /// A tube through [points](BrushTool::points).
    Path,
    /// Any form: [`BrushTool::model`], as wide as its longest side is.
    Model,
}

/// The direction of a [`BrushTool`]'s axis.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Default)]
pub enum ToolAlign {
    /// Straight up.
    #[default]
    Upright,
    /// Along the normal of the ground.
    Surface,
}

impl ToolShape {
    /// All shapes, in the panel's order.
    pub const ALL: [Self; 8] = [
        Self::Sphere,
        Self::Box,
        Self::Cylinder,
        Self::Capsule,
        Self::Cone,
        Self::Torus,
        Self::Path,
        Self::Model,
    ];

    /// Whether `length` applies.
    pub fn is_long(self) -> bool {
        matches!(self, Self::Cylinder | Self::Capsule | Self::Cone)
    }
}

impl BrushTool {
    /// The brush for a position on the ground, in world space.
    pub fn brush_at(&self, hit: &TerrainHit) -> Brush {
        let row = self.operation.row();
        let operation = row.operation(self, hit);
        let mut brush = match (&operation, self.fitting_shape()) {
            (Operation::Road, _) => {
                let along = Corridor::new(self.path_to(self.middle(hit)), self.length, self.length);
                Brush::road(along, self.falloff)
            }
            (Operation::Paste { paste }, _) => Brush::paste(paste.clone()),
            (_, ToolShape::Path) => Brush::dig(self.path_to(self.middle(hit))),
            (_, ToolShape::Model) => match self.model_at(hit) {
                Some(model) => Brush::dig(model),
                None => Brush::dig(self.shape_at(hit)),
            },
            _ => Brush::dig(self.shape_at(hit)),
        };
        brush.operation = operation;
        brush.roughness = self.roughness();
        brush.power = self.power;
        if !row.may_fill() {
            return if row.rounds() { brush.with_falloff(self.rounding) } else { brush };
        }
        let brush = if row.rounds() {
            brush.with_falloff(self.rounding)
        } else {
            brush.with_strength(self.strength).with_falloff(self.falloff)
        };
        if self.is_of_material { brush.with_material(self.material_id()) } else { brush }
    }

    /// Its model at a position.
    fn model_at(&self, hit: &TerrainHit) -> Option<GridShape> {
        self.model.shape(self.middle(hit), self.rotation(hit), self.radius)
    }

    /// The brush along the points of its path, which are forgotten. `None` without points.
    pub fn finish_path(&mut self) -> Option<Brush> {
        let hit = hit_at(self.points.pop()?, Vec3::Y);
        // Points are where the middle of the brush is.
        let brush = Self { sink: 0.0, ..self.clone() }.brush_at(&hit);
        self.points.clear();
        Some(brush)
    }

    /// Adds a point to its path, where the middle of a brush would be.
    pub fn add_point(&mut self, hit: &TerrainHit) {
        if self.points.len() < PATH_POINTS {
            self.points.push(self.middle(hit));
        }
    }

    /// The middle of the brush at a position.
    fn middle(&self, hit: &TerrainHit) -> Vec3 {
        hit.position - self.axis(hit) * self.sink * self.reach()
    }

    /// The path through its points to a last one. A single point makes a short one.
    fn path_to(&self, end: Vec3) -> BrushPath {
        let mut points: Vec<Vec3> = self.points.iter().copied().take(PATH_POINTS).collect();
        if points.is_empty() {
            points.push(end - Vec3::X * 0.1 * self.radius);
        }
        points.push(end);
        let points = points.into_iter().map(|point| (point, self.radius));
        if self.is_smooth { BrushPath::spline(points) } else { BrushPath::polyline(points) }
    }

    /// What is pasted at a position, with its anchor there: exactly, if it is upright, turned by quarter turns, and pasted on a terrain
    /// with voxels of the same size at whole multiples of it.
    pub(super) fn paste_at(&self, hit: &TerrainHit) -> Option<Paste> {
        let (prefab, voxel) = (self.prefab.prefab()?, self.prefab.voxel_size);
        let place = (hit.position / voxel).round() * voxel;
        Some(Paste {
            scale: voxel,
            mirror: self.is_mirrored,
            edited_only: self.prefab.is_edits_only,
            ..Paste::new(prefab, place).rotated(self.rotation(hit) * self.prefab.rotation)
        })
    }

    /// Copies what lies in its shape, around a position, to be pasted.
    ///
    /// # Errors
    /// As [`World::copy`](crate::terrain::World::copy): when it is too large, or not in the world.
    pub fn copy(
        &mut self,
        terrain: &Terrain,
        place: &GlobalTransform,
        hit: &TerrainHit,
    ) -> Result<(), PrefabError> {
        let to_voxels = place.affine().inverse();
        let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
        self.shape_at(hit).outline(|from, to| {
            for at in [from, to].map(|at| to_voxels.transform_point3(at)) {
                (low, high) = (low.min(at), high.max(at));
            }
        });
        let samples = LatticeBox { min: low.floor().as_ivec3(), max: high.ceil().as_ivec3() };
        let anchor = to_voxels.transform_point3(hit.position).round().as_ivec3();
        let prefab = terrain.world().copy(samples, anchor)?;
        self.prefab = ToolPrefab {
            name: Some(texts::COPIED.into()),
            rotation: place.rotation(),
            is_edits_only: self.prefab.is_edits_only,
            ..ToolPrefab::new(prefab, place.scale().x.abs())
        };
        self.operation = ToolOperation::Paste;
        Ok(())
    }

    /// The shape of [`brush_at`](Self::brush_at), for a preview.
    ///
    /// For a path, a ball at its end; for a model, the box around it.
    pub fn shape_at(&self, hit: &TerrainHit) -> Shape {
        let paste = self.paste_at(hit).filter(|_| self.operation == ToolOperation::Paste);
        paste.map_or_else(|| self.shape_around(self.middle(hit), self.axis(hit)), |paste| paste.shape())
    }

    /// The shape that its operation has: the chosen one if it [fits](ToolOperation::fits), else the first that does.
    pub fn fitting_shape(&self) -> ToolShape {
        let fits = |shape: &ToolShape| self.operation.fits(*shape);
        let first = ToolShape::ALL.into_iter().find(fits).unwrap_or_default();
        if fits(&self.shape) { self.shape } else { first }
    }

    /// The height of a stamp above the ground at a place in its square, for a preview: `u` and `v` go from -1 to 1.
    /// `None` for other operations.
    pub fn stamp_height(&self, u: f32, v: f32) -> Option<f32> {
        let image = self.stamp.image().filter(|_| self.operation == ToolOperation::Stamp)?;
        let at = |part: f32, samples: u32| {
            ((0.5 + 0.5 * part.clamp(-1.0, 1.0)) * (samples - 1) as f32).round() as usize
        };
        let sample = at(v, image.height()) * image.width() as usize + at(u, image.width());
        Some(f32::from(*image.samples().get(sample)?) / f32::from(u16::MAX) * self.amount)
    }

    /// The shape around its centre.
    pub(super) fn shape_around(&self, middle: Vec3, axis: Vec3) -> Shape {
        let end = middle - axis * self.length / 2.0;
        match self.fitting_shape() {
            ToolShape::Sphere | ToolShape::Path => Shape::sphere(middle, self.radius),
            ToolShape::Box => Shape::turned_cuboid(middle, self.half, self.turned(axis)),
            ToolShape::Model => Shape::turned_cuboid(middle, self.model.half(self.radius), self.turned(axis)),
            ToolShape::Cylinder => Shape::cylinder(end, axis * self.length, self.radius),
            ToolShape::Capsule => Shape::capsule(end, end + axis * self.length, self.radius),
            ToolShape::Cone => Shape::cone(end, axis * self.length, self.radius),
            ToolShape::Torus => Shape::torus(middle, axis, self.radius, self.tube.min(self.radius)),
        }
    }

    /// How the brush is turned at a position: from upright to its axis, and about it.
    pub fn rotation(&self, hit: &TerrainHit) -> Quat {
        self.turned(self.axis(hit))
    }

    fn turned(&self, axis: Vec3) -> Quat {
        Quat::from_rotation_arc(Vec3::Y, axis) * Quat::from_rotation_y(self.turn.to_radians())
    }

    /// The direction of its axis at this position.
    pub(super) fn axis(&self, hit: &TerrainHit) -> Vec3 {
        match self.align {
            ToolAlign::Upright => Vec3::Y,
            ToolAlign::Surface => hit.normal.try_normalize().unwrap_or(Vec3::Y),
        }
    }

    /// Half of its largest horizontal extent.
    pub fn width(&self) -> f32 {
        let half = match self.fitting_shape() {
            _ if self.operation == ToolOperation::Paste => self.prefab.half(),
            ToolShape::Box => self.half,
            ToolShape::Model => self.model.half(self.radius),
            ToolShape::Torus => Vec3::splat(self.radius + self.tube.min(self.radius)),
            _ => Vec3::splat(self.radius),
        };
        half.x.max(half.z)
    }

    /// The material to add or paint.
    pub fn material_id(&self) -> MaterialId {
        MaterialId(self.material)
    }

    /// The roughness of its surface, if any.
    pub fn roughness(&self) -> Option<Roughness> {
        self.is_rough.then(|| Roughness::new(self.bump, self.bump_width, self.seed))
    }

    /// Half extent along its axis.
    fn reach(&self) -> f32 {
        match self.fitting_shape() {
            ToolShape::Sphere | ToolShape::Path => self.radius,
            ToolShape::Box => self.half.y,
            ToolShape::Model => self.model.half(self.radius).y,
            ToolShape::Cylinder | ToolShape::Cone => self.length / 2.0,
            ToolShape::Capsule => self.length / 2.0 + self.radius,
            ToolShape::Torus => self.tube.min(self.radius),
        }
    }

    /// The radii that its shape may have.
    pub(super) fn radii(&self, voxel_size: f32) -> RangeInclusive<f32> {
        let range = RADIUS.range(voxel_size);
        let is_model = self.fitting_shape() == ToolShape::Model;
        let least = if is_model { self.model.least_radius() * voxel_size } else { 0.0 };
        range.start().max(least)..=range.end().max(least)
    }

    /// Scales its radius, or the size of a box, within the range of the panel's sliders for this voxel size. Useful
    /// for a mouse wheel.
    pub fn grow(&mut self, factor: f32, voxel_size: f32) {
        let range = self.radii(voxel_size);
        let grow = |size: f32| (size * factor).clamp(*range.start(), *range.end());
        match self.fitting_shape() {
            ToolShape::Box => self.half = self.half.map(grow),
            _ => self.radius = grow(self.radius),
        }
    }
}

/// A hit of no terrain.
fn hit_at(position: Vec3, normal: Vec3) -> TerrainHit {
    TerrainHit {
        terrain: Entity::PLACEHOLDER,
        distance: 0.0,
        position,
        normal,
        material: MaterialId::default(),
        from_inside: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brush::shapes::Cylinder;
    use crate::brush::{Edit, Operation, ShapeGrid};
    use crate::ground::GreyImage;

    fn hit() -> TerrainHit {
        TerrainHit {
            terrain: Entity::PLACEHOLDER,
            distance: 9.0,
            position: Vec3::new(10.0, 20.0, 30.0),
            normal: Vec3::X,
            material: MaterialId(1),
            from_inside: false,
        }
    }

    #[test]
    fn every_setting_reaches_the_brush() {
        let tool = BrushTool::default();
        assert_eq!(tool.brush_at(&hit()), Brush::dig(Shape::sphere(hit().position, 4.0)));

        let tool = BrushTool {
            operation: ToolOperation::Add,
            shape: ToolShape::Cylinder,
            align: ToolAlign::Surface,
            length: 6.0,
            radius: 2.0,
            sink: 1.0,
            material: 7,
            is_rough: true,
            bump: 0.25,
            bump_width: 3.0,
            seed: 9,
            ..BrushTool::default()
        };
        let brush = tool.brush_at(&hit());
        // It is completely in the ground: its far end is where the ray hit the surface.
        let Shape::Cylinder(Cylinder { base, axis, radius }) = brush.shape else { panic!("a cylinder") };
        assert_eq!((base, axis, radius), (Vec3::new(4.0, 20.0, 30.0), Vec3::X * 6.0, 2.0));
        assert_eq!(brush.operation, Operation::Add { material: MaterialId(7) });
        assert_eq!(brush.roughness, Some(Roughness::new(0.25, 3.0, 9)));
    }

    #[test]
    fn sculpting_leaves_materials_alone_unless_told_otherwise() {
        let tool = BrushTool { operation: ToolOperation::Raise, material: 7, ..BrushTool::default() };
        assert_eq!(tool.brush_at(&hit()).blend.material, None);
        let tool = BrushTool { is_of_material: true, ..tool };
        assert_eq!(tool.brush_at(&hit()).blend.material, Some(MaterialId(7)));
    }

    #[test]
    fn each_shape_is_pushed_in_by_its_own_depth() {
        for shape in ToolShape::ALL {
            for (sink, highest) in [(1.0, 20.0), (0.0, 23.0), (-1.0, 26.0)] {
                let tool =
                    BrushTool { shape, sink, radius: 3.0, half: Vec3::splat(3.0), ..BrushTool::default() };
                let tool = match shape {
                    ToolShape::Capsule => BrushTool { radius: 1.0, length: 4.0, ..tool },
                    ToolShape::Torus => BrushTool { tube: 3.0, ..tool },
                    _ => BrushTool { length: 6.0, ..tool },
                };
                let mut top = f32::MIN;
                tool.shape_at(&hit()).outline(|from, to| top = top.max(from.y).max(to.y));
                assert!((top - highest).abs() < 1e-4, "{shape:?} {sink}: {top}");
            }
        }
    }

    #[test]
    fn every_operation_and_shape_makes_a_valid_edit() {
        for row in super::super::operations::OPERATIONS {
            for shape in ToolShape::ALL {
                for align in [ToolAlign::Upright, ToolAlign::Surface] {
                    let tool = BrushTool { operation: row.tool, shape, align, ..BrushTool::default() };
                    let brush = tool.brush_at(&hit());
                    assert!(Edit::quantize(&brush).is_ok(), "{tool:?}: {:?}", Edit::quantize(&brush));
                }
            }
        }
    }

    #[test]
    fn a_path_is_one_brush_through_its_points() {
        let at = |x: f32| TerrainHit { position: Vec3::new(x, 20.0, 30.0), normal: Vec3::Y, ..hit() };
        for (operation, sink) in [(ToolOperation::Dig, 0.5), (ToolOperation::Road, 0.0)] {
            let mut tool =
                BrushTool { operation, shape: ToolShape::Path, sink, radius: 2.0, ..BrushTool::default() };
            assert_eq!(tool.finish_path(), None);
            tool.add_point(&at(0.0));
            tool.add_point(&at(10.0));
            let shown = tool.brush_at(&at(20.0));
            tool.add_point(&at(20.0));
            assert_eq!(tool.finish_path().as_ref(), Some(&shown), "the preview is the edit");
            assert!(tool.points.is_empty() && Edit::quantize(&shown).is_ok());
            let straight = BrushTool { is_smooth: false, ..tool.clone() };
            assert_ne!(straight.brush_at(&at(20.0)), tool.brush_at(&at(20.0)));
        }
        let mut tool = BrushTool { shape: ToolShape::Path, ..BrushTool::default() };
        (0..400).for_each(|x| tool.add_point(&at(x as f32)));
        assert!(Edit::quantize(&tool.brush_at(&at(400.0))).is_ok());
        assert!(tool.finish_path().is_some_and(|brush| Edit::quantize(&brush).is_ok()));
    }

    #[test]
    fn what_is_copied_is_pasted_as_it_was() {
        let ground = crate::ground::Ground::flat(64, 64, 20.0).expect("valid");
        let mut terrain = Terrain::new(ground, &crate::terrain::TerrainSettings::default()).expect("valid");
        terrain.apply([Brush::add(
            Shape::cuboid(Vec3::new(16.0, 22.0, 16.0), Vec3::new(2.0, 3.0, 2.0)),
            MaterialId(5),
        )]);
        let at = |x: f32| TerrainHit { position: Vec3::new(x, 20.0, 16.0), ..hit() };
        let mut tool = BrushTool { shape: ToolShape::Box, half: Vec3::splat(8.0), ..BrushTool::default() };
        tool.copy(&terrain, &GlobalTransform::IDENTITY, &at(16.0)).expect("it is in the world");
        assert_eq!(tool.operation, ToolOperation::Paste);
        let receipts = terrain.apply([tool.brush_at(&at(40.2))]);
        assert!(receipts.iter().all(|receipt| receipt.outcome.is_ok()), "{receipts:?}");
        let solid = |x: f64| terrain.world().is_solid(bevy::math::DVec3::new(x, 23.0, 16.0));
        assert!(solid(16.0) && solid(40.0) && !solid(28.0));
        let kept = tool.prefab.clone();
        assert!(tool.copy(&terrain, &GlobalTransform::IDENTITY, &at(-900.0)).is_err());
        assert_eq!(tool.prefab, kept, "an error changes nothing");
    }

    #[test]
    fn a_hut_can_be_entered() {
        let ground = crate::ground::Ground::flat(64, 64, 20.0).expect("valid");
        let mut terrain = Terrain::new(ground, &crate::terrain::TerrainSettings::default()).expect("valid");
        let tool = BrushTool { operation: ToolOperation::Paste, ..BrushTool::default() };
        let hit = TerrainHit { position: Vec3::new(32.0, 20.0, 32.0), normal: Vec3::Y, ..hit() };
        let receipts = terrain.apply([tool.brush_at(&hit)]);
        assert!(receipts.iter().all(|receipt| receipt.outcome.is_ok()), "{receipts:?}");
        let solid = |x: f64, y: f64, z: f64| terrain.world().is_solid(bevy::math::DVec3::new(x, y, z));
        assert!(solid(28.0, 23.0, 32.0) && solid(32.0, 26.0, 32.0), "walls and a roof");
        assert!(!solid(32.0, 22.0, 32.0) && !solid(32.0, 22.0, 28.0), "a room and a door");
    }

    #[test]
    fn what_is_stamped_has_a_name() {
        let image = GreyImage::from_samples(3, 2, vec![0; 6]).expect("six samples");
        let named = StampImage::new("Dunes", image);
        let unnamed = StampImage { name: None, ..named.clone() };
        let labels = [&StampImage::default(), &named, &unnamed].map(StampImage::label);
        assert_eq!(labels, ["Ridge", "Dunes", "3 x 2 samples"]);
    }

    #[test]
    fn a_stamp_is_no_ring() {
        let ring = BrushTool { shape: ToolShape::Torus, ..BrushTool::default() };
        let stamp = BrushTool { operation: ToolOperation::Stamp, ..ring.clone() };
        assert!(matches!(ring.shape_at(&hit()), Shape::Torus(_)));
        assert_eq!(stamp.shape_at(&hit()), Shape::sphere(hit().position, ring.radius));
        // The shape is not forgotten.
        assert_eq!(BrushTool { operation: ToolOperation::Dig, ..stamp }, ring);
    }

    #[test]
    fn the_preview_of_a_stamp_is_as_high_as_its_image() {
        let image = GreyImage::from_samples(2, 2, vec![0, u16::MAX, 0, 0]).expect("four samples");
        let tool = BrushTool {
            operation: ToolOperation::Stamp,
            stamp: StampImage::new("step", image),
            amount: 3.0,
            ..BrushTool::default()
        };
        let heights = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)].map(|(u, v)| tool.stamp_height(u, v));
        assert_eq!(heights, [Some(0.0), Some(3.0), Some(0.0)]);
        assert_eq!(BrushTool::default().stamp_height(0.0, 0.0), None);
    }

    #[test]
    fn growing_has_ends() {
        for (shape, voxel) in ToolShape::ALL.into_iter().flat_map(|shape| [(shape, 0.125), (shape, 8.0)]) {
            let mut tool = BrushTool { shape, ..BrushTool::default() };
            (0..100).for_each(|_| tool.grow(1.5, voxel));
            let most = if shape == ToolShape::Box { tool.half.x } else { tool.radius };
            (0..200).for_each(|_| tool.grow(0.5, voxel));
            let least = if shape == ToolShape::Box { tool.half.x } else { tool.radius };
            assert_eq!(least..=most, tool.radii(voxel));
        }
    }

    #[test]
    fn a_copy_of_a_turned_terrain_is_pasted_as_it_lay() {
        let ground = crate::ground::Ground::flat(64, 64, 10.0).expect("valid ground");
        let terrain = Terrain::new(ground, &Default::default()).expect("valid settings");
        let turn = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
        let place = GlobalTransform::from(Transform { rotation: turn, scale: Vec3::splat(2.0), ..default() });
        let hit = TerrainHit { position: place.transform_point(Vec3::new(30.0, 10.0, 30.0)), ..hit() };
        let mut tool = BrushTool::default();
        tool.prefab.is_edits_only = false;
        tool.copy(&terrain, &place, &hit).expect("it lies in the world");
        let paste = tool.paste_at(&hit).expect("a copy");
        assert!(paste.rotation.dot(turn).abs() > 0.999_9, "{}", paste.rotation);
        assert!((paste.scale - 2.0).abs() < 1e-5 && !paste.edited_only, "{}", paste.scale);
        // The tool's own turn comes on top.
        tool.turn = -90.0;
        let paste = tool.paste_at(&hit).expect("a copy");
        assert!(paste.rotation.dot(Quat::IDENTITY).abs() > 0.999_9, "{}", paste.rotation);
    }

    #[test]
    fn a_model_of_any_size_that_is_offered_is_a_valid_brush() {
        let long = ShapeGrid::from_fn(UVec3::new(5, 9, 128), |at| (at.x - 2).abs() as f32 - 1.0);
        let models = [ToolModel::default(), ToolModel::new("long", long.expect("a grid"))];
        for (model, voxel) in models.iter().flat_map(|model| [0.125, 1.0, 8.0].map(|voxel| (model, voxel))) {
            let mut tool = BrushTool { shape: ToolShape::Model, model: model.clone(), ..default() };
            for factor in [0.0, 1e9] {
                tool.grow(factor, voxel);
                let brush = tool.brush_at(&hit());
                let shape = tool.model_at(&hit()).expect("a grid");
                let in_voxels = GridShape { scale: shape.scale / voxel, center: Vec3::ZERO, ..shape };
                assert!(
                    Edit::quantize(&Brush::dig(in_voxels)).is_ok(),
                    "{factor} with voxels of {voxel}: {brush:?}"
                );
            }
        }
    }
}
