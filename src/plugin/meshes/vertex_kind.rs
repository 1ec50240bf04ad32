//! The attributes of vertices, and which of them a terrain has.

use bevy::color::LinearRgba;
use bevy::mesh::{MeshVertexAttribute, VertexFormat};

use crate::plugin::{MaterialColors, SkyLight};
use crate::terrain::Terrain;

/// The attributes of vertices in meshes of tiles, chunks and pieces, for materials that read them.
impl Terrain {
    /// Up to four material ids of a vertex, for materials that look them up. All corners of a triangle have equal ids
    /// in equal order, so a shader may take those of any corner and blend the weights alone.
    pub const ATTRIBUTE_MATERIAL_IDS: MeshVertexAttribute =
        MeshVertexAttribute::new("Vertex_BurrowMaterialIds", 0x6275_7272_6f77_0001, VertexFormat::Uint8x4);

    /// The weight of each of a vertex's material ids, 0..=1.
    pub const ATTRIBUTE_MATERIAL_WEIGHTS: MeshVertexAttribute = MeshVertexAttribute::new(
        "Vertex_BurrowMaterialWeights",
        0x6275_7272_6f77_0002,
        VertexFormat::Unorm8x4,
    );

    /// How many voxels a vertex lies below the surface that was there before anyone dug; less than 0 above it, 0 on it.
    /// Not on terrains with [`SlimVertices`](crate::plugin::SlimVertices).
    pub const ATTRIBUTE_GROUND_DEPTH: MeshVertexAttribute =
        MeshVertexAttribute::new("Vertex_BurrowGroundDepth", 0x6275_7272_6f77_0003, VertexFormat::Float32);

    /// The share of the sky that lights a vertex, 0..=1, in x: 1 on a plain, 0 in a cave; see
    /// [`World::sky_light`](crate::terrain::World::sky_light). In y how deep it lies below the surface that was there
    /// before anyone dug, of which 1 is 8 voxels or more. In z the share of the sky again or, if it is larger, the
    /// share of level directions in which a vertex under a roof sees the open within 14 voxels, at most 5/16: what lies
    /// there is lit, and lights the vertex. w is 0. Materials multiply ambient and indirect light by z, reflections by
    /// x, and never the light of the sun. Only on terrains with [`SkyLight`](crate::plugin::SkyLight).
    pub const ATTRIBUTE_SKY_LIGHT: MeshVertexAttribute =
        MeshVertexAttribute::new("Vertex_BurrowSkyLight", 0x6275_7272_6f77_0004, VertexFormat::Unorm8x4);
}

/// The depth in voxels that is 1 in [`Terrain::ATTRIBUTE_SKY_LIGHT`].
pub const CUT_VOXELS: i32 = 8;

/// The attributes of a terrain's vertices in addition to positions, normals and materials.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct VertexExtras {
    /// The depth in the ground.
    pub has_depth: bool,
    /// The light of the sky.
    pub has_sky_light: bool,
    /// The colours of materials, blended; none if it is empty.
    pub colors: Vec<LinearRgba>,
}

/// Which attributes a terrain's components ask for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct VertexKind {
    /// [`SlimVertices`](crate::plugin::SlimVertices).
    pub is_slim: bool,
    /// [`SkyLight`](crate::plugin::SkyLight).
    pub has_sky_light: bool,
}

impl VertexKind {
    pub fn of(is_slim: bool, sky_light: Option<&SkyLight>) -> Self {
        Self { is_slim, has_sky_light: sky_light.is_some_and(|light| light.is_on) }
    }
}

impl VertexExtras {
    /// The extras of a terrain with these components.
    pub(crate) fn of(colors: Option<&MaterialColors>, kind: VertexKind) -> Self {
        let VertexKind { is_slim, has_sky_light } = kind;
        if is_slim {
            return Self { has_sky_light, ..Self::default() };
        }
        let colors = colors.map_or(Vec::new(), |colors| colors.0.clone());
        Self { has_depth: true, has_sky_light, colors }
    }
}
