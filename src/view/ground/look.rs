//! Settings: how a terrain's ground looks.

use bevy::prelude::*;

/// Most layers of a ground; ids from the last one on share it.
pub const MAX_LAYERS: usize = 16;

/// How a terrain's ground looks: put it on the terrain's entity instead of a material, and
/// [`GroundPlugin`](super::GroundPlugin) makes and keeps its [`GroundMaterial`](super::GroundMaterial).
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
    /// What lies below the ground, and shows where it is dug.
    pub strata: GroundStrata,
    /// Where the ground is steeper than this, the skin of grass or snow gives way to what is below: rise over run at
    /// which it begins to, and at which none is left.
    pub cliffs: (f32, f32),
    /// Metres from the eye within which layers are drawn near, and beyond which they are drawn far, six times as large.
    pub distance: (f32, f32),
    /// How much tints differ from place to place, 0 to 1.
    pub variety: f32,
    /// How many texels a pixel may cost.
    pub quality: GroundQuality,
}

/// A layer of the ground.
#[derive(Reflect, Clone, Debug, PartialEq)]
#[reflect(Default)]
pub struct GroundLayer {
    /// Metres that its texture covers.
    pub metres: f32,
    /// How strong its relief is: 1 as its texture says, 0 flat.
    pub relief: f32,
    /// How metallic it is, 0 to 1.
    pub metallic: f32,
    /// Its colours are multiplied by this.
    pub tint: LinearRgba,
    /// What it does below the surface, where it is the ground's own material and was not built.
    pub kind: GroundLayerKind,
    /// The layer of the textures that floors and ceilings show instead: for what lies in beds, whose laminae run along
    /// walls and not over floors.
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

/// What a layer does below the surface.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Default)]
pub enum GroundLayerKind {
    /// The same all the way down.
    #[default]
    Body,
    /// Only on the surface, like grass: below, and on cliffs, lies what the [`GroundStrata`] say.
    Skin,
    /// Stands for all that the [`GroundStrata`] say.
    Strata,
}

/// What the ground is made of, from the surface down. Layers are given by number.
#[derive(Reflect, Clone, Debug, PartialEq)]
#[reflect(Default)]
pub struct GroundStrata {
    /// The layer under grass, and how deep it reaches in metres.
    pub soil: (u8, f32),
    /// The layer below the soil, and how thick it is in metres.
    pub subsoil: (u8, f32),
    /// Rock below, in beds that repeat from bottom to top: layers, each about a quarter of the whole. The first one also
    /// crusts natural faces, here and there.
    pub beds: [u8; 4],
    /// Metres from one bed to its repetition.
    pub height: f32,
    /// How far beds are bent, in metres.
    pub bend: f32,
    /// A thin seam that lies in the beds: its layer, how thick it is (0: there is none), and the depth in metres from which
    /// on it is there.
    pub seam: (u8, f32, f32),
    /// Veins that run through the rock: their layer, how thick they are (0 none, 1 much), and from which depth on.
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

/// How many texels a pixel of the ground may cost. Each layer is laid on from all sides that show: one where the
/// ground is level, two on most slopes.
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
    /// For the textures that [`GroundTextures::Baked`](super::GroundTextures::Baked) stands for.
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
