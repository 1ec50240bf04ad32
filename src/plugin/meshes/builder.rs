//! Surface meshes as Bevy meshes.

use std::borrow::Cow;
use std::sync::Arc;

use bevy::asset::RenderAssetUsages;
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::NoAutoAabb;
use bevy::color::{ColorToComponents, LinearRgba};
use bevy::math::{IVec3, Vec3};
use bevy::mesh::{Indices, Mesh, PrimitiveTopology, VertexAttributeValues};

use super::ground_depth::{Heights, NodeHeights, depth};
use super::palettes::{Arranged, Palettes};
use super::vertex_kind::{CUT_VOXELS, VertexExtras};
use crate::ground::Ground;
use crate::lattice::{Column, LatticeBox, ONE, SNAP};
use crate::plugin::MeshBytes;
use crate::surface::{self, MaterialMix, SurfaceMesh, Vertex, tile};
use crate::terrain::{SurfaceDraft, Terrain, TileUpdate, World};
use crate::world::sky::{Light, LitWorld, SkyColumns, SkyLights, SparseSky};

/// The components of an entity in addition to its mesh: bounds that Bevy need not compute, and bytes.
pub(crate) type MeshFacts = (Aabb, NoAutoAabb, MeshBytes);

/// A mesh ready to be swapped in; `None` where nothing is to be drawn.
pub(crate) type BuiltMesh = Option<(Mesh, MeshFacts)>;

/// Builds Bevy meshes from surfaces of a terrain.
#[derive(Clone)]
pub(crate) struct MeshBuilder {
    extras: VertexExtras,
    usages: RenderAssetUsages,
    ground: Arc<Ground>,
    /// The world that lights surfaces; `None` where they have no sky light.
    lit: Option<Arc<LitWorld>>,
}

impl MeshBuilder {
    pub(crate) fn new(world: &World, extras: VertexExtras, usages: RenderAssetUsages) -> Self {
        Self { extras, usages, ground: world.shared_ground(), lit: None }
    }

    /// Whether surfaces have sky light, and so need a world that lights them.
    pub(crate) fn has_sky_light(&self) -> bool {
        self.extras.has_sky_light
    }

    /// Lights all surfaces that are built from now on by a world.
    pub(crate) fn light_by(&mut self, lit: &Arc<LitWorld>) {
        self.lit = self.has_sky_light().then(|| Arc::clone(lit));
    }

    /// Builds the Bevy mesh of a surface whose positions count from this point, in the task. `whole` is the draft's
    /// [surface](SurfaceDraft::surface) where it is known.
    pub(super) fn build(
        &self,
        origin: IVec3,
        draft: &SurfaceDraft,
        whole: Option<&SurfaceMesh>,
        lights: &mut TileLights,
    ) -> BuiltMesh {
        match draft {
            SurfaceDraft::Nothing => None,
            SurfaceDraft::Tile(tile) => self.build_tile(origin, tile, whole, lights),
            SurfaceDraft::Chunk(chunk) => self.build_lit(origin, chunk.mesh(), lights),
            SurfaceDraft::Unmeshed(chunk) => self.build_lit(origin, chunk.surface().mesh(), lights),
        }
    }

    /// Builds the mesh of a piece that broke off, in the light that its place has once it is gone.
    pub(in crate::plugin) fn build_piece(&self, bounds: LatticeBox, surface: &SurfaceMesh) -> BuiltMesh {
        let columns = [bounds.min, bounds.max].map(|corner| Column::new(corner.x, corner.z));
        self.build_lit(bounds.min, surface, &mut TileLights::new(Some(self), columns.into()))
    }

    fn build_lit(&self, origin: IVec3, surface: &SurfaceMesh, lights: &mut TileLights) -> BuiltMesh {
        if surface.is_empty() {
            return None;
        }
        let mut arrays = Arrays::with_capacity(surface.vertices.len(), self);
        arrays.push(&surface.vertices, origin);
        if let Some(lights) = lights.get() {
            arrays.push_lights(&surface.vertices, origin, lights);
        }
        arrays.finish(&surface.indices)
    }

    /// Builds the mesh of a node of level 1 or above, with columns that are a stride apart. Most vertices lie over
    /// them, so their heights are computed together, and those of others one by one.
    pub(crate) fn build_node(
        &self,
        columns: (Column, Column),
        stride: i32,
        surface: &SurfaceMesh,
    ) -> BuiltMesh {
        if surface.is_empty() {
            return None;
        }
        let mut arrays = Arrays::with_capacity(surface.vertices.len(), self);
        if self.extras.has_depth {
            arrays.heights = Heights::Node(NodeHeights::new(&self.ground, columns, stride));
        }
        arrays.push(&surface.vertices, columns.0.at(0));
        if let Some(lit) = &self.lit {
            let mut lights = SparseSky::new(lit.view()).with_grid(columns.0, columns.1, stride);
            arrays.push_lights(&surface.vertices, columns.0.at(0), &mut lights);
        }
        arrays.finish(&surface.indices)
    }

    /// Builds the mesh of a tile, whose columns come before its rings. `whole` is its mesh where it is known.
    fn build_tile(
        &self,
        origin: IVec3,
        draft: &TileUpdate,
        whole: Option<&SurfaceMesh>,
        lights: &mut TileLights,
    ) -> BuiltMesh {
        if draft.indices().is_empty() {
            return None;
        }
        let vertices = match whole {
            Some(whole) => Cow::Borrowed(&*whole.vertices),
            None => Cow::Owned(tile::vertices(&draft.ground, draft.grid, draft.tile, &draft.rings)),
        };
        let columns = vertices.len().saturating_sub(draft.rings.vertices().len());
        let (columns, rings) = vertices.split_at(columns);
        let mut arrays = Arrays::with_capacity(vertices.len(), self);
        arrays.push_on_surface(columns);
        arrays.push(rings, origin);
        if let Some(lights) = lights.get() {
            // Columns lie on the undug surface, so they have no depth below it.
            let of_columns =
                lights.ground_lights().into_iter().map(|light| [light.sky, 0, light.daylight, 0]);
            arrays.lights.extend(of_columns.take(columns.len()));
            arrays.push_lights(rings, origin, lights);
        }
        arrays.finish(draft.indices())
    }
}

/// The light over a tile, for its mesh and those of its chunks: computed when it is first needed, if there is any.
#[derive(Default)]
pub(super) struct TileLights<'a> {
    lit: Option<&'a LitWorld>,
    columns: Option<(Column, Column)>,
    lights: Option<SkyColumns<'a>>,
}

impl<'a> TileLights<'a> {
    /// The light over some columns, both ends included, of the world by which a builder's surfaces are lit.
    pub fn new(builder: Option<&'a MeshBuilder>, columns: (Column, Column)) -> Self {
        let lit = builder.and_then(|builder| builder.lit.as_deref());
        Self { lit, columns: Some(columns), lights: None }
    }

    fn get(&mut self) -> Option<&mut SkyColumns<'a>> {
        let (lit, (low, high)) = (self.lit?, self.columns?);
        Some(self.lights.get_or_insert_with(|| SkyColumns::new(lit.view(), low, high)))
    }
}

/// The attributes of a mesh while it is built.
struct Arrays<'a> {
    mesh_builder: &'a MeshBuilder,
    heights: Heights,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    materials: Palettes,
    /// The lowest and the highest corner.
    bounds: (Vec3, Vec3),
    /// Empty without depths.
    depths: Vec<f32>,
    /// Empty without sky light.
    lights: Vec<[u8; 4]>,
    /// Empty without colours.
    colors: Vec<[f32; 4]>,
    /// The materials that were blended last, and their colour.
    blended: (MaterialMix, [f32; 4]),
}

impl<'a> Arrays<'a> {
    fn with_capacity(vertices: usize, mesh_builder: &'a MeshBuilder) -> Self {
        let VertexExtras { has_depth, has_sky_light, colors } = &mesh_builder.extras;
        let room = |is_there: bool| if is_there { vertices } else { 0 };
        Self {
            mesh_builder,
            heights: Heights::Ground,
            positions: Vec::with_capacity(vertices),
            normals: Vec::with_capacity(vertices),
            materials: Palettes::with_capacity(vertices),
            bounds: (Vec3::INFINITY, Vec3::NEG_INFINITY),
            depths: Vec::with_capacity(room(*has_depth)),
            lights: Vec::with_capacity(room(*has_sky_light)),
            colors: Vec::with_capacity(room(!colors.is_empty())),
            blended: (MaterialMix::default(), blend(MaterialMix::default(), colors)),
        }
    }

    /// Appends vertices whose positions count from some point.
    fn push(&mut self, vertices: &[Vertex], origin: IVec3) {
        self.push_without_depth(vertices);
        if self.mesh_builder.extras.has_depth {
            let ground = &*self.mesh_builder.ground;
            let depth = |vertex: &Vertex| {
                let place = origin * SNAP + vertex.position;
                match &self.heights {
                    Heights::Ground => depth(place, |column| ground.height(column)),
                    Heights::Node(heights) => depth(place, |column| heights.height(ground, column)),
                }
            };
            self.depths.extend(vertices.iter().map(depth));
        }
    }

    /// Appends vertices that lie on the undug surface.
    fn push_on_surface(&mut self, vertices: &[Vertex]) {
        self.push_without_depth(vertices);
        if self.mesh_builder.extras.has_depth {
            self.depths.resize(self.positions.len(), 0.0);
        }
    }

    fn push_without_depth(&mut self, vertices: &[Vertex]) {
        let (mut low, mut high) = (IVec3::MAX, IVec3::MIN);
        for vertex in vertices {
            (low, high) = (low.min(vertex.position), high.max(vertex.position));
        }
        if !vertices.is_empty() {
            let [low, high] = [low, high].map(|corner| corner.as_vec3() / SNAP as f32);
            self.bounds = (self.bounds.0.min(low), self.bounds.1.max(high));
        }
        self.positions.extend(vertices.iter().map(Vertex::position_f32));
        self.normals.extend(vertices.iter().map(|vertex| vertex.normal.to_array()));
        self.materials.extend(vertices.iter().map(|vertex| vertex.materials));
        if !self.mesh_builder.extras.colors.is_empty() {
            vertices.iter().for_each(|vertex| self.push_color(vertex.materials));
        }
    }

    /// Appends the light of vertices whose positions count from some point.
    fn push_lights(&mut self, vertices: &[Vertex], origin: IVec3, lights: &mut dyn SkyLights) {
        let light = |vertex: &Vertex| {
            let place = origin * SNAP + vertex.position;
            let depth = lights.depth(place).clamp(0, CUT_VOXELS * ONE) * 255 / (CUT_VOXELS * ONE);
            let Light { sky, daylight } = lights.light(place);
            [sky, depth as u8, daylight, 0]
        };
        self.lights.extend(vertices.iter().map(light));
    }

    fn push_color(&mut self, mix: MaterialMix) {
        if self.blended.0 != mix {
            self.blended = (mix, blend(mix, &self.mesh_builder.extras.colors));
        }
        self.colors.push(self.blended.1);
    }

    fn finish(mut self, indices: &surface::Indices) -> BuiltMesh {
        let (min, max) = self.bounds;
        let Arranged { ids, weights, copies, indices } = self.materials.arrange(indices);
        copy(&mut self.positions, &copies);
        copy(&mut self.normals, &copies);
        copy(&mut self.depths, &copies);
        copy(&mut self.colors, &copies);
        copy(&mut self.lights, &copies);
        let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, self.mesh_builder.usages)
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, self.positions)
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, self.normals)
            .with_inserted_attribute(Terrain::ATTRIBUTE_MATERIAL_IDS, VertexAttributeValues::Uint8x4(ids))
            .with_inserted_attribute(
                Terrain::ATTRIBUTE_MATERIAL_WEIGHTS,
                VertexAttributeValues::Unorm8x4(weights),
            )
            .with_inserted_indices(match indices {
                surface::Indices::U16(list) => Indices::U16(list),
                surface::Indices::U32(list) => Indices::U32(list),
            });
        if self.mesh_builder.extras.has_depth {
            mesh.insert_attribute(Terrain::ATTRIBUTE_GROUND_DEPTH, self.depths);
        }
        if !self.lights.is_empty() {
            mesh.insert_attribute(Terrain::ATTRIBUTE_SKY_LIGHT, VertexAttributeValues::Unorm8x4(self.lights));
        }
        if !self.mesh_builder.extras.colors.is_empty() {
            mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, self.colors);
        }
        let indices = mesh.indices().map_or(0, |indices| match indices {
            Indices::U16(list) => size_of_val(&list[..]),
            Indices::U32(list) => size_of_val(&list[..]),
        });
        let bytes = MeshBytes(mesh.get_vertex_buffer_size() + indices);
        Some((mesh, (Aabb::from_min_max(min, max), NoAutoAabb, bytes)))
    }
}

/// Appends copies of some values; nothing if there are no values.
fn copy<T: Copy>(values: &mut Vec<T>, of: &[u32]) {
    let copies: Vec<T> = of.iter().filter_map(|&at| values.get(at as usize).copied()).collect();
    values.extend(copies);
}

/// The mixed colour of a vertex.
fn blend(mix: MaterialMix, colors: &[LinearRgba]) -> [f32; 4] {
    let color = |id: u8| {
        let known = colors.get(usize::from(id)).or(colors.last());
        known.copied().unwrap_or(LinearRgba::WHITE).to_f32_array()
    };
    let mut sum = [0.0; 4];
    for (&id, &weight) in mix.ids.iter().zip(&mix.weights).filter(|(_, weight)| **weight > 0) {
        for (sum, part) in sum.iter_mut().zip(color(id)) {
            *sum += part * f32::from(weight) / 255.0;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::{ColumnMaterial, GreyImage, MaterialControl, MaterialId, NoiseHeights, NoiseSource};
    use crate::lod::Cut;
    use crate::plugin::MaterialColors;
    use crate::plugin::meshes::VertexKind;
    use crate::terrain::{MeshKey, NodeUpdate, TerrainSettings};

    const SKIN: ColumnMaterial = ColumnMaterial { base: MaterialId(0), overlay: MaterialId(1), blend: 255 };

    fn dug(ground: Ground, brushes: &[Brush]) -> Terrain {
        let ground = ground.with_materials(&MaterialControl::Uniform(SKIN)).unwrap();
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).unwrap();
        assert!(terrain.apply(brushes).iter().all(|receipt| receipt.outcome.is_ok()));
        terrain
    }

    /// All vertices that are drawn, with their place in 1/4096 voxel.
    fn drawn(world: &World) -> Vec<(bool, IVec3, Vertex)> {
        let tiles = world.grid().tiles().map(MeshKey::Tile);
        let all = tiles.chain(world.drawn_chunks().map(MeshKey::Chunk));
        let vertices = all.flat_map(|drawn| {
            let (is_tile, mesh) = match drawn {
                MeshKey::Tile(tile) => (true, world.tile_mesh(tile)),
                MeshKey::Chunk(chunk) => (false, world.chunk_mesh(chunk)),
            };
            let origin = world.origin(drawn) * SNAP;
            mesh.vertices.into_iter().map(move |vertex| (is_tile, origin, vertex))
        });
        vertices.collect()
    }

    #[test]
    fn depth_is_measured_from_the_ground_as_it_was() {
        let terrain = dug(
            Ground::flat(64, 64, 10.5).unwrap(),
            &[Brush::dig(Shape::sphere(Vec3::new(32.0, 10.0, 32.0), 6.0))],
        );
        let mut deepest: f32 = 0.0;
        for (is_tile, origin, vertex) in drawn(terrain.world()) {
            let found = depth(origin + vertex.position, |column| terrain.world().ground().height(column));
            let y = (origin.y + vertex.position.y) as f32 / SNAP as f32;
            assert_eq!(found, 10.5 - y);
            assert!(!is_tile || found == 0.0);
            deepest = deepest.max(found);
        }
        assert!((6.0..7.0).contains(&deepest), "{deepest}");
    }

    #[test]
    fn tiles_and_chunks_agree_on_the_depth_of_what_they_share() {
        let noise = NoiseHeights { seed: 8, scale: 20.0, amplitude: 14.0, ..NoiseHeights::default() };
        let ground = Ground::from_noise(64, 64, &noise).unwrap();
        let place = Vec3::new(31.0, ground.height(Column::new(31, 30)) as f32 / ONE as f32, 30.0);
        let terrain = dug(ground, &[Brush::dig(Shape::sphere(place, 7.0))]);
        let vertices = drawn(terrain.world());
        let of = |wanted: bool| {
            vertices.iter().filter(move |(is_tile, ..)| *is_tile == wanted).map(|(_, origin, vertex)| {
                let place = *origin + vertex.position;
                (place.to_array(), depth(place, |column| terrain.world().ground().height(column)))
            })
        };
        let tiles: std::collections::BTreeMap<[i32; 3], f32> = of(true).collect();
        let shared: Vec<_> =
            of(false).filter_map(|(at, own)| tiles.get(&at).map(|other| (own, *other))).collect();
        assert!(shared.len() > 30, "only {} shared vertices", shared.len());
        for (own, other) in shared {
            assert_eq!(own.to_bits(), other.to_bits());
            assert!(own.abs() < 1.0 / 64.0, "{own} is on the surface");
        }
    }

    #[test]
    fn a_lone_height_is_the_height() {
        let noise = NoiseHeights { seed: 2, scale: 40.0, amplitude: 30.0, ..NoiseHeights::default() };
        let source = NoiseSource::new(&noise).unwrap();
        for ground in [Ground::from_noise(90, 70, &noise), Ground::from_source(90, 70, source)] {
            let ground = ground.unwrap();
            for (x, z) in (-3..95).flat_map(|x| (-3..75).map(move |z| (x, z))) {
                let column = Column::new(x, z);
                assert_eq!(ground.lone_height(column), ground.height(column), "{column:?}");
            }
        }
    }

    #[test]
    fn colours_are_blended_by_weight() {
        let colors = [LinearRgba::RED, LinearRgba::GREEN];
        let mix = MaterialMix { ids: [0, 9, 0, 0], weights: [51, 204, 0, 0] };
        for (found, expected) in blend(mix, &colors).into_iter().zip([0.2, 0.8, 0.0, 1.0]) {
            assert!((found - expected).abs() < 1e-6, "{found} is not {expected}");
        }
    }

    /// All data of a Bevy mesh, as bytes.
    /// The mesh of a surface that has all of its vertices.
    fn whole(builder: &MeshBuilder, origin: IVec3, surface: &SurfaceMesh) -> BuiltMesh {
        builder.build_lit(origin, surface, &mut TileLights::default())
    }

    fn bytes_of(ready: BuiltMesh) -> Option<(Vec<Vec<u8>>, Option<Indices>, Aabb)> {
        let (mesh, (bounds, ..)) = ready?;
        let attributes = mesh.attributes().map(|(_, values)| values.get_bytes().to_vec());
        Some((attributes.collect(), mesh.indices().cloned(), bounds))
    }

    #[test]
    fn depths_of_a_node_are_those_of_the_ground_wherever_its_vertices_lie() {
        let noise = NoiseHeights { seed: 4, scale: 30.0, amplitude: 20.0, ..NoiseHeights::default() };
        // Widths that are not a multiple of any stride.
        let ground = Ground::from_source(157, 93, NoiseSource::new(&noise).unwrap()).unwrap();
        let digs: Vec<Brush> = (0..12)
            .map(|i| (i * 37 % 157, i * 23 % 93))
            .map(|(x, z)| (x, ground.height(Column::new(x, z)) / ONE, z))
            .map(|(x, y, z)| Brush::dig(Shape::sphere(IVec3::new(x, y, z).as_vec3(), 5.0)))
            .collect();
        let settings = TerrainSettings { chunk_size: 16, ..TerrainSettings::default() };
        let mut terrain = Terrain::new(ground, &settings).unwrap();
        terrain.apply(digs);
        let world = terrain.world();
        let builder = MeshBuilder::new(
            world,
            VertexExtras::of(None, VertexKind::default()),
            RenderAssetUsages::RENDER_WORLD,
        );
        let mut compared = 0;
        for level in 0..4 {
            // Nodes of different levels meet.
            let cut = Cut::random(world.lod_grid(level), u64::from(level), 50);
            for NodeUpdate { node, mesh, .. } in world.draw_cut(cut).1 {
                let Some(mesh) = mesh else { continue };
                let columns = world.lod_grid(level).columns(node);
                let found = bytes_of(builder.build_node(columns, node.stride(), &mesh));
                assert!(found == bytes_of(whole(&builder, columns.0.at(0), &mesh)), "{node:?}");
                compared += 1;
            }
        }
        assert!(compared > 20, "{compared}");
    }

    #[test]
    fn a_tile_straight_from_the_ground_is_the_tile() {
        let noise = NoiseHeights { seed: 5, scale: 20.0, amplitude: 14.0, ..NoiseHeights::default() };
        let mask = GreyImage::from_samples(70, 60, (0..70 * 60).map(|index| index % 97 * 640).collect());
        let blend =
            MaterialControl::Blend { mask: mask.unwrap(), base: MaterialId(2), overlay: MaterialId(1) };
        let colors = MaterialColors(vec![LinearRgba::RED, LinearRgba::GREEN, LinearRgba::BLUE]);
        for (chunk_size, control) in [(16, blend), (9, MaterialControl::Uniform(SKIN))] {
            let ground = Ground::from_noise(70, 60, &noise).unwrap().with_materials(&control).unwrap();
            let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
            let mut terrain = Terrain::new(ground, &settings).unwrap();
            let builders = [true, false].map(|is_slim| {
                let kind = VertexKind { is_slim, has_sky_light: false };
                let extras = VertexExtras::of(Some(&colors), kind);
                MeshBuilder::new(terrain.world(), extras, RenderAssetUsages::RENDER_WORLD)
            });
            let mut compared = 0;
            for i in 0..9 {
                let place = Vec3::new((i * 23 % 71) as f32, (i * 7 % 12) as f32, (i * 31 % 61) as f32);
                terrain.submit(Brush::dig(Shape::sphere(place, 3.0 + i as f32)));
                let commit = terrain.begin().unwrap().run();
                for (tile, update) in &commit.meshes.tiles {
                    let origin = terrain.world().origin(MeshKey::Tile(*tile));
                    for builder in &builders {
                        let found = bytes_of(builder.build(
                            origin,
                            &SurfaceDraft::Tile(update.clone()),
                            None,
                            &mut TileLights::default(),
                        ));
                        assert!(found == bytes_of(whole(builder, origin, &update.mesh())), "{tile:?}");
                        compared += usize::from(found.is_some());
                    }
                }
                terrain.commit(commit).unwrap();
            }
            assert!(compared > 20, "{compared}");
        }
    }
}
