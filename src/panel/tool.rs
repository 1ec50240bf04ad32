//! The current brush: the panel's left column sets it, and games read it.

use std::sync::{Arc, LazyLock};

use bevy::prelude::*;

use super::lengths::RADIUS;
use super::texts;
use super::tool_operation::ToolOperation;
use crate::brush::{
    Brush, BrushPath, Corridor, FULL_POWER, Operation, Paste, Prefab, PrefabError, PrefabSample, Roughness,
    Shape,
};
use crate::ground::{GreyImage, MaterialId};
use crate::lattice::LatticeBox;
use crate::plugin::TerrainHit;
use crate::terrain::Terrain;

/// The current brush, in metres of world space. The panel and the game may change it. The game turns it into
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
    /// Rotation about its axis in degrees. Only affects boxes, stamps and what is pasted.
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
    /// Metres to raise or lower, or the height of a stamp.
    pub amount: f32,
    /// Target height for levelling, in metres of world space.
    pub level: f32,
    /// Height of terraces, in metres.
    pub step: f32,
    /// The image for stamping.
    #[reflect(ignore)]
    pub stamp: StampImage,
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
            amount: 2.0,
            level: 0.0,
            step: 4.0,
            stamp: StampImage::default(),
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

/// The image of a [`BrushTool`]'s stamp; white is high. The default is a mountain with ridges.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StampImage {
    /// Heights with 2 to 256 samples per side. Brushes with other images are rejected.
    pub image: Option<Arc<GreyImage>>,
    /// The name of the image in the panel.
    pub name: Option<Name>,
}

impl StampImage {
    /// An image with a name.
    pub fn new(name: impl Into<Name>, image: impl Into<Arc<GreyImage>>) -> Self {
        Self { image: Some(image.into()), name: Some(name.into()) }
    }

    /// The label in the panel: the image's name, or its size without one.
    pub(super) fn label(&self) -> String {
        match (&self.image, &self.name) {
            (None, _) => texts::RIDGE.into(),
            (Some(_), Some(name)) => name.to_string(),
            (Some(image), None) => format!("{} x {} samples", image.width(), image.height()),
        }
    }

    /// The image, or the default one.
    pub(super) fn image(&self) -> Option<Arc<GreyImage>> {
        self.image.clone().or_else(|| RIDGE.clone())
    }
}

/// What a [`BrushTool`] pastes. The default is a hut.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolPrefab {
    /// A piece of a world.
    pub prefab: Option<Arc<Prefab>>,
    /// Metres of a voxel where it was copied: 1/8 to 8.
    pub voxel_size: f32,
    /// Whether only samples that were edited are pasted, and not the ground around them.
    pub is_edits_only: bool,
    /// Its name in the panel.
    pub name: Option<Name>,
}

impl Default for ToolPrefab {
    fn default() -> Self {
        Self { prefab: None, voxel_size: 1.0, is_edits_only: true, name: None }
    }
}

impl ToolPrefab {
    /// A prefab that was copied from voxels of this size in metres.
    pub fn new(prefab: impl Into<Arc<Prefab>>, voxel_size: f32) -> Self {
        Self { prefab: Some(prefab.into()), voxel_size, ..Self::default() }
    }

    /// The label in the panel.
    pub(super) fn label(&self) -> String {
        match (&self.prefab, &self.name) {
            (None, _) => texts::HUT.into(),
            (Some(_), Some(name)) => name.to_string(),
            (Some(prefab), None) => {
                let [x, y, z] = prefab.size().to_array();
                format!("{x} x {y} x {z}")
            }
        }
    }

    /// The prefab, or the default one.
    fn prefab(&self) -> Option<Arc<Prefab>> {
        self.prefab.clone().or_else(|| HUT.clone())
    }
}

/// A hut of concrete with a door, 9 x 6 x 9 voxels, on its anchor.
static HUT: LazyLock<Option<Arc<Prefab>>> = LazyLock::new(|| {
    const SIZE: IVec3 = IVec3::new(11, 8, 11);
    let sample = |at: IVec3| {
        // Voxels inside a box around the middle of the floor.
        let within = |at: IVec3, half: i32, height: i32| {
            let side = (at.x - 5).abs().max((at.z - 5).abs());
            (side as f32 - (half as f32 + 0.5))
                .max(at.y as f32 - (height as f32 + 0.5))
                .max(-0.5 - at.y as f32)
        };
        let door = ((at.x - 5).abs() as f32 - 1.5).max(at.y as f32 - 4.5).max(at.z as f32 - 4.5);
        let room = within(at, 3, 5).min(door);
        let depth = within(at, 4, 6).max(-room);
        PrefabSample {
            density: (depth * 256.0) as i16,
            material: if depth < 0.0 { MaterialId(5) } else { MaterialId::GROUND },
            is_edited: within(at, 5, 7) < 0.0,
            has_stored_material: depth < 0.0,
        }
    };
    let places = (0..SIZE.y)
        .flat_map(|y| (0..SIZE.z).flat_map(move |z| (0..SIZE.x).map(move |x| IVec3::new(x, y, z))));
    Prefab::new(SIZE, IVec3::new(5, 0, 5), 0, places.map(sample)).ok().map(Arc::new)
});

/// A mountain with three ridges.
static RIDGE: LazyLock<Option<Arc<GreyImage>>> = LazyLock::new(|| {
    const SIDE: u32 = 65;
    let height = |x: u32, z: u32| {
        let at = (Vec2::new(x as f32, z as f32) * 2.0 / (SIDE - 1) as f32) - 1.0;
        let ridge = 0.5 + 0.5 * (3.0 * at.y.atan2(at.x)).cos();
        let fall = (1.0 - at.length()).clamp(0.0, 1.0);
        (fall.powf(1.6 - 0.8 * ridge) * f32::from(u16::MAX)) as u16
    };
    let samples = (0..SIDE).flat_map(|z| (0..SIDE).map(move |x| height(x, z))).collect();
    GreyImage::from_samples(SIDE, SIDE, samples).ok().map(Arc::new)
});

/// Most points that a path of a [`BrushTool`] has before its last one.
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
    pub const ALL: [Self; 7] =
        [Self::Sphere, Self::Box, Self::Cylinder, Self::Capsule, Self::Cone, Self::Torus, Self::Path];

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
            _ => Brush::dig(self.shape_at(hit)),
        };
        brush.operation = operation;
        brush.roughness = self.roughness();
        brush.power = self.power;
        if !row.sculpts() {
            return brush;
        }
        let brush = brush.with_strength(self.strength).with_falloff(self.falloff);
        if self.is_of_material { brush.with_material(self.material_id()) } else { brush }
    }

    /// The brush along the points of its path, which are forgotten. `None` without points.
    pub fn finish_path(&mut self) -> Option<Brush> {
        let position = self.points.pop()?;
        let hit = TerrainHit {
            terrain: Entity::PLACEHOLDER,
            distance: 0.0,
            position,
            normal: Vec3::Y,
            material: MaterialId::default(),
            from_inside: false,
        };
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

    /// What is pasted at a position, with its anchor there: exactly, if it was copied from voxels of the same size and is turned
    /// by quarter turns.
    pub(super) fn paste_at(&self, hit: &TerrainHit) -> Option<Paste> {
        let (prefab, voxel) = (self.prefab.prefab()?, self.prefab.voxel_size);
        let place = (hit.position / voxel).round() * voxel;
        let turned = Quat::from_rotation_y(self.turn.to_radians());
        Some(Paste {
            scale: voxel,
            mirror: self.is_mirrored,
            edited_only: self.prefab.is_edits_only,
            ..Paste::new(prefab, place).rotated(turned)
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
        self.prefab =
            ToolPrefab { name: Some(texts::COPIED.into()), ..ToolPrefab::new(prefab, terrain.voxel_size()) };
        self.operation = ToolOperation::Paste;
        Ok(())
    }

    /// The shape of [`brush_at`](Self::brush_at), for a preview.
    ///
    /// For a path, a ball at its end.
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
            ToolShape::Box => {
                let turn = Quat::from_rotation_y(self.turn.to_radians());
                Shape::turned_cuboid(middle, self.half, Quat::from_rotation_arc(Vec3::Y, axis) * turn)
            }
            ToolShape::Cylinder => Shape::cylinder(end, axis * self.length, self.radius),
            ToolShape::Capsule => Shape::capsule(end, end + axis * self.length, self.radius),
            ToolShape::Cone => Shape::cone(end, axis * self.length, self.radius),
            ToolShape::Torus => Shape::torus(middle, axis, self.radius, self.tube.min(self.radius)),
        }
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
        if self.fitting_shape() == ToolShape::Box { self.half.x.max(self.half.z) } else { self.radius }
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
            ToolShape::Cylinder | ToolShape::Cone => self.length / 2.0,
            ToolShape::Capsule => self.length / 2.0 + self.radius,
            ToolShape::Torus => self.tube.min(self.radius),
        }
    }

    /// Scales its radius, or the size of a box, within the range of the panel's sliders for this voxel size. Useful
    /// for a mouse wheel.
    pub fn grow(&mut self, factor: f32, voxel_size: f32) {
        let range = RADIUS.range(voxel_size);
        let grow = |size: f32| (size * factor).clamp(*range.start(), *range.end());
        match self.fitting_shape() {
            ToolShape::Box => self.half = self.half.map(grow),
            _ => self.radius = grow(self.radius),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brush::shapes::Cylinder;
    use crate::brush::{Edit, Operation};

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
            assert_eq!(least..=most, RADIUS.range(voxel));
        }
    }
}
