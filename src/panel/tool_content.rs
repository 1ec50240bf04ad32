//! The content of a brush of the panel that is not a number: an image, a model, or a piece of a world.

use std::sync::{Arc, LazyLock};

use bevy::prelude::*;

use super::texts;
use crate::brush::{GridShape, Prefab, PrefabSample, ShapeGrid};
use crate::ground::{GreyImage, MaterialId};

/// The label of content in the panel: its name, or its size without one, or the default's name where there is none.
fn label(size: Option<String>, name: Option<&Name>, default: &str) -> String {
    match (size, name) {
        (None, _) => default.into(),
        (Some(_), Some(name)) => name.to_string(),
        (Some(size), None) => size,
    }
}

fn sides(size: UVec3) -> String {
    let [x, y, z] = size.to_array();
    format!("{x} x {y} x {z}")
}

/// The image of a [`BrushTool`](super::BrushTool)'s stamp; white is high. The default is a mountain with ridges.
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
        let size = self.image.as_ref().map(|image| format!("{} x {} samples", image.width(), image.height()));
        label(size, self.name.as_ref(), texts::RIDGE)
    }

    /// The image, or the default one.
    pub(super) fn image(&self) -> Option<Arc<GreyImage>> {
        self.image.clone().or_else(|| RIDGE.clone())
    }
}

/// A form that a [`BrushTool`](super::BrushTool) digs or builds: a closed mesh, for example. The default is a boulder.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolModel {
    /// Its distances, in a grid whose longest side becomes as long as the tool is wide.
    pub grid: Option<ShapeGrid>,
    /// Its name in the panel.
    pub name: Option<Name>,
}

impl ToolModel {
    /// A form with a name.
    pub fn new(name: impl Into<Name>, grid: ShapeGrid) -> Self {
        Self { grid: Some(grid), name: Some(name.into()) }
    }

    /// The label in the panel.
    pub(super) fn label(&self) -> String {
        label(self.grid.as_ref().map(|grid| sides(grid.size())), self.name.as_ref(), texts::BOULDER)
    }

    /// The form around its middle, with its longest side twice the radius.
    pub(super) fn shape(&self, middle: Vec3, rotation: Quat, radius: f32) -> Option<GridShape> {
        let scale = radius / self.least_radius() * LEAST_SCALE;
        Some(GridShape::new(self.grid()?, middle).with_rotation(rotation).with_scale(scale))
    }

    /// Half the sides of its grid, where the longest side is twice the radius.
    pub(super) fn half(&self, radius: f32) -> Vec3 {
        let size = self.grid().map_or(Vec3::ONE, |grid| grid.size().as_vec3() - 1.0);
        radius * size / size.max_element()
    }

    /// The least radius, in voxels.
    pub(super) fn least_radius(&self) -> f32 {
        let longest = self.grid().map_or(1, |grid| grid.size().max_element() - 1);
        longest as f32 / 2.0 * LEAST_SCALE
    }

    /// The grid, or the default one.
    fn grid(&self) -> Option<ShapeGrid> {
        self.grid.clone().or_else(|| BOULDER.clone())
    }
}

/// The minimum number of voxels between two samples of a [`GridShape`].
const LEAST_SCALE: f32 = 1.0 / 16.0;

/// A boulder with bumps, in a grid of 17 samples a side.
static BOULDER: LazyLock<Option<ShapeGrid>> = LazyLock::new(|| {
    ShapeGrid::from_fn(UVec3::splat(17), |at| {
        let at = (at - 8).as_vec3();
        let bumps = (at.x * 0.9 + 1.0).sin() + (at.y * 1.1).sin() + (at.z * 0.8 + 2.0).sin();
        at.length() - 6.0 + 0.45 * bumps
    })
    .ok()
});

/// What a [`BrushTool`](super::BrushTool) pastes. The default is a hut.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolPrefab {
    /// A piece of a world.
    pub prefab: Option<Arc<Prefab>>,
    /// Metres of a voxel where it was copied: 1/8 to 8.
    pub voxel_size: f32,
    /// How the terrain was turned from which it was copied.
    pub rotation: Quat,
    /// Whether only samples that were edited are pasted, and not the ground around them.
    pub is_edits_only: bool,
    /// Its name in the panel.
    pub name: Option<Name>,
}

impl Default for ToolPrefab {
    fn default() -> Self {
        let rotation = Quat::IDENTITY;
        Self { prefab: None, voxel_size: 1.0, rotation, is_edits_only: true, name: None }
    }
}

impl ToolPrefab {
    /// A prefab that was copied from voxels of this size in metres.
    pub fn new(prefab: impl Into<Arc<Prefab>>, voxel_size: f32) -> Self {
        Self { prefab: Some(prefab.into()), voxel_size, ..Self::default() }
    }

    /// The label in the panel.
    pub(super) fn label(&self) -> String {
        let size = self.prefab.as_ref().map(|prefab| sides(prefab.size().as_uvec3()));
        label(size, self.name.as_ref(), texts::HUT)
    }

    /// Half its sides in metres, before it is turned.
    pub(super) fn half(&self) -> Vec3 {
        let size = self.prefab().map_or(Vec3::ONE, |prefab| prefab.size().as_vec3());
        size * self.voxel_size / 2.0
    }

    /// The prefab, or the default one.
    pub(super) fn prefab(&self) -> Option<Arc<Prefab>> {
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
