//! Voids and outliers: found, counted, filled from their surroundings, clamped or refused.

use bevy_burrow::ground::{
    ElevationGrid, ElevationScale, HeightFormat, ImportError, ImportNote, ImportOptions, ImportReport,
    RawLayout, Repair, SampleKind,
};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::MeshKey;
use glam::Vec3;

/// Reads samples as a RAW file of floats.
fn read(
    width: u32,
    samples: &[f32],
    options: ImportOptions,
) -> Result<(ElevationGrid, ImportReport), ImportError> {
    let bytes: Vec<u8> = samples.iter().flat_map(|value| value.to_le_bytes()).collect();
    let size = Some((width, samples.len() as u32 / width));
    let raw = RawLayout { size, sample: Some(SampleKind::Float(32)), ..RawLayout::default() };
    let format = Some(HeightFormat::Raw);
    ElevationGrid::decode(&bytes, &ImportOptions { format, raw, ..options })
}

/// Gentle ground between 100 and 140.
fn ground(side: u32) -> Vec<f32> {
    let height = |x: u32, z: u32| 120.0 + 10.0 * (x as f32 / 9.0).sin() + 10.0 * (z as f32 / 7.0).cos();
    (0..side).flat_map(|z| (0..side).map(move |x| height(x, z))).collect()
}

#[test]
fn voids_of_every_kind_are_filled_within_the_range_of_what_surrounds_them() {
    let mut rng = fastrand::Rng::with_seed(9);
    let side = 65;
    for (void, declared) in [
        (f32::NAN, None),
        (f32::INFINITY, None),
        (f32::MIN, None),
        (-9999.0, None),
        (-32_768.0, None),
        (0.0, Some(0.0)),
        (121.0, Some(121.0)),
    ] {
        let whole = ground(side);
        let mut samples = whole.clone();
        // Single voids, and a lake of them at the rim.
        for _ in 0..40 {
            samples[rng.usize(0..(side * side) as usize)] = void;
        }
        for z in 20..34 {
            samples[(z * side) as usize..][..12].fill(void);
        }
        let is_void = |value: f32| value.to_bits() == void.to_bits();
        let voids = samples.iter().filter(|value| is_void(**value)).count() as u64;
        let options = ImportOptions { no_data: declared, ..ImportOptions::default() };
        let (grid, report) = read(side, &samples, options.clone()).expect("a readable file");
        assert_eq!(report.voids, voids, "{void}: {report}");
        for (index, (&found, &given)) in grid.samples().iter().zip(&samples).enumerate() {
            if is_void(given) {
                assert!((99.0..=141.0).contains(&found), "{void} is filled with {found} at {index}");
                assert!((found - whole[index]).abs() < 12.0, "{void}: {found} in place of {}", whole[index]);
            } else {
                assert_eq!(found.to_bits(), given.to_bits(), "{void}: samples with a value stay");
            }
        }
        let (kept, _) =
            read(side, &samples, ImportOptions { voids: Repair::Keep, ..options.clone() }).expect("readable");
        assert_eq!(kept.samples().iter().filter(|value| value.is_nan()).count() as u64, voids);
        assert!(kept.into_ground(&ElevationScale::default()).is_err());
        let (clamped, _) = read(side, &samples, ImportOptions { voids: Repair::Clamp, ..options.clone() })
            .expect("readable");
        let lowest = samples.iter().copied().filter(|&value| !is_void(value)).fold(f32::MAX, f32::min);
        let mut both = clamped.samples().iter().zip(&samples);
        assert!(both.all(|(&found, &given)| found == if is_void(given) { lowest } else { given }));
        let refused = read(side, &samples, ImportOptions { voids: Repair::Refuse, ..options });
        assert!(matches!(refused, Err(ImportError::Voids { count, .. }) if count == voids));
    }
}

#[test]
fn values_outside_of_the_valid_range_are_voids() {
    let mut samples = ground(33);
    samples[40] = 500.0;
    samples[41] = 90.0;
    let options = ImportOptions { valid: Some([100.0, 140.0]), ..ImportOptions::default() };
    let (grid, report) = read(33, &samples, options).expect("a readable file");
    assert_eq!(report.voids, 2);
    assert!(grid.samples().iter().all(|value| (100.0..=140.0).contains(value)));
    for valid in [[f32::NAN, 1.0], [2.0, 1.0]] {
        let options = ImportOptions { valid: Some(valid), ..ImportOptions::default() };
        assert!(matches!(read(33, &samples, options), Err(ImportError::Option { name: "valid", .. })));
    }
}

#[test]
fn a_file_of_voids_alone_is_refused() {
    let refused = read(3, &[f32::NAN; 9], ImportOptions::default());
    assert!(matches!(refused, Err(ImportError::AllVoid { samples: 9 })));
}

#[test]
fn needles_are_found_and_repaired_and_nothing_else_is() {
    let side = 129;
    let whole = ground(side);
    let mut samples = whole.clone();
    let mut rng = fastrand::Rng::with_seed(3);
    // One in a hundred, up and down, some side by side.
    let mut needles = Vec::new();
    for _ in 0..160 {
        let at = rng.usize(0..samples.len());
        samples[at] = if rng.bool() { 1900.0 } else { -1700.0 };
        needles.push(at);
    }
    needles.sort_unstable();
    needles.dedup();
    let of = |outliers| read(side, &samples, ImportOptions { outliers, ..ImportOptions::default() });
    let (kept, report) = of(Repair::Keep).expect("a readable file");
    assert_eq!(kept.samples(), samples);
    assert!(report.outliers as usize * 10 >= needles.len() * 9, "{report}");
    assert!(report.notes.iter().any(|note| matches!(note, ImportNote::Outliers { .. })));
    for repair in [Repair::Fill, Repair::Clamp] {
        let (grid, report) = of(repair).expect("a readable file");
        assert_eq!(report.outliers as usize, needles.len(), "{repair:?}: {report}");
        for (index, (&found, &before)) in grid.samples().iter().zip(&whole).enumerate() {
            if needles.binary_search(&index).is_ok() {
                assert!((99.0..=141.0).contains(&found), "{repair:?}: {found} at {index}");
            } else {
                assert_eq!(found, before);
            }
        }
    }
    assert!(matches!(of(Repair::Refuse), Err(ImportError::Outliers { .. })));
}

#[test]
fn walls_towers_and_terraces_are_no_needles() {
    let side = 65;
    let plateau = |x: u32, z: u32| if (20..40).contains(&x) && (10..30).contains(&z) { 300.0 } else { 0.0 };
    let stairs = |x: u32, _| (x / 8) as f32 * 50.0;
    let wall = |x: u32, z: u32| if x == 30 || z == 12 { 200.0 } else { 0.0 };
    let tower = |x: u32, z: u32| if x / 2 == 12 && z / 2 == 9 { 400.0 } else { 0.0 };
    let heights: [&dyn Fn(u32, u32) -> f32; 4] = [&plateau, &stairs, &wall, &tower];
    for (number, height) in heights.into_iter().enumerate() {
        let samples: Vec<f32> = (0..side).flat_map(|z| (0..side).map(move |x| height(x, z))).collect();
        let options = ImportOptions { outliers: Repair::Fill, ..ImportOptions::default() };
        let (grid, report) = read(side, &samples, options).expect("a readable file");
        assert_eq!((report.outliers, report.voids), (0, 0), "{number}: {report}");
        assert_eq!(grid.samples(), samples, "{number}");
    }
}

#[test]
fn zeros_in_a_plain_are_reported_with_a_remedy() {
    let mut samples = vec![2000.0; 33 * 33];
    samples[7] = 0.0;
    let (_, report) = read(33, &samples, ImportOptions::default()).expect("a readable file");
    let text = report.to_string();
    assert!(
        text.contains("1 samples of 0 lie far outside of all others") && text.contains("no_data"),
        "{text}"
    );
}

/// A plain with a void every few samples, as one that a program makes of a survey's picture.
fn survey() -> Vec<f32> {
    let mut samples = vec![2000.0; 129 * 129];
    samples.iter_mut().step_by(101).for_each(|sample| *sample = 0.0);
    samples
}

#[test]
fn a_dig_in_a_repaired_survey_costs_what_it_does_on_a_plain() {
    let drawn = |options: ImportOptions| {
        let (grid, _) = read(129, &survey(), options).expect("a readable file");
        let ground = grid.into_ground(&ElevationScale::default()).expect("valid heights");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
        terrain.apply([Brush::dig(Shape::sphere(Vec3::new(64.0, 2000.0, 64.0), 4.0))]);
        terrain.world().drawn().filter(|(drawn, _)| matches!(drawn, MeshKey::Chunk(_))).count()
    };
    let declared = ImportOptions { no_data: Some(0.0), ..ImportOptions::default() };
    let needles = ImportOptions { outliers: Repair::Fill, ..ImportOptions::default() };
    for options in [declared, needles] {
        let chunks = drawn(options);
        assert!(chunks <= 8, "a dig of radius 4 draws {chunks} chunks");
    }
}
