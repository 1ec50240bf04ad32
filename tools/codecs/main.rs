//! Bytes of edited samples, and how many are encoded and decoded in a second: as worlds are saved, by zstd, and by pco.
//!
//! `cargo run --release --manifest-path tools/codecs/Cargo.toml`

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use bevy_burrow::format::WorldId;
use bevy_burrow::prelude::*;
use bevy_burrow::store::WorldFile;
use bevy_burrow::terrain::Meshing;
use fastrand::Rng;
use glam::Vec3;

const HEIGHTS: &[u8] = include_bytes!("../../assets/jacksboro_fault.png");

fn main() {
    let image = GreyImage::decode_png(HEIGHTS, &ImageLimits::default()).expect("the shipped picture");
    let scale = ImageScale { voxels_per_sample: 3, low: 0.0, high: 150.0, detail: None };
    let ground = Arc::new(Ground::from_image(&image, &scale).expect("a valid landscape"));
    let mut rng = Rng::with_seed(1);
    let digs = (0..2_000)
        .map(|_| [20.0 + rng.f32() * 900.0, 20.0 + rng.f32() * 900.0, 2.0 + rng.f32() * 3.0])
        .collect();
    print_world("2,000 digs", &ground, digs);
    print_world("a crater", &ground, vec![[500.0, 500.0, 60.0]]);
}

/// Digs at these x and z of the surface, with these radii.
fn print_world(name: &str, ground: &Arc<Ground>, digs: Vec<[f32; 3]>) {
    let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid settings");
    terrain.set_meshing(Meshing::Never);
    let dig = |[x, z, radius]: [f32; 3]| {
        let height = terrain.world().height(x.into(), z.into()).expect("within the world");
        Brush::dig(Shape::sphere(Vec3::new(x, height as f32, z), radius))
    };
    let brushes: Vec<Brush> = digs.into_iter().map(dig).collect();
    terrain.apply(brushes);
    let samples: usize = terrain.world().bricks().map(|(pos, brick)| brick.edited_samples(pos).count()).sum();
    println!("{name}: {:.2} million edited samples", samples as f64 / 1e6);
    let start = Instant::now();
    let bytes = WorldFile::to_bytes(&terrain, WorldId(1), &BTreeMap::new()).expect("a small world");
    let encoded = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let imported = WorldFile::from_bytes(&bytes, Arc::clone(ground)).expect("the bytes of a world");
    let decoded = start.elapsed().as_secs_f64();
    assert_eq!(imported.terrain.world().hash(), terrain.world().hash());
    print("as worlds are saved, with their places", samples, bytes.len(), encoded, decoded);
    print_others(&terrain);
}

fn print(name: &str, samples: usize, bytes: usize, encoded: f64, decoded: f64) {
    let samples = samples as f64;
    println!(
        "    {name}: {:.2} bytes each; {:.1} million a second are encoded, {:.1} decoded",
        bytes as f64 / samples,
        samples / encoded / 1e6,
        samples / decoded / 1e6
    );
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
    print(name, plain.len() / 3, packed.len(), encoded, decoded);
}
