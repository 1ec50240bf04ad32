//! Builds navigation meshes in tasks, and makes islands of them.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_landmass::coords::ThreeD;
use bevy_landmass::prelude::*;
use bevy_landmass::{NavMeshHandle, NavigationMesh};

use super::Navigation;
use super::ledges::spawn_links;
use super::tiles::{Build, BuiltMesh, LoadedTile, NavigationTiles, despawn};
use crate::lattice::SNAP;
use crate::navigation::{NavPolygons, NavTilePos, WalkableTile};
use crate::plugin::Places;
use crate::terrain::World as Ground;
use crate::threads::{ThreadTask, Threads};

/// The most tiles that one task builds.
pub(super) const TILES: usize = 32;

/// See [`NavigationPlugin::wait`](super::NavigationPlugin::wait).
#[derive(Resource)]
pub(super) struct Wait(pub Duration);

impl NavigationTiles {
    /// Starts to build tiles of a world.
    pub(super) fn build(&mut self, world: &Arc<Ground>, tiles: &[NavTilePos], is_urgent: bool) {
        let Some(walker) = self.walker.clone() else { return };
        let scale = self.scale;
        let threads = if is_urgent { Threads::Transactions } else { Threads::Background };
        for tiles in tiles.chunks(TILES) {
            let (world, walker, own) = (Arc::clone(world), Arc::clone(&walker), tiles.to_vec());
            let task = ThreadTask::start(threads, move || {
                let built = own.into_iter().map(|pos| {
                    let tile = WalkableTile::new(&world, pos, &walker);
                    let polygons = tile.polygons();
                    let mesh = mesh(&polygons, scale);
                    (pos, mesh.map(|mesh| BuiltMesh { polygons, ledges: tile.ledges(), mesh }))
                });
                built.collect()
            });
            self.count += 1;
            let (number, tiles) = (self.count, tiles.to_vec());
            self.builds.push(Build { number, tiles, is_awaited: is_urgent, is_urgent, task });
        }
    }
}

/// The mesh of a tile in metres, from its lowest column on; `None` if it has no polygons.
fn mesh(polygons: &NavPolygons, scale: f32) -> Option<Arc<ValidNavigationMesh3d>> {
    if polygons.is_empty() {
        return None;
    }
    let vertices = polygons.vertices().iter().map(|vertex| vertex.as_vec3() / SNAP as f32 * scale);
    let mesh = NavigationMesh::<ThreeD> {
        vertices: vertices.collect(),
        // Landmass wants them clockwise, seen from above, where y points up.
        polygons: polygons
            .iter()
            .map(|own| own.iter().rev().map(|&vertex| vertex as usize).collect())
            .collect(),
        polygon_type_indices: vec![0; polygons.len()],
        height_mesh: None,
    };
    let checked = mesh.validate();
    checked
        .map_err(|error| error!("the tile {:?} has no navigation mesh: {error}", polygons.pos()))
        .ok()
        .map(Arc::new)
}

/// Makes islands of tiles that are done, and replaces those that changed. Waits for tiles that the commit of the last
/// frame changed.
pub(super) fn replace_islands(
    mut navigations: Query<(&Navigation, &mut NavigationTiles)>,
    places: Places,
    meshes: Option<ResMut<Assets<NavMesh3d>>>,
    handles: Query<&NavMeshHandle3d>,
    wait: Res<Wait>,
    mut commands: Commands,
) {
    // Without landmass' plugin, nothing is shown.
    let Some(mut meshes) = meshes else { return };
    let start = Instant::now();
    for (navigation, mut tiles) in &mut navigations {
        let tiles = tiles.bypass_change_detection();
        let mut done = Vec::new();
        tiles.builds.retain_mut(|build| {
            let is_awaited = std::mem::take(&mut build.is_awaited);
            let time = if is_awaited { wait.0.saturating_sub(start.elapsed()) } else { Duration::ZERO };
            let Some(result) = build.task.check_within(time) else { return true };
            // A task that panicked has logged why. Its tiles have no islands: those before may be of ground that is
            // gone.
            let empty = |_| build.tiles.iter().map(|&pos| (pos, None)).collect();
            done.push((build.number, result.unwrap_or_else(empty)));
            false
        });
        for (number, built) in done {
            for (pos, mesh) in built {
                // Newer ones may be done already, and tiles may be gone.
                let Some(tile) = tiles.tiles.get_mut(&pos).filter(|tile| tile.build < number) else {
                    continue;
                };
                tile.build = number;
                let ledges = mesh.as_ref().map_or_else(Vec::new, |mesh| mesh.ledges.clone());
                // Landmass searches new paths for all agents whose paths cross an island that is replaced.
                let island = tile.island.filter(|&island| handles.contains(island));
                let is_same = tile.polygons.as_deref() == mesh.as_ref().map(|mesh| &mesh.polygons);
                if !is_same || island != tile.island {
                    show(navigation, pos, tile, mesh, (&mut meshes, &handles), &mut commands);
                }
                if ledges == tile.ledges && island == tile.island {
                    continue;
                }
                tile.links.drain(..).for_each(|link| despawn(Some(link), &mut commands));
                tile.ledges.clear();
                if let (Some(island), Some(place)) = (tile.island, places.of(navigation.terrain)) {
                    tile.links = spawn_links(navigation, island, pos, &ledges, &place, &mut commands);
                    tile.ledges = ledges;
                }
            }
        }
    }
}

/// Gives a tile its island, a new mesh, or none.
fn show(
    navigation: &Navigation,
    pos: NavTilePos,
    tile: &mut LoadedTile,
    built: Option<BuiltMesh>,
    (meshes, handles): (&mut Assets<NavMesh3d>, &Query<&NavMeshHandle3d>),
    commands: &mut Commands,
) {
    let Some(BuiltMesh { polygons, mesh: nav_mesh, .. }) = built else {
        despawn(tile.island.take(), commands);
        tile.polygons = None;
        return;
    };
    tile.polygons = Some(Arc::new(polygons));
    let nav_mesh = || NavMesh3d { nav_mesh: Arc::clone(&nav_mesh) };
    if let Some(handle) = tile.island.and_then(|island| handles.get(island).ok()) {
        // Landmass takes the mesh of the handle before agents move in this frame.
        if meshes.insert(&handle.0, nav_mesh()).is_ok() {
            return;
        }
    }
    despawn(tile.island.take(), commands);
    let island = Island3dBundle {
        island: Island,
        archipelago_ref: ArchipelagoRef3d::new(navigation.archipelago),
        nav_mesh: NavMeshHandle(meshes.add(nav_mesh())),
    };
    let origin = pos.origin().at(0).as_vec3();
    // A terrain may be despawned in this frame.
    let (terrain, bundle) = (navigation.terrain, (island, Transform::from_translation(origin)));
    tile.island = Some(commands.spawn(bundle).id());
    if let Some(island) = tile.island {
        commands.queue(move |world: &mut World| {
            if world.get_entity(terrain).is_err() {
                world.despawn(island);
            } else if let Ok(mut island) = world.get_entity_mut(island) {
                island.insert(ChildOf(terrain));
            }
        });
    }
}
