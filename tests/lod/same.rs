//! What stays the same: nodes that do not touch a change of level, and nodes of level 0 far from coarser ones.

use std::sync::Mutex;

use bevy_burrow::lattice::SNAP;
use bevy_burrow::surface::{SurfaceMesh, Vertex};
use fastrand::Rng;
use glam::IVec3;

use crate::check::draw;
use crate::random::{for_worlds, split_once};
use crate::worlds::world_count;

fn triangles(mesh: &SurfaceMesh) -> Vec<[Vertex; 3]> {
    mesh.triangles().collect()
}

fn is_same(a: &SurfaceMesh, b: &SurfaceMesh) -> bool {
    let bits = |mesh: &SurfaceMesh| -> Vec<_> {
        let vertices = triangles(mesh).into_iter().flatten();
        vertices
            .map(|vertex| (vertex.position, vertex.normal.to_array().map(f32::to_bits), vertex.materials))
            .collect()
    };
    bits(a) == bits(b)
}

#[test]
fn when_a_node_splits_only_nodes_that_touch_it_change() {
    // Apart, at a corner, over an edge: the same, changed.
    let counts = Mutex::new([[0usize; 2]; 3]);
    for_worlds(world_count(80), |index, terrain, cut| {
        let Some((finer, node)) = split_once(&mut Rng::with_seed(index), terrain, cut) else { return };
        let [before, after] = [cut, &finer].map(|cut| draw(terrain.world(), cut));
        for (other, mesh) in &before {
            let Some(now) = after.get(other) else {
                assert_eq!(*other, node);
                continue;
            };
            let is_same = is_same(mesh, now);
            let shared = cut.touching(*other).contains(&node);
            assert!(shared || is_same, "world {index}: {other:?} changed though {node:?} does not touch it");
            let [size, low] =
                [node, *other].map(|node| cut.grid().columns(node)).map(|(low, high)| [low, high]);
            let overlap = |a: [i32; 2], b: [i32; 2]| a[1].min(b[1]) - a[0].max(b[0]);
            let along = [
                overlap([size[0].x, size[1].x], [low[0].x, low[1].x]),
                overlap([size[0].z, size[1].z], [low[0].z, low[1].z]),
            ];
            let kind = if !shared {
                0
            } else if along == [0, 0] {
                1
            } else {
                2
            };
            counts.lock().expect("no panic")[kind][usize::from(!is_same)] += 1;
        }
    });
    let counts = counts.into_inner().expect("no panic");
    println!("nodes apart, at a corner, over an edge; the same and changed: {counts:?}");
    assert_eq!(counts[0][1], 0);
    assert!(counts[2][1] > 0, "{counts:?}");
}

#[test]
fn plain_nodes_are_drawn_by_their_tiles_and_chunks() {
    let counts = Mutex::new([0usize; 3]);
    for_worlds(world_count(80), |index, terrain, cut| {
        let world = terrain.world();
        for node in cut.nodes().filter(|node| node.level == 0) {
            let is_plain = world.is_plain(cut, node);
            counts.lock().expect("no panic")[usize::from(is_plain)] += 1;
            let tile = node.tile();
            let mut chunks: Vec<_> = world.drawn_chunks().filter(|chunk| chunk.tile() == tile).collect();
            chunks.sort_unstable();
            let mut expected = triangles(&world.tile_mesh(tile));
            for chunk in chunks {
                let up = IVec3::Y * (world.grid().origin(chunk).y * SNAP);
                let moved = |vertex: Vertex| Vertex { position: vertex.position + up, ..vertex };
                expected.extend(world.chunk_mesh(chunk).triangles().map(|triangle| triangle.map(moved)));
            }
            let mesh = world.node_mesh(cut, node);
            let vertices: Vec<Vertex> = expected.into_iter().flatten().collect();
            let numbers = (0..vertices.len() as u32).collect();
            let indices = bevy_burrow::surface::Indices::new(vertices.len(), numbers);
            let is_same = is_same(&mesh, &SurfaceMesh { vertices, indices });
            assert!(is_same || !is_plain, "world {index}: {node:?}");
            counts.lock().expect("no panic")[2] += usize::from(!is_same);
        }
    });
    let [drawn_anew, plain, differ] = counts.into_inner().expect("no panic");
    println!("{plain} plain nodes, {drawn_anew} others, of which {differ} look different");
    assert!(plain > 0 && differ > 0);
}
