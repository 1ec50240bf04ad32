//! Loose pieces of ground that fall as bodies.

use avian3d::prelude::*;
use bevy::prelude::*;

use super::debris_collider;
use crate::ground::MaterialId;
use crate::lattice::{LatticeBox, SNAP};
use crate::plugin::{
    BurrowSystems, GroundPiece, HistoryMoved, LoosePieceFound, MaterialColors, ThreadTask, Threads,
    trigger_if_alive,
};
use crate::surface::SurfaceMesh;
use crate::terrain::{PieceFate, Restored, Terrain};

/// Ground that broke off falls as a body. Put a [`LooseGround`](crate::plugin::LooseGround) with some `debris` on the
/// terrain, and pieces up to so many voxels fall. With `Assets<Mesh>` a piece is drawn from the frame on in which the ground
/// loses it; it falls, and is in the way, when its collider is done, which a task makes. Its mesh comes with the transaction;
/// only where a game commits by itself is it made on the main thread.
///
/// Needs avian's `PhysicsPlugins` and the [`TerrainPhysicsPlugin`](super::TerrainPhysicsPlugin), and for ground to fall on a
/// [`ColliderSource`](super::ColliderSource) nearby.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// # use bevy_burrow::physics::{DebrisPlugin, DebrisSettings};
/// # fn game(app: &mut App, terrain: Terrain) {
/// app.add_plugins(DebrisPlugin).insert_resource(DebrisSettings { stay: 60.0, ..default() });
/// app.world_mut().spawn((terrain, LooseGround { crumbs: 8, debris: 4096, ..default() }));
/// # }
/// ```
#[derive(Default)]
pub struct DebrisPlugin;

/// How debris behaves. Changes count for pieces that fall later.
#[derive(Resource, Reflect, Clone, Debug, PartialEq)]
#[reflect(Resource, Default)]
pub struct DebrisSettings {
    /// Pieces at once. While there are as many, others vanish.
    pub most: usize,
    /// Seconds from when a piece takes shape as a body until it crumbles.
    pub stay: f32,
    /// How slippery pieces are.
    pub friction: Friction,
    /// How bouncy they are.
    pub restitution: Restitution,
}

impl Default for DebrisSettings {
    fn default() -> Self {
        Self { most: 24, stay: 25.0, friction: Friction::new(0.9), restitution: Restitution::new(0.05) }
    }
}

/// A piece of ground that fell, or falls: on the body, whose `Transform` is in the middle of the piece. Its mesh is a
/// child, a [`GroundPiece`], and looks as it did in the ground.
#[derive(Component, Clone, Debug, PartialEq)]
#[require(RigidBody::Dynamic, Visibility, TransformInterpolation)]
pub struct Debris {
    /// The terrain that it was part of.
    pub terrain: Entity,
    /// The tag of the brush that cut it off.
    pub tag: u64,
    /// What most of it is made of.
    pub material: MaterialId,
    /// How large it is, in voxels.
    pub voxels: u64,
    /// Half the sides of its bounds as it was in the ground, in metres.
    pub half: Vec3,
    /// Seconds until it crumbles.
    pub left: f32,
}

/// A piece has lain about for long enough; it is despawned right after this.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct DebrisCrumbled {
    /// The piece's entity.
    pub entity: Entity,
}

/// A piece that is drawn already, and whose collider is being made: no body yet, it stays where it was in the ground.
#[derive(Component)]
#[require(Transform, Visibility)]
struct Shaping {
    debris: Debris,
    task: ThreadTask<Option<Collider>>,
}

impl Plugin for DebrisPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<DebrisSettings>().add_observer(clear).add_systems(
            Update,
            (break_off, make_room, take_shape, crumble)
                .chain()
                .after(BurrowSystems::Commit)
                .before(BurrowSystems::Propagate),
        );
    }
}

/// Nobody sees a hole: in the frame in which the ground loses a piece, the piece is there.
fn break_off(
    mut commands: Commands,
    settings: Res<DebrisSettings>,
    mut found: MessageReader<LoosePieceFound>,
    terrains: Query<(&Terrain, Option<&MaterialColors>)>,
    places: TransformHelper,
    pieces: Query<(), Or<(With<Debris>, With<Shaping>)>>,
    mut meshes: Option<ResMut<Assets<Mesh>>>,
) {
    let mut room = settings.most.saturating_sub(pieces.count());
    // A game that takes a terrain's colours away wants none on its pieces.
    let plain = MaterialColors(Vec::new());
    for found in found.read().filter(|found| found.piece.fate == PieceFate::BrokeOff) {
        let Ok((terrain, colors)) = terrains.get(found.terrain) else { continue };
        let Ok(ground) = places.compute_global_transform(found.terrain) else { continue };
        let Some(surface) = found.piece.mesh.clone().filter(|_| room > 0) else { continue };
        room -= 1;
        let (scale, bounds) = (ground.scale().x, found.piece.bounds);
        let size = bounds.max - bounds.min;
        let debris = describe(found, size.as_vec3() * (scale / 2.0), settings.stay);
        let middle = ground.transform_point(found.origin() + size.as_vec3() / 2.0);
        let place = Transform::from_translation(middle).with_rotation(ground.rotation());
        let corner = Transform::from_translation(-debris.half).with_scale(Vec3::splat(scale));
        let task = ThreadTask::start(Threads::Background, move || {
            let mut surface = SurfaceMesh::clone(&surface);
            surface.vertices.iter_mut().for_each(|vertex| vertex.position -= size * (SNAP / 2));
            debris_collider(&surface, scale)
        });
        let mut piece = commands.spawn((Name::new("debris"), Shaping { debris, task }, place));
        if let Some(meshes) = &mut meshes
            && let Some(mesh) = found.mesh(terrain, colors.unwrap_or(&plain))
        {
            let part = GroundPiece { terrain: found.terrain, origin: bounds.min };
            piece.with_child((part, Mesh3d(meshes.add(mesh)), corner));
        }
    }
}

fn describe(found: &LoosePieceFound, half: Vec3, stay: f32) -> Debris {
    let most = found.piece.materials.iter().max_by_key(|(_, voxels)| *voxels);
    Debris {
        terrain: found.terrain,
        tag: found.tag,
        material: most.map_or_else(MaterialId::default, |(material, _)| material),
        voxels: found.piece.voxels,
        half,
        left: stay,
    }
}

/// Where undo or redo put ground, there is no room for what had fallen from it.
fn make_room(
    mut commands: Commands,
    mut steps: MessageReader<HistoryMoved>,
    places: TransformHelper,
    pieces: Query<(Entity, &Debris, &Transform)>,
    shaping: Query<(Entity, &Shaping, &Transform)>,
) {
    for HistoryMoved { terrain, receipt } in steps.read() {
        let Some(entity) = *terrain else { continue };
        let Ok(ground) = places.compute_global_transform(entity) else { continue };
        let Ok(Restored { bounds: Some(bounds), added, .. }) = &receipt.outcome else { continue };
        if added.total() == 0 {
            continue;
        }
        let local = ground.affine().inverse();
        let shaping = shaping.iter().map(|(entity, piece, place)| (entity, &piece.debris, place));
        for (entity, debris, place) in pieces.iter().chain(shaping) {
            let middle = local.transform_point3(place.translation);
            if meets(*bounds, middle, debris.half.length() / ground.scale().x) {
                commands.entity(entity).try_despawn();
            }
        }
    }
}

/// Does a ball reach into a box?
fn meets(bounds: LatticeBox, middle: Vec3, reach: f32) -> bool {
    middle.distance(middle.clamp(bounds.min.as_vec3(), bounds.max.as_vec3())) < reach
}

/// Pieces whose colliders are done become bodies.
fn take_shape(
    mut commands: Commands,
    settings: Res<DebrisSettings>,
    mut shaping: Query<(Entity, &mut Shaping)>,
) {
    for (entity, mut piece) in &mut shaping {
        let Some(collider) = piece.task.finish() else { continue };
        let mut entity = commands.entity(entity);
        let Some(collider) = collider else {
            entity.try_despawn();
            continue;
        };
        let DebrisSettings { friction, restitution, .. } = *settings;
        entity.try_remove::<Shaping>().try_insert((piece.debris.clone(), collider, friction, restitution));
    }
}

fn crumble(mut commands: Commands, time: Res<Time>, mut pieces: Query<(Entity, &mut Debris)>) {
    for (entity, mut debris) in &mut pieces {
        debris.left -= time.delta_secs();
        if debris.left <= 0.0 {
            trigger_if_alive(&mut commands, DebrisCrumbled { entity });
            commands.entity(entity).try_despawn();
        }
    }
}

/// A terrain that goes, or makes way for another one, takes along what fell from it.
fn clear(
    gone: On<Discard, Terrain>,
    mut commands: Commands,
    pieces: Query<(Entity, &Debris)>,
    shaping: Query<(Entity, &Shaping)>,
) {
    let all = pieces.iter().chain(shaping.iter().map(|(entity, piece)| (entity, &piece.debris)));
    for (entity, _) in all.filter(|(_, debris)| debris.terrain == gone.entity) {
        commands.entity(entity).try_despawn();
    }
}
