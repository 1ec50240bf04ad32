//! Large and long files of every format, by writers of their own, and the memory that reading them takes.

use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

use allocation_counter::measure;
use bevy_burrow::ground::{ElevationGrid, HeightFormat, ImportOptions, RawLayout};

/// A sample of a file, 0 to 65535.
fn sample(x: u32, z: u32) -> u16 {
    let (x, z) = (f64::from(x), f64::from(z));
    ((x / 90.0).sin() * 9000.0 + (z / 70.0).cos() * 9000.0 + x + z + 20_000.0) as u16
}

fn samples(width: u32, height: u32) -> Vec<u16> {
    (0..height).flat_map(|z| (0..width).map(move |x| sample(x, z))).collect()
}

fn png(width: u32, height: u32) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.set_compression(png::Compression::Fast);
    let bytes: Vec<u8> = samples(width, height).into_iter().flat_map(u16::to_be_bytes).collect();
    encoder.write_header().expect("a header").write_image_data(&bytes).expect("an image");
    file
}

fn tiff(width: u32, height: u32) -> Vec<u8> {
    use tiff::encoder::{TiffEncoder, colortype::Gray16, colortype::Gray32Float};
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).expect("a file");
    // Floats for square files, so that both are written.
    if width == height {
        let floats: Vec<f32> = samples(width, height).into_iter().map(f32::from).collect();
        encoder.write_image::<Gray32Float>(width, height, &floats).expect("an image");
    } else {
        encoder.write_image::<Gray16>(width, height, &samples(width, height)).expect("an image");
    }
    file.into_inner()
}

/// A TIFF of floats of 64 bits in one strip, twice as large as the grid.
fn tiff_of_doubles(width: u32, height: u32) -> Vec<u8> {
    use tiff::encoder::{TiffEncoder, colortype::Gray64Float};
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).expect("a file");
    let doubles: Vec<f64> = samples(width, height).into_iter().map(f64::from).collect();
    let mut image = encoder.new_image::<Gray64Float>(width, height).expect("an image");
    image.rows_per_strip(height).expect("one strip");
    image.write_data(&doubles).expect("samples");
    file.into_inner()
}

fn exr(width: u32, height: u32) -> Vec<u8> {
    use exr::prelude::*;
    let pixels = |at: Vec2<usize>| (f32::from(sample(at.0 as u32, at.1 as u32)),);
    let channels = SpecificChannels::build().with_channel("Y").with_pixel_fn(pixels);
    let image = Image::from_channels((width as usize, height as usize), channels);
    let mut file = Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut file).expect("an image");
    file.into_inner()
}

fn raw(width: u32, height: u32) -> Vec<u8> {
    samples(width, height).into_iter().flat_map(u16::to_le_bytes).collect()
}

fn hgt(width: u32, height: u32) -> Vec<u8> {
    samples(width, height).into_iter().flat_map(|value| (value / 2).to_be_bytes()).collect()
}

/// Numbers with more decimals than they need, four times as large as the grid.
fn long_ascii(width: u32, height: u32) -> Vec<u8> {
    let text = String::from_utf8(ascii(width, height)).expect("a text");
    let (header, samples) = text.split_at(text.find("cellsize 1\n").expect("a header") + 11);
    let samples = samples.replace([' ', '\n'], ".0000000000 ");
    format!("{header}{samples}").into_bytes()
}

fn ascii(width: u32, height: u32) -> Vec<u8> {
    let mut text = format!("ncols {width}\nnrows {height}\ncellsize 1\n");
    for z in 0..height {
        let row: Vec<String> = (0..width).map(|x| sample(x, z).to_string()).collect();
        text += &row.join(" ");
        text.push('\n');
    }
    text.into_bytes()
}

#[test]
fn large_files_are_read_exactly_within_three_times_their_size() {
    let writers: [(HeightFormat, fn(u32, u32) -> Vec<u8>); 6] = [
        (HeightFormat::Png, png),
        (HeightFormat::Tiff, tiff),
        (HeightFormat::Exr, exr),
        (HeightFormat::Raw, raw),
        (HeightFormat::Hgt, hgt),
        (HeightFormat::Ascii, ascii),
    ];
    // 4097 x 4097 with BURROW_LARGE, as it takes half a minute.
    let large = std::env::var("BURROW_LARGE").is_ok().then_some((4097, 4097));
    for (format, write) in writers {
        for (width, height) in [(1025, 1025), (16, 4096), (4096, 16)].into_iter().chain(large) {
            if format == HeightFormat::Hgt && width != height {
                continue;
            }
            let bytes = write(width, height);
            let raw = RawLayout { size: Some((width, height)), ..RawLayout::default() };
            let options = ImportOptions { format: Some(format), raw, ..ImportOptions::default() };
            let mut decoded = None;
            let memory = measure(|| decoded = Some(ElevationGrid::decode(&bytes, &options)));
            let (grid, report) =
                decoded.expect("measured").unwrap_or_else(|error| panic!("{format}: {error}"));
            assert_eq!((grid.width(), grid.height()), (width, height), "{format}");
            let value = |sample: u16| match format {
                // Half of it, which is within signed 16 bits.
                HeightFormat::Hgt => f32::from(sample / 2),
                _ => f32::from(sample),
            };
            let expected = samples(width, height).into_iter().map(value);
            assert!(grid.samples().iter().copied().eq(expected), "{format} of {width} x {height}");
            assert_eq!((report.voids, report.outliers), (0, 0), "{format}");
            // Four bytes a sample, and buffers that do not grow with the file.
            let most = 3 * 4 * u64::from(width) * u64::from(height) + (2 << 20);
            assert!(
                memory.bytes_max <= most,
                "{format} of {width} x {height} takes {} bytes",
                memory.bytes_max
            );
        }
    }
}

#[test]
fn opening_a_file_takes_no_more_than_three_times_the_grid_however_large_the_file_is() {
    let (width, height) = (1025, 513);
    let writers: [(HeightFormat, fn(u32, u32) -> Vec<u8>); 8] = [
        (HeightFormat::Png, png),
        (HeightFormat::Tiff, tiff),
        (HeightFormat::Tiff, tiff_of_doubles),
        (HeightFormat::Exr, exr),
        (HeightFormat::Raw, raw),
        (HeightFormat::Hgt, hgt),
        (HeightFormat::Ascii, ascii),
        (HeightFormat::Ascii, long_ascii),
    ];
    for (number, (format, write)) in writers.into_iter().enumerate() {
        let (width, height) = if format == HeightFormat::Hgt { (height, height) } else { (width, height) };
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("opened_{number}"));
        fs::write(&path, write(width, height)).expect("a file");
        let raw = RawLayout { size: Some((width, height)), ..RawLayout::default() };
        let options = ImportOptions { format: Some(format), raw, ..ImportOptions::default() };
        let mut opened = None;
        let memory = measure(|| opened = Some(ElevationGrid::open(&path, &options)));
        let (grid, _) = opened.expect("measured").unwrap_or_else(|error| panic!("{format}: {error}"));
        assert_eq!((grid.width(), grid.height()), (width, height), "{format}");
        let most = 3 * 4 * u64::from(width) * u64::from(height) + (1 << 20);
        assert!(memory.bytes_max <= most, "{number}, {format}: {} bytes, not {most}", memory.bytes_max);
        fs::remove_file(&path).expect("the file");
    }
}
