//! What is guessed of RAW files, and what looks wrong.

use bevy_burrow::ground::{
    ElevationGrid, HeightFormat, ImportNote, ImportOptions, ImportReport, RawFormat, RawLayout, SampleKind,
};

/// Hills of up to `top`, with details, that are no period of any width.
fn hills(width: u32, height: u32, top: f64) -> Vec<f64> {
    let value = |x: u32, z: u32| {
        let (x, z) = (f64::from(x), f64::from(z));
        let hills = (x / 71.0 + 1.0).sin() + (z / 53.0).cos() + 0.5 * ((x + 2.0 * z) / 31.0).sin();
        let details = 0.02 * (x / 2.3).sin() * (z / 3.1).cos();
        top * (hills + details + 3.0) / 6.0
    };
    (0..height).flat_map(|z| (0..width).map(move |x| value(x, z))).collect()
}

fn read(bytes: &[u8], raw: RawLayout) -> (ElevationGrid, ImportReport) {
    let options = ImportOptions { format: Some(HeightFormat::Raw), raw, ..ImportOptions::default() };
    ElevationGrid::decode(bytes, &options).expect("a readable file")
}

fn better_width(report: &ImportReport) -> Option<u32> {
    report.notes.iter().find_map(|note| match note {
        ImportNote::LooksTransposed { width } => Some(*width),
        _ => None,
    })
}

#[test]
fn the_bytes_of_a_sample_are_guessed_by_the_samples() {
    for (width, height) in [(512, 1024), (1024, 512), (256, 512), (300, 200), (512, 512), (512, 2048)] {
        for top in [1.0, 2_000.0] {
            let floats: Vec<f32> = hills(width, height, top).into_iter().map(|value| value as f32).collect();
            let little: Vec<u8> = floats.iter().flat_map(|value| value.to_le_bytes()).collect();
            let big: Vec<u8> = floats.iter().flat_map(|value| value.to_be_bytes()).collect();
            for bytes in [little, big] {
                let (grid, report) = read(&bytes, RawLayout::default());
                assert_eq!(report.sample, SampleKind::Float(32), "{width} x {height}: {report}");
                if width * height != 1 << 20 {
                    assert_eq!((grid.width(), grid.height()), (width, height), "{report}");
                }
                assert_eq!(grid.samples(), floats);
            }
        }
        for top in [300.0, 65_535.0] {
            let integers: Vec<u16> =
                hills(width, height, top).into_iter().map(|value| value as u16).collect();
            let bytes: Vec<u8> = integers.iter().flat_map(|value| value.to_le_bytes()).collect();
            let (grid, report) = read(&bytes, RawLayout::default());
            assert_eq!(report.sample, SampleKind::Unsigned(16), "{width} x {height}: {report}");
            assert!(grid.samples().iter().copied().eq(integers.into_iter().map(f32::from)));
        }
    }
}

#[test]
fn an_island_of_floats_in_a_wide_sea_is_no_picture_of_16_bits() {
    let mut floats = vec![0.0_f32; 512 * 1024];
    for (index, value) in hills(64, 64, 90.0).into_iter().enumerate() {
        floats[(400 + index / 64) * 512 + 200 + index % 64] = value as f32;
    }
    let bytes: Vec<u8> = floats.iter().flat_map(|value| value.to_le_bytes()).collect();
    let (grid, report) = read(&bytes, RawLayout::default());
    assert_eq!(report.sample, SampleKind::Float(32), "{report}");
    assert_eq!(grid.samples(), floats);
}

#[test]
fn level_files_are_guessed_by_their_size() {
    for value in [0.0_f32, 2.0, 100.5] {
        let bytes: Vec<u8> = vec![value; 64 * 64].into_iter().flat_map(f32::to_le_bytes).collect();
        let (grid, report) = read(&bytes, RawLayout::default());
        assert_eq!((grid.width(), grid.height()), (64, 64), "{value}: {report}");
    }
}

#[test]
fn a_square_that_is_none_is_reported() {
    for (width, height) in [(512, 2048), (2048, 512), (128, 512), (256, 1024), (1024, 1024), (257, 257)] {
        let samples = hills(width, height, 65_535.0);
        let bytes: Vec<u8> = samples.iter().flat_map(|&value| (value as u16).to_le_bytes()).collect();
        let (grid, report) = read(&bytes, RawLayout::default());
        assert_eq!(grid.width(), grid.height(), "a square is the first guess");
        assert_eq!(better_width(&report), (width != height).then_some(width), "{width} x {height}: {report}");
    }
    let mut rng = fastrand::Rng::with_seed(4);
    for side in [4, 16, 32, 256, 1024] {
        let bytes: Vec<u8> = (0..side * side).flat_map(|_| rng.u16(..).to_le_bytes()).collect();
        let raw = RawLayout { sample: Some(SampleKind::Unsigned(16)), ..RawLayout::default() };
        assert_eq!(better_width(&read(&bytes, raw).1), None, "noise fits no width better");
    }
}

#[test]
fn a_wrong_byte_order_is_noticed_on_gentle_ground_too() {
    let looks_swapped = |samples: &[u16], byte_order, sample| {
        let bytes: Vec<u8> = samples.iter().flat_map(|value| value.to_le_bytes()).collect();
        let size = Some((256, samples.len() as u32 / 256));
        let raw =
            RawLayout { size, sample: Some(sample), byte_order: Some(byte_order), ..RawLayout::default() };
        read(&bytes, raw).1.notes.contains(&ImportNote::LooksByteSwapped)
    };
    for sample in [SampleKind::Unsigned(16), SampleKind::Signed(16)] {
        for top in [500.0, 900.0, 3_000.0, 30_000.0] {
            let samples: Vec<u16> = hills(256, 200, top).into_iter().map(|value| value as u16).collect();
            assert!(looks_swapped(&samples, RawFormat::BigEndian, sample), "{top}");
            assert!(!looks_swapped(&samples, RawFormat::LittleEndian, sample), "{top}");
        }
        // 8 bits in the high byte, as some programs widen them.
        let widened: Vec<u16> = hills(256, 200, 255.0).into_iter().map(|value| (value as u16) << 8).collect();
        assert!(!looks_swapped(&widened, RawFormat::LittleEndian, sample));
    }
    // A lowland with voids, whose value swapped is 128.
    let mut rng = fastrand::Rng::with_seed(8);
    let lowland: Vec<u16> =
        (0..256 * 200).map(|_| if rng.u8(..) < 6 { 0x8000 } else { u16::from(rng.u8(..) == 0) }).collect();
    assert!(!looks_swapped(&lowland, RawFormat::LittleEndian, SampleKind::Signed(16)));
}
