//! TIFF files, assembled by hand: tags, channels and types that no writer of the table makes.

use bevy_burrow::ground::{
    ElevationGrid, HeightScale, ImportError, ImportNote, ImportOptions, ImportReport, Repair, SampleKind,
};

/// The values of a tag.
#[derive(Clone)]
enum Field {
    Shorts(Vec<u16>),
    Longs(Vec<u32>),
    Doubles(Vec<f64>),
    Text(&'static str),
}

/// An image of a TIFF in one strip, or one strip for each plane.
#[derive(Clone)]
struct File {
    size: (u32, u32),
    bits: u16,
    channels: u16,
    /// 1: unsigned, 2: signed, 3: floats.
    format: u16,
    /// 0: white is 0, 1: black is 0, 2: colours.
    photometric: u16,
    is_planar: bool,
    tags: Vec<(u16, Field)>,
    data: Vec<u8>,
    is_big_endian: bool,
    is_big_tiff: bool,
}

impl File {
    fn new(size: (u32, u32), bits: u16, format: u16, data: Vec<u8>) -> Self {
        let (channels, photometric, is_planar, tags) = (1, 1, false, Vec::new());
        let (is_big_endian, is_big_tiff) = (false, false);
        Self { size, bits, channels, format, photometric, is_planar, tags, data, is_big_endian, is_big_tiff }
    }

    fn floats(size: (u32, u32), values: &[f32]) -> Self {
        Self::new(size, 32, 3, values.iter().flat_map(|value| value.to_le_bytes()).collect())
    }

    fn with(mut self, tag: u16, field: Field) -> Self {
        self.tags.push((tag, field));
        self
    }

    fn number(&self, value: u64, size: usize) -> Vec<u8> {
        if self.is_big_endian {
            value.to_be_bytes()[8 - size..].to_vec()
        } else {
            value.to_le_bytes()[..size].to_vec()
        }
    }

    fn encode(&self) -> Vec<u8> {
        let word = if self.is_big_tiff { 8 } else { 4 };
        let mut out = if self.is_big_endian { b"MM".to_vec() } else { b"II".to_vec() };
        out.extend(self.number(if self.is_big_tiff { 43 } else { 42 }, 2));
        if self.is_big_tiff {
            out.extend(self.number(8, 2));
            out.extend(self.number(0, 2));
        }
        let offset_at = out.len();
        out.extend(vec![0; word]);
        let start = out.len() as u32;
        out.extend(&self.data);
        let planes = if self.is_planar { u32::from(self.channels) } else { 1 };
        let length = self.data.len() as u32 / planes;
        let mut tags = vec![
            (256, Field::Longs(vec![self.size.0])),
            (257, Field::Longs(vec![self.size.1])),
            (258, Field::Shorts(vec![self.bits; self.channels.into()])),
            (259, Field::Shorts(vec![1])),
            (262, Field::Shorts(vec![self.photometric])),
            (273, Field::Longs((0..planes).map(|plane| start + plane * length).collect())),
            (277, Field::Shorts(vec![self.channels])),
            (278, Field::Longs(vec![self.size.1])),
            (279, Field::Longs(vec![length; planes as usize])),
            (284, Field::Shorts(vec![if self.is_planar { 2 } else { 1 }])),
            (339, Field::Shorts(vec![self.format; self.channels.into()])),
        ];
        tags.extend(self.tags.iter().cloned());
        tags.sort_by_key(|(tag, _)| *tag);
        let mut directory = self.number(tags.len() as u64, if self.is_big_tiff { 8 } else { 2 });
        for (tag, field) in tags {
            let (kind, values): (u64, Vec<Vec<u8>>) = match field {
                Field::Shorts(values) => (3, values.iter().map(|&v| self.number(v.into(), 2)).collect()),
                Field::Longs(values) => (4, values.iter().map(|&v| self.number(v.into(), 4)).collect()),
                Field::Doubles(values) => (12, values.iter().map(|v| self.number(v.to_bits(), 8)).collect()),
                Field::Text(text) => (2, text.bytes().chain([0]).map(|byte| vec![byte]).collect()),
            };
            let count = values.len() as u64;
            let mut value = values.concat();
            if value.len() > word {
                let at = out.len() as u64;
                out.extend(value);
                value = self.number(at, word);
            }
            value.resize(word, 0);
            directory.extend(self.number(tag.into(), 2));
            directory.extend(self.number(kind, 2));
            directory.extend(self.number(count, word));
            directory.extend(value);
        }
        directory.extend(vec![0; word]);
        let at = self.number(out.len() as u64, word);
        out[offset_at..offset_at + word].copy_from_slice(&at);
        out.extend(directory);
        out
    }

    fn read(&self) -> Result<(ElevationGrid, ImportReport), ImportError> {
        let options = ImportOptions { voids: Repair::Keep, ..ImportOptions::default() };
        ElevationGrid::decode(&self.encode(), &options)
    }
}

/// Values of 3 x 2 samples.
const VALUES: [f32; 6] = [1.5, 2.5, 3.25, -4.0, 5.0, 1e-9];

#[test]
fn samples_of_files_whose_white_is_zero_are_as_they_are_stored() {
    for (is_big_endian, is_big_tiff) in [(false, false), (true, false), (false, true), (true, true)] {
        let of = |bits: u16, format: u16, values: &[u64]| {
            let mut file = File::new((3, 2), bits, format, Vec::new());
            (file.photometric, file.is_big_endian, file.is_big_tiff) = (0, is_big_endian, is_big_tiff);
            file.data = values.iter().flat_map(|&value| file.number(value, bits as usize / 8)).collect();
            let (grid, report) = file.read().expect("a readable file");
            assert!(report.notes.contains(&ImportNote::WhiteIsZero), "{report}");
            grid
        };
        for bits in [8, 16, 32] {
            assert_eq!(of(bits, 1, &[0, 1, 2, 3, 200, 255]).samples(), [0.0, 1.0, 2.0, 3.0, 200.0, 255.0]);
        }
        // The decoder refuses signed samples whose white is zero.
        let signed = of(16, 2, &[0xFFFF, 1, 2, 3, 4, 5]);
        assert_eq!(signed.samples(), [-1.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        // 1 - (1 - 1e-9) is 0 as f32.
        let floats = of(32, 3, &VALUES.map(|value| u64::from(value.to_bits())));
        assert_eq!(floats.samples(), VALUES);
    }
}

#[test]
fn the_void_value_of_a_file_whose_white_is_zero_is_that_of_stored_samples() {
    let samples = [0_u16, 65_535, 100, 101, 102, 103];
    let mut file = File::new((3, 2), 16, 1, samples.iter().flat_map(|value| value.to_le_bytes()).collect());
    file.photometric = 0;
    let (grid, report) = file.with(42113, Field::Text("0")).read().expect("a readable file");
    assert_eq!(report.voids, 1);
    assert!(grid.samples()[0].is_nan());
    assert_eq!(grid.samples()[1], 65_535.0);
}

#[test]
fn the_alpha_channel_of_a_grey_file_is_ignored() {
    let pixels: Vec<f32> = VALUES.into_iter().flat_map(|value| [value, 1.0]).collect();
    let planes: Vec<f32> = VALUES.into_iter().chain([1.0; 6]).collect();
    for (data, is_planar) in [(pixels, false), (planes, true)] {
        let file = File { channels: 2, is_planar, ..File::floats((3, 2), &data) };
        for (alpha, photometric) in [(1, 1), (2, 1), (2, 0)] {
            let file = File { photometric, ..file.clone() }.with(338, Field::Shorts(vec![alpha]));
            let (grid, report) = file.read().expect("a readable file");
            assert_eq!(grid.samples(), VALUES);
            assert!(report.notes.contains(&ImportNote::AlphaIgnored), "{report}");
        }
        // Of two channels that are just two, none is known to be the heights.
        let refused = file.with(338, Field::Shorts(vec![0])).read();
        assert!(matches!(refused, Err(ImportError::Channels { .. })), "{refused:?}");
    }
}

#[test]
fn colours_in_planes_are_compared() {
    let mut file = File::floats((3, 2), &[VALUES; 3].concat());
    (file.channels, file.is_planar, file.photometric) = (3, true, 2);
    let (grid, report) = file.read().expect("a readable file");
    assert_eq!(grid.samples(), VALUES);
    assert!(report.notes.contains(&ImportNote::GreyAsColour), "{report}");
    // The blue of sample (1, 1).
    file.data[(12 + 4) * 4] ^= 1;
    let refused = file.read();
    assert!(matches!(refused, Err(ImportError::Colour { x: 1, z: 1, .. })), "{refused:?}");
}

#[test]
fn samples_of_less_than_a_byte_are_read() {
    // Each row begins with a new byte.
    for (bits, rows, samples) in [
        (1, [0b1011_0000, 0b0110_0000], [1.0, 0.0, 1.0, 0.0, 1.0, 1.0]),
        (2, [0b1101_1000, 0b0001_1000], [3.0, 1.0, 2.0, 0.0, 1.0, 2.0]),
    ] {
        for photometric in [0, 1] {
            let file = File { photometric, ..File::new((3, 2), bits, 1, rows.to_vec()) };
            let (grid, report) = file.read().expect("a readable file");
            assert_eq!(grid.samples(), samples, "{bits} bits");
            assert_eq!(report.sample, SampleKind::Unsigned(bits as u8));
        }
    }
    let file = File::new((3, 2), 4, 1, vec![0x12, 0x3F, 0x45, 0x6F]);
    assert_eq!(file.read().expect("a readable file").0.samples(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let signed = File { format: 2, ..file }.read();
    assert!(
        matches!(&signed, Err(ImportError::Damaged { reason, .. }) if reason.contains("4 bits")),
        "{signed:?}"
    );
}

#[test]
fn the_origin_is_the_middle_of_the_first_sample_whether_samples_are_areas_or_points() {
    let keys = |raster_type| Field::Shorts(vec![1, 1, 0, 1, 1025, 0, 1, raster_type]);
    let file = File::floats((3, 2), &VALUES);
    let scale = file
        .clone()
        .with(33550, Field::Doubles(vec![30.0, 20.0, 0.0]))
        .with(33922, Field::Doubles(vec![1.0, 1.0, 0.0, 500_000.0, 4_600_000.0, 0.0]));
    let matrix = |across: [f64; 2], down: [f64; 2]| {
        let [a, b, d, e] = [across[0], down[0], across[1], down[1]];
        let (east, north) = (499_970.0, 4_600_020.0);
        let rows = [[a, b, 0.0, east], [d, e, 0.0, north], [0.0; 4], [0.0, 0.0, 0.0, 1.0]];
        file.clone().with(34264, Field::Doubles(rows.concat()))
    };
    for file in [scale, matrix([30.0, 0.0], [0.0, -20.0])] {
        for (file, origin) in [
            (file.clone(), [499_985.0, 4_600_010.0]),
            (file.clone().with(34735, keys(1)), [499_985.0, 4_600_010.0]),
            (file.with(34735, keys(2)), [499_970.0, 4_600_020.0]),
        ] {
            let (_, report) = file.read().expect("a readable file");
            assert_eq!((report.spacing, report.origin), (Some([30.0, 20.0]), Some(origin)), "{report}");
            assert!(!report.notes.contains(&ImportNote::NotNorthUp), "{report}");
        }
    }
    // A quarter turn, and rows that go north.
    for (file, spacing) in
        [(matrix([0.0, 3.0], [4.0, 0.0]), [3.0, 4.0]), (matrix([2.0, 0.0], [0.0, 2.0]), [2.0; 2])]
    {
        let (_, report) = file.read().expect("a readable file");
        assert_eq!(report.spacing, Some(spacing));
        assert!(report.notes.contains(&ImportNote::NotNorthUp), "{report}");
    }
    let ties = Field::Doubles(vec![0.0; 18]);
    for file in [file.clone().with(33922, ties), matrix([f64::NAN, 0.0], [0.0, 1.0])] {
        let (_, report) = file.read().expect("a readable file");
        assert_eq!((report.spacing, report.origin), (None, None));
        assert!(report.notes.contains(&ImportNote::PlaceIgnored), "{report}");
    }
}

#[test]
fn the_scale_and_offset_of_gdal_are_reported_and_part_of_the_scale() {
    let metadata = "<GDALMetadata>\n<Item name=\"SCALE\" sample=\"1\" role=\"scale\">7</Item>\n\
        <Item name=\"OFFSET\" sample=\"0\" role=\"offset\">-100</Item>\n\
        <Item name=\"SCALE\" sample=\"0\" role=\"scale\">0.1</Item>\n</GDALMetadata>\n";
    let file = File::floats((3, 2), &VALUES).with(42112, Field::Text(metadata));
    let (grid, report) = file.read().expect("a readable file");
    assert_eq!(grid.samples(), VALUES, "samples are as they are stored");
    assert_eq!(report.value_scale, Some([0.1, -100.0]));
    assert!(report.to_string().contains("value * 0.1 + -100"), "{report}");
    let scale = report.scale(0.5).expect("a scale");
    assert_eq!(scale.heights, HeightScale::Units { voxels_per_unit: 0.2, base: -200.0 });
    let plain = File::floats((3, 2), &VALUES).read().expect("a readable file").1;
    assert_eq!(plain.value_scale, None);
}

#[test]
fn an_orientation_is_reported() {
    for (orientation, is_noted) in [(1, false), (3, true), (8, true), (9, false)] {
        let file = File::floats((3, 2), &VALUES).with(274, Field::Shorts(vec![orientation]));
        let (grid, report) = file.read().expect("a readable file");
        assert_eq!(grid.samples(), VALUES, "rows are as they are stored");
        let note = ImportNote::OrientationIgnored { orientation };
        assert_eq!(report.notes.contains(&note), is_noted, "{report}");
    }
}
