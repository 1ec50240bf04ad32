//! The current brush: the panel's left column sets it, and games read it.

use bevy::prelude::*;

pub use super::tool_content::{StampImage, ToolModel, ToolPrefab};
use super::tool_operation::ToolOperation;
use crate::brush::FULL_POWER;
use crate::plugin::TerrainHit;

/// The current brush, in metres of world space. The panel and the game may change it. A size that
/// the game sets is not clamped: a brush with one that is out of range is rejected. The game turns it into
/// brushes:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// # use bevy_burrow::panel::{BrushTool, pointer_is_free};
/// fn sculpt(tool: Res<BrushTool>, terrains: Terrains, eye: Single<&Transform, With<Camera>>, mut brushes:
/// MessageWriter<Brush>) {     if let Some(hit) = terrains.raycast(Ray3d::new(eye.translation, eye.forward()), 200.0) {
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
    /// The [`MaterialId`](crate::ground::MaterialId) to add or paint.
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
    /// Where it was placed: it stays there, with handles to move, turn and scale it. Games show their preview there, and
    /// make no strokes meanwhile; [`PanelAction`](super::PanelAction) applies it. A path can't be placed.
    #[reflect(ignore)]
    pub placed: Option<TerrainHit>,
    /// The points of a path that are set already, in world space; a brush adds its own place as the last one. At most
    /// [`PATH_POINTS`].
    pub points: Vec<Vec3>,
    /// Whether a path is a curve without kinks.
    pub is_smooth: bool,
    /// Power against the hardness of materials, see [`Brush::power`](crate::brush::Brush::power); 255 digs everything.
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
            placed: None,
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
#[doc(hidden)]
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
