//! The settings of a terrain's look.

use bevy::prelude::*;

/// Most layers of a ground; ids from the last one on share it.
pub const MAX_LAYERS: usize = 16;

/// The look of a terrain's ground. Put it on the terrain's entity instead of a material, and
/// [`GroundPlugin`](super::GroundPlugin) creates and updates its [`GroundMaterial`](super::GroundMaterial).
///
/// A [`MaterialId`](crate::ground::MaterialId) is the number of a layer of the textures: [`GroundTextures`](super::GroundTextures).
/// Changes made before `PostUpdate` show in the same frame, on the terrain's pieces too.
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
pub struct GroundLook {
    /// The layers, by number; [`MAX_LAYERS`] at most.
    pub layers: Vec<GroundLayer>,
    /// The strata below the surface, which show where it is dug.
    pub strata: GroundStrata,
    /// The slopes (rise over run) at which skins such as grass and snow begin to disappear, and at which they are gone.
    pub cliffs: (f32, f32),
    /// Distances from the camera in metres: up to the first, textures have their own scale; beyond the second, six times it.
    pub distance: (f32, f32),
    /// The variation of tints from place to place, 0 to 1.
    pub variety: f32,
    /// The texture fetches per pixel.
    pub quality: GroundQuality,
}

/// A layer of the ground.
#[derive(Reflect, Clone, Debug, PartialEq)]
#[reflect(Default)]
pub struct GroundLayer {
    /// Metres that its texture covers.
    pub metres: f32,
    /// The strength of its relief: 1 as in its texture, 0 flat.
    pub relief: f32,
    /// How metallic it is, 0 to 1.
    pub metallic: f32,
    /// Its colours are multiplied by this.
    pub tint: LinearRgba,
    /// How it continues below the surface, where the ground was not built.
    pub kind: GroundLayerKind,
    /// The texture layer for floors and ceilings, if it differs: bedded rock shows its laminae on walls only.
    pub top: Option<u8>,
}

impl Default for GroundLayer {
    fn default() -> Self {
        Self {
            metres: 4.0,
            relief: 1.0,
            metallic: 0.0,
            tint: LinearRgba::WHITE,
            kind: GroundLayerKind::Body,
            top: None,
        }
    }
}

/// How a layer continues below the surface.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Default)]
pub enum GroundLayerKind {
    /// The same all the way down.
    #[default]
    Body,
    /// Only on the surface, like grass. Below, and on cliffs, the [`GroundStrata`] show.
    Skin,
    /// Replaced by the [`GroundStrata`].
    Strata,
}

/// The strata from the surface down. Layers are given by number.
#[derive(Reflect, Clone, Debug, PartialEq)]
#[reflect(Default)]
pub struct GroundStrata {
    /// The layer under grass, and how deep it reaches in metres.
    pub soil: (u8, f32),
    /// The layer below the soil, and how thick it is in metres.
    pub subsoil: (u8, f32),
    /// The beds of rock below: four layers of about equal thickness that repeat. The first one also appears as a crust on
    /// natural faces.
    pub beds: [u8; 4],
    /// The height in metres after which the beds repeat.
    pub height: f32,
    /// The amplitude by which beds are bent, in metres.
    pub bend: f32,
    /// A thin seam within the beds: its layer, its thickness in metres (0 for none), and the depth in metres where it begins.
    pub seam: (u8, f32, f32),
    /// Veins in the rock: their layer, their thickness (0 none, 1 most), and the depth in metres where they begin.
    pub vein: (u8, f32, f32),
}

impl Default for GroundStrata {
    /// Soil over clay over rock, sandstone and shale, with a seam of coal and veins of gold.
    fn default() -> Self {
        Self {
            soil: (8, 1.3),
            subsoil: (4, 1.6),
            beds: [0, 9, 0, 10],
            height: 26.0,
            bend: 5.0,
            seam: (6, 1.1, 4.0),
            vein: (7, 0.5, 6.0),
        }
    }
}

/// The texture fetches per pixel. Each layer is projected from every side that the surface faces: one on level ground, two on
/// most slopes.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default)]
pub enum GroundQuality {
    /// The two strongest layers, repeating: for weak machines and software renderers.
    Low,
    /// The three strongest layers, without repetition.
    #[default]
    High,
}

impl Default for GroundLook {
    /// The look for [`GroundTextures::Baked`](super::GroundTextures::Baked).
    fn default() -> Self {
        let layer = |metres, relief, kind| GroundLayer { metres, relief, kind, ..default() };
        let body = |metres| layer(metres, 1.0, GroundLayerKind::Body);
        let bedded = |metres, top| GroundLayer { top: Some(top), ..body(metres) };
        let gold = GroundLayer { metallic: 0.35, ..body(2.5) };
        Self {
            layers: vec![
                layer(6.0, 1.0, GroundLayerKind::Strata),
                layer(3.0, 0.8, GroundLayerKind::Skin),
                layer(4.0, 1.0, GroundLayerKind::Skin),
                layer(6.0, 1.0, GroundLayerKind::Skin),
                body(4.0),
                body(4.0),
                body(2.5),
                gold,
                body(3.0),
                bedded(5.0, 12),
                bedded(4.0, 13),
                body(2.5),
            ],
            strata: GroundStrata::default(),
            cliffs: (0.9, 1.5),
            distance: (35.0, 80.0),
            variety: 0.5,
            quality: GroundQuality::High,
        }
    }
}
