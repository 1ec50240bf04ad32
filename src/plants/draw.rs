//! Draws plants: a few entities for each patch, whose meshes hold many copies of one plant.
//!
//! All patches of a species share one mesh, so Bevy draws them together. The vertex shader puts each copy into its
//! place, which it reads from a buffer, and leaves out those that do not stand by a bit of another one. A dig writes
//! bits; no mesh is built.

use bevy::asset::RenderAssetUsages;
use bevy::camera::primitives::{Aabb, MeshAabb};
use bevy::camera::visibility::{NoAutoAabb, VisibilityRange};
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::light::NotShadowCaster;
use bevy::mesh::{Indices, MeshTag, PrimitiveTopology, VertexAttributeValues};
use bevy::pbr::{MaterialPlugin, PbrPlugin};
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::storage::ShaderBuffer;

use super::material::{PlantExtension, PlantMaterial, PlantUniform};
use super::slots::{Record, Slots};
use super::upload::PlantBuffers;
use super::{News, NewsList, PlantSystems, ShownPlants};
use crate::scatter::{PatchPos, Plant, PlantPatch, Species};
use crate::terrain::Terrain;

/// Vertices that a mesh of copies has at most, if a single plant does not have more.
const VERTICES: usize = 2048;

/// Draws the plants of terrains with [`PlantLooks`]. Add it after Bevy's plugins, in addition to
/// [`PlantsPlugin`](super::PlantsPlugin); a game that draws plants itself leaves it out and reads [`ShownPlants`].
/// Needs storage buffers in vertex shaders, which WebGL lacks.
#[derive(Default)]
pub struct PlantDrawingPlugin;

impl Plugin for PlantDrawingPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<PbrPlugin>() {
            return;
        }
        bevy::asset::embedded_asset!(app, "plants.wgsl");
        app.add_plugins(MaterialPlugin::<PlantMaterial>::default())
            .init_resource::<PlantBuffers>()
            .add_observer(forget_looks)
            .add_observer(free_slots)
            .add_systems(Update, draw_plants.in_set(PlantSystems).after(super::follow::follow_commits))
            .add_systems(
                PostUpdate,
                (
                    draw_plants.in_set(PlantSystems).after(super::follow::follow_commits),
                    limit_shadows.after(TransformSystems::Propagate),
                ),
            );
        super::upload::build(app);
    }
}

/// How a species looks.
#[derive(Clone, Debug)]
pub struct PlantLook {
    /// The name of the species.
    pub species: String,
    /// The mesh in metres, with its foot at the origin, for plants of size 1. Positions and normals; colours and the
    /// first texture coordinates, if it has any.
    pub mesh: Handle<Mesh>,
    /// A simpler mesh for plants farther away than the species' [`detail`](crate::scatter::ViewDistances::detail).
    /// Without it, they are drawn with the same mesh up to the end.
    pub far: Option<Handle<Mesh>>,
    /// The material of the mesh.
    pub material: StandardMaterial,
    /// Metres by which the wind moves what is a metre above the ground.
    pub sway: f32,
    /// How much plants differ in brightness and hue, as a share.
    pub tint: f32,
    /// Whether plants follow the slope, as grass does, or are upright.
    pub follows_slope: bool,
}

impl Default for PlantLook {
    fn default() -> Self {
        Self {
            species: String::new(),
            mesh: Handle::default(),
            far: None,
            material: StandardMaterial::default(),
            sway: 0.0,
            tint: 0.3,
            follows_slope: false,
        }
    }
}

/// How the species of a terrain look. Insert it on the terrain's entity, together with its [`Plants`](super::Plants).
/// Species without a look are not drawn.
#[derive(Component, Clone, Debug, Default)]
#[require(DrawnPlants)]
pub struct PlantLooks(pub Vec<PlantLook>);

/// A mesh of copies, and how far it is drawn.
#[derive(Clone, Debug)]
struct Model {
    mesh: Handle<Mesh>,
    material: Handle<PlantMaterial>,
    /// Copies in the mesh; a power of two.
    copies: u32,
    /// The box around one of them, in metres.
    extent: Aabb,
    /// Metres from the camera between which it is drawn.
    range: (f32, f32),
    shadows: f32,
}

/// The patches of a terrain that are drawn.
#[derive(Component, Debug, Default)]
pub(crate) struct DrawnPlants {
    /// By species, once their meshes are loaded: one model, or two.
    models: HashMap<u8, Vec<Model>>,
    /// First slot, number of slots, entities.
    patches: HashMap<PatchPos, (u32, u32, Vec<Entity>)>,
    /// Loaded patches that are not drawn yet.
    waiting: Vec<PatchPos>,
}

/// An entity with some plants of a patch.
#[derive(Component)]
struct PlantPart {
    /// Metres from the camera up to which they cast shadows.
    shadows: f32,
}

impl DrawnPlants {
    fn drop_patch(&mut self, pos: PatchPos, commands: &mut Commands, slots: &mut Slots) {
        self.waiting.retain(|waiting| *waiting != pos);
        if let Some((start, count, entities)) = self.patches.remove(&pos) {
            slots.give(start, count);
            entities.into_iter().for_each(|entity| commands.entity(entity).try_despawn());
        }
    }

    fn clear(&mut self, commands: &mut Commands, slots: &mut Slots) {
        let all: Vec<PatchPos> = self.patches.keys().copied().collect();
        all.into_iter().for_each(|pos| self.drop_patch(pos, commands, slots));
        self.waiting.clear();
        self.models.clear();
    }
}

/// Draws what is loaded and changed since the last call.
fn draw_plants(
    mut commands: Commands,
    mut terrains: Query<(Entity, Option<&Terrain>, &mut ShownPlants, Ref<PlantLooks>, &mut DrawnPlants)>,
    mut buffers: ResMut<PlantBuffers>,
    mut assets: ResMut<Assets<ShaderBuffer>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<PlantMaterial>>,
) {
    let buffers = buffers.bypass_change_detection();
    for (entity, terrain, mut shown, looks, mut drawn) in &mut terrains {
        let ShownPlants { patches, news, .. } = shown.bypass_change_detection();
        let drawn = drawn.bypass_change_detection();
        let mut latest = news.take();
        if looks.is_changed() || latest.is_none() {
            drawn.clear(&mut commands, &mut buffers.slots);
            latest = None;
            drawn.waiting.extend(patches.iter().flat_map(|patches| patches.iter().map(|(pos, _)| pos)));
        }
        for news in latest.into_iter().flatten() {
            match news {
                News::Cleared => drawn.clear(&mut commands, &mut buffers.slots),
                News::Loaded(pos) => drawn.waiting.push(pos),
                News::Unloaded(pos) => drawn.drop_patch(pos, &mut commands, &mut buffers.slots),
                News::Changed(change) => {
                    if let Some((start, ..)) = drawn.patches.get(&change.patch) {
                        buffers.slots.set(start + change.index as u32, change.stands);
                    }
                }
            }
        }
        let (Some(patches), Some(terrain)) = (patches, terrain) else { continue };
        let species = patches.scatter().species();
        for pos in std::mem::take(&mut drawn.waiting) {
            let Some(own) = species.get(usize::from(pos.species)) else { continue };
            let Some(look) = looks.0.iter().find(|look| look.species == own.name) else { continue };
            let Some(patch) = patches.get(pos).filter(|patch| !patch.plants().is_empty()) else { continue };
            if !drawn.models.contains_key(&pos.species) {
                let size = patches.scatter().patch_size(pos.species);
                let made =
                    models(own, look, size, terrain.voxel_size(), buffers, &mut meshes, &mut materials);
                let Some(made) = made else {
                    drawn.waiting.push(pos);
                    continue;
                };
                drawn.models.insert(pos.species, made);
            }
            let models = &drawn.models[&pos.species];
            let (low, _) = patches.scatter().patch_cells(pos);
            let origin = IVec3::new(low.x, 0, low.z);
            let placed = show(
                (entity, terrain.voxel_size()),
                origin,
                patch,
                models,
                &mut commands,
                &mut buffers.slots,
            );
            drawn.patches.insert(pos, placed);
        }
    }
    grow(buffers, &mut assets, &mut materials);
}

/// Without looks nothing is drawn, and nothing reads the changes.
fn forget_looks(
    gone: On<Remove, PlantLooks>,
    mut terrains: Query<(&mut DrawnPlants, &mut ShownPlants), Allow<Disabled>>,
    mut buffers: ResMut<PlantBuffers>,
    mut commands: Commands,
) {
    if let Ok((mut drawn, mut shown)) = terrains.get_mut(gone.entity) {
        drawn.clear(&mut commands, &mut buffers.slots);
        shown.news = NewsList::default();
    }
}

/// Frees the slots of a terrain that is despawned or loses its looks' state. Its entities go with it.
fn free_slots(
    gone: On<Remove, DrawnPlants>,
    mut drawn: Query<&mut DrawnPlants, Allow<Disabled>>,
    mut buffers: ResMut<PlantBuffers>,
) {
    let Ok(mut drawn) = drawn.get_mut(gone.entity) else { return };
    for (_, (start, count, _)) in drawn.patches.drain() {
        buffers.slots.give(start, count);
    }
}

/// Writes the plants of a patch, and spawns its entities.
fn show(
    (terrain, voxel): (Entity, f32),
    origin: IVec3,
    patch: &PlantPatch,
    models: &[Model],
    commands: &mut Commands,
    slots: &mut Slots,
) -> (u32, u32, Vec<Entity>) {
    let plants = patch.plants();
    let most = models.iter().map(|model| model.copies).max().unwrap_or(1);
    let count = (plants.len() as u32).next_multiple_of(most);
    let start = slots.take(count);
    for (index, plant) in plants.iter().enumerate() {
        let slot = start + index as u32;
        slots.write(slot, record(plant, origin));
        slots.set(slot, patch.stands(index));
    }
    let mut entities = Vec::new();
    for model in models {
        for (part, plants) in plants.chunks(model.copies as usize).enumerate() {
            let around = bounds(plants, origin, model, voxel);
            // Half of the box is added, since the distance counts from its middle.
            let slack = Vec3::from(around.half_extents).length() * voxel;
            let (begin, end) = ((0.85 * model.range.0 - slack).max(0.0), model.range.1 + slack);
            let child = commands.spawn((
                PlantPart { shadows: model.shadows },
                Mesh3d(model.mesh.clone()),
                MeshMaterial3d(model.material.clone()),
                MeshTag(start + part as u32 * model.copies),
                Transform::from_translation(origin.as_vec3()),
                (around, NoAutoAabb),
                VisibilityRange { start_margin: begin..begin, end_margin: end..end, use_aabb: true },
                NotShadowCaster,
            ));
            entities.push(child.id());
        }
    }
    if let Ok(mut terrain) = commands.get_entity(terrain) {
        terrain.add_children(&entities);
    }
    (start, count, entities)
}

/// A plant, as the shader reads it.
fn record(plant: &Plant, origin: IVec3) -> Record {
    let along = |at: i32, from: i32| (at - from * 256).clamp(0, 0xffff) as u32;
    let rise = plant.rise.map(|rise| u32::from((rise / 8).clamp(-127, 127) as i8 as u8));
    [
        along(plant.x, origin.x) | along(plant.z, origin.z) << 16,
        (plant.position().y as f32).to_bits(),
        u32::from(plant.turn) | u32::from(plant.size) << 16,
        rise[0] | rise[1] << 8 | u32::from(plant.variant) << 16,
    ]
}

/// The box around plants, relative to their patch.
fn bounds(plants: &[Plant], origin: IVec3, model: &Model, voxel: f32) -> Aabb {
    let (mut low, mut high) = (Vec3::splat(f32::MAX), Vec3::splat(f32::MIN));
    let mut size = 0.0f32;
    for plant in plants {
        let at = plant.position().as_vec3() - origin.as_vec3();
        (low, high) = (low.min(at), high.max(at));
        size = size.max(f32::from(plant.size) / 256.0);
    }
    let (near, far) = (Vec3::from(model.extent.min()), Vec3::from(model.extent.max()));
    // However it is turned, and with room for wind and slope.
    let radius = near.xz().abs().max(far.xz().abs()).length() * 1.5;
    let scale = size / voxel;
    let more = Vec3::new(radius, radius, radius) * scale;
    Aabb::from_min_max(low - more, high + more + Vec3::Y * far.y.max(0.0) * scale)
}

/// The models of a species; `None` while its meshes are loading.
fn models(
    species: &Species,
    look: &PlantLook,
    patch: i32,
    voxel: f32,
    buffers: &PlantBuffers,
    meshes: &mut Assets<Mesh>,
    materials: &mut Assets<PlantMaterial>,
) -> Option<Vec<Model>> {
    let view = &species.view;
    let (detail, end) = (view.detail.min(view.end) * voxel, view.end * voxel);
    let handles = std::iter::once(&look.mesh).chain(&look.far);
    if handles.clone().any(|handle| meshes.get(handle).is_none()) {
        return None;
    }
    let usual = (patch as f32 / species.spacing).powi(2) * species.density;
    let has_far = look.far.is_some();
    let made = handles.enumerate().filter_map(|(index, handle)| {
        let range = match (index, has_far) {
            (0, true) => (0.0, detail),
            (0, false) => (0.0, end),
            _ => (detail, end),
        };
        let uniform = PlantUniform {
            begin: range.0,
            end: range.1,
            fade: if index == 0 && has_far { 0.0 } else { 0.2 },
            sway: look.sway,
            tint: look.tint,
            slope: if look.follows_slope { 1.0 } else { 0.0 },
            voxels: 1.0 / voxel,
        };
        let (records, gone) = (buffers.records.clone(), buffers.gone.clone());
        let extension = PlantExtension { uniform, records, gone };
        let material = materials.add(PlantMaterial { base: look.material.clone(), extension });
        let one = meshes.get(handle)?;
        let most = (VERTICES / one.count_vertices().max(1)).clamp(1, 256) as f32;
        let copies = most.min((usual / 2.0).max(1.0)) as u32;
        // Rounded down to a power of two.
        let copies = 1 << copies.ilog2();
        let extent = one.compute_aabb()?;
        let mesh = meshes.add(copies_of(one, copies)?);
        Some(Model { mesh, material, copies, extent, range, shadows: view.shadows * voxel })
    });
    let made: Vec<Model> = made.collect();
    if made.len() < 1 + usize::from(has_far) {
        warn!(
            "the meshes of the species `{}` cannot be drawn: they need triangles with positions",
            species.name
        );
    }
    Some(made)
}

/// A mesh of several copies, each with its number as second texture coordinate.
fn copies_of(one: &Mesh, copies: u32) -> Option<Mesh> {
    let VertexAttributeValues::Float32x3(positions) = one.attribute(Mesh::ATTRIBUTE_POSITION)? else {
        return None;
    };
    let count = positions.len();
    let normals = match one.attribute(Mesh::ATTRIBUTE_NORMAL) {
        Some(VertexAttributeValues::Float32x3(normals)) => normals.clone(),
        _ => vec![[0.0, 1.0, 0.0]; count],
    };
    let colors = match one.attribute(Mesh::ATTRIBUTE_COLOR) {
        Some(VertexAttributeValues::Float32x4(colors)) => colors.clone(),
        _ => vec![[1.0; 4]; count],
    };
    let uvs = match one.attribute(Mesh::ATTRIBUTE_UV_0) {
        Some(VertexAttributeValues::Float32x2(uvs)) => uvs.clone(),
        _ => vec![[0.0; 2]; count],
    };
    let indices: Vec<u32> = match one.indices() {
        Some(indices) => indices.iter().map(|index| index as u32).collect(),
        None => (0..count as u32).collect(),
    };
    let numbers = (0..copies).flat_map(|copy| std::iter::repeat_n([copy as f32, 0.0], count));
    let all = (0..copies).flat_map(|copy| indices.iter().map(move |index| index + copy * count as u32));
    let times = copies as usize;
    (one.primitive_topology() == PrimitiveTopology::TriangleList).then(|| {
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions.repeat(times))
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals.repeat(times))
            .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colors.repeat(times))
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs.repeat(times))
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_1, numbers.collect::<Vec<_>>())
            .with_inserted_indices(Indices::U32(all.collect()))
    })
}

/// Makes larger buffers with all plants once there are more than they hold. Other changes are [written in
/// place](super::upload).
fn grow(
    buffers: &mut PlantBuffers,
    assets: &mut Assets<ShaderBuffer>,
    materials: &mut Assets<PlantMaterial>,
) {
    let slots = &mut buffers.slots;
    if slots.len() == buffers.room {
        return;
    }
    buffers.room = slots.len();
    slots.take_changes();
    for (handle, bytes) in [(&buffers.records, slots.record_bytes()), (&buffers.gone, slots.gone_bytes())] {
        if let Some(mut buffer) = assets.get_mut(handle) {
            buffer.data = Some(bytes.to_vec());
        }
    }
    // Larger buffers are others: materials have to be bound to them, which writing to them does.
    let all: Vec<_> = materials.ids().collect();
    for id in all {
        if let Some(mut material) = materials.get_mut(id) {
            let _: &mut PlantMaterial = &mut material;
        }
    }
}

/// Lets plants near to a camera cast shadows, and no others.
fn limit_shadows(
    mut commands: Commands,
    parts: Query<(Entity, &PlantPart, &Aabb, &GlobalTransform, Has<NotShadowCaster>)>,
    cameras: Query<&GlobalTransform, With<Camera3d>>,
) {
    for (entity, part, around, place, is_without) in &parts {
        let middle = place.transform_point(around.center.into());
        let radius = place.radius_vec3a(around.half_extents);
        let near = cameras.iter().map(|camera| camera.translation().distance(middle));
        let is_near = near.fold(f32::MAX, f32::min) - radius < part.shadows;
        if is_near == is_without {
            match is_near {
                true => commands.entity(entity).try_remove::<NotShadowCaster>(),
                false => commands.entity(entity).try_insert(NotShadowCaster),
            };
        }
    }
}
