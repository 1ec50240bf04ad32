//! Components of terrains, tiles, chunks, fields and pieces.

use bevy::ecs::component::{Component, ComponentId, Mutable, RequiredComponentsRegistrator, StorageType};
use bevy::prelude::*;

use super::entities::places::TerrainPlace;
use crate::lattice::{ChunkPos, TilePos};
use crate::lod::Node;
use crate::terrain::{Order, Terrain};
use crate::volume;

/// The model itself is the component; see [`Terrain`]. What it requires is there in any order of plugins and spawns.
impl Component for Terrain {
    const STORAGE_TYPE: StorageType = StorageType::Table;
    type Mutability = Mutable;

    fn register_required_components(_: ComponentId, required: &mut RequiredComponentsRegistrator) {
        required.register_required(Transform::default);
        required.register_required(Visibility::default);
        required.register_required(MaterialColors::default);
        required.register_required(TerrainPlace::default);
        #[cfg(feature = "render")]
        required.register_required(Materials::default);
    }
}

/// Which types of materials a terrain has, as bits in the order of precedence.
#[cfg(feature = "render")]
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Materials(pub u64);

/// A tile of the heightmap: child of its [`Terrain`]. Has a `Mesh3d` while some of its cells are not dug.
///
/// On terrains with [`LevelsOfDetail`](super::LevelsOfDetail) it may be a square of 2^`level` tiles along each side,
/// which one mesh draws with all that was dug and built there. One of level 0 without a mesh is not drawn: it is there
/// for its collider.
///
/// It inherits the terrain's material, `RenderLayers`, `NotShadowCaster` and `NotShadowReceiver`: insert them on the
/// terrain. Leave tiles out of saved scenes: a scene of the whole world would restore them without their terrain, which
/// is not reflected.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
#[require(Transform, Visibility)]
pub struct Tile {
    /// Chunks along +x.
    pub x: i32,
    /// Chunks along +z.
    pub z: i32,
    /// The tile's level of detail; always 0 without [`LevelsOfDetail`](super::LevelsOfDetail).
    pub level: u8,
}

/// A chunk that digging touched: child of its [`Terrain`]. Has a `Mesh3d` if it draws something, even if it has no
/// field itself; on terrains with [`LevelsOfDetail`](super::LevelsOfDetail) while it is drawn at level 0. It inherits
/// components, and is left out of saved scenes, like a [`Tile`].
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
#[require(Transform, Visibility)]
pub struct Chunk {
    /// Chunks along +x.
    pub x: i32,
    /// Chunks along +y.
    pub y: i32,
    /// Chunks along +z.
    pub z: i32,
}

/// Which surface a tile or chunk shows, if one was built: the plugin writes it in the frame of the swap.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
pub struct ShownSurface {
    /// The revision of the world that the surface belongs to; it stays while other parts change.
    pub revision: u64,
    /// Whether it is known to have no triangles.
    pub is_empty: bool,
}

/// The bytes of the vertices and indices of a tile's or chunk's mesh on the GPU, while it has a `Mesh3d`.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
pub struct MeshBytes(pub usize);

/// A region of edits: child of its [`Chunk`]. It is data; the chunk draws it.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
pub struct Field {
    /// The field's id in receipts.
    pub id: u64,
    /// Lowest edited lattice point, in voxels of the terrain.
    pub min: IVec3,
    /// Highest edited lattice point.
    pub max: IVec3,
    /// Counts the edits that changed it.
    pub revision: u64,
}

/// A mesh that was part of a terrain and now moves independently, as [`LoosePieceFound`](super::LoosePieceFound) has
/// them: a relationship to that terrain, which lists its pieces in [`GroundPieces`]. A piece inherits the terrain's
/// material, layers and shadows as a [`Tile`] does, unless it is spawned with its own of the same type. It follows when
/// they change or are removed. With a `GroundLook`, the texture on a piece stays where it was in the ground, wherever
/// the piece goes.
///
/// When the terrain is despawned, its pieces stay as they are, and lose this component.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// fn show(
///     mut commands: Commands,
///     mut found: MessageReader<LoosePieceFound>,
///     terrains: Query<(&Terrain, &MaterialColors)>,
///     mut meshes: ResMut<Assets<Mesh>>,
/// ) {
///     for found in found.read() {
///         let Ok((terrain, colors)) = terrains.get(found.terrain) else { continue };
///         let Some(mesh) = found.mesh(terrain, colors) else { continue };
///         let piece = GroundPiece { terrain: found.terrain, origin: found.piece.bounds.min };
///         let place = Transform::from_translation(found.origin()); // below the terrain, which may be scaled
///         commands.entity(found.terrain).with_child((piece, Mesh3d(meshes.add(mesh)), place));
///     }
/// }
/// # let mut app = App::new();
/// // In the frame in which the ground loses it, so that the piece inherits the terrain's components.
/// app.add_systems(Update, show.after(BurrowSystems::Commit).before(BurrowSystems::Propagate));
/// ```
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
#[relationship(relationship_target = GroundPieces)]
#[require(Transform, Visibility)]
pub struct GroundPiece {
    /// The terrain that it was part of.
    #[relationship]
    pub terrain: Entity,
    /// The lattice point that positions of its mesh count from, in voxels of the terrain.
    pub origin: IVec3,
}

/// The pieces of a terrain. Bevy keeps it up to date; see [`GroundPiece`].
#[derive(Component, Reflect, Clone, Debug, Default, PartialEq, Eq)]
#[reflect(Component, Default)]
#[relationship_target(relationship = GroundPiece)]
pub struct GroundPieces(Vec<Entity>);

impl From<TilePos> for Tile {
    fn from(tile: TilePos) -> Self {
        Self { x: tile.x, z: tile.z, level: 0 }
    }
}

impl From<Node> for Tile {
    fn from(node: Node) -> Self {
        let TilePos { x, z } = node.tile();
        Self { x, z, level: node.level }
    }
}

impl From<ChunkPos> for Chunk {
    fn from(chunk: ChunkPos) -> Self {
        Self { x: chunk.x, y: chunk.y, z: chunk.z }
    }
}

impl From<Tile> for TilePos {
    /// Returns the lowest tile.
    fn from(Tile { x, z, .. }: Tile) -> Self {
        Self { x, z }
    }
}

impl From<Chunk> for ChunkPos {
    fn from(Chunk { x, y, z }: Chunk) -> Self {
        Self { x, y, z }
    }
}

impl From<&volume::Field> for Field {
    fn from(field: &volume::Field) -> Self {
        Self { id: field.id.0, min: field.bounds.min, max: field.bounds.max, revision: field.revision }
    }
}

/// Marks a terrain that waits, for example for the world that it is to show: it is not loaded and begins no
/// transaction, and brushes for it stay queued. A `SavedWorld` or `StartLevel` inserts it until its world is read; if
/// the game has inserted it before, it stays until the game removes it.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Component, Default)]
pub struct Held;

/// Collects the edits, undos and redos of this terrain instead of applying them, so that for example a server can
/// decide about them. The system that inserts this takes the list, answers its items, and applies the results with
/// [`Terrain::submit`] and [`Order::Parts`].
#[derive(Component, Clone, Debug, Default, PartialEq)]
pub struct EditOutbox {
    /// The collected orders. Undos and redos follow the edits of their frame.
    pub orders: Vec<Order>,
}

/// The meshes of this terrain have vertices of 32 bytes: positions, normals, materials; no colours and no depth in the
/// ground, which take 20 more. A `GroundLook` inserts and removes it; insert it yourself for materials of your own that
/// need neither.
///
/// A terrain that gets or loses it is loaded again, and its former tiles and chunks stay until then.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Component, Default)]
pub struct SlimVertices;

/// Whether the meshes of this terrain have [`Terrain::ATTRIBUTE_SKY_LIGHT`]: how much of the sky lights each vertex, so
/// that pits, gullies and tunnels are darker than meadows, near and far, and as soon as they are dug. It takes 4 bytes
/// a vertex. A `GroundLook` inserts it, unless the terrain has [`SkyLight::OFF`]; insert it yourself for a material of
/// your own that reads the attribute. Servers and other apps without meshes compute no light.
///
/// A terrain whose meshes have it or lose it is loaded again, and its former tiles and chunks stay until then.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component, Default)]
pub struct SkyLight {
    /// Whether vertices have the attribute.
    pub is_on: bool,
}

impl SkyLight {
    /// No light of the sky: all ground is lit alike.
    pub const OFF: Self = Self { is_on: false };
}

impl Default for SkyLight {
    fn default() -> Self {
        Self { is_on: true }
    }
}

/// The colour of each material id, for the vertex colours of a terrain's meshes; insert it on the terrain's entity. Ids
/// past its end have the last colour. If it is empty, or there are [`SlimVertices`], meshes have no vertex colours,
/// which saves 16 bytes a vertex.
///
/// Only meshes that are built after a change have the new colours, and after its removal none.
#[derive(Component, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component)]
pub struct MaterialColors(pub Vec<LinearRgba>);

impl Default for MaterialColors {
    /// Rock, grass, sand, snow, clay, concrete, coal, gold, soil, sandstone, shale, gravel, iron, copper.
    fn default() -> Self {
        let colors = [
            (0.36, 0.33, 0.30),
            (0.24, 0.36, 0.13),
            (0.71, 0.61, 0.42),
            (0.90, 0.92, 0.95),
            (0.55, 0.36, 0.24),
            (0.62, 0.62, 0.64),
            (0.11, 0.11, 0.12),
            (0.83, 0.62, 0.17),
            (0.30, 0.21, 0.14),
            (0.68, 0.50, 0.33),
            (0.34, 0.33, 0.35),
            (0.48, 0.46, 0.43),
            (0.50, 0.26, 0.18),
            (0.27, 0.55, 0.44),
        ];
        Self(colors.map(|(r, g, b)| LinearRgba::from(Color::srgb(r, g, b))).to_vec())
    }
}
