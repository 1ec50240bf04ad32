//! Heightmaps that are written: read again, they are as before.

use bevy_burrow::ground::{
    ElevationGrid, ElevationScale, HeightFormat, ImportOptions, RawLayout, Repair, SampleKind,
};
use bevy_burrow::prelude::*;
use glam::Vec3;

use super::hash;

fn grid(width: u32, height: u32) -> ElevationGrid {
    let value = |index: u32| match index % 41 {
        7 => f32::NAN,
        part => part as f32 * 12.37 - 91.015_62 + index as f32 / 3.0,
    };
    ElevationGrid::from_samples(width, height, (0..width * height).map(value).collect()).expect("a grid")
}

fn read(bytes: &[u8], format: Option<HeightFormat>, (width, height): (u32, u32)) -> ElevationGrid {
    let sample = Some(SampleKind::Float(32));
    let byte_order = Some(bevy_burrow::ground::RawFormat::LittleEndian);
    let raw = RawLayout { size: Some((width, height)), sample, byte_order, ..RawLayout::default() };
    let options = ImportOptions { format, raw, voids: Repair::Keep, ..ImportOptions::default() };
    ElevationGrid::decode(bytes, &options).expect("the written file can be read").0
}

#[test]
fn exact_formats_come_back_bit_by_bit() {
    for size in [(1, 1), (2, 5), (33, 17)] {
        let grid = grid(size.0, size.1);
        for (bytes, format) in [
            (grid.encode_raw(), Some(HeightFormat::Raw)),
            (grid.encode_ascii(2.5).into_bytes(), None),
            (grid.encode_tiff().expect("a file"), None),
            (grid.encode_exr().expect("a file"), None),
        ] {
            let again = read(&bytes, format, size);
            assert_eq!((again.width(), again.height()), size);
            assert_eq!(hash(&again), hash(&grid), "{format:?}");
        }
    }
}

#[test]
fn a_png_is_exact_to_its_sixteen_bits() {
    let whole = ElevationGrid::from_samples(9, 7, (0..63).map(|i| (i * i) as f32 / 7.0 - 40.0).collect());
    let grid = whole.expect("a grid");
    let (bytes, [low, high]) = grid.encode_png().expect("a file");
    let again = read(&bytes, None, (9, 7));
    let step = f64::from(high - low) / 65_535.0;
    for (&found, &value) in again.samples().iter().zip(grid.samples()) {
        let found = f64::from(low) + f64::from(found) * step;
        assert!((found - f64::from(value)).abs() <= step * 0.501, "{found} in place of {value}");
    }
}

#[test]
fn a_pristine_world_comes_back_from_its_heightmap_and_an_edited_one_as_it_is_asked() {
    let noise = NoiseHeights { seed: 3, scale: 20.0, amplitude: 30.0, ..NoiseHeights::default() };
    let ground = Ground::from_noise(70, 41, &noise).expect("valid");
    let hash = ground.hash();
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    let elevation = terrain.world().elevation().expect("a small world");
    assert_eq!(elevation.into_ground(&ElevationScale::default()).expect("valid").hash(), hash);

    terrain.apply([
        Brush::dig(Shape::sphere(Vec3::new(20.0, 5.0, 20.0), 9.0)),
        Brush::add(Shape::sphere(Vec3::new(69.0, 30.0, 40.0), 6.0), MaterialId(2)),
        Brush::add(Shape::sphere(Vec3::new(40.0, 60.0, 12.0), 4.0), MaterialId(2)),
    ]);
    let elevation = terrain.world().elevation().expect("a small world");
    for (x, z) in (0..=41).flat_map(|z| (0..=70).map(move |x| (x, z))) {
        let expected = terrain.world().height(f64::from(x), f64::from(z)).expect("inside");
        // At the rim, places are asked for a millionth of a voxel inside.
        let difference = (f64::from(elevation.value(x, z)) - expected).abs();
        assert!(difference < 1e-3, "({x}, {z}): {difference}");
    }
    assert_ne!(elevation.into_ground(&ElevationScale::default()).expect("valid").hash(), hash);
}
