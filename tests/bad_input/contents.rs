//! Paths, roads, grids, meshes, prefabs and pastes with arbitrary numbers, and damaged edits of any kind.

use std::sync::Arc;

use bevy_burrow::brush::CustomShape;
use bevy_burrow::brush::shapes::MeshGrid;
use bevy_burrow::lattice::{LIMIT, LatticeBox, REACH};
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{IVec3, Quat, UVec3, Vec3};

use crate::terrains::{assert_flawless, small_terrain};
use crate::worlds::{any_random_brush, contents};

/// A plausible number, or occasionally any.
fn number(rng: &mut Rng, low: f32, high: f32) -> f32 {
    let (limit, reach) = (LIMIT as f32, REACH as f32);
    let special = [
        0.0,
        -0.0,
        -1.0,
        0.249,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        f32::MIN,
        f32::MIN_POSITIVE,
        1e-45,
        limit,
        -limit,
        limit + 0.01,
        reach,
        -reach,
        reach + 0.1,
        1024.0,
        8192.0,
        16_777_216.0,
    ];
    match rng.u32(0..60) {
        0 => f32::from_bits(rng.u32(..)),
        1 => special[rng.usize(..special.len())],
        2 => (rng.i32(-8..40) as f32) / 2.0,
        _ => low + rng.f32() * (high - low),
    }
}

fn point(rng: &mut Rng) -> Vec3 {
    Vec3::from_array([(); 3].map(|()| number(rng, -3.0, 17.0)))
}

fn rotation(rng: &mut Rng) -> Quat {
    let plain = Quat::from_scaled_axis(Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 6.0);
    match rng.u32(0..8) {
        0 => Quat::from_array([(); 4].map(|()| number(rng, -1.0, 1.0))),
        1 => plain * number(rng, 0.98, 1.02),
        2 => Quat::IDENTITY,
        _ => plain,
    }
}

/// A path, which may have too few points or too many, and points on top of each other.
fn path(rng: &mut Rng) -> BrushPath {
    let count = match rng.u32(0..30) {
        0 => 0,
        1 => 1,
        2 => 256,
        3 => 257,
        _ => rng.usize(2..6),
    };
    let mut points: Vec<(Vec3, f32)> = (0..count).map(|_| (point(rng), number(rng, 0.25, 3.0))).collect();
    if rng.u32(0..4) == 0 {
        let first = points.first().copied();
        first.into_iter().for_each(|first| points[count / 2..].fill(first));
    }
    if rng.bool() { BrushPath::spline(points) } else { BrushPath::polyline(points) }
}

fn shape(rng: &mut Rng) -> CustomShape {
    match rng.u32(0..3) {
        0 => CustomShape::Path(path(rng)),
        1 => CustomShape::Corridor(Corridor::new(path(rng), number(rng, 0.0, 6.0), number(rng, 0.0, 6.0))),
        _ => {
            let grids = &contents().0;
            let shape = GridShape::new(grids[rng.usize(..grids.len())].clone(), point(rng));
            CustomShape::Grid(shape.with_rotation(rotation(rng)).with_scale(number(rng, 0.3, 2.0)))
        }
    }
}

fn paste(rng: &mut Rng) -> Paste {
    let prefabs = &contents().1;
    let paste = Paste::new(Arc::clone(&prefabs[rng.usize(..prefabs.len())]), point(rng));
    let paste = Paste { mirror: rng.bool(), edited_only: rng.bool(), ..paste };
    match rng.u32(0..3) {
        0 => paste.turned_about_x(rng.i32(..)).turned_about_z(rng.i32(..)),
        _ => Paste { scale: number(rng, 0.3, 1.5), ..paste.rotated(rotation(rng)) },
    }
}

fn brush(rng: &mut Rng) -> Brush {
    let material = MaterialId(rng.u8(..));
    let brush = match rng.u32(0..13) {
        0 => {
            let points = path(rng).points;
            let mut curves: Vec<Shape> = match rng.bool() {
                true => Shape::along_spline(&points).collect(),
                false => Shape::along_polyline(&points).collect(),
            };
            Brush::dig(curves.pop().unwrap_or_else(|| Shape::sphere(point(rng), number(rng, 0.3, 5.0))))
        }
        12 => Brush::dig(shape(rng)),
        1 => Brush::add(shape(rng), material),
        2 => Brush::paint(shape(rng), material),
        3 => Brush::reset(shape(rng)),
        4 => Brush::fill(shape(rng), number(rng, 0.0, 6.0)),
        5 => Brush::carve(shape(rng), number(rng, 0.0, 6.0)),
        6 => Brush::smooth(shape(rng), number(rng, 0.0, 1.0)),
        7 => Brush::raise(shape(rng), number(rng, 0.0, 3.0)),
        8 => Brush::flatten(shape(rng), point(rng), point(rng)),
        9 => {
            let corridor = Corridor::new(path(rng), number(rng, 0.0, 6.0), number(rng, 0.0, 6.0));
            Brush::road(corridor, number(rng, 0.0, 3.0))
        }
        10 => Brush::paste(paste(rng)),
        _ => Brush { operation: Operation::Paste { paste: paste(rng) }, ..Brush::dig(shape(rng)) },
    };
    let brush = if rng.bool() { brush.with_power(rng.u8(..)) } else { brush };
    match rng.u32(0..6) {
        0 => brush.with_roughness(Roughness::new(number(rng, 0.0, 2.0), number(rng, 1.0, 6.0), rng.u32(..))),
        1 => brush.with_falloff(number(rng, 0.0, 4.0)),
        2 => brush.with_strength(number(rng, 0.0, 1.0)),
        3 => {
            let scale = number(rng, 0.5, 2.0);
            brush.transformed(rotation(rng), point(rng) - 7.0, scale)
        }
        _ => brush,
    }
}

/// Whether a small terrain applies it quickly. Brushes of the largest size are valid, but too slow for these tests.
fn is_affordable(terrain: &Terrain, edit: &Edit) -> bool {
    let reach = edit.reach().intersection(terrain.world().grid().edit_bounds());
    reach.is_none_or(|reach| reach.volume() < 30_000)
}

/// Applies a brush, and checks its receipt; returns whether it was accepted.
fn apply(terrain: &mut Terrain, brush: &Brush) -> bool {
    let quantized = Edit::quantize(brush);
    if quantized.as_ref().is_ok_and(|edit| !is_affordable(terrain, edit)) {
        return false;
    }
    let before = terrain.world().hash();
    let receipts = terrain.apply([brush]);
    let [Receipt { tag, outcome, .. }] = &receipts[..] else { panic!("{brush:?}: {receipts:?}") };
    assert_eq!(*tag, brush.tag);
    match (quantized, outcome) {
        (Err(error), Err(Rejection::Brush(why))) => {
            // NaN differs from itself.
            assert_eq!(error.to_string(), why.to_string());
            assert!(!error.to_string().is_empty());
        }
        (Ok(_), Ok(applied)) => {
            assert_eq!(applied.bounds.is_some(), terrain.world().hash() != before, "{brush:?}");
        }
        (Ok(_), Err(Rejection::OutsideWorld)) => {}
        (quantized, _) => panic!("{brush:?}: {quantized:?}, but {outcome:?}"),
    }
    outcome.is_ok()
}

#[test]
fn any_paths_roads_grids_and_pastes_get_receipts_and_leave_a_closed_surface() {
    let (mut accepted, mut refused) = (0, 0);
    for seed in 0..300 {
        let mut rng = Rng::with_seed(seed);
        let mut terrain = small_terrain();
        let pristine = terrain.world().hash();
        for tag in 0..6 {
            let brush = brush(&mut rng).with_tag(tag);
            brush.shape.outline(|_, _| {});
            if let Some(custom) = &brush.custom {
                custom.outline(|_, _| {});
            }
            match Edit::quantize(&brush) {
                Ok(edit) => {
                    edit.check().expect("as it was quantised");
                    let json = serde_json::to_string(&edit).expect("edits are written");
                    assert_eq!(serde_json::from_str::<Edit>(&json).expect("its own line"), edit);
                    if is_affordable(&terrain, &edit) && edit.reach().volume() < 1 << 20 {
                        assert!(brush.voxel_count().is_ok());
                    }
                }
                Err(_) => {
                    assert!(brush.voxel_count().is_err());
                    refused += 1;
                }
            }
            accepted += usize::from(apply(&mut terrain, &brush));
        }
        assert_flawless(&terrain, seed);
        while terrain.undo().outcome.is_ok() {}
        assert_eq!(terrain.world().hash(), pristine);
    }
    assert!(accepted > 600 && refused > 300, "{accepted} accepted, {refused} refused");
}

/// Changes some characters of a line of JSON.
fn damage(rng: &mut Rng, json: &str) -> String {
    let mut bytes = json.as_bytes().to_vec();
    for _ in 0..rng.usize(1..4) {
        // Of the long lists of samples, only the ends are interesting.
        let end = bytes.len().min(400);
        let at = if rng.bool() { rng.usize(..end) } else { bytes.len() - 1 - rng.usize(..end) };
        let new = b"0123456789-.e,[]{}"[rng.usize(..18)];
        match rng.u32(0..3) {
            0 => bytes[at] = new,
            1 => bytes.insert(at, new),
            _ => drop(bytes.remove(at)),
        }
    }
    String::from_utf8(bytes).expect("still ASCII")
}

#[test]
fn damaged_edits_and_lines_of_any_kind_are_refused_or_applied() {
    let (mut edits, mut lines) = (0, 0);
    for seed in 0..150 {
        let mut rng = Rng::with_seed(seed);
        let mut terrain = small_terrain();
        let brush = any_random_brush(&mut rng, terrain.world().ground());
        let edit = Edit::quantize(&brush).expect("a valid brush");
        let json = [
            serde_json::to_string(&edit).expect("edits are written"),
            serde_json::to_string(&brush).expect("brushes are written"),
        ];
        for _ in 0..20 {
            if let Ok(edit) = serde_json::from_str::<Edit>(&damage(&mut rng, &json[0])) {
                edit.check().expect("an edit that is read is valid");
                let again = serde_json::to_string(&edit).expect("edits are written");
                assert_eq!(serde_json::from_str::<Edit>(&again).expect("its own line"), edit);
                if is_affordable(&terrain, &edit) {
                    let receipt = terrain.apply([edit]).remove(0);
                    let is_outside = matches!(receipt.outcome, Err(Rejection::OutsideWorld));
                    assert!(receipt.outcome.is_ok() || is_outside, "{receipt:?}");
                    edits += 1;
                }
            }
            if let Ok(brush) = serde_json::from_str::<Brush>(&damage(&mut rng, &json[1])) {
                apply(&mut terrain, &brush);
                lines += 1;
            }
        }
        assert_flawless(&terrain, seed);
    }
    assert!(edits > 100 && lines > 100, "{edits} edits and {lines} lines were read");
}

/// A tetrahedron with corners at the origin and these distances along the axes.
fn tetrahedron(sides: Vec3) -> ([Vec3; 4], [[u32; 3]; 4]) {
    let corners = [Vec3::ZERO, sides * Vec3::X, sides * Vec3::Y, sides * Vec3::Z];
    (corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
}

#[test]
fn any_mesh_is_a_grid_or_an_error() {
    let mut accepted = 0;
    for seed in 0..400 {
        let mut rng = Rng::with_seed(seed);
        let (mut corners, mut triangles) =
            tetrahedron(Vec3::from_array([(); 3].map(|()| number(&mut rng, 1.0, 9.0))));
        let by = point(&mut rng);
        corners.iter_mut().for_each(|corner| *corner += by);
        match rng.u32(0..8) {
            0 => corners[rng.usize(..4)] = point(&mut rng),
            1 => triangles[rng.usize(..4)][rng.usize(..3)] = [0, 3, 4, u32::MAX][rng.usize(..4)],
            2 => corners.iter_mut().for_each(|corner| *corner *= number(&mut rng, 1e-44, 1e-38)),
            3 => corners.iter_mut().for_each(|corner| *corner *= number(&mut rng, 1e36, 1e38)),
            _ => {}
        }
        let made = ShapeGrid::from_painted_mesh(&corners, &triangles, &[MaterialId(2); 4], rng.u32(8..24));
        match made {
            Ok(MeshGrid { grid, middle, cell }) => {
                assert!(middle.is_finite() && cell.is_finite() && cell > 0.0, "seed {seed}: {middle} {cell}");
                assert!(grid.has_materials());
                let shape = GridShape::new(grid, Vec3::splat(7.0));
                assert!(Edit::quantize(&Brush::fill(shape, 1.0)).is_ok());
                accepted += 1;
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    assert!(accepted > 100, "{accepted}");
}

#[test]
fn meshes_without_extent_or_materials_are_refused_by_what_they_lack() {
    let refused = |corners: &[Vec3], triangles: &[[u32; 3]], materials: usize| {
        let materials = vec![MaterialId(2); materials];
        ShapeGrid::from_painted_mesh(corners, triangles, &materials, 24).map(drop).expect_err("refused")
    };
    let (corners, triangles) = tetrahedron(Vec3::splat(9.0));
    assert!(ShapeGrid::from_painted_mesh(&corners, &triangles, &[MaterialId(2); 4], 24).is_ok());
    for count in [0, 3, 5] {
        let error = refused(&corners, &triangles, count).to_string();
        assert!(error.contains(&format!("{count} materials")) && error.contains("4 triangles"), "{error}");
    }
    // A line, there and back; and meshes smaller than numbers can be divided, or larger than they can be subtracted.
    assert_eq!(refused(&corners, &[[0, 1, 0], [1, 0, 1]], 2), BrushError::NoTriangles);
    let (_, triangles) = tetrahedron(Vec3::ONE);
    for (low, high, is_refused) in
        [(0.0, 1e-45, true), (0.0, 1e-40, true), (0.0, 3e38, false), (-3e38, 3e38, true), (2e38, 3e38, true)]
    {
        let corners = corners.map(|corner| corner.map(|part| if part == 0.0 { low } else { high }));
        let made = ShapeGrid::from_painted_mesh(&corners, &triangles, &[MaterialId(2); 4], 24);
        assert_eq!(made.is_err_and(|error| error == BrushError::NoTriangles), is_refused, "{low} to {high}");
    }
}

#[test]
fn an_image_that_holds_no_grid_is_an_empty_one_which_no_brush_has() {
    let mut rng = Rng::with_seed(2);
    for (width, height) in [(1, 1), (2, 2), (1, 400), (5, 3), (3, 10), (128, 128)] {
        let samples: Vec<u16> = (0..width * height).map(|_| rng.u16(1..9)).collect();
        let json = format!(r#"{{"width":{width},"height":{height},"samples":{samples:?}}}"#);
        let grid: ShapeGrid = serde_json::from_str(&json).expect("an image");
        assert_eq!(grid.size(), UVec3::ZERO);
        for at in [IVec3::ZERO, IVec3::MIN, IVec3::MAX, IVec3::splat(7)] {
            assert!(grid.distance(at) > 0, "{width} x {height}: nothing is inside");
            assert_eq!(grid.material(at), MaterialId::GROUND);
        }
        let grid = grid.with_materials(|_| MaterialId(3));
        assert!(!grid.has_materials());
        let brush = Brush::dig(GridShape::new(grid, Vec3::splat(7.0)));
        assert_eq!(Edit::quantize(&brush), Err(BrushError::NoGrid));
        apply(&mut small_terrain(), &brush);
    }
}

#[test]
fn pieces_of_worlds_of_any_box_are_prefabs_and_grids_or_errors() {
    let mut terrain = small_terrain();
    terrain.apply([Brush::dig(Shape::sphere(Vec3::splat(7.0), 3.0))]);
    let ends = [i32::MIN, -LIMIT - 1, -LIMIT, -1, 0, 3, 6, 12, 14, 200, LIMIT, LIMIT + 1, i32::MAX];
    let (mut rng, mut made) = (Rng::with_seed(3), [0; 2]);
    for _ in 0..3000 {
        let mut part = || match rng.u32(0..12) {
            0 => ends[rng.usize(..ends.len())],
            _ => rng.i32(0..13),
        };
        let mut end = || IVec3::from_array([(); 3].map(|()| part()));
        let (samples, anchor) = (LatticeBox { min: end(), max: end() }, end());
        match terrain.world().copy(samples, anchor) {
            Ok(prefab) => {
                assert_eq!(prefab.size(), samples.size());
                let at = Vec3::from_array([(); 3].map(|()| number(&mut rng, -3.0, 17.0)));
                let paste = Paste::new(prefab, at).onto_ground(terrain.world().ground());
                apply(&mut terrain, &Brush::paste(paste));
                made[0] += 1;
            }
            Err(error) => {
                let what = error.to_string();
                assert!(what.contains("copy") || what.contains("nearer"), "{what}");
            }
        }
        match terrain.world().shape_grid(samples) {
            Ok(grid) => {
                assert_eq!(grid.size().as_ivec3(), samples.size());
                made[1] += 1;
            }
            Err(error) => assert!(matches!(error, BrushError::GridSize { .. }), "{error}"),
        }
    }
    assert!(made.iter().all(|&made| made > 20), "{made:?}");
    assert_flawless(&terrain, "pastes");
}
