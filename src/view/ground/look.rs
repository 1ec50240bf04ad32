//! The settings of a terrain's look.

use bevy::prelude::*;

use crate::plugin::{SkyLight, SlimVertices};

/// The maximum number of layers of a ground; ids from the last one on share it.
pub const MAX_LAYERS: usize = 16;

/// The look of a terrain's ground, whose meshes then have [`SlimVertices`]. Put it on the terrain's entity instead of a
/// material, and `GroundPlugin` creates and updates its [`GroundMaterial`](super::GroundMaterial).
///
/// A [`MaterialId`](crate::ground::MaterialId) is the number of a layer of the textures:
/// [`GroundTextures`](super::GroundTextures). Changes made before `PostUpdate` show in the same frame, on the terrain's
/// pieces too.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// # fn look(mut commands: Commands, terrain: Terrain) {
/// commands.spawn((terrain, GroundLook::default()));
/// # }
/// ```
#[derive(Component, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component, Default)]
#[require(SlimVertices, SkyLight)]
pub struct GroundLook {
    /// The layers, by number; [`MAX_LAYERS`] at most.
    pub layers: Vec<GroundLayer>,
    /// Distances from the camera in metres. Up to the first, textures have their own scale. Beyond the second, they are
    /// six times as large, and four times larger again each time that the distance grows fourfold; there, a large-scale
    /// relief is added, which fades out until 3 km.
    pub distance: (f32, f32),
    /// The strength of variations in tint, 0 to 1: from place to place, by slope in the distance, and on dug faces.
    pub variety: f32,
    /// The texture fetches per pixel.
    pub quality: GroundQuality,
    /// A picture of the whole ground that tints distant views.
    pub color_map: Option<ColorMap>,
}

/// A picture of the whole ground from above, such as a satellite image or the colour map of a terrain tool. Far from
/// the camera, layers keep their texture and take the picture's colours, except for faces that were dug.
///
/// It is stretched over the terrain: its first row lies at z = 0, and the first pixel of each row at x = 0. When its
/// file changes and Bevy's asset server watches files, the ground changes too.
#[derive(Reflect, Clone, Debug, PartialEq)]
pub struct ColorMap {
    /// The picture. Until it is loaded, the ground has the colours of its layers.
    pub image: Handle<Image>,
    /// Metres from the camera at which its colours begin to show, and at which they show fully.
    pub distance: (f32, f32),
    /// How much they show there, 0 to 1; multiplied by each layer's [`map_tint`](GroundLayer::map_tint).
    pub strength: f32,
}

impl ColorMap {
    /// The colours of a picture, from 60 to 300 metres on.
    pub fn new(image: Handle<Image>) -> Self {
        Self { image, distance: (60.0, 300.0), strength: 1.0 }
    }
}

/// A layer of the ground.
#[derive(Reflect, Clone, Debug, PartialEq)]
#[reflect(Default)]
pub struct GroundLayer {
    /// Metres that its texture covers.
    pub metres: f32,
    /// The strength of its relief: 1 as in its texture, 0 flat.
    pub relief: f32,
    /// The strength of the large-scale relief that is shown far from the camera: 1 for crags, less for smooth ground, 0
    /// for built materials. It is the relief of layer 0, or the layer's own if it has another [`top`](Self::top).
    pub broad_relief: f32,
    /// How metallic it is, 0 to 1.
    pub metallic: f32,
    /// The colour by which its colours are multiplied.
    pub tint: LinearRgba,
    /// How much a [`ColorMap`] tints it: 1 for natural ground, 0 for built materials such as bricks and placed snow.
    pub map_tint: f32,
    /// Whether its texture is cut into pieces near the camera, which hides its repetition and takes up to three times
    /// the fetches. Unsuitable for textures with a pattern, such as bricks.
    pub has_pieces: bool,
    /// The texture layer for floors and ceilings, if it differs: bedded rock shows its laminae on walls only.
    pub top: Option<u8>,
}

impl Default for GroundLayer {
    fn default() -> Self {
        Self {
            metres: 4.0,
            relief: 1.0,
            broad_relief: 0.5,
            metallic: 0.0,
            tint: LinearRgba::WHITE,
            map_tint: 1.0,
            has_pieces: true,
            top: None,
        }
    }
}

/// The texture fetches per pixel. A pixel shows its two strongest layers, each projected from the two sides that the
/// surface faces most: one on level ground.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default)]
pub enum GroundQuality {
    /// Textures visibly repeat: for weak machines and software renderers.
    Low,
    /// Textures do not visibly repeat near the camera.
    #[default]
    High,
}

impl Default for GroundLook {
    /// The look for [`GroundTextures::Baked`](super::GroundTextures::Baked).
    fn default() -> Self {
        let layer = |metres, broad_relief| GroundLayer { metres, broad_relief, ..default() };
        let bedded = |metres, top| GroundLayer { top: Some(top), ..layer(metres, 0.9) };
        let ore = |metres, metallic| GroundLayer { metallic, ..layer(metres, 0.8) };
        Self {
            layers: vec![
                layer(6.0, 1.0),
                GroundLayer { relief: 0.8, ..layer(3.0, 0.4) },
                layer(4.0, 0.35),
                layer(6.0, 0.4),
                layer(4.0, 0.5),
                GroundLayer { has_pieces: false, map_tint: 0.0, ..layer(4.0, 0.0) },
                layer(2.5, 0.8),
                ore(2.5, 0.35),
                layer(3.0, 0.5),
                bedded(5.0, 14),
                bedded(4.0, 15),
                layer(2.5, 0.7),
                ore(2.5, 0.2),
                ore(2.5, 0.25),
            ],
            distance: (48.0, 64.0),
            variety: 0.5,
            quality: GroundQuality::High,
            color_map: None,
        }
    }
}
