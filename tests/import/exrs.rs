//! EXR files of several channels.

use std::io::Cursor;

use bevy_burrow::ground::{ElevationGrid, ImportError, ImportNote, ImportOptions};
use exr::prelude::*;

/// A file of 5 x 3 samples; channel `n` holds `n * 100 + index`.
fn file(names: &[&str]) -> Vec<u8> {
    let channel = |(number, name): (usize, &&str)| {
        let samples = (0..15).map(|index| (number * 100 + index) as f32).collect();
        AnyChannel::new(*name, FlatSamples::F32(samples))
    };
    let channels = names.iter().enumerate().map(channel).collect();
    let image = Image::from_channels((5, 3), AnyChannels::sort(channels));
    let mut file = Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut file).expect("an image");
    file.into_inner()
}

#[test]
fn heights_next_to_colours_are_read() {
    for name in ["Z", "height", "Height"] {
        for (others, ignored) in [
            (&["R", "G", "B"][..], "B, G, R"),
            (&["R", "G", "B", "A"], "B, G, R"),
            (&["roughness"], "roughness"),
        ] {
            let names = [&[name], others].concat();
            let (grid, report) =
                ElevationGrid::decode(&file(&names), &ImportOptions::default()).expect("a readable file");
            assert!(grid.samples().iter().copied().eq((0..15_u8).map(f32::from)), "{names:?}: {report}");
            let note = ImportNote::ChannelsIgnored { names: ignored.into(), read: name.into() };
            assert!(report.notes.contains(&note), "{report}");
            assert_eq!(report.notes.contains(&ImportNote::AlphaIgnored), others.contains(&"A"));
        }
    }
}

#[test]
fn colours_without_heights_are_refused() {
    for names in [&["R", "G", "B"][..], &["R", "G", "B", "A"], &["R", "G", "B", "Y"]] {
        let refused = ElevationGrid::decode(&file(names), &ImportOptions::default());
        assert!(matches!(refused, Err(ImportError::Colour { x: 0, z: 0, .. })), "{names:?}: {refused:?}");
    }
}
