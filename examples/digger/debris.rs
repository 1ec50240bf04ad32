//! Ground that was cut off: it falls as a body, lies about for a while, and crumbles to chips.

use avian3d::prelude::*;
use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::physics::debris_collider;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::PieceFate;

use crate::landscape::{self, NewGame};
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
            .add_systems(
                Update,
                (break_off, clear_away, take_shape, crumble).chain().after(BurrowSystems::Commit),
            )
            .add_observer(clear_all);
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

/// Where undo or redo put ground, there is no room for what had fallen from it.
fn clear_away(
    mut commands: Commands,
    mut steps: MessageReader<HistoryMoved>,
    pieces: Query<(Entity, &Piece, &Transform)>,
    shaping: Query<(Entity, &Shaping)>,
) {
    for HistoryMoved { receipt, .. } in steps.read() {
        let Ok(Restored { bounds: Some(bounds), added, .. }) = &receipt.outcome else { continue };
        if added.total() == 0 {
            continue;
        }
        let whole = pieces.iter().map(|(entity, piece, place)| {
            let middle = place.translation + place.rotation * piece.half;
            (entity, middle, piece.half.length())
        });
        let coming = shaping
            .iter()
            .map(|(entity, &Shaping(_, corner, _, half))| (entity, corner + half, half.length()));
        for (entity, middle, reach) in whole.chain(coming) {
            if meets(*bounds, middle, reach) {
                commands.entity(entity).despawn();
            }
        }
    }
}

/// Does a ball reach into a box?
fn meets(bounds: LatticeBox, middle: Vec3, reach: f32) -> bool {
    middle.distance(middle.clamp(bounds.min.as_vec3(), bounds.max.as_vec3())) < reach
}

/// A new game has no old rubble.
fn clear_all(
    _: On<NewGame>,
    mut commands: Commands,
    pieces: Query<Entity, Or<(With<Piece>, With<Shaping>)>>,
) {
    for piece in &pieces {
        commands.entity(piece).despawn();
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

#[cfg(test)]
mod tests {
    use bevy_burrow::terrain::HistoryStep;

    use super::*;

    /// One piece in a box from 10 to 20, one far from it, and a step that put ground there or took some.
    fn left_after(dig: bool) -> Vec<f32> {
        let ground = Ground::from_fn(64, 64, |_, _| 15.0).expect("a small world");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
        let ball = Shape::sphere(Vec3::splat(15.0), 4.0);
        terrain.apply([if dig { Brush::dig(ball) } else { Brush::add(ball, landscape::ROCK) }]);
        let receipt = terrain.undo();
        assert_eq!(receipt.step, HistoryStep::Undo);
        let mut app = App::new();
        app.add_message::<HistoryMoved>().add_systems(Update, clear_away);
        for at in [14.0, 40.0] {
            let piece = Piece { left: 9.0, material: landscape::ROCK, half: Vec3::ONE };
            app.world_mut().spawn((piece, Transform::from_translation(Vec3::splat(at))));
        }
        app.world_mut().write_message(HistoryMoved { terrain: None, receipt });
        app.update();
        let mut pieces = app.world_mut().query_filtered::<&Transform, With<Piece>>();
        pieces.iter(app.world()).map(|place| place.translation.x).collect()
    }

    #[test]
    fn what_fell_makes_room_for_ground_that_comes_back() {
        assert_eq!(left_after(true), [40.0]);
        assert_eq!(left_after(false), [14.0, 40.0]);
    }
}
