//! Unions and subtractions with rounded edges, and grids with materials of their own.

use bevy_burrow::brush::{BrushError, Edit};
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{IVec3, Quat, UVec3, Vec3};

use crate::measured::{assert_closed, terrain};
use crate::worlds::{any_random_brush, random_ground, random_roughness, random_strata, world_count};

fn flat(height: f64) -> Terrain {
    terrain(Ground::flat(96, 96, height).expect("a valid height"))
}

/// Whether a point is solid, and how far from it the surface lies in a round fillet between the ground at height 20 and
/// an upright cylinder of radius 8 around (48, 48): in voxels, by definition.
fn fillet(point: IVec3, radius: f64, is_dig: bool) -> (bool, f64) {
    let (x, z) = (f64::from(point.x - 48), f64::from(point.z - 48));
    let (above, beside) = (f64::from(point.y) - 20.0, x.hypot(z) - 8.0);
    let (own, shape) = if is_dig { (-above, beside) } else { (above, beside) };
    let corner = (radius - own).max(0.0).hypot((radius - shape).max(0.0));
    let union = if own < radius && shape < radius { radius - corner } else { own.min(shape) };
    ((union < 0.0) != is_dig, union.abs())
}

#[test]
fn a_pillar_stands_on_a_round_foot_and_a_shaft_has_a_round_rim() {
    for radius in [0.0, 1.0, 3.0, 6.0, 12.0] {
        for is_dig in [false, true] {
            let mut ground = flat(20.0);
            let shape = Shape::cylinder(Vec3::new(48.0, 6.0, 48.0), Vec3::Y * 28.0, 8.0);
            let brush = if is_dig { Brush::carve(shape, radius) } else { Brush::fill(shape, radius) };
            ground.apply([brush]);
            assert_closed(&ground);
            let around = LatticeBox { min: IVec3::new(24, 9, 24), max: IVec3::new(72, 31, 72) };
            let mut near = 0;
            for point in around.points() {
                let (is_solid, far) = fillet(point, f64::from(radius), is_dig);
                // The way along the lattice is up to 8 % longer.
                let most = 0.05 + 0.03 * f64::from(radius);
                let found = ground.world().samples().is_solid(point);
                assert!(far < most || found == is_solid, "{radius} {is_dig} {point}: {far}");
                near += usize::from(far < 1.0);
            }
            assert!(near > 1000);
        }
    }
}

#[test]
fn without_a_radius_they_are_an_add_and_a_dig() {
    let mut rng = Rng::with_seed(5);
    let hills = |x: i32, z: i32| 20.0 + 5.0 * (f64::from(x) * 0.3).sin() + 4.0 * (f64::from(z) * 0.2).cos();
    for _ in 0..12 {
        let [mut plain, mut own] = [(); 2].map(|()| terrain(Ground::from_fn(64, 64, hills).expect("finite")));
        for _ in 0..6 {
            let like = any_random_brush(&mut rng, plain.world().ground());
            let (shape, is_dig) = (like.shape, rng.bool());
            let material = MaterialId(rng.u8(..5));
            let (a, b) = match is_dig {
                true => (Brush::dig(shape), Brush::carve(shape, 0.0)),
                false => (Brush::add(shape, material), Brush::fill(shape, 0.0).with_material(material)),
            };
            plain.apply([Brush { roughness: like.roughness, ..a }]);
            own.apply([Brush { roughness: like.roughness, ..b }]);
            assert_eq!(plain.world().hash(), own.world().hash());
        }
    }
}

#[test]
fn a_fill_never_takes_away_and_a_carve_never_adds_and_both_end_at_the_radius() {
    let cliffs = |x: i32, z: i32| if (x / 9 + z / 13) % 2 == 0 { 14.0 } else { 33.0 };
    let (mut rounded, mut changed) = (0, 0);
    for seed in 0..24 {
        let mut rng = Rng::with_seed(seed);
        let mut ground = terrain(Ground::from_fn(64, 64, cliffs).expect("finite"));
        for _ in 0..4 {
            let brush = any_random_brush(&mut rng, ground.world().ground());
            ground.apply([brush]);
        }
        let like = any_random_brush(&mut rng, ground.world().ground());
        let (radius, is_dig) = (rng.f32() * 9.0, rng.bool());
        let new = |radius| {
            let brush =
                if is_dig { Brush::carve(like.shape, radius) } else { Brush::fill(like.shape, radius) };
            Brush { roughness: like.roughness, ..brush }
        };
        let before = ground.snapshot();
        let edit = Edit::quantize(&new(radius)).expect("valid");
        ground.apply([new(radius)]);
        assert_closed(&ground);
        let rounded_world = ground.snapshot();
        ground.undo();
        ground.apply([new(0.0)]);
        let (reach, evaluator) = (edit.reach(), edit.evaluator());
        for point in reach.grown(4).points().filter(|point| point.x >= 0 && point.z >= 0) {
            if point.x > 64 || point.z > 64 {
                continue;
            }
            let [was, plain, is] =
                [&*before, ground.world(), &*rounded_world].map(|own| own.samples().distance(point));
            let in_order = if is_dig { was <= plain && plain <= is } else { was >= plain && plain >= is };
            // What is stored ends at 128 voxels.
            assert!(in_order || was.abs() > 32_000, "seed {seed} at {point}: {was}, {plain}, {is}");
            if is != was {
                let most = (radius * 256.0).round() as i32;
                assert!(evaluator.distance(point) <= most.max(512), "seed {seed} at {point}");
                assert!(reach.contains(point));
                changed += 1;
            }
            rounded += usize::from(is != plain);
        }
    }
    assert!(changed > 10_000 && rounded > 3000, "{changed} {rounded}");
}

#[test]
fn edges_are_the_same_wherever_bricks_and_chunks_begin() {
    let mut rng = Rng::with_seed(7);
    let height = |x: i32, z: i32| 24.0 + 6.0 * (f64::from(x) * 0.4).sin() + f64::from((x * 7 + z * 3) % 5);
    for _ in 0..6 {
        let by = IVec3::new(rng.i32(0..17), rng.i32(-9..9), rng.i32(0..17));
        let mut worlds = [IVec3::ZERO, by].map(|by| {
            let height = move |x: i32, z: i32| height(x - by.x, z - by.z) + f64::from(by.y);
            terrain(Ground::from_fn(90, 90, height).expect("finite"))
        });
        for _ in 0..5 {
            let at = (Vec3::new(rng.f32(), rng.f32(), rng.f32()) * Vec3::new(20.0, 12.0, 20.0)
                + Vec3::new(30.0, 18.0, 30.0))
                * 256.0;
            let shape = Shape::sphere(at.round() / 256.0, 2.0 + rng.f32() * 5.0);
            let brush = match rng.u8(..3) {
                0 => Brush::dig(shape),
                1 => Brush::fill(shape, 6.0 * rng.f32()),
                _ => Brush::carve(shape, 6.0 * rng.f32()),
            };
            for (world, by) in worlds.iter_mut().zip([IVec3::ZERO, by]) {
                world.apply([brush.transformed(Quat::IDENTITY, by.as_vec3(), 1.0)]);
            }
        }
        let around = LatticeBox { min: IVec3::new(16, 4, 16), max: IVec3::new(64, 44, 64) };
        for point in around.points() {
            let [own, other] = [(&worlds[0], point), (&worlds[1], point + by)].map(|(world, at)| {
                (world.world().samples().distance(at), world.world().samples().is_edited(at))
            });
            assert_eq!(own, other, "{point} {by}");
        }
    }
}

#[test]
fn too_large_a_radius_is_refused_by_its_name() {
    let shape = Shape::sphere(Vec3::splat(9.0), 4.0);
    assert!(Edit::quantize(&Brush::carve(shape, 16.0)).is_ok());
    for brush in [Brush::fill(shape, 16.1), Brush::carve(shape, 64.0)] {
        assert_eq!(
            Edit::quantize(&brush),
            Err(BrushError::OutOfBounds {
                what: "falloff",
                value: brush.blend.falloff,
                least: 0.0,
                most: 16.0
            })
            .map_err(|error| match error {
                // Rounded to 1/256.
                BrushError::OutOfBounds { what, least, most, value } =>
                    BrushError::OutOfBounds { what, least, most, value: (value * 256.0).round() / 256.0 },
                error => error,
            })
        );
    }
    // From outside, too.
    let json =
        serde_json::to_string(&Edit::quantize(&Brush::fill(shape, 16.0)).expect("valid")).expect("an edit");
    assert!(serde_json::from_str::<Edit>(&json).is_ok());
    let error = serde_json::from_str::<Edit>(&json.replace(r#""falloff":4096"#, r#""falloff":4097"#));
    assert!(error.is_err_and(|error| error.to_string().contains("falloff")));
}

/// A ball whose material says in which octant a sample lies.
fn octants() -> ShapeGrid {
    ShapeGrid::from_fn(UVec3::new(19, 21, 20), |at| (at - 9).as_vec3().length() - 7.0)
        .expect("valid")
        .with_materials(|at| {
            let bit = |axis: usize| u8::from(at[axis] > 9) << axis;
            MaterialId(10 + bit(0) + bit(1) + bit(2))
        })
}

#[test]
fn a_fill_has_the_materials_of_its_grid_wherever_it_is_turned() {
    let grid = octants();
    let mut rng = Rng::with_seed(2);
    for _ in 0..8 {
        let turn = Quat::from_scaled_axis((Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5) * 6.0);
        let (scale, mut ground) = (0.6 + rng.f32(), flat(10.0));
        let place = Vec3::new(48.0, 34.0, 48.0) + Vec3::new(rng.f32(), rng.f32(), rng.f32());
        // Sample 9 of each side lies there.
        let middle = place + turn * ((grid.size().as_vec3() - 1.0) / 2.0 - 9.0) * scale;
        let shape = GridShape::new(grid.clone(), middle).with_rotation(turn).with_scale(scale);
        let receipt = ground.apply_one(Brush::fill(shape.clone(), 0.0));
        assert!(receipt.outcome.is_ok_and(|applied| applied.added.total() > 200));
        let (world, mut seen) = (ground.world(), 0);
        for point in LatticeBox::point(place.as_ivec3()).grown(10).points() {
            if !world.samples().is_solid(point) {
                continue;
            }
            let local = turn.inverse() * (point.as_vec3() - place) / scale;
            // The border lies between samples 9 and 10.
            if (local - 0.5).abs().min_element() < 0.7 {
                continue;
            }
            let bit = |axis: usize| u8::from(local[axis] > 0.5) << axis;
            assert_eq!(
                world.samples().material(point),
                MaterialId(10 + bit(0) + bit(1) + bit(2)),
                "{point} {local}"
            );
            seen += 1;
        }
        assert!(seen > 50, "{seen}");
        // One material for all of it, and that of an add.
        let mut ground = flat(10.0);
        ground.apply([Brush::fill(shape.clone(), 0.0).with_material(MaterialId(3))]);
        assert_eq!(ground.world().samples().material(place.round().as_ivec3()), MaterialId(3));
        ground.apply([Brush::add(shape, MaterialId(4))]);
        assert_eq!(
            ground.world().samples().material(place.round().as_ivec3()),
            MaterialId(3),
            "it was solid"
        );
    }
}

#[test]
fn where_a_grid_has_no_material_new_ground_has_that_below_it() {
    let grid = ShapeGrid::from_fn(UVec3::splat(17), |at| (at - 8).as_vec3().length() - 6.0).expect("valid");
    let half = grid.clone().with_materials(|at| if at.x > 8 { MaterialId(6) } else { MaterialId::GROUND });
    assert!(half.has_materials() && !grid.has_materials());
    assert_ne!(grid, half);
    assert_eq!(half.material(IVec3::new(40, 0, 0)), MaterialId(6), "as at the rim");
    let at = Vec3::new(40.0, 26.0, 40.0);
    for (grid, right) in [(half, MaterialId(6)), (grid, MaterialId(2))] {
        let mut ground = flat(20.0);
        ground.apply([Brush::paint(
            Shape::cuboid(at - Vec3::Y * 8.0, Vec3::new(16.0, 6.0, 16.0)),
            MaterialId(2),
        )]);
        ground.apply([Brush::fill(GridShape::new(grid, at), 2.0)]);
        let materials = [IVec3::new(43, 26, 40), IVec3::new(37, 26, 40)].map(|at| {
            assert!(ground.world().samples().is_solid(at));
            ground.world().samples().material(at)
        });
        assert_eq!(materials, [right, MaterialId(2)]);
    }
}

#[test]
fn grids_with_materials_are_written_and_read_and_wrong_ones_refused() {
    let shape = GridShape::new(octants(), Vec3::splat(20.0)).with_rotation(Quat::from_rotation_x(0.4));
    let brush = Brush::fill(shape, 1.5).with_roughness(random_roughness(&mut Rng::with_seed(3), 1.0));
    let edit = Edit::quantize(&brush).expect("valid");
    let json = serde_json::to_string(&edit).expect("an edit");
    assert_eq!(serde_json::from_str::<Edit>(&json).expect("an edit"), edit);
    let line = serde_json::to_string(&brush).expect("a brush");
    assert_eq!(serde_json::from_str::<Brush>(&line).expect("a brush"), brush);
    // With a row more or less it is not a valid grid.
    let image = edit.stamp_image().expect("the grid's image").clone();
    for rows in [image.height() - 1, image.height() + 1] {
        let mut samples = image.samples().to_vec();
        samples.resize((image.width() * rows) as usize, 0);
        let other =
            std::sync::Arc::new(GreyImage::from_samples(image.width(), rows, samples).expect("as many"));
        assert_eq!(edit.clone().with_stamp_image(other), Err(BrushError::NoGrid));
    }
}

#[test]
fn a_mesh_with_materials_has_them_on_its_faces() {
    // A box whose faces have materials 1 to 6, of quads in the order -x, x, -y, y, -z, z.
    let corner =
        |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * Vec3::new(12.0, 9.0, 10.0);
    let positions: Vec<Vec3> = (0..8).map(corner).collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let materials: Vec<MaterialId> = (0..12).map(|i| MaterialId(1 + i / 2)).collect();
    let mesh = ShapeGrid::from_painted_mesh(&positions, &triangles, &materials, 30).expect("closed");
    assert!(ShapeGrid::from_painted_mesh(&positions, &triangles, &materials[1..], 30).is_err());
    let plain = ShapeGrid::from_mesh(&positions, &triangles, 30).expect("closed");
    assert_eq!((mesh.middle, mesh.cell, mesh.grid.size()), (plain.middle, plain.cell, plain.grid.size()));
    let place = Vec3::new(40.0, 40.0, 40.0);
    let mut ground = flat(10.0);
    ground.apply([Brush::fill(GridShape::new(mesh.grid, place + mesh.middle).with_scale(mesh.cell), 0.0)]);
    let near = |at: Vec3| ground.world().samples().material((place + at).round().as_ivec3());
    let middle = Vec3::new(6.0, 4.5, 5.0);
    for (axis, half) in [(Vec3::X, 5.0), (Vec3::Y, 3.5), (Vec3::Z, 4.0)] {
        for (side, step) in [(-1.0, 0), (1.0, 1)] {
            let number = 1 + 2 * axis.dot(Vec3::new(0.0, 1.0, 2.0)) as u8 + step;
            assert_eq!(near(middle + axis * half * side), MaterialId(number), "{axis} {side}");
        }
    }
}

#[test]
fn any_piece_of_a_random_world_is_built_again_in_the_air() {
    let mut solid = 0;
    for seed in 0..world_count(16) {
        let mut rng = Rng::with_seed(seed + 40);
        let (own, chunk_size) = random_ground(&mut rng, seed);
        let (low, high) = own.height_range();
        let strata = random_strata(&mut rng, [low as f32 / 256.0 - 20.0, high as f32 / 256.0 + 2.0]);
        let own = if rng.bool() { own.with_strata(&strata).expect("valid strata") } else { own };
        let brushes: Vec<Brush> = (0..8).map(|_| any_random_brush(&mut rng, &own)).collect();
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let mut ground = Terrain::new(own, &settings).expect("valid");
        ground.apply(brushes);
        let world = ground.snapshot();
        let bricks: Vec<IVec3> = world.bricks().map(|(pos, _)| pos.origin()).collect();
        let Some(&middle) = rng.choice(&bricks) else { continue };
        let size = IVec3::from_array([(); 3].map(|()| rng.i32(3..30)));
        // Some of it may lie beyond the rim, where the ground continues as at the rim.
        let piece = LatticeBox { min: middle - size / 2, max: middle - size / 2 + size - 1 };
        let grid = world.shape_grid(piece).expect("a valid size");
        // Far above anything else.
        let by = IVec3::Y * (high / 256 + 700 - piece.min.y);
        let place = (piece.min + piece.max).as_vec3() / 2.0 + by.as_vec3();
        let bounds = world.grid().edit_bounds();
        if piece.intersection(bounds).is_none() {
            continue;
        }
        let fill = Brush::fill(GridShape::new(grid, place), 0.0);
        let receipt = ground.apply_one(fill.clone());
        let added = receipt.outcome.expect("it lies in the world").added;
        let (own, samples, mut counted) = (world.samples(), ground.world().samples(), 0);
        for point in piece.points().filter(|&point| bounds.contains(point + by)) {
            let is_rim = (point - piece.min).min(piece.max - point).min_element() == 0;
            let is_solid = own.is_solid(point) && !is_rim;
            assert_eq!(samples.is_solid(point + by), is_solid, "world {seed} at {point}");
            if is_solid {
                assert_eq!(samples.material(point + by), own.material(point), "world {seed} at {point}");
                counted += 1;
            }
        }
        assert_eq!(added.total(), counted, "world {seed}");
        solid += counted;
        assert_closed(&ground);
        // A reset of the same shape takes all of it away again.
        ground.apply([Brush { operation: Operation::Reset, ..fill }]);
        assert_eq!(ground.world().hash(), world.hash(), "world {seed}");
    }
    assert!(solid > 5000, "{solid}");
}

#[test]
fn a_piece_of_a_world_is_built_again_elsewhere() {
    let mut ground = flat(20.0);
    ground.apply([
        Brush::add(Shape::sphere(Vec3::new(24.0, 30.0, 24.0), 6.0), MaterialId(3)),
        Brush::add(Shape::cuboid(Vec3::new(24.0, 34.0, 24.0), Vec3::new(2.5, 6.0, 2.5)), MaterialId(5)),
    ]);
    let piece = LatticeBox { min: IVec3::new(14, 23, 14), max: IVec3::new(34, 42, 34) };
    let grid = ground.world().shape_grid(piece).expect("a valid size");
    let by = IVec3::new(40, 2, 37);
    let middle = (piece.min + piece.max).as_vec3() / 2.0 + by.as_vec3();
    ground.apply([Brush::fill(GridShape::new(grid.clone(), middle), 0.0)]);
    let samples = ground.world().samples();
    let mut solid = 0;
    for point in piece.grown(-1).points() {
        assert_eq!(samples.is_solid(point), samples.is_solid(point + by), "{point}");
        if samples.is_solid(point) {
            assert_eq!(samples.material(point), samples.material(point + by), "{point}");
            solid += 1;
        }
    }
    assert!(solid > 800);
    for side in [1, 128] {
        let wrong = LatticeBox { min: IVec3::ZERO, max: IVec3::new(side, 20, 20) };
        assert!(matches!(ground.world().shape_grid(wrong), Err(BrushError::GridSize { .. })));
    }
    let everything = LatticeBox { min: IVec3::MIN, max: IVec3::MAX };
    assert!(ground.world().shape_grid(everything).is_err());
}
