//! Links over ledges as animation links of landmass.

use bevy::prelude::*;
use bevy_landmass::prelude::*;

use super::Navigation;
use crate::lattice::SNAP;
use crate::navigation::{LedgeLink, NavTilePos};
use crate::plugin::Places;

impl Navigation {
    /// The kind of animation links along which agents jump down.
    pub const JUMP_DOWN: usize = 0;
    /// The kind of animation links along which agents climb up.
    pub const CLIMB_UP: usize = 1;
}

/// How much longer a metre of climbing is than one of walking, for the choice of paths.
const CLIMBING: f32 = 4.0;

/// The edges of a link, in voxels of the terrain: where it begins, and where it leads.
#[derive(Component, Clone, Copy, Debug)]
pub(super) struct LedgeEdges {
    terrain: Entity,
    edges: [[Vec3; 2]; 2],
}

impl LedgeEdges {
    fn placed(&self, place: &GlobalTransform) -> [(Vec3, Vec3); 2] {
        self.edges.map(|edge| edge.map(|end| place.transform_point(end))).map(|[from, to]| (from, to))
    }
}

/// Spawns the links of a tile as children of its island. Returns them.
pub(super) fn spawn_links(
    navigation: &Navigation,
    island: Entity,
    pos: NavTilePos,
    ledges: &[LedgeLink],
    place: &GlobalTransform,
    commands: &mut Commands,
) -> Vec<Entity> {
    let mut spawned = Vec::new();
    for ledge in ledges {
        let origin = pos.origin().at(0).as_vec3();
        // Inside the cells, where there is mesh on all sides.
        let ends = |[from, to]: [IVec3; 2], by: f32| {
            let [from, to] =
                [from, to].map(|end| origin + end.as_vec3() / SNAP as f32 + ledge.way.as_vec3() * by);
            let along = (to - from).normalize_or_zero() / 4.0;
            [from + along, to - along]
        };
        let (top, bottom) = (ends(ledge.top, -0.5), ends(ledge.bottom, 0.5));
        let kinds = [
            (ledge.is_jump, Navigation::JUMP_DOWN, [top, bottom]),
            (ledge.is_climb, Navigation::CLIMB_UP, [bottom, top]),
        ];
        for (_, kind, edges) in kinds.into_iter().filter(|(is_there, ..)| *is_there) {
            let own = LedgeEdges { terrain: navigation.terrain, edges };
            let [start_edge, end_edge] = own.placed(place);
            let way = end_edge.0 - start_edge.0;
            let steep = if kind == Navigation::CLIMB_UP { CLIMBING } else { 1.0 };
            let link = AnimationLink3d {
                start_edge,
                end_edge,
                kind,
                cost: way.xz().length() + way.y.abs() * steep,
                bidirectional: false,
            };
            let archipelago_ref = ArchipelagoRef3d::new(navigation.archipelago);
            let bundle = (AnimationLink3dBundle { link, archipelago_ref }, own);
            spawned.push(commands.spawn(bundle).id());
        }
    }
    let children = spawned.clone();
    // The island may be despawned in this frame.
    commands.queue(move |world: &mut World| {
        for link in children {
            if world.get_entity(island).is_err() {
                world.despawn(link);
            } else if let Ok(mut link) = world.get_entity_mut(link) {
                link.insert(ChildOf(island));
            }
        }
    });
    spawned
}

/// Moves links with terrains that move.
pub(super) fn move_links(
    mut links: Query<(&LedgeEdges, &mut AnimationLink3d)>,
    moved: Query<Entity, (With<crate::terrain::Terrain>, Changed<GlobalTransform>)>,
    places: Places,
) {
    if moved.is_empty() {
        return;
    }
    for (own, mut link) in links.iter_mut().filter(|(own, _)| moved.contains(own.terrain)) {
        let Some(place) = places.of(own.terrain) else { continue };
        let [start, end] = own.placed(&place);
        if (link.start_edge, link.end_edge) != (start, end) {
            (link.start_edge, link.end_edge) = (start, end);
        }
    }
}
