//! Meshes with more vertices than 16-bit indices can address.

use bevy_burrow::ground::Ground;
use bevy_burrow::lattice::ONE;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::{Indices, SurfaceMesh};
use bevy_burrow::terrain::MeshKey;
use glam::Vec3;

/// Checks that indices have 16 bits where that is enough, and that each has a vertex; returns whether they have 32
/// bits.
fn check(what: &str, mesh: &SurfaceMesh) -> bool {
    let is_long = matches!(mesh.indices, Indices::U32(_));
    assert_eq!(is_long, mesh.vertices.len() > Indices::MAX_SHORT, "{what}");
    assert!(mesh.indices.iter().all(|index| (index as usize) < mesh.vertices.len()), "{what}");
    is_long
}

/// A grid of holes below level ground, layer by layer from the top.
fn holes(layers: std::ops::Range<i32>) -> Vec<Brush> {
    let place = |i: i32| 8.0 + 12.0 * i as f32;
    let hole = |x, y, z| Brush::dig(Shape::sphere(Vec3::new(place(x), place(9 - y), place(z)), 4.5));
    layers.flat_map(|y| (0..100).map(move |i| hole(i % 10, y, i / 10))).collect()
}

#[test]
fn a_chunk_grows_beyond_16_bits_and_shrinks_again() {
    let ground = || Ground::flat(128, 128, 130.0).expect("valid ground");
    let settings = TerrainSettings { chunk_size: 128, ..Default::default() };
    let mut terrain = Terrain::new(ground(), &settings).expect("valid settings");
    let (mut states, mut long) = (vec![terrain.world().drawn().collect::<Vec<_>>()], 0);
    for layer in 0..8 {
        terrain.apply(holes(layer..layer + 1));
        let drawn: Vec<(MeshKey, SurfaceMesh)> = terrain.world().drawn().collect();
        long += drawn.iter().filter(|(at, mesh)| check(&format!("{at:?}, {layer} layers"), mesh)).count();
        states.push(drawn);
    }
    assert!((1..8).contains(&long), "{long} meshes with 32-bit indices");
    let mut at_once = Terrain::new(ground(), &settings).expect("valid settings");
    at_once.apply(holes(0..8));
    assert!(
        at_once.world().drawn().collect::<Vec<_>>() == states[8],
        "digging layer by layer differs from digging all at once"
    );
    let seams = terrain.world().check_seams();
    assert!(seams.is_flawless(), "{seams:?}");
    for state in states.iter().rev().skip(1) {
        terrain.undo();
        assert!(terrain.world().drawn().collect::<Vec<_>>() == *state, "undo draws something else");
    }
}

#[test]
fn a_ring_on_needles_makes_a_tile_grow_beyond_16_bits() {
    let height = |at: i32| if (at % 34 + at / 34) % 2 == 0 { 0 } else { (3000 + at) * ONE };
    let ground = Ground::from_heights(33, 33, (0..34 * 34).map(height).collect()).expect("valid ground");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let untouched: Vec<(MeshKey, SurfaceMesh)> = terrain.world().drawn().collect();
    terrain.apply([Brush::dig(Shape::sphere(Vec3::new(16.0, 1500.0, 16.0), 3.0))]);
    let is_long = |(at, mesh): (MeshKey, SurfaceMesh)| {
        check(&format!("{at:?}"), &mesh) && matches!(at, MeshKey::Tile(_))
    };
    assert!(terrain.world().drawn().any(is_long), "no tile has more vertices than 16 bits can address");
    let seams = terrain.world().check_seams();
    assert!(seams.is_flawless(), "{seams:?}");
    terrain.undo();
    assert!(terrain.world().drawn().collect::<Vec<_>>() == untouched);
}
