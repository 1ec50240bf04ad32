//! Compares every field and every shared constant of `layout.cuh` with the Rust side.

use std::collections::HashMap;
use std::mem::offset_of;

use super::*;
use crate::ground::{BED, BeddingRecord, FILL, MAX_STRATA, POCKET, StratumRecord, VEIN};

const HEADER: &str = include_str!("../kernels/layout.cuh");

/// A field: its name, offset and size in bytes.
type Field = (String, usize, usize);

#[derive(Default)]
struct Struct {
    fields: Vec<Field>,
    bytes: usize,
    align: usize,
}

/// The header without comments.
fn code() -> String {
    HEADER.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join(" ")
}

/// Evaluates a product or sum of numbers and constants.
fn value(text: &str, constants: &HashMap<String, i64>) -> i64 {
    let term = |text: &str| -> i64 {
        let factor = |text: &str| match text.strip_prefix("0x") {
            Some(hex) => i64::from_str_radix(hex, 16).expect("a number"),
            None => text.parse().unwrap_or_else(|_| constants[text]),
        };
        match text.split_once('/') {
            Some((a, b)) => factor(a.trim()) / factor(b.trim()),
            None => text.split('*').map(|text| factor(text.trim())).product(),
        }
    };
    text.split('+').map(|text| term(text.trim())).sum()
}

/// The constants, and the values of enumerators.
fn constants(code: &str) -> HashMap<String, i64> {
    let mut found = HashMap::new();
    for statement in code.split(';') {
        if let Some((_, rest)) = statement.split_once("constexpr ") {
            let (name, text) = rest.split_once('=').expect("a constant has a value");
            let name = name.split_whitespace().last().expect("a constant has a name");
            found.insert(name.to_owned(), value(text, &found));
        }
        if let Some((_, body)) = statement.split_once("enum ").and_then(|(_, rest)| rest.split_once('{')) {
            for (number, name) in body.trim_end().trim_end_matches('}').split(',').enumerate() {
                let (name, number) = match name.split_once('=') {
                    Some((name, text)) => (name, value(text, &found)),
                    None => (name, number as i64),
                };
                found.insert(name.trim().to_owned(), number);
            }
        }
    }
    found
}

/// The structs with the offsets of C's layout rules.
fn structs(code: &str, constants: &HashMap<String, i64>) -> HashMap<String, Struct> {
    let mut all = HashMap::<String, Struct>::new();
    for text in code.split("struct ").skip(1) {
        let (head, rest) = text.split_once('{').expect("a struct has a body");
        let body = rest.split_once('}').expect("a body ends").0;
        let name = head.split_whitespace().last().expect("a struct has a name").to_owned();
        let aligned = head.split_once("alignas(").and_then(|(_, rest)| rest.split_once(')'));
        let mut found = Struct {
            align: aligned.map_or(1, |(number, _)| value(number, constants) as usize),
            ..Struct::default()
        };
        for field in body.split(';').map(str::trim).filter(|field| !field.is_empty()) {
            let (bytes, align, names) = match field.rsplit_once('*') {
                Some((_, name)) => (8, 8, name.split(')').next().expect("a name")),
                None => {
                    let (kind, names) = field.split_once(' ').expect("a type and names");
                    let bytes = match kind {
                        "u8" => 1,
                        "i16" | "u16" => 2,
                        "i32" | "u32" | "float" => 4,
                        "i64" | "u64" | "double" => 8,
                        _ => all[kind].bytes,
                    };
                    (bytes, all.get(kind).map_or(bytes, |of| of.align), names)
                }
            };
            for name in names.split(',') {
                let mut parts = name.trim().split('[');
                let name = parts.next().expect("a name").trim().to_owned();
                let len: i64 = parts.map(|len| value(len.trim_end_matches(']'), constants)).product();
                let at = found.bytes.next_multiple_of(align);
                found.bytes = at + bytes * len as usize;
                found.align = found.align.max(align);
                found.fields.push((name, at, bytes * len as usize));
            }
        }
        found.bytes = found.bytes.next_multiple_of(found.align);
        all.insert(name, found);
    }
    all
}

fn bytes_of_field<T, F>(_: fn(&T) -> &F) -> usize {
    size_of::<F>()
}

#[test]
fn every_field_is_where_the_kernels_expect_it() {
    let code = code();
    let mut structs = structs(&code, &constants(&code));
    // In a slot, materials follow the record.
    let brick = structs.get_mut("Brick").expect("bricks");
    assert_eq!(brick.bytes, BRICK_BYTES);
    assert_eq!(brick.fields.pop(), Some(("materials".into(), RECORD_BYTES, MATERIAL_BYTES)));
    brick.bytes = RECORD_BYTES;

    macro_rules! check {
        ($($name:ident is $type:ty: $($($part:ident).+),+;)+) => {$(
            let of = structs.remove(stringify!($name)).expect(stringify!($name));
            assert_eq!(of.bytes, size_of::<$type>(), stringify!($name));
            let ours = [$((
                [$(stringify!($part)),+].join("."),
                offset_of!($type, $($part).+),
                bytes_of_field(|all: &$type| &all.$($part).+),
            )),+];
            assert_eq!(of.fields.len(), ours.len(), stringify!($name));
            for (theirs, ours) in of.fields.iter().zip(&ours) {
                let last = ours.0.rsplit('.').next().unwrap_or_default();
                assert!(theirs.0.ends_with(last), "{theirs:?} {ours:?}");
                assert_eq!((theirs.1, theirs.2), (ours.1, ours.2), "{theirs:?} {ours:?}");
            }
        )+};
    }
    check! {
        Brick is BrickRecord: samples, solid, edited;
        Stack is StackRecord: heights, columns, pad;
        StratumRecord is StratumRecord: material, body, condition, seed, scale, limit, rough, rough_scale, depth, height, bed, ys;
        Bedding is BeddingRecord: dip, fold, scale, seed;
        StrataTable is StrataTable: bedding, last, count, strata;
        ScatterJob is ScatterJob: to, from, bytes, pad;
        ScatterParams is ScatterParams: jobs;
        EditJob is EditJob: brick, base, target, stack, first, count, cuts, window, strides, surface;
        EditRecord is EditRecord: kind, operation, material, is_rough, origin_voxel, origin_fraction, min, max, constants, amplitude, scale, seed, noise_origin,
            band, grid;
        GridRecord is GridRecord: rows, squared, scale, size, image, has_materials, pad;
        SculptParams is SculptParams: operation, material, strength, falloff, amounts, point, half, height, image, columns, rows, power,
            matrix, squared, length;
        EditResult is EditResult: hash, flags, record, material, bounds, uniform, pad;
        EditPart is EditPart: job, edit, part, bounds;
        EditCount is EditCount: edit, outcome, voxels, pad;
        EditParams is EditParams: bricks, stacks, jobs, list, edit_records, results, records, materials, parts, counts, counters,
            record_capacity, material_capacity, part_capacity, count_capacity, strata, grids, images;
        Rules is Rules: hardness, unbreakable, bedrock, boxes;
        Protected is Protected: min, max;
        StencilEditParams is StencilEditParams: edit, windows, sculpt_params, surface, rules, look, last, pad;
        SurfaceJob is SurfaceJob: brick, stack, window, strides, around, pad;
        SurfaceStartParams is SurfaceStartParams: bricks, stacks, windows, jobs, distances, horizon, last, pad;
        SurfaceSpreadParams is SurfaceSpreadParams: jobs, from, to;
        ColumnJob is ColumnJob: stack, x, z, pad, mask, pad2, borders;
        MeshJob is MeshJob: window, strides, column, y, cells, pad;
        MeshResult is MeshResult: vertex, vertices, index, indices;
        MeshParams is MeshParams: bricks, stacks, windows, columns, jobs, table, results, positions, normals, mixes, indices,
            counters, vertex_capacity, index_capacity, width, depth, single.is_single, single.ids, single.weights, pad, strata;
        HeightsParams is HeightsParams: tables, heights, noise.scale, noise.origin, noise.frequency, noise.lacunarity,
            noise.persistence, noise.weighting, noise.factor, noise.peak, noise.amplitude, noise.base, first, count, row_len,
            octaves, is_ridged, pad;
    }
    assert!(structs.is_empty(), "not compared: {:?}", structs.keys());
}

#[test]
fn every_constant_is_the_same() {
    let mut found = constants(&code());
    let mut check = |name: &str, value: i64| assert_eq!(found.remove(name), Some(value), "{name}");
    check("THREADS", THREADS.into());
    check("WARP", u32::MAX.into());
    check("LEN", 512);
    check("SIDE", 8);
    check("WINDOW", 11);
    check("AREA", 121);
    check("CORNERS", 81);
    check("ONE", crate::lattice::ONE.into());
    check("SNAP", crate::lattice::SNAP.into());
    check("BAND", crate::brush::BAND.into());
    check("DEPTH", crate::brush::DEPTH.into());
    check("OVERLAY_DEPTH", crate::ground::OVERLAY_DEPTH.into());
    check("PRISTINE", Sample::PRISTINE.bits().into());
    check("GROUND", MaterialId::GROUND.0.into());
    check("NONE", NONE.into());
    check("CHANGED", EditResult::CHANGED.into());
    check("EXTENDED", EditResult::EXTENDED.into());
    check("UNIFORM", EditResult::UNIFORM.into());
    check("HAS_MATERIALS", EditResult::HAS_MATERIALS.into());
    check("TOO_FAR", EditResult::TOO_FAR.into());
    check("MOST_STRATA", MAX_STRATA as i64);
    check("GRID_ZERO", crate::brush::shapes::GRID_ZERO.into());
    for (name, number) in [("FILL", FILL), ("BED", BED), ("VEIN", VEIN), ("POCKET", POCKET)] {
        check(name, number.into());
    }
    // Enumerators that the host writes as numbers.
    let numbered =
        |names: &[&str]| names.iter().zip(0..).map(|(name, n)| ((*name).to_owned(), n)).collect::<Vec<_>>();
    for (name, number) in [
        numbered(&["DIG", "ADD", "PAINT"]),
        numbered(&[
            "PLAIN",
            "SMOOTH",
            "SHARPEN",
            "FLATTEN",
            "LEVEL",
            "SHIFT",
            "STAMP",
            "TERRACE",
            "UNION",
            "SUBTRACTION",
        ]),
    ]
    .concat()
    {
        check(&name, number);
    }
    assert!(found.is_empty(), "not compared: {:?}", found.keys());
}

#[test]
fn shapes_have_the_same_numbers() {
    let shapes = include_str!("../kernels/shapes.cuh");
    let list = shapes.split_once("enum Kind {").and_then(|(_, rest)| rest.split_once('}')).expect("a list").0;
    let names: Vec<String> = list.split(',').map(|name| name.trim().to_lowercase()).collect();
    assert!(crate::brush::shapes::NAMES.iter().map(|name| name.to_lowercase()).eq(names));
}
