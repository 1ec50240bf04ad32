//! Ground that was cut off: it falls as a body, lies about for a while, and crumbles to chips.

use avian3d::prelude::*;
use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use bevy_burrow::physics::debris_collider;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::PieceFate;

use crate::landscape;
use crate::particles::{Burst, Matter};

/// Pieces up to so many voxels vanish, others up to so many fall.
const CRUMBS: u32 = 6;
const DEBRIS: u32 = 3000;
/// Seconds that a fallen piece lies about, and how many do at most.
const STAY: f32 = 25.0;
const PIECES: usize = 24;

/// Lets loose ground fall.
pub struct DebrisPlugin;

impl Plugin for DebrisPlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(look_for_pieces)
            .add_systems(Startup, mix)
            .add_systems(Update, (break_off, take_shape, crumble).chain().after(BurrowSystems::Commit));
    }
}

/// A piece that fell, or falls; and for how long it stays.
#[derive(Component)]
#[require(RigidBody::Dynamic, Visibility, Friction::new(0.9), Restitution::new(0.05), TransformInterpolation)]
struct Piece {
    left: f32,
    material: MaterialId,
    half: Vec3,
}

/// A piece whose mesh and collider are being made.
#[derive(Component)]
struct Shaping(Task<Option<(Mesh, Collider)>>, Vec3, MaterialId, Vec3);

/// What all pieces are drawn with; their colours are those of their vertices.
#[derive(Resource)]
struct Rubble(Handle<StandardMaterial>);

fn mix(mut commands: Commands, mut materials: ResMut<Assets<StandardMaterial>>) {
    let rubble = StandardMaterial { perceptual_roughness: 0.95, reflectance: 0.15, ..default() };
    commands.insert_resource(Rubble(materials.add(rubble)));
}

fn look_for_pieces(ready: On<TerrainReady>, mut terrains: Query<&mut Terrain>) {
    if let Ok(mut terrain) = terrains.get_mut(ready.entity) {
        terrain.set_loose(Some(LooseSettings { crumbs: CRUMBS, debris: DEBRIS, ..default() }));
    }
}

/// The receipt of a dig tells what it cut off; the rest is made in a task.
fn break_off(
    mut commands: Commands,
    mut receipts: MessageReader<BrushApplied>,
    pieces: Query<(), Or<(With<Piece>, With<Shaping>)>>,
) {
    let mut room = PIECES.saturating_sub(pieces.count());
    for BrushApplied { receipt, .. } in receipts.read() {
        let Ok(applied) = &receipt.outcome else { continue };
        for piece in applied.loose.iter().filter(|piece| piece.fate == PieceFate::BrokeOff) {
            let Some(surface) = piece.mesh.clone().filter(|_| room > 0) else { continue };
            room -= 1;
            let most = piece.materials.iter().max_by_key(|(_, voxels)| *voxels);
            let material = most.map_or(landscape::ROCK, |(material, _)| material);
            let corner = piece.bounds.min.as_vec3();
            let half = (piece.bounds.max - piece.bounds.min).as_vec3() / 2.0;
            let task = AsyncComputeTaskPool::get()
                .spawn(async move { Some((mesh(&surface), debris_collider(&surface, 1.0)?)) });
            commands.spawn(Shaping(task, corner, material, half));
        }
    }
}

/// The surface of a piece as Bevy draws it.
fn mesh(surface: &SurfaceMesh) -> Mesh {
    let vertices = &surface.vertices;
    let positions: Vec<[f32; 3]> = vertices.iter().map(|vertex| vertex.position_f32()).collect();
    let normals: Vec<[f32; 3]> = vertices.iter().map(|vertex| vertex.normal.to_array()).collect();
    let colors: Vec<[f32; 4]> = vertices
        .iter()
        .map(|vertex| landscape::colour(MaterialId(vertex.materials.ids[0])).to_f32_array())
        .collect();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colors)
        .with_inserted_indices(Indices::U32(surface.indices.clone()))
}

fn take_shape(
    mut commands: Commands,
    mut shaping: Query<(Entity, &mut Shaping)>,
    rubble: Res<Rubble>,
    mut meshes: ResMut<Assets<Mesh>>,
) {
    for (entity, mut shaping) in &mut shaping {
        let Some(made) = check_ready(&mut shaping.0) else { continue };
        let &mut Shaping(_, corner, material, half) = &mut *shaping;
        commands.entity(entity).despawn();
        if let Some((mesh, collider)) = made {
            commands.spawn((
                Name::new("debris"),
                Piece { left: STAY, material, half },
                collider,
                Transform::from_translation(corner),
                Mesh3d(meshes.add(mesh)),
                MeshMaterial3d(rubble.0.clone()),
            ));
        }
    }
}

fn crumble(
    mut commands: Commands,
    time: Res<Time>,
    mut pieces: Query<(Entity, &mut Piece, &Transform)>,
    mut bursts: MessageWriter<Burst>,
) {
    for (entity, mut piece, place) in &mut pieces {
        piece.left -= time.delta_secs();
        if piece.left <= 0.0 {
            let middle = place.translation + place.rotation * piece.half;
            let chips = Burst {
                place: middle,
                out: Vec3::Y,
                count: 18,
                speed: 2.5,
                matter: Matter::Chips(piece.material),
            };
            bursts.write(Burst {
                count: 4,
                speed: 1.0,
                matter: Matter::Dust(piece.material),
                ..chips.clone()
            });
            bursts.write(chips);
            commands.entity(entity).despawn();
        }
    }
}
