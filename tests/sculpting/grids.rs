//! Shapes of any form: grids of distances of functions and of meshes.

use std::f32::consts::{PI, TAU};
use std::time::Instant;

use bevy_burrow::brush::{BrushError, Edit, MeshGrid};
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{DVec3, Quat, UVec3, Vec3};

use crate::measured::{assert_closed, terrain};

fn count(name: &str, default: usize) -> usize {
    std::env::var(name).ok().and_then(|count| count.parse().ok()).unwrap_or(default)
}

/// A closed mesh.
struct Mesh {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// A bumpy cave of about this many triangles, some 20 voxels wide.
fn cave(triangles: usize) -> Mesh {
    let rings = ((triangles / 4) as f32).sqrt().ceil() as u32 + 2;
    let around = 2 * rings;
    let at = |ring: u32, step: u32| {
        let (up, turn) = (PI * ring as f32 / rings as f32, TAU * (step % around) as f32 / around as f32);
        let way = Vec3::new(up.sin() * turn.cos(), up.cos(), up.sin() * turn.sin());
        let bumps = (way.x * 7.0).sin() * (way.y * 5.0 + 1.0).cos() + 0.5 * (way.z * 13.0).sin();
        way * Vec3::new(11.0, 6.0, 8.0) * (1.0 + 0.12 * bumps)
    };
    let mut mesh = Mesh { positions: vec![at(0, 0)], triangles: Vec::new() };
    for ring in 1..rings {
        mesh.positions.extend((0..around).map(|step| at(ring, step)));
    }
    mesh.positions.push(at(rings, 0));
    let place = |ring: u32, step: u32| match ring {
        0 => 0,
        ring if ring == rings => (rings - 1) * around + 1,
        ring => 1 + (ring - 1) * around + step % around,
    };
    for (ring, step) in (0..rings).flat_map(|ring| (0..around).map(move |step| (ring, step))) {
        let [a, b, c, d] = [(ring, step), (ring, step + 1), (ring + 1, step), (ring + 1, step + 1)]
            .map(|(r, s)| place(r, s));
        if ring > 0 {
            mesh.triangles.push([a, b, d]);
        }
        if ring + 1 < rings {
            mesh.triangles.push([a, d, c]);
        }
    }
    mesh
}

impl Mesh {
    fn corners(&self) -> impl Iterator<Item = [DVec3; 3]> {
        self.triangles
            .iter()
            .map(|triangle| triangle.map(|corner| self.positions[corner as usize].as_dvec3()))
    }

    /// The winding number of a point by solid angles, and its distance from the surface.
    fn look(&self, p: DVec3) -> (f64, f64) {
        let (mut angles, mut distance) = (0.0, f64::MAX);
        for corners in self.corners() {
            let [a, b, c] = corners.map(|corner| corner - p);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            angles += 2.0 * a.dot(b.cross(c)).atan2(below);
            // Triangles are small, so that their corners and sides tell nearly all.
            let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| {
                let way = to - from;
                let t = (-from.dot(way) / way.length_squared()).clamp(0.0, 1.0);
                (from + way * t).length()
            });
            let normal = (b - a).cross(c - a);
            let above = a.dot(normal).abs() / normal.length();
            // The point is the origin here.
            let foot = normal * a.dot(normal) / normal.length_squared();
            let is_inside = [(a, b), (b, c), (c, a)]
                .iter()
                .all(|(from, to)| normal.dot((*to - *from).cross(foot - *from)) >= 0.0);
            distance = sides.into_iter().fold(distance, f64::min);
            distance = if is_inside { distance.min(above) } else { distance };
        }
        (angles / (4.0 * std::f64::consts::PI), distance)
    }
}

/// 100,000 triangles with `BURROW_CAVE_TRIANGLES`, and as many samples with `BURROW_CAVE_SAMPLES`.
#[test]
fn a_turned_cave_of_a_mesh_is_stamped_into_a_hillside() {
    let mesh = cave(count("BURROW_CAVE_TRIANGLES", 1500));
    let began = Instant::now();
    let MeshGrid { grid, middle, cell } =
        ShapeGrid::from_mesh(&mesh.positions, &mesh.triangles, 64).expect("a closed mesh");
    println!("{} triangles: converted in {:.2?}", mesh.triangles.len(), began.elapsed());
    let hillside = |x: i32, z: i32| 12.0 + 0.4 * f64::from(x) + 2.0 * (f64::from(z) * 0.2).sin();
    let mut ground = terrain(Ground::from_fn(96, 96, hillside).expect("finite"));
    let hash = ground.world().hash();
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.3);
    let (place, scale) = (Vec3::new(52.0, 34.0, 47.0), 1.3);
    // A point of the mesh lies at `place + turn * (point * scale)`.
    let shape =
        GridShape::new(grid, place + turn * (middle * scale)).with_rotation(turn).with_scale(cell * scale);
    let began = Instant::now();
    let receipt = ground.apply_one(Brush::dig(shape.clone()));
    println!("stamped in {:.2?}", began.elapsed());
    assert!(receipt.outcome.is_ok_and(|applied| applied.removed.total() > 1500));
    assert_closed(&ground);

    let (mut rng, mut seen) = (Rng::with_seed(4), [0; 2]);
    for _ in 0..count("BURROW_CAVE_SAMPLES", 1500) {
        let by = (Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5) * 36.0;
        let point = (place + by).round().as_ivec3();
        let (winding, distance) = mesh.look((turn.inverse() * (point.as_vec3() - place) / scale).as_dvec3());
        // Within half a cell, the grid may be on the other side.
        if distance < f64::from(cell) / 2.0 {
            continue;
        }
        assert!((winding - winding.round()).abs() < 1e-3, "{winding}");
        let is_inside = winding.round() != 0.0;
        let was_solid = ground.world().ground().distance(point) < 0;
        assert_eq!(
            ground.world().samples().is_solid(point),
            was_solid && !is_inside,
            "{point}: winding number {winding}, {distance} from the surface"
        );
        seen[usize::from(is_inside)] += 1;
    }
    assert!(seen[0] > 100 && seen[1] > 50, "{seen:?}");
    ground.undo();
    assert_eq!((ground.world().hash(), ground.world().bricks().count()), (hash, 0));
    ground.apply([Brush::add(shape.clone(), MaterialId(2)), Brush::reset(shape)]);
    assert_eq!(ground.world().hash(), hash);
}

#[test]
fn a_grid_of_a_ball_is_that_ball_at_any_rotation_and_scale() {
    let grid = ShapeGrid::from_fn(UVec3::new(21, 23, 25), |at| {
        (at.as_vec3() - Vec3::new(10.0, 11.0, 12.0)).length() - 7.0
    })
    .expect("a valid size");
    let mut rng = Rng::with_seed(1);
    for _ in 0..40 {
        let turn = Quat::from_scaled_axis((Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5) * 6.0);
        let (center, scale) = (Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 90.0, 0.2 + 2.0 * rng.f32());
        let shape = GridShape::new(grid.clone(), center).with_rotation(turn).with_scale(scale);
        let edit = Edit::quantize(&Brush::dig(shape)).expect("valid");
        let ball = Edit::quantize(&Brush::dig(Shape::sphere(center, 7.0 * scale))).expect("valid");
        for _ in 0..100 {
            let by = (Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5) * 18.0 * scale;
            let point = (center + by).round().as_ivec3();
            let [found, exact] = [&edit, &ball].map(|edit| edit.evaluator().distance(point));
            let cell = 256.0 * scale;
            if exact as f32 > 2.5 * cell {
                // Outside the grid, only the distance to the grid is known.
                assert!(found as f32 > cell && found <= exact + cell as i32 / 4, "{found}, not {exact}");
                continue;
            }
            // Linear between samples of a curved surface; in the middle it is a cone.
            let most = if exact as f32 > -4.0 * cell { 0.1 } else { 0.9 };
            assert!(((found - exact).abs() as f32) < 4.0 + most * cell, "{found}, not {exact}");
        }
        assert!(edit.reach().contains(center.as_ivec3()));
    }
}

#[test]
fn grids_are_written_and_read_in_all_forms() {
    let grid = ShapeGrid::from_fn(UVec3::new(5, 4, 6), |at| at.as_vec3().length() - 3.3).expect("valid");
    let shape = GridShape::new(grid, Vec3::new(3.0, 4.0, 5.5))
        .with_scale(2.0)
        .with_rotation(Quat::from_rotation_y(1.0));
    let brush = Brush::add(shape, MaterialId(2)).with_tag(3);
    let edit = Edit::quantize(&brush).expect("valid");
    let json = serde_json::to_string(&edit).expect("an edit");
    assert_eq!(serde_json::from_str::<Edit>(&json).expect("an edit"), edit);
    let line = serde_json::to_string(&brush).expect("a brush");
    assert_eq!(serde_json::from_str::<Brush>(&line).expect("a brush"), brush);
    // Broken grids are refused, whatever is in them.
    for (from, to) in [(r#""width":5"#, r#""width":1"#), (r#""height":25"#, r#""height":5"#)] {
        assert!(json.contains(from), "{json}");
        assert!(serde_json::from_str::<Edit>(&json.replace(from, to)).is_err());
    }
    let image = |width: u32, samples: Vec<u16>| {
        let height = samples.len() as u32 / width;
        std::sync::Arc::new(GreyImage::from_samples(width, height, samples).expect("as many"))
    };
    for other in [image(1, vec![7; 9]), image(3, vec![9; 9]), image(3, vec![3; 30]), image(2, vec![1; 4])] {
        let error = edit.clone().with_stamp_image(other).expect_err("no grid");
        assert_eq!(error, BrushError::NoGrid);
    }
}

#[test]
fn meshes_with_holes_and_grids_of_wrong_sizes_are_refused() {
    let mesh = cave(300);
    let refused = |positions: &[Vec3], triangles: &[[u32; 3]], samples| {
        ShapeGrid::from_mesh(positions, triangles, samples).expect_err("refused")
    };
    assert_eq!(refused(&mesh.positions, &mesh.triangles[1..], 32), BrushError::OpenMesh { edges: 3 });
    let mut flipped = mesh.triangles.clone();
    flipped[5].swap(0, 1);
    assert_eq!(refused(&mesh.positions, &flipped, 32), BrushError::OpenMesh { edges: 3 });
    assert!(matches!(refused(&[], &[[0, 1, 2]], 32), BrushError::NoTriangles));
    assert!(matches!(refused(&mesh.positions, &[], 32), BrushError::NoTriangles));
    assert!(matches!(refused(&[Vec3::ONE; 3], &[[0, 1, 2]], 32), BrushError::NoTriangles));
    assert!(matches!(refused(&[Vec3::NAN; 3], &[[0, 1, 2]], 32), BrushError::NotFinite { .. }));
    for samples in [0, 7, 129, u32::MAX] {
        assert!(matches!(refused(&mesh.positions, &mesh.triangles, samples), BrushError::GridSize { .. }));
    }
    assert!(ShapeGrid::from_fn(UVec3::new(2, 9, 9), |_| 1.0).is_err());
    assert!(ShapeGrid::from_fn(UVec3::new(9, 9, 129), |_| 1.0).is_err());
    assert!(ShapeGrid::from_fn(UVec3::splat(4), |_| f32::NAN).is_err());
    assert!(ShapeGrid::from_fn(UVec3::splat(4), |_| f32::NEG_INFINITY).is_ok());
    // Two bodies that overlap, one of them inside out, are one.
    let inside_out =
        mesh.triangles.iter().map(|[a, b, c]| [*b, *a, *c].map(|i| i + mesh.positions.len() as u32));
    let both: Vec<[u32; 3]> = mesh.triangles.iter().copied().chain(inside_out).collect();
    let moved = mesh.positions.iter().map(|at| *at + Vec3::new(40.0, 0.0, 0.0));
    let positions: Vec<Vec3> = mesh.positions.iter().copied().chain(moved).collect();
    let two = ShapeGrid::from_mesh(&positions, &both, 64).expect("closed");
    let inside = |at: Vec3| {
        let size = two.grid.size().as_vec3();
        two.grid.distance(((at - two.middle) / two.cell + (size - 1.0) / 2.0).round().as_ivec3()) < 0
    };
    assert!(inside(Vec3::ZERO) && inside(Vec3::X * 40.0) && !inside(Vec3::X * 20.0));
}

/// Where boxes overlap or share a face, no air stays between them, though the face may lie exactly on samples.
#[test]
fn faces_within_a_shape_leave_no_air() {
    for (second, scale) in [(5.0, 1.0), (10.0, 1.0), (5.0, 0.25)] {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for from in [0.0, second] {
            let first = positions.len() as u32;
            let corner = |bits: u32| {
                Vec3::new((bits & 1) as f32, (bits >> 1 & 1) as f32, (bits >> 2) as f32) * 10.0
                    + Vec3::X * from
            };
            positions.extend((0..8).map(corner));
            let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
            triangles.extend(
                faces
                    .iter()
                    .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
                    .map(|t| t.map(|at| first + at)),
            );
        }
        let mesh = ShapeGrid::from_mesh(&positions, &triangles, second as u32 + 15).expect("closed");
        assert_eq!(mesh.cell, 1.0);
        let mut terrain =
            Terrain::new(Ground::flat(64, 64, 0.0).expect("valid"), &TerrainSettings::default())
                .expect("valid");
        let place = Vec3::new(20.0, 20.0, 20.0);
        terrain.apply([Brush::add(mesh.placed(place, Quat::IDENTITY, scale), MaterialId(2))]);
        let samples = terrain.world().samples();
        let size = (Vec3::new(second + 10.0, 10.0, 10.0) * scale).as_ivec3();
        for at in (LatticeBox { min: place.as_ivec3() + 1, max: place.as_ivec3() + size - 1 }).points() {
            assert!(samples.is_solid(at), "{at} with boxes at 0 and {second}, {scale} times");
        }
    }
}

#[test]
fn a_mesh_off_its_origin_lies_where_its_points_go() {
    let mut mesh = cave(400);
    mesh.positions.iter_mut().for_each(|at| *at += Vec3::new(30.0, -7.0, 12.0));
    let grid = ShapeGrid::from_mesh(&mesh.positions, &mesh.triangles, 48).expect("closed");
    let (middle, rotation, scale) = (Vec3::new(32.0, 30.0, 31.0), Quat::from_rotation_z(0.7), 0.8);
    let rotation = rotation * Quat::from_rotation_y(1.9);
    let place = middle - rotation * (grid.middle * scale);
    mesh.positions.iter_mut().for_each(|at| *at = rotation * (*at * scale) + place);

    let ground = Ground::flat(64, 64, 60.0).expect("valid");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    terrain.apply([Brush::dig(grid.placed(place, rotation, scale))]);
    let (mut inside, samples) = (0, terrain.world().samples());
    let around = LatticeBox { min: middle.as_ivec3() - 14, max: middle.as_ivec3() + 14 };
    for at in around.points() {
        let (winding, distance) = mesh.look(at.as_dvec3());
        if distance > 1.5 {
            assert_eq!(samples.is_solid(at), winding.abs() < 0.5, "{at}");
            inside += usize::from(winding.abs() > 0.5);
        }
    }
    assert!(inside > 100, "{inside}");
}
