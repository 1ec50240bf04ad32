//! Samples that are encoded and decoded in a second.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use bevy_burrow::format::WorldId;
use bevy_burrow::prelude::*;
use bevy_burrow::store::{from_bytes, to_bytes};
use bevy_burrow::terrain::Meshing;
use fastrand::Rng;
use glam::Vec3;

use crate::worlds::real_ground;

pub fn print() {
    let ground = Arc::new(real_ground());
    let mut rng = Rng::with_seed(1);
    let mut dig = |_| {
        let [x, z, radius] = [20.0 + rng.f32() * 900.0, 20.0 + rng.f32() * 900.0, 2.0 + rng.f32() * 3.0];
        (Vec3::new(x, 0.0, z), radius)
    };
    let digs = (0..2_000).map(&mut dig).collect();
    for (name, digs) in [("2,000 digs", digs), ("a crater", vec![(Vec3::new(500.0, 0.0, 500.0), 60.0)])] {
        print_world(name, &ground, digs);
    }
}

/// Digs at these points of the surface, with these radii.
fn print_world(name: &str, ground: &Arc<Ground>, digs: Vec<(Vec3, f32)>) {
    let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid settings");
    terrain.set_meshing(Meshing::Never);
    let height =
        |at: Vec3| terrain.world().height(at.x.into(), at.z.into()).expect("within the world") as f32;
    let brushes: Vec<Brush> = digs
        .into_iter()
        .map(|(at, radius)| Brush::dig(Shape::sphere(at.with_y(height(at)), radius)))
        .collect();
    terrain.apply(brushes);
    let samples: u64 =
        terrain.world().bricks().map(|(pos, brick)| brick.edited_samples(pos).count() as u64).sum();
    let start = Instant::now();
    let bytes = to_bytes(&terrain, WorldId(1), &BTreeMap::new()).expect("a small world");
    let encoded = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let imported = from_bytes(&bytes, Arc::clone(ground)).expect("the bytes of a world");
    let decoded = start.elapsed().as_secs_f64();
    assert_eq!(imported.terrain.world().hash(), terrain.world().hash());
    let million = samples as f64 / 1e6;
    println!(
        "{name}: {million:.2} million edited samples, {:.2} bytes each; {:.1} million a second are encoded, {:.1} decoded",
        bytes.len() as f64 / samples as f64,
        million / encoded,
        million / decoded
    );
    print_others(&terrain);
}

/// What compressors for everybody make of the same samples: densities first, then materials. Which samples they are, which a
/// saved world says too, is left out.
fn print_others(terrain: &Terrain) {
    let world = terrain.world();
    let (densities, materials): (Vec<i16>, Vec<u8>) = world
        .bricks()
        .flat_map(|(pos, brick)| brick.edited_samples(pos))
        .map(|(_, density, MaterialId(material))| (density as i16, material))
        .unzip();
    let bytes = |densities: &[i16], materials: &[u8]| -> Vec<u8> {
        densities.iter().flat_map(|density| density.to_le_bytes()).chain(materials.iter().copied()).collect()
    };
    let plain = bytes(&densities, &materials);
    for level in [1, 3, 19] {
        let pack = || zstd::bulk::compress(&plain, level).expect("bytes");
        let unpack = |packed: &[u8]| zstd::bulk::decompress(packed, plain.len()).expect("packed bytes");
        print_other(&format!("zstd, level {level}"), &plain, pack, unpack);
    }
    for level in [4, 8] {
        let settings = pco::ChunkConfig::default().with_compression_level(level);
        let pack = || {
            let densities = pco::standalone::simple_compress(&densities, &settings).expect("numbers");
            let materials = zstd::bulk::compress(&materials, 3).expect("bytes");
            let length = (densities.len() as u32).to_le_bytes();
            [&length[..], &densities, &materials].concat()
        };
        let unpack = |packed: &[u8]| {
            let (length, packed) = packed.split_at(4);
            let (first, second) =
                packed.split_at(u32::from_le_bytes(length.try_into().expect("four bytes")) as usize);
            let densities: Vec<i16> = pco::standalone::simple_decompress(first).expect("packed numbers");
            bytes(&densities, &zstd::bulk::decompress(second, materials.len()).expect("packed bytes"))
        };
        print_other(&format!("pco, level {level}, materials by zstd"), &plain, pack, unpack);
    }
}

fn print_other(name: &str, plain: &[u8], pack: impl Fn() -> Vec<u8>, unpack: impl Fn(&[u8]) -> Vec<u8>) {
    let start = Instant::now();
    let packed = pack();
    let encoded = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let unpacked = unpack(&packed);
    let decoded = start.elapsed().as_secs_f64();
    assert!(unpacked == plain, "{name} returns what it was given");
    // A density takes two bytes, a material one.
    let samples = plain.len() as f64 / 3.0;
    println!(
        "    {name}: {:.2} bytes each; {:.1} million a second are encoded, {:.1} decoded",
        packed.len() as f64 / samples,
        samples / encoded / 1e6,
        samples / decoded / 1e6
    );
}
