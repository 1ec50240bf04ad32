//! The drawn surface is closed, whatever was dug.
//!
//! `BURROW_WORLDS=10000 cargo test --release --no-default-features --test seams` runs more random worlds.

mod worlds;

use std::collections::BTreeMap;
use std::collections::hash_map::Entry;

use bevy_burrow::lattice::SNAP;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::MaterialMix;
use bevy_burrow::terrain::{MeshKey, World};
use fastrand::Rng;
use glam::{IVec3, Vec3};
use rustc_hash::FxHashMap;
use worlds::{random_world, real_ground, world_count};

/// Vertices at the same position that were compared, and how many of them have several materials, by the parts that
/// meet there.
#[derive(Debug, Default)]
struct MeetingVertices(BTreeMap<&'static str, [usize; 2]>);

impl MeetingVertices {
    fn kind(a: MeshKey, b: MeshKey) -> &'static str {
        match (a, b) {
            (MeshKey::Tile(a), MeshKey::Tile(b)) if a == b => "parts of a tile",
            (MeshKey::Tile(_), MeshKey::Tile(_)) => "two tiles",
            (MeshKey::Chunk(a), MeshKey::Chunk(b)) if a == b => "parts of a chunk",
            (MeshKey::Chunk(_), MeshKey::Chunk(_)) => "two chunks",
            _ => "tile and chunk",
        }
    }

    fn add(&mut self, other: &Self) {
        for (kind, [all, mixed]) in &other.0 {
            let own = self.0.entry(kind).or_default();
            (own[0], own[1]) = (own[0] + all, own[1] + mixed);
        }
    }

    /// Checks that all drawn vertices at the same position have the same materials and weights.
    fn check_materials(&mut self, world: &World, what: &str) {
        let mut first: FxHashMap<IVec3, (MeshKey, MaterialMix)> = FxHashMap::default();
        for (drawn, mesh) in world.drawn() {
            // Tiles also contain vertices that no triangle uses.
            let mut is_drawn = vec![false; mesh.vertices.len()];
            mesh.indices.iter().for_each(|index| is_drawn[index as usize] = true);
            let origin = world.origin(drawn) * SNAP;
            for (vertex, _) in mesh.vertices.iter().zip(is_drawn).filter(|(_, is_drawn)| *is_drawn) {
                let (place, own) = (origin + vertex.position, vertex.materials);
                let (other, theirs) = match first.entry(place) {
                    Entry::Vacant(place) => {
                        place.insert((drawn, own));
                        continue;
                    }
                    Entry::Occupied(entry) => *entry.get(),
                };
                let at = place.as_dvec3() / f64::from(SNAP);
                assert_eq!(own, theirs, "{what}: materials of {drawn:?} and {other:?} at {at}");
                let [all, mixed] = self.0.entry(Self::kind(drawn, other)).or_default();
                *all += 1;
                *mixed += usize::from(own.weights[0] < 255);
            }
        }
    }
}

#[test]
fn random_worlds_are_flawless() {
    let worlds = world_count(300);
    let threads = std::thread::available_parallelism().map_or(2, |n| n.get() as u64);
    let (mut triangles, mut cells, mut meeting) = (0, 0, MeetingVertices::default());
    std::thread::scope(|scope| {
        let soak = |thread: u64| {
            let (mut triangles, mut cells, mut meeting) = (0, 0, MeetingVertices::default());
            for index in (thread..worlds).step_by(threads as usize) {
                let terrain = random_world(&mut Rng::with_seed(index), index);
                let report = terrain.world().check_seams();
                assert!(report.is_flawless(), "world {index}: {report}");
                meeting.check_materials(terrain.world(), &format!("world {index}"));
                triangles += report.triangles;
                cells += terrain.world().mask().len();
            }
            (triangles, cells, meeting)
        };
        let runs: Vec<_> = (0..threads).map(|thread| scope.spawn(move || soak(thread))).collect();
        for run in runs {
            let (t, c, m) = run.join().expect("a world failed; see above");
            triangles += t;
            cells += c;
            meeting.add(&m);
        }
    });
    assert!(cells > 0, "no world was dug at its surface");
    println!("vertices that meet in seams, and those of more than one material: {meeting:?}");
    for kind in ["two tiles", "two chunks", "tile and chunk"] {
        assert!(meeting.0.get(kind).is_some_and(|[_, mixed]| *mixed > 0), "{kind}: {meeting:?}");
    }
    println!(
        "{worlds} worlds, {triangles} triangles, {cells} cells drawn by marching cubes: all closed, all manifold"
    );
}

#[test]
fn a_brush_row_over_the_steepest_real_ground_leaves_no_open_edge() {
    let ground = real_ground();
    let steepness = |x: i32, z: i32| {
        let h = |dx, dz| ground.height(bevy_burrow::lattice::Column::new(x + dx, z + dz));
        (h(1, 0) - h(-1, 0)).abs().max((h(0, 1) - h(0, -1)).abs())
    };
    let columns = (32..ground.depth() - 32).flat_map(|z| (64..ground.width() - 64).map(move |x| (x, z)));
    let (x, z) = columns.max_by_key(|&(x, z)| steepness(x, z)).expect("the landscape is large enough");
    println!("steepest at ({x}, {z}): {:.2} voxels rise per voxel", f64::from(steepness(x, z)) / 512.0);
    let row: Vec<Brush> = (-8..=8)
        .map(|i| {
            let column = bevy_burrow::lattice::Column::new(x + i * 4, z + i);
            let height = ground.height(column) as f32 / 256.0;
            Brush::dig(Shape::sphere(Vec3::new(column.x as f32, height, column.z as f32), 4.0))
        })
        .collect();
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    terrain.apply(&row);
    let report = terrain.world().check_seams();
    println!("{report}");
    assert!(report.is_flawless(), "{report}");
}

#[test]
fn ground_dug_through_the_rim_is_shaded_there_as_it_is_inside() {
    for (chunk_size, along, across) in [(8, Vec3::X, Vec3::Z), (25, Vec3::Z, Vec3::X)] {
        let ground = Ground::flat(42, 42, 10.3).expect("finite heights");
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        let rod = |y: f32, beside: f32| {
            let middle = across * beside + Vec3::Y * y;
            Shape::capsule(middle - along * 30.0, middle + along * 72.0, 3.0)
        };
        terrain.apply([
            Brush::dig(rod(10.0, 8.0)),
            Brush::dig(rod(2.0, 21.0)),
            Brush::add(rod(11.0, 34.0), MaterialId(2)),
        ]);

        // The cut is the same along the whole world, so neighbouring vertices have the same normal.
        let mut normals: BTreeMap<[i32; 2], Vec3> = BTreeMap::new();
        let (mut vertices, mut at_rim) = (0, 0);
        let world = terrain.world();
        for chunk in world.drawn_chunks() {
            let mesh = world.chunk_mesh(chunk);
            for vertex in &mesh.vertices {
                let place = vertex.position + world.grid().origin(chunk) * SNAP;
                let [here, beside] = if along == Vec3::X { [place.x, place.z] } else { [place.z, place.x] };
                let first = *normals.entry([beside, place.y]).or_insert(vertex.normal);
                assert!(first.distance(vertex.normal) < 1.0e-6, "{place}: {} or {first}", vertex.normal);
                vertices += 1;
                at_rim += usize::from(here == 0 || here == 42 * SNAP);
            }
        }
        assert!(vertices > 2_000 && at_rim > 80, "{vertices} vertices, {at_rim} at the rim");
    }
}
