//! Material maps: the files of `tests/fixtures/materials`, which `tools/material_files.py` makes, against numpy and Pillow.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use bevy_burrow::ground::{
    ColumnMaterial, ElevationGrid, IdOptions, ImportError, ImportOptions, MaterialMap, MaterialReport,
    NoiseSource, SplatOptions,
};
use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::Vec3;
use serde_json::Value;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/materials")
}

fn read(name: &Value) -> Vec<u8> {
    fs::read(folder().join(name.as_str().expect("a name"))).expect("a file of the table")
}

fn material(value: &Value) -> Option<MaterialId> {
    value.as_u64().map(|id| MaterialId(id as u8))
}

fn decode(entry: &Value) -> Result<(MaterialMap, MaterialReport), ImportError> {
    let list = |name: &str| entry[name].as_array().cloned().unwrap_or_default();
    let deep = material(&entry["deep"]);
    if entry["splats"].is_array() {
        let layers = list("layers").iter().map(material).collect();
        let files: Vec<Vec<u8>> = list("splats").iter().map(read).collect();
        return MaterialMap::decode_splats(&files, &SplatOptions { layers, deep, ..SplatOptions::default() });
    }
    let id = |own: &Value| (own[0].as_u64().expect("an id") as u16, material(&own[1]).expect("a material"));
    let ids = list("of").iter().map(id).collect();
    let byte = |value: &Value| value.as_u64().expect("a part of a colour") as u8;
    let colours = list("colours");
    let colours = colours
        .iter()
        .map(|own| ([0, 1, 2].map(|part| byte(&own[0][part])), material(&own[1]).expect("one")));
    let options = IdOptions { ids, colours: colours.collect(), deep, ..IdOptions::default() };
    MaterialMap::decode_ids(&read(&entry["ids"]), &options)
}

/// FNV-1a of base, overlay and blend of every sample.
fn hash(map: &MaterialMap) -> String {
    let bytes = map.columns().iter().flat_map(|own| [own.base.0, own.overlay.0, own.blend]);
    let hash = bytes.fold(0xCBF2_9CE4_8422_2325, |state: u64, byte| {
        (state ^ u64::from(byte)).wrapping_mul(0x100_0000_01B3)
    });
    format!("{hash:016x}")
}

#[test]
fn every_map_is_read_as_by_numpy_and_pillow_or_refused_with_a_reason() {
    let table = fs::read_to_string(folder().join("table.json")).expect("the table");
    let table: Vec<Value> = serde_json::from_str(&table).expect("a list");
    assert!(table.len() >= 30);
    let mut wrong = Vec::new();
    for entry in table {
        let problem = match (decode(&entry), entry["error"].as_str()) {
            (Err(error), Some(reason)) => {
                let text = error.to_string();
                let is_right = text.contains(reason) && !text.contains('\n') && text.contains(':');
                (!is_right).then(|| format!("refused with: {text}"))
            }
            (Err(error), None) => Some(format!("refused: {error}")),
            (Ok((_, report)), Some(reason)) => Some(format!("read, not refused with {reason}: {report}")),
            (Ok((map, report)), None) => {
                let notes = format!("{:?}", report.notes);
                let expected = entry["notes"].as_array().cloned().unwrap_or_default();
                let has_notes = expected.iter().all(|note| notes.contains(note.as_str().expect("a note")));
                let is_quiet =
                    !expected.is_empty() || report.notes.is_empty() || notes.contains("AlphaIgnored");
                let size = [map.width(), map.height()].map(u64::from);
                let same =
                    [Some(size[0]), Some(size[1])] == [entry["width"].as_u64(), entry["height"].as_u64()];
                let is_right = same && has_notes && is_quiet && entry["hash"] == hash(&map);
                (!is_right).then(|| format!("read as {report}, {}", hash(&map)))
            }
        };
        wrong.extend(problem.map(|problem| format!("{entry}\n  {problem}")));
    }
    assert!(wrong.is_empty(), "{} maps:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn any_damage_of_a_map_is_read_or_refused_without_a_panic() {
    let file = fs::read(folder().join("one_0.png")).expect("a file of the table");
    let mut rng = Rng::with_seed(3);
    let options = SplatOptions::of([1, 2, 3, 4].map(MaterialId));
    for _ in 0..3000 {
        let mut bytes = file.clone();
        for _ in 0..rng.usize(1..4) {
            let at = rng.usize(..bytes.len());
            bytes[at] = rng.u8(..);
        }
        bytes.truncate(rng.usize(..=bytes.len()));
        drop(MaterialMap::decode_splats(&[&bytes], &options));
        drop(MaterialMap::decode_ids(&bytes, &IdOptions::default()));
    }
}

#[test]
fn a_map_is_stretched_over_the_world_and_each_column_has_its_nearest_sample() {
    let solid = |id| ColumnMaterial::solid(MaterialId(id));
    let map = MaterialMap::from_columns(3, 2, (0..6).map(solid).collect()).expect("a map");
    let control = MaterialControl::Map(Arc::new(map));
    let kept = Ground::flat(8, 4, 3.0).expect("valid").with_materials(&control).expect("valid");
    let noise = NoiseHeights::default();
    let source = NoiseSource::new(&noise).expect("valid");
    let computed = Ground::from_source(8, 4, source).and_then(|ground| ground.with_materials(&control));
    let computed = computed.expect("valid");
    for (x, z) in (0..=8).flat_map(|x| (0..=4).map(move |z| (x, z))) {
        let expected = solid(((x + 2) / 4 + (z + 2) / 4 * 3) as u8);
        for ground in [&kept, &computed] {
            assert_eq!(ground.column_material(Column::new(x, z)), expected, "({x}, {z})");
        }
    }
    let wrong = MaterialMap::from_columns(1, 1, vec![solid(255)]).expect("a map");
    assert!(
        Ground::flat(8, 4, 3.0)
            .expect("valid")
            .with_materials(&MaterialControl::Map(Arc::new(wrong)))
            .is_err()
    );
}

#[test]
fn another_map_and_other_heights_below_a_world_keep_its_edits() {
    let flat = |map: &[u8], height| {
        let columns = map.iter().map(|&id| ColumnMaterial::solid(MaterialId(id))).collect();
        let map = MaterialMap::from_columns(2, 2, columns).expect("a map");
        let ground = Ground::flat(64, 64, height).expect("valid");
        Arc::new(ground.with_materials(&MaterialControl::Map(Arc::new(map))).expect("valid"))
    };
    let (first, second) = (flat(&[1, 2, 3, 4], 20.0), flat(&[5, 6, 7, 8], 24.5));
    let edits = [
        Brush::dig(Shape::sphere(Vec3::new(20.0, 20.0, 20.0), 6.0)),
        Brush::add(Shape::sphere(Vec3::new(44.0, 30.0, 40.0), 5.0), MaterialId(9)),
    ];
    let mut terrain = Terrain::new(Arc::clone(&first), &TerrainSettings::default()).expect("valid");
    terrain.apply(edits.clone());
    let before = terrain.snapshot();
    terrain.apply_one(Order::Ground(Arc::clone(&second))).outcome.expect("it has the same size");
    let (old, new) = (before.samples(), terrain.world().samples());
    let mut edited = 0;
    for point in before.bricks().flat_map(|(pos, _)| pos.samples().points()) {
        assert_eq!(
            (old.sample(point), old.stored_material(point)),
            (new.sample(point), new.stored_material(point))
        );
        edited += u32::from(old.is_edited(point));
    }
    assert!(edited > 500);
    assert_eq!(terrain.world().ground().column_material(Column::new(3, 3)).base, MaterialId(5));
    assert!(terrain.world().check_seams().is_flawless());
    terrain.apply_one(Order::Ground(first)).outcome.expect("it has the same size");
    assert_eq!(terrain.world().hash(), before.hash());
}

#[test]
fn the_scale_of_a_file_in_metres_follows_from_its_tags() {
    let text = |cell: &str| {
        format!("ncols 3\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize {cell}\n1 2 3 4 5 6 7 8 9\n")
    };
    let report =
        |cell| ElevationGrid::decode(text(cell).as_bytes(), &ImportOptions::default()).expect("a grid").1;
    for (cell, voxel_size, voxels) in [("4", 1.0, 4), ("4", 0.5, 8), ("30", 2.0, 15), ("2.002", 1.0, 2)] {
        let scale = report(cell).scale(voxel_size).expect("whole voxels");
        assert_eq!(scale.voxels_per_sample, voxels);
        let (grid, _) =
            ElevationGrid::decode(text(cell).as_bytes(), &ImportOptions::default()).expect("a grid");
        let ground = grid.into_ground(&scale).expect("valid");
        assert_eq!(ground.width(), voxels as i32 * 2);
        assert_eq!(f64::from(ground.height(Column::new(0, 0))), (256.0 / voxel_size).round());
    }
    for (cell, voxel_size) in
        [("0.000277", 1.0), ("4", 3.0), ("100", 1.0), ("4", 0.0), ("4", f64::NAN), ("4", -1.0)]
    {
        let error = report(cell).scale(voxel_size).expect_err("it does not fit").to_string();
        assert!(error.contains("choose a voxel size"), "{error}");
    }
}
