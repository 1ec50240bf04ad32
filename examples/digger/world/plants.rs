//! Grass, flowers, stones, bushes and trees. Trees whose ground is dug away fall; so do those that a pickaxe hits.

use avian3d::prelude::*;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy_burrow::plants::{
    PlantDrawingPlugin, PlantLook, PlantLooks, PlantRemoved, PlantReturned, Plants, PlantsPlugin, ShownPlants,
};
use bevy_burrow::prelude::*;
use bevy_burrow::scatter::{Clearance, Clusters, PlantId, ScatterRules, Species, Stem, ViewDistances};

use crate::player::camera::PlayerCamera;
use crate::tools::digging::Misses;
use crate::tools::{Tool, ToolUsed};
use crate::world::landscape::{DespawnOnNewGame, GRASS, ROCK};

#[path = "../../shared/plant_meshes.rs"]
mod plant_meshes;

/// Metres that a pickaxe reaches.
const REACH: f32 = 6.0;
/// Seconds that a fallen tree lies about.
const LIES: f32 = 40.0;

pub struct PlantEffectsPlugin;

impl Plugin for PlantEffectsPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins((PlantsPlugin, PlantDrawingPlugin))
            .add_observer(grow)
            .add_observer(fell)
            .add_systems(Update, (fall, stand_up, rot).chain().after(BurrowSystems::Commit));
    }
}

/// What grows in the digger.
pub fn rules() -> ScatterRules {
    let view = |detail, end, shadows| ViewDistances { detail, end, shadows };
    let tree = |name: &str, slope| Species {
        spacing: 7.0,
        distance: 5.5,
        room: 1.2,
        size: (0.6, 1.3),
        slope: (0.0, slope),
        materials: vec![GRASS],
        clearance: Clearance { radius: 1.2, height: 7.0 },
        stem: Some(Stem { radius: 0.35, height: 6.0 }),
        view: view(90.0, 700.0, 140.0),
        ..Species::named(name)
    };
    let small = |name: &str| Species { materials: vec![GRASS], slope: (0.0, 0.9), ..Species::named(name) };
    let group = |size, cover| Some(Clusters { size, cover });
    let species = vec![
        Species { density: 0.7, clusters: group(120.0, 0.5), ..tree("fir", 1.0) },
        Species { density: 0.5, clusters: group(90.0, 0.4), ..tree("oak", 0.5) },
        Species {
            spacing: 4.0,
            density: 0.35,
            room: 0.8,
            size: (0.6, 1.4),
            clearance: Clearance { radius: 0.6, height: 1.2 },
            clusters: group(40.0, 0.5),
            view: view(200.0, 200.0, 60.0),
            ..small("bush")
        },
        Species {
            spacing: 5.0,
            density: 0.4,
            room: 0.4,
            size: (0.4, 2.0),
            slope: (0.0, 1.4),
            materials: vec![GRASS, ROCK],
            view: view(160.0, 160.0, 40.0),
            ..small("stone")
        },
        Species {
            density: 0.4,
            size: (0.7, 1.3),
            clusters: group(22.0, 0.3),
            view: view(60.0, 60.0, 0.0),
            ..small("flower")
        },
        Species { spacing: 0.6, size: (0.7, 1.5), view: view(25.0, 110.0, 0.0), ..small("grass") },
    ];
    ScatterRules { seed: 11, species }
}

/// The meshes of each species: near, far, sway, whether it follows the slope.
fn looks(meshes: &mut Assets<Mesh>) -> Vec<PlantLook> {
    use plant_meshes::{bush, far_fir, far_grass, far_oak, fir, flower, grass, oak, stone};
    let mut look = |species: &str, mesh: Mesh, far: Option<Mesh>, sway: f32, follows_slope: bool| PlantLook {
        species: species.into(),
        mesh: meshes.add(mesh),
        far: far.map(|far| meshes.add(far)),
        material: StandardMaterial {
            perceptual_roughness: 0.95,
            reflectance: 0.15,
            double_sided: true,
            cull_mode: None,
            ..default()
        },
        sway,
        follows_slope,
        ..default()
    };
    vec![
        look("fir", fir(), Some(far_fir()), 0.004, false),
        look("oak", oak(), Some(far_oak()), 0.004, false),
        look("bush", bush(), None, 0.02, false),
        look("stone", stone(), None, 0.0, true),
        look("flower", flower(), None, 0.12, true),
        look("grass", grass(), Some(far_grass()), 0.15, true),
    ]
}

/// Plants a terrain as soon as it is shown.
fn grow(ready: On<TerrainReady>, mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>) {
    commands.entity(ready.entity).try_insert((Plants(rules()), PlantLooks(looks(&mut meshes))));
}

/// A blow of the pickaxe or the drill at a stem fells its tree.
fn fell(
    used: On<ToolUsed>,
    camera: Single<&GlobalTransform, With<PlayerCamera>>,
    terrains: Query<(Entity, &Terrain, &ShownPlants, &GlobalTransform)>,
    mut brushes: MessageWriter<TargetedBrush>,
    mut misses: ResMut<Misses>,
) {
    if !matches!(used.tool, Tool::Pickaxe | Tool::Drill) {
        return;
    }
    for (entity, terrain, shown, place) in &terrains {
        let Some(scatter) = shown.scatter() else { continue };
        let inverse = place.affine().inverse();
        let origin = inverse.transform_point3(camera.translation()).as_dvec3();
        let direction = inverse.transform_vector3(camera.forward().into()).as_dvec3();
        let reach = used.aim.map_or(REACH, |aim| aim.point.distance(camera.translation()));
        let world = terrain.world();
        let most = f64::from(reach.min(REACH) / terrain.voxel_size());
        if let Some(hit) = scatter.raycast(world, origin, direction, most, |_| true) {
            brushes.write(TargetedBrush { terrain: entity, brush: hit.plant.removal_in_world(place) });
            misses.end();
        }
    }
}

/// The foot of the tree that is nearest to a place; `None` where none stands or plants are not shown.
pub fn nearest_tree(world: &mut World, place: Vec3) -> Option<Vec3> {
    let mut terrains = world.query::<(&Terrain, &ShownPlants, &GlobalTransform)>();
    terrains.iter(world).find_map(|(terrain, shown, at)| {
        let scatter = shown.scatter()?;
        let own = at.affine().inverse().transform_point3(place).as_dvec3();
        let is_tree = |index: usize| scatter.species()[index].stem.is_some();
        let tree = scatter.nearest(terrain.world(), own, 200.0, is_tree)?;
        Some(at.transform_point(tree.position().as_vec3()))
    })
}

/// A tree that fell, and when.
#[derive(Component)]
struct FallenTree {
    plant: PlantId,
    since: f32,
}

/// Trees that lost their ground become bodies.
fn fall(
    mut removed: MessageReader<PlantRemoved>,
    terrains: Query<(&ShownPlants, &PlantLooks)>,
    time: Res<Time>,
    mut commands: Commands,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    // Not a whole wood at once.
    for PlantRemoved { terrain, plant, transform, .. } in removed.read().take(8) {
        let Ok((shown, PlantLooks(looks))) = terrains.get(*terrain) else { continue };
        let index = usize::from(plant.id.species);
        let Some(species) = shown.scatter().and_then(|scatter| scatter.species().get(index)) else {
            continue;
        };
        let look = looks.iter().find(|look| look.species == species.name);
        let (Some(stem), Some(look)) = (species.stem, look) else { continue };
        let collider = Collider::compound(vec![(
            Vec3::Y * (stem.height / 2.0 + 0.3),
            Quat::IDENTITY,
            Collider::cylinder(stem.radius * 0.8, stem.height),
        )]);
        let push = transform.rotation * Vec3::X * 0.5;
        commands.spawn((
            FallenTree { plant: plant.id, since: time.elapsed_secs() },
            DespawnOnNewGame,
            Mesh3d(look.mesh.clone()),
            MeshMaterial3d(materials.add(look.material.clone())),
            *transform,
            (RigidBody::Dynamic, collider, AngularDamping(0.4), AngularVelocity(push)),
        ));
    }
}

/// Trees that stand again lie about no more.
fn stand_up(
    mut returned: MessageReader<PlantReturned>,
    fallen: Query<(Entity, &FallenTree)>,
    mut commands: Commands,
) {
    if returned.is_empty() {
        return;
    }
    let trees: HashMap<PlantId, Entity> = fallen.iter().map(|(entity, tree)| (tree.plant, entity)).collect();
    for plant in returned.read() {
        trees.get(&plant.plant.id).into_iter().for_each(|tree| commands.entity(*tree).try_despawn());
    }
}

fn rot(fallen: Query<(Entity, &FallenTree)>, time: Res<Time>, mut commands: Commands) {
    for (entity, tree) in &fallen {
        if time.elapsed_secs() - tree.since > LIES {
            commands.entity(entity).try_despawn();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_burrow::scatter::Scatter;

    #[test]
    fn the_rules_are_valid_and_every_species_has_a_look() {
        let scatter = Scatter::new(&rules()).expect("valid rules");
        let looks = looks(&mut Assets::default());
        for species in scatter.species() {
            assert!(looks.iter().any(|look| look.species == species.name), "{}", species.name);
        }
    }
}
