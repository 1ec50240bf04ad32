//! The files of `tests/fixtures/import`, which `tools/import_files.py` makes, against what independent readers found.

use std::fs;
use std::path::PathBuf;

use bevy_burrow::ground::{ElevationGrid, HeightFormat, ImportError, ImportOptions};
use serde_json::Value;

use super::hash;

/// A file of the table.
pub struct Entry {
    pub name: String,
    pub bytes: Vec<u8>,
    pub options: ImportOptions,
    pub expected: Value,
}

/// All files.
pub fn entries() -> Vec<Entry> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/import");
    let table = fs::read_to_string(folder.join("table.json")).expect("the table of files");
    let table: Vec<Value> = serde_json::from_str(&table).expect("a list");
    let entry = |expected: Value| {
        let name = expected["file"].as_str().expect("a name").to_owned();
        let bytes = fs::read(folder.join(&name)).expect("a file of the table");
        let options = serde_json::from_value(expected["options"].clone()).expect("options");
        Entry { name, bytes, options, expected }
    };
    table.into_iter().map(entry).collect()
}

#[test]
fn every_file_is_read_as_by_an_independent_reader_or_refused_with_a_reason() {
    let (mut wrong, entries) = (Vec::new(), entries());
    assert!(entries.len() >= 120);
    for Entry { name, bytes, options, expected } in entries {
        let found = ElevationGrid::decode(&bytes, &options);
        let problem = match (found, expected["error"].as_str()) {
            (Err(error), Some(reason)) => {
                let text = error.to_string();
                let is_one_sentence = !text.contains('\n') && text.contains(':');
                (!text.contains(reason) || !is_one_sentence).then(|| format!("refused with: {text}"))
            }
            (Err(error), None) => Some(format!("refused: {error}")),
            (Ok((grid, report)), Some(reason)) => Some(format!(
                "read as {} x {}, not refused with {reason}: {report}",
                grid.width(),
                grid.height()
            )),
            (Ok((grid, report)), None) => {
                let notes = format!("{:?}", report.notes);
                let note = |note: &Value| match note {
                    Value::String(name) => name.clone(),
                    note => note.as_object().and_then(|note| note.keys().next().cloned()).unwrap_or_default(),
                };
                let has_notes =
                    expected["notes"].as_array().into_iter().flatten().all(|n| notes.contains(&note(n)));
                let size = [grid.width(), grid.height()].map(u64::from);
                let expected_size =
                    ["width", "height"].map(|side| expected[side].as_u64().unwrap_or_default());
                let has_hash = expected["hash"] == format!("{:016x}", hash(&grid));
                let has_voids = expected["voids"] == report.voids;
                let is_right = has_notes && size == expected_size && has_hash && has_voids;
                (!is_right).then(|| format!("read as {report}\n  in place of {expected}"))
            }
        };
        wrong.extend(problem.map(|problem| format!("{name}: {problem}")));
    }
    assert!(wrong.is_empty(), "{} files:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn georeferenced_files_say_where_they_lie() {
    let entries = entries();
    let report = |name: &str| {
        let entry = entries.iter().find(|entry| entry.name == name).expect("a file of the table");
        ElevationGrid::decode(&entry.bytes, &entry.options).expect("a readable file").1
    };
    let geo = report("geo.tif");
    // Its tie point is the corner of the first sample.
    assert_eq!((geo.spacing, geo.origin), (Some([30.0; 2]), Some([500_015.0, 4_599_985.0])));
    // Nine rows of 25: the middle of the first sample of the top row.
    let corner = report("plain.asc");
    assert_eq!((corner.spacing, corner.origin), (Some([25.0; 2]), Some([500_012.5, 4_600_212.5])));
    let middle = report("centre.asc");
    assert_eq!(middle.origin, Some([500_000.0, 4_600_200.0]));
    assert_eq!(report("dx_dy.asc").spacing, Some([25.0, 30.0]));
}

#[test]
fn a_tile_of_srtm_is_a_degree_wide_and_fits_no_voxels_before_it_is_projected() {
    let read = |width: usize, height: usize| {
        let bytes = [[0, 7], [0, 9]].concat().repeat(width * height / 2 + 1);
        let options = ImportOptions { format: Some(HeightFormat::Hgt), ..ImportOptions::default() };
        ElevationGrid::decode(&bytes[..width * height * 2], &options).expect("a readable file").1
    };
    for (width, height) in [(1201, 1201), (1801, 3601)] {
        let report = read(width, height);
        assert_eq!(report.spacing, Some([1.0 / (width as f64 - 1.0), 1.0 / (height as f64 - 1.0)]));
        for voxel_size in [0.5, 1.0, 30.0] {
            assert!(matches!(report.scale(voxel_size), Err(ImportError::Spacing { .. })));
        }
    }
}

#[test]
fn files_that_are_opened_are_read_as_their_bytes_are() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/import");
    for Entry { name, bytes, options, .. } in entries() {
        let path = folder.join(&name);
        let decoded = ElevationGrid::decode(&bytes, &options).map(|(grid, report)| (hash(&grid), report));
        let opened = ElevationGrid::open(&path, &options).map(|(grid, report)| (hash(&grid), report));
        assert_eq!(opened, decoded, "{name}");
    }
}

#[test]
fn guesses_of_raw_files_are_reported() {
    for Entry { name, bytes, options, .. } in entries() {
        if name.ends_with("guessed.raw") {
            let (_, report) = ElevationGrid::decode(&bytes, &options).expect("a readable file");
            let text = report.to_string();
            assert!(
                text.contains("the size was guessed") && text.contains("byte order was guessed"),
                "{name}: {text}"
            );
        }
    }
}
