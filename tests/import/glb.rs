//! The drawn surface as glTF, and its materials as splat maps.

use std::collections::HashMap;
use std::sync::Arc;

use bevy_burrow::ground::{ColumnMaterial, MaterialMap, SplatOptions};
use bevy_burrow::lattice::{Column, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{GlbError, World};
use glam::{IVec3, Vec3};
use serde_json::Value;

fn dug() -> Terrain {
    let noise = NoiseHeights { seed: 3, scale: 20.0, amplitude: 10.0, base: 20.0, ..NoiseHeights::default() };
    let rules = MaterialRule { overlay: MaterialId(2), slope: (0.0, 0.5), ..MaterialRule::default() };
    let control = MaterialControl::Rules { base: MaterialId(1), rules: vec![rules] };
    let ground = Ground::from_noise(70, 41, &noise).and_then(|ground| ground.with_materials(&control));
    let mut terrain = Terrain::new(ground.expect("valid"), &TerrainSettings::default()).expect("valid");
    terrain.apply([
        Brush::dig(Shape::sphere(Vec3::new(20.0, 22.0, 20.0), 9.0)),
        Brush::add(Shape::sphere(Vec3::new(50.0, 30.0, 20.0), 6.0), MaterialId(5)),
        Brush::dig(Shape::capsule(Vec3::new(5.0, 15.0, 5.0), Vec3::new(60.0, 12.0, 35.0), 3.0)),
    ]);
    terrain
}

/// The JSON of a file, and its buffer.
fn parts(file: &[u8]) -> (Value, &[u8]) {
    let number = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().expect("4 bytes")) as usize;
    assert_eq!((&file[..4], number(4), number(8)), (&b"glTF"[..], 2, file.len()));
    let json = number(12);
    assert_eq!((&file[16..20], json % 4), (&b"JSON"[..], 0));
    let buffer = 20 + json;
    assert_eq!((&file[buffer + 4..buffer + 8], number(buffer) + buffer + 8), (&b"BIN\0"[..], file.len()));
    (serde_json::from_slice(&file[20..buffer]).expect("valid JSON"), &file[buffer + 8..])
}

/// All triangles of a file, in metres.
fn triangles(file: &[u8]) -> Vec<[[f32; 3]; 3]> {
    let (json, buffer) = parts(file);
    let at = |value: &Value| value.as_u64().unwrap_or_default() as usize;
    let bytes = |accessor: &Value, size: usize| {
        let view = &json["bufferViews"][at(&accessor["bufferView"])];
        let start = at(&view["byteOffset"]) + at(&accessor["byteOffset"]);
        &buffer[start..start + at(&accessor["count"]) * size]
    };
    let mut found = Vec::new();
    for node in json["nodes"].as_array().expect("nodes") {
        let place: Vec<f64> = serde_json::from_value(node["translation"].clone()).expect("a place");
        for primitive in json["meshes"][at(&node["mesh"])]["primitives"].as_array().expect("primitives") {
            let accessor = |value: &Value| json["accessors"][at(value)].clone();
            let (positions, indices) =
                (accessor(&primitive["attributes"]["POSITION"]), accessor(&primitive["indices"]));
            let positions: Vec<[f32; 3]> = bytes(&positions, 12)
                .chunks_exact(12)
                .map(|own| {
                    std::array::from_fn(|axis| {
                        let part =
                            f32::from_le_bytes(own[axis * 4..axis * 4 + 4].try_into().expect("4 bytes"));
                        part + place[axis] as f32
                    })
                })
                .collect();
            let indices: Vec<usize> = bytes(&indices, 4)
                .chunks_exact(4)
                .map(|own| u32::from_le_bytes(own.try_into().expect("4 bytes")) as usize)
                .collect();
            found.extend(indices.chunks_exact(3).map(|own| [0, 1, 2].map(|corner| positions[own[corner]])));
        }
    }
    found
}

fn drawn(world: &World, size: f32) -> Vec<[[f32; 3]; 3]> {
    let of = |(key, mesh): (bevy_burrow::terrain::MeshKey, bevy_burrow::surface::SurfaceMesh)| {
        let origin = world.origin(key).as_vec3();
        let corner = |vertex: bevy_burrow::surface::Vertex| {
            (Vec3::from_array(vertex.position_f32()) * size + origin * size).to_array()
        };
        mesh.triangles().map(|triangle| triangle.map(corner)).collect::<Vec<_>>()
    };
    world.drawn().flat_map(of).collect()
}

#[test]
fn a_file_has_every_drawn_triangle_and_no_other() {
    let terrain = dug();
    for size in [1.0, 0.5] {
        let file = terrain.world().to_glb(None, size, &|_| Vec3::ONE).expect("a file");
        assert!(triangles(&file) == drawn(terrain.world(), size));
    }
    // A part of the world: fewer, and all of them among the others.
    let near = LatticeBox { min: IVec3::new(2, 0, 2), max: IVec3::new(20, 40, 20) };
    let some = triangles(&terrain.world().to_glb(Some(near), 1.0, &|_| Vec3::ONE).expect("a file"));
    let mut all: HashMap<[[u32; 3]; 3], usize> = HashMap::new();
    let bits = |triangle: [[f32; 3]; 3]| triangle.map(|corner| corner.map(f32::to_bits));
    drawn(terrain.world(), 1.0).into_iter().for_each(|own| *all.entry(bits(own)).or_default() += 1);
    assert!(!some.is_empty() && some.len() < all.values().sum());
    assert!(some.into_iter().all(|own| all.contains_key(&bits(own))));
}

#[test]
fn colours_are_mixed_and_stay_colours() {
    let terrain = dug();
    let colour = |MaterialId(id)| Vec3::new(f32::from(id) / 5.0, f32::NAN, 9.0);
    let file = terrain.world().to_glb(None, 1.0, &colour).expect("a file");
    let (json, buffer) = parts(&file);
    let view = &json["bufferViews"][2];
    let (start, length) =
        (view["byteOffset"].as_u64().unwrap() as usize, view["byteLength"].as_u64().unwrap() as usize);
    let floats = buffer[start..start + length].chunks_exact(4);
    let floats: Vec<f32> = floats.map(|own| f32::from_le_bytes(own.try_into().expect("4 bytes"))).collect();
    assert!(floats.iter().all(|part| (0.0..=1.0).contains(part)));
    assert!(floats.chunks_exact(3).any(|own| own == [1.0, 0.0, 1.0]), "the hill of material 5");
}

#[test]
fn what_cannot_be_written_is_refused() {
    let terrain = dug();
    let outside = LatticeBox { min: IVec3::splat(5000), max: IVec3::splat(5001) };
    let glb = |region, size| terrain.world().to_glb(region, size, &|_| Vec3::ONE);
    assert_eq!(glb(Some(outside), 1.0), Err(GlbError::Empty));
    for size in [0.0, -1.0, f32::NAN, f32::INFINITY, f32::MAX, 1e37] {
        assert!(matches!(glb(None, size), Err(GlbError::VoxelSize(_))));
    }
}

#[test]
fn splat_maps_that_are_written_are_the_surface_when_they_are_read() {
    let terrain = dug();
    let maps = terrain.world().splat_maps().expect("few materials");
    assert_eq!(maps.layers, [1, 2, 5].map(MaterialId));
    let (map, report) =
        MaterialMap::decode_splats(&maps.files, &SplatOptions::of(maps.layers)).expect("its own files");
    assert_eq!(report.notes, []);
    let world = terrain.world();
    for (x, z) in (0..=70).flat_map(|x| (0..=41).map(move |z| (x, z))) {
        let y = world.height(x.into(), z.into()).expect("inside");
        let skin = map.column(x as u32, z as u32).skin();
        let place = glam::DVec3::new(x.into(), y, z.into());
        let pristine = world.ground().surface_material(Column::new(x, z));
        assert!(skin == world.material_under(place) || skin == pristine.skin(), "({x}, {z})");
    }
    // Seventeen materials are too many.
    let columns = (0..18).map(|id| ColumnMaterial::solid(MaterialId(id))).collect();
    let control = MaterialControl::Map(Arc::new(MaterialMap::from_columns(18, 1, columns).expect("a map")));
    let ground = Ground::flat(17, 1, 3.0).and_then(|ground| ground.with_materials(&control)).expect("valid");
    let many = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    let error = many.world().splat_maps().expect_err("too many").to_string();
    assert!(error.contains("18 materials"), "{error}");
}
