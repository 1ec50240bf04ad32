//! Loose pieces of ground that fall as rigid bodies.

use std::time::Duration;

use avian3d::prelude::*;
use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;

use super::debris_collider;
use crate::ground::MaterialId;
use crate::lattice::SNAP;
use crate::plugin::{
    BurrowSystems, GroundPiece, LoosePieceFound, LoosePieceReturned, MaterialColors, Places, trigger_if_alive,
};
use crate::surface::SurfaceMesh;
use crate::terrain::{PieceFate, PieceId, Terrain};
use crate::threads::{ThreadTask, Threads, panic_message};

/// Makes ground that broke off fall as a rigid body. Put a [`LooseSettings`](crate::terrain::LooseSettings) on the
/// terrain; its `debris` is the largest piece that falls, in voxels. If the app has `Assets<Mesh>`, a piece is drawn
/// from the frame in which the ground loses it. It becomes a body as soon as a task has built its collider. Its mesh is
/// built with the transaction; it is built on the main thread only if the game commits transactions itself.
///
/// Matter is neither doubled nor lost: when a piece becomes ground again, by an undo of any player or because a server
/// refused the dig, its debris is despawned wherever it has rolled, and no other is. A redo lets it fall again.
///
/// Requires avian's `PhysicsPlugins`, the [`TerrainPhysicsPlugin`](super::TerrainPhysicsPlugin), and a
/// [`ColliderSource`](super::ColliderSource) nearby, so that there is ground to fall on.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// # use bevy_burrow::physics::{DebrisPlugin, DebrisSettings};
/// # fn game(app: &mut App, terrain: Terrain) {
/// app.add_plugins(DebrisPlugin).insert_resource(DebrisSettings { stay: 60.0, ..default() });
/// app.world_mut().spawn((terrain, LooseSettings { crumbs: 8, debris: 4096, ..default() }));
/// # }
/// ```
#[derive(Default)]
pub struct DebrisPlugin;

/// How debris behaves. Changes apply to later pieces.
#[derive(Resource, Reflect, Clone, Debug, PartialEq)]
#[reflect(Resource, Default)]
pub struct DebrisSettings {
    /// The greatest number of pieces at a time. Further ones vanish.
    pub most: usize,
    /// Seconds of `Time<Physics>` from the moment when a piece becomes a body until it crumbles.
    pub stay: f32,
    /// Friction of the pieces.
    pub friction: Friction,
    /// Restitution of the pieces.
    pub restitution: Restitution,
}

impl Default for DebrisSettings {
    fn default() -> Self {
        Self { most: 24, stay: 25.0, friction: Friction::new(0.9), restitution: Restitution::new(0.05) }
    }
}

/// A piece of ground that broke off and is a rigid body now. Its `Transform` is at the middle of the piece,
/// [`DebrisOf`] is its terrain, and its mesh is a child with a [`GroundPiece`] that looks as it did in the ground.
#[derive(Component, Clone, Debug, PartialEq)]
#[require(RigidBody::Dynamic, Visibility, TransformInterpolation)]
pub struct Debris {
    /// The id of the piece.
    pub id: PieceId,
    /// The tag of the brush that cut it off.
    pub tag: u64,
    /// The most common material of the piece.
    pub material: MaterialId,
    /// The size of the piece in voxels.
    pub voxels: u64,
    /// Half the sides of its bounds as it was in the ground, in metres.
    pub half: Vec3,
    /// Seconds of physics until it crumbles.
    pub left: f32,
}

/// The relationship of a piece to the terrain that it broke off from, which lists its pieces in [`TerrainDebris`].
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
#[relationship(relationship_target = TerrainDebris)]
pub struct DebrisOf(pub Entity);

/// The pieces that broke off from a terrain, including those whose colliders are still being built. They are despawned
/// with it, and when another `Terrain` replaces it.
#[derive(Component, Reflect, Clone, Debug, Default, PartialEq, Eq)]
#[reflect(Component, Default)]
#[relationship_target(relationship = DebrisOf, linked_spawn)]
pub struct TerrainDebris(Vec<Entity>);

/// A piece crumbles: it is despawned right after this event.
#[derive(EntityEvent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct DebrisCrumbled {
    /// The piece's entity.
    pub entity: Entity,
}

/// Distinguishes debris of pieces with equal names: the piece that was cut off last is the first to return.
#[derive(Component, Clone, Copy, Debug)]
struct Origin {
    id: PieceId,
    /// Counts pieces.
    number: u64,
    /// Pieces of this name that were cut off later, and whose debris is gone, since it crumbled or had no room.
    gone_since: usize,
}

/// A piece that is drawn, but not a body yet, since its collider is being built. It stays where it was in the ground.
#[derive(Component)]
#[require(Transform, Visibility)]
struct PendingDebris {
    debris: Debris,
    task: ThreadTask<Option<Collider>>,
}

impl Plugin for DebrisPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<DebrisSettings>().add_observer(clear).add_systems(
            Update,
            (break_off, return_to_ground, become_body, crumble)
                .chain()
                .after(BurrowSystems::Commit)
                .before(BurrowSystems::Begin),
        );
    }
}

/// Spawns pieces in the frame in which the ground loses them, so that no hole shows.
fn break_off(
    mut commands: Commands,
    settings: Res<DebrisSettings>,
    mut found: MessageReader<LoosePieceFound>,
    terrains: Query<(&Terrain, Option<&MaterialColors>)>,
    places: Places,
    pieces: Query<(), With<DebrisOf>>,
    mut meshes: Option<ResMut<Assets<Mesh>>>,
    mut number: Local<u64>,
) {
    let mut room = settings.most.saturating_sub(pieces.count());
    // A terrain without colours has pieces without colours.
    let plain = MaterialColors(Vec::new());
    for found in found.read().filter(|found| found.piece.fate == PieceFate::BrokeOff) {
        let Ok((terrain, colors)) = terrains.get(found.terrain) else { continue };
        let Ok(ground) = places.compute_global_transform(found.terrain) else { continue };
        *number += 1;
        let origin = Origin { id: found.piece.id, number: *number, gone_since: 0 };
        let Some(surface) = found.piece.mesh.clone().filter(|_| room > 0) else {
            let terrain = found.terrain;
            commands.queue(move |world: &mut World| forget(world, terrain, origin));
            continue;
        };
        room -= 1;
        let (scale, bounds) = (ground.scale().x, found.piece.bounds);
        let size = bounds.max - bounds.min;
        let debris = describe(found, size.as_vec3() * (scale / 2.0), settings.stay);
        let middle = ground.transform_point(found.origin() + size.as_vec3() / 2.0);
        let place = Transform::from_translation(middle).with_rotation(ground.rotation());
        let corner = Transform::from_translation(-debris.half).with_scale(Vec3::splat(scale));
        let task = ThreadTask::start(Threads::Colliders, move || {
            let mut surface = SurfaceMesh::clone(&surface);
            surface.vertices.iter_mut().for_each(|vertex| vertex.position -= size * (SNAP / 2));
            debris_collider(&surface, scale)
        });
        let mut piece = commands.spawn((
            Name::new("debris"),
            DebrisOf(found.terrain),
            origin,
            PendingDebris { debris, task },
            place,
        ));
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
        id: found.piece.id,
        tag: found.tag,
        material: most.map_or_else(MaterialId::default, |(material, _)| material),
        voxels: found.piece.voxels,
        half,
        left: stay,
    }
}

/// Despawns the debris of pieces that are ground again.
fn return_to_ground(mut commands: Commands, mut returned: MessageReader<LoosePieceReturned>) {
    for LoosePieceReturned { terrain, piece } in returned.read() {
        let (terrain, id) = (*terrain, piece.id);
        if piece.fate == PieceFate::BrokeOff {
            // Whatever was spawned for messages before this one is there by then.
            commands.queue(move |world: &mut World| take_back(world, terrain, id));
        }
    }
}

/// The debris of one name that was cut off last, before the given number.
fn latest(world: &World, terrain: Entity, id: PieceId, before: u64) -> Option<Entity> {
    let pieces = world.get::<TerrainDebris>(terrain)?.iter();
    let origins = pieces.filter_map(|piece| Some((piece, world.get::<Origin>(piece)?)));
    let same = origins.filter(|(_, own)| own.id == id && own.number < before);
    same.max_by_key(|(_, own)| own.number).map(|(piece, _)| piece)
}

/// Despawns the debris of the piece of this name that was cut off last, unless that one is gone already.
fn take_back(world: &mut World, terrain: Entity, id: PieceId) {
    let Some(piece) = latest(world, terrain, id, u64::MAX) else { return };
    let Some(mut origin) = world.get_mut::<Origin>(piece) else { return };
    if origin.gone_since > 0 {
        origin.gone_since -= 1;
    } else {
        world.despawn(piece);
    }
}

/// Records that a piece has no debris any more, although it is not ground again.
fn forget(world: &mut World, terrain: Entity, gone: Origin) {
    let earlier = latest(world, terrain, gone.id, gone.number);
    if let Some(mut origin) = earlier.and_then(|piece| world.get_mut::<Origin>(piece)) {
        origin.gone_since += gone.gone_since + 1;
    }
}

/// Despawns a piece that is not ground again.
fn vanish(world: &mut World, piece: Entity) {
    let Ok(entity) = world.get_entity(piece) else { return };
    let known = entity.get::<DebrisOf>().copied().zip(entity.get::<Origin>().copied());
    if let Some((DebrisOf(terrain), origin)) = known {
        forget(world, terrain, origin);
    }
    world.despawn(piece);
}

/// Turns pieces whose colliders are built into bodies.
fn become_body(
    mut commands: Commands,
    settings: Res<DebrisSettings>,
    mut pending: Query<(Entity, &mut PendingDebris)>,
) {
    for (entity, mut piece) in &mut pending {
        let Some(built) = piece.task.check() else { continue };
        let collider = built.unwrap_or_else(|panic| {
            let why = panic_message(panic.as_ref());
            error!(
                "{entity}, debris of {} voxels, vanishes: its collider panicked: {why}",
                piece.debris.voxels
            );
            None
        });
        let Some(collider) = collider else {
            commands.queue(move |world: &mut World| vanish(world, entity));
            continue;
        };
        let DebrisSettings { friction, restitution, .. } = *settings;
        commands.entity(entity).try_remove::<PendingDebris>().try_insert((
            piece.debris.clone(),
            collider,
            friction,
            restitution,
        ));
    }
}

/// Ages pieces by the time that physics has advanced.
fn crumble(
    mut commands: Commands,
    time: Res<Time<Physics>>,
    mut last: Local<Duration>,
    mut pieces: Query<(Entity, &mut Debris)>,
) {
    let now = time.elapsed();
    let passed = now.saturating_sub(std::mem::replace(&mut last, now)).as_secs_f32();
    if passed == 0.0 {
        return;
    }
    for (entity, mut debris) in &mut pieces {
        debris.left -= passed;
        if debris.left <= 0.0 {
            trigger_if_alive(&mut commands, DebrisCrumbled { entity });
            commands.queue(move |world: &mut World| vanish(world, entity));
        }
    }
}

/// Despawns the pieces of a terrain that is removed or replaced.
fn clear(
    gone: On<Discard, Terrain>,
    mut commands: Commands,
    terrains: Query<&TerrainDebris, Allow<Disabled>>,
) {
    for piece in terrains.get(gone.entity).into_iter().flat_map(|pieces| pieces.iter()) {
        commands.entity(piece).try_despawn();
    }
}
