//! Coarse vertices have the shares of the materials that they stand for.

use bevy_burrow::ground::{Ground, MaterialControl, MaterialId};
use bevy_burrow::lattice::Column;
use bevy_burrow::lod::Cut;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::Vertex;
use bevy_burrow::terrain::World;

use crate::check::{check, draw};

/// Level ground with a material for each column.
fn ground(side: i32, material: impl Fn(Column) -> u8) -> Ground {
    let ids = (0..=side).flat_map(|z| (0..=side).map(move |x| Column::new(x, z)));
    let samples = ids.map(|column| u16::from(material(column)) << 8).collect();
    let map =
        GreyImage::from_samples(side as u32 + 1, side as u32 + 1, samples).expect("a sample for each column");
    let control = MaterialControl::Ids { map, base: MaterialId(0) };
    let ground = Ground::flat(side as u32, side as u32, 4.5).expect("a valid size");
    ground.with_materials(&control).expect("valid materials")
}

fn terrain(ground: Ground) -> Terrain {
    Terrain::new(ground, &TerrainSettings { chunk_size: 8, ..Default::default() }).expect("valid settings")
}

/// The vertices that a cut draws, by node level, with their columns.
fn vertices(world: &World, cut: &Cut) -> Vec<(u8, Column, Vertex)> {
    let of_node = |(node, mesh): (bevy_burrow::lod::Node, bevy_burrow::surface::SurfaceMesh)| {
        let low = cut.grid().columns(node).0;
        let of = move |vertex: Vertex| {
            let [x, _, z] = vertex.position_f32();
            (node.level, low.offset(x as i32, z as i32), vertex)
        };
        mesh.triangles().flatten().map(of).collect::<Vec<_>>()
    };
    world.drawn_in(cut).flat_map(of_node).collect()
}

fn share(vertex: &Vertex, material: u8) -> u32 {
    let mix = vertex.materials;
    mix.ids
        .iter()
        .zip(mix.weights)
        .filter(|(id, _)| **id == material)
        .map(|(_, weight)| u32::from(weight))
        .sum()
}

#[test]
fn a_coarse_vertex_has_the_shares_of_its_columns() {
    let inside = |column: Column| (8..=56).contains(&column.x) && (8..=56).contains(&column.z);
    // A border along x: its vertices show some of both, and all others one.
    let halves = terrain(ground(64, |column| 1 + u8::from(column.x >= 33)));
    for level in 1..=3 {
        let cut = Cut::coarsest(halves.world().lod_grid(level));
        let mut mixed = 0;
        for (level, column, vertex) in
            vertices(halves.world(), &cut).into_iter().filter(|(_, at, _)| inside(*at))
        {
            let (left, right) = (share(&vertex, 1), share(&vertex, 2));
            assert_eq!(left + right, 255);
            let stride = 1 << level;
            mixed += usize::from(left > 0 && right > 0);
            match column.x {
                x if x + stride <= 33 => assert_eq!(left, 255, "{column:?} at level {level}"),
                x if x - stride >= 33 => assert_eq!(right, 255, "{column:?} at level {level}"),
                _ => {}
            }
        }
        assert!(mixed > 0, "level {level}");
    }
}

#[test]
fn full_detail_is_what_it_was() {
    let spots = terrain(ground(64, |column| 1 + (column.x * 7 + column.z * 13) as u8 % 5));
    let world = spots.world();
    let cut = Cut::new(world.lod_grid(3), |_| true);
    for (level, column, vertex) in vertices(world, &cut) {
        assert_eq!((level, share(&vertex, world.ground().surface_material(column).skin().0)), (0, 255));
    }
}

#[test]
fn levels_show_the_same_where_they_meet() {
    let spots = terrain(ground(96, |column| 1 + ((column.x / 3) ^ (column.z / 5)) as u8 % 5));
    let world = spots.world();
    let mut coarse = 0;
    for seed in 0..40 {
        let cut = Cut::random(world.lod_grid(3), seed, 60);
        let counts = check(world, &cut, &draw(world, &cut));
        assert!(counts.is_flawless());
        assert_eq!(counts.material_jumps, 0, "cut {seed}");
        coarse += counts.coarse;
    }
    assert!(coarse > 1000);
}
