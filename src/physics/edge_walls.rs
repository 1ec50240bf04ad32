//! Invisible walls along a terrain's four edges.

use avian3d::prelude::*;
use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;

use super::TerrainContact;
use crate::lattice::ONE;
use crate::plugin::TerrainReady;
use crate::terrain::Terrain;

/// Invisible walls along the four edges of a terrain, so that no body walks or falls off it. Insert it on the terrain's
/// entity.
///
/// The walls are static colliders and children of the terrain: they move with it, and have the layers of its
/// [`TerrainContact`], if it has one. They are rebuilt when another terrain or another ground takes its place, and
/// removed with this component or with the terrain. Insert it again to change it. If a size is not finite and positive,
/// there are no walls, and an error is logged.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::physics::EdgeWalls;
/// # use bevy_burrow::prelude::*;
/// # fn spawn(mut commands: Commands, terrain: Terrain) {
/// commands.spawn((terrain, EdgeWalls::default()));
/// # }
/// ```
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default)]
pub struct EdgeWalls {
    /// How far the walls reach above the highest ground and below the lowest, in voxels. The ground is that of the
    /// heightmap; pits may be deeper and buildings higher by this value.
    pub height: f32,
    /// How thick the walls are, in voxels. They stand outside the terrain. Fast bodies need thick walls.
    pub thickness: f32,
}

impl Default for EdgeWalls {
    fn default() -> Self {
        Self { height: 1500.0, thickness: 8.0 }
    }
}

/// One of the four walls.
#[derive(Component)]
pub(super) struct EdgeWall;

/// All walls, including those of disabled terrains.
type Walls<'w, 's> = Query<'w, 's, (Entity, &'static ChildOf), (With<EdgeWall>, Allow<Disabled>)>;

type Terrains<'w, 's> =
    Query<'w, 's, (&'static Terrain, &'static EdgeWalls, Option<&'static TerrainContact>), Allow<Disabled>>;

pub(super) fn build(new: On<Insert, EdgeWalls>, commands: Commands, terrains: Terrains, old: Walls) {
    replace(new.entity, commands, &terrains, &old);
}

pub(super) fn rebuild(ready: On<TerrainReady>, commands: Commands, terrains: Terrains, old: Walls) {
    replace(ready.entity, commands, &terrains, &old);
}

pub(super) fn remove(gone: On<Remove, EdgeWalls>, mut commands: Commands, old: Walls) {
    despawn(gone.entity, &mut commands, &old);
}

pub(super) fn remove_with_terrain(gone: On<Remove, Terrain>, mut commands: Commands, old: Walls) {
    despawn(gone.entity, &mut commands, &old);
}

fn despawn(terrain: Entity, commands: &mut Commands, old: &Walls) {
    for (wall, _) in old.iter().filter(|(_, parent)| parent.parent() == terrain) {
        commands.entity(wall).try_despawn();
    }
}

fn replace(entity: Entity, mut commands: Commands, terrains: &Terrains, old: &Walls) {
    let Ok((terrain, &EdgeWalls { height, thickness }, contact)) = terrains.get(entity) else { return };
    despawn(entity, &mut commands, old);
    if ![height, thickness].into_iter().all(|size| size.is_finite() && size > 0.0) {
        error!(
            "{entity} has no edge walls: height {height} and thickness {thickness} must be finite and positive"
        );
        return;
    }
    let grid = terrain.world().grid();
    let (width, depth) = (grid.width() as f32, grid.depth() as f32);
    let half = thickness / 2.0;
    let (low, high) = terrain.world().ground().height_range();
    let [low, high] = [low, high].map(|height| height as f32 / ONE as f32);
    let layers = contact.map(|contact| contact.0.layers).unwrap_or_default();
    for (x, z, along_x, along_z) in [
        (-half, depth / 2.0, thickness, depth),
        (width + half, depth / 2.0, thickness, depth),
        (width / 2.0, -half, width + 2.0 * thickness, thickness),
        (width / 2.0, depth + half, width + 2.0 * thickness, thickness),
    ] {
        commands.spawn((
            Name::new("edge wall"),
            EdgeWall,
            RigidBody::Static,
            layers,
            Collider::cuboid(along_x, high - low + 2.0 * height, along_z),
            Transform::from_xyz(x, (low + high) / 2.0, z),
            ChildOf(entity),
        ));
    }
}
