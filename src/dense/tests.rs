//! The fast mesher against the simple one, bit for bit, and laws that every mesh obeys.

use std::collections::{HashMap, HashSet};

use fastrand::Rng;

use super::*;

/// Positions and normals of all triangle corners, in order, as bits.
fn corners(mesh: &DenseMesh) -> Vec<([u32; 3], Option<[u32; 3]>)> {
    let bits = |vector: &[f32; 3]| vector.map(f32::to_bits);
    let corner = |&index: &u32| {
        let index = index as usize;
        (bits(&mesh.positions[index]), mesh.normals.get(index).map(bits))
    };
    mesh.indices.iter().map(corner).collect()
}

/// Meshes a grid with both meshers, and demands the same.
fn check<S: Density>(
    mesher: &mut DenseMesher,
    grid: DenseGrid<S>,
    normals: Normals,
    what: &str,
) -> DenseMesh {
    let mut mesh = DenseMesh::default();
    mesher.mesh(grid, normals, &mut mesh);
    let expected = simple::mesh(grid, normals);
    assert_eq!(mesh.indices.len(), expected.indices.len(), "triangles of {what}");
    assert_eq!(mesh.normals.len(), if normals == Normals::None { 0 } else { mesh.positions.len() }, "{what}");
    assert!(mesh.indices.iter().all(|&index| (index as usize) < mesh.positions.len()), "{what}");
    let (corners, expected_corners) = (corners(&mesh), corners(&expected));
    if let Some(at) = (0..corners.len()).find(|&at| corners[at] != expected_corners[at]) {
        panic!("{what}: corner {at} is {:?}, not {:?}", corners[at], expected_corners[at]);
    }
    assert_eq!(mesh.positions.len(), expected.positions.len(), "vertices of {what}");
    let used: HashSet<u32> = mesh.indices.iter().copied().collect();
    assert_eq!(used.len(), mesh.positions.len(), "every vertex of {what} is used");
    mesh
}

fn check_all<S: Density + std::fmt::Debug>(mesher: &mut DenseMesher, samples: &[S], size: [usize; 3]) {
    for normals in [Normals::None, Normals::Gradient] {
        let grid = DenseGrid::new(samples, size).expect("a grid");
        check(mesher, grid, normals, &format!("{size:?} {}, {normals:?}", std::any::type_name::<S>()));
        if let Ok(grid) = DenseGrid::with_apron(samples, size) {
            check(
                mesher,
                grid,
                normals,
                &format!("{size:?} {} + apron, {normals:?}", std::any::type_name::<S>()),
            );
        }
    }
}

/// Random integers, solid with a probability that itself is random: thin and dense surfaces.
fn random_samples(rng: &mut Rng, size: [usize; 3]) -> Vec<i16> {
    let solid = [0.02, 0.3, 0.5, 0.98][rng.usize(..4)];
    let reach = [2, 300, 0x7fff][rng.usize(..3)];
    let sample = |rng: &mut Rng| if rng.f32() < solid { -rng.i16(1..=reach) } else { rng.i16(0..=reach) };
    (0..size.iter().product()).map(|_| sample(rng)).collect()
}

fn check_random(rng: &mut Rng, mesher: &mut DenseMesher, size: [usize; 3]) {
    let samples = random_samples(rng, size);
    check_all(mesher, &samples, size);
    let numbers: Vec<f32> = samples.iter().map(|&sample| f32::from(sample)).collect();
    check_all(mesher, &numbers, size);
    let (mut from_i16, mut from_f32) = (DenseMesh::default(), DenseMesh::default());
    mesher.mesh(DenseGrid::new(&samples, size).expect("a grid"), Normals::Gradient, &mut from_i16);
    mesher.mesh(DenseGrid::new(&numbers, size).expect("a grid"), Normals::Gradient, &mut from_f32);
    assert_eq!(from_i16, from_f32, "{size:?}");
}

#[test]
fn small_grids_are_meshed_like_cell_by_cell() {
    let (mut rng, mut mesher) = (Rng::with_seed(1), DenseMesher::new());
    for x in 2..=9 {
        for y in 2..=9 {
            for z in 2..=9 {
                check_random(&mut rng, &mut mesher, [x, y, z]);
            }
        }
    }
}

#[test]
fn rows_that_end_at_any_bit_of_a_word_are_meshed_like_cell_by_cell() {
    let (mut rng, mut mesher) = (Rng::with_seed(2), DenseMesher::new());
    for x in (15..=18)
        .chain(31..=34)
        .chain(47..=50)
        .chain(61..=68)
        .chain([99, 100, 101])
        .chain(124..=132)
        .chain([190, 257])
    {
        for [y, z] in [[2, 2], [4, 5], [7, 4]] {
            check_random(&mut rng, &mut mesher, [x, y, z]);
        }
    }
}

#[test]
fn grids_of_many_batches_are_meshed_like_cell_by_cell() {
    let (mut rng, mut mesher) = (Rng::with_seed(3), DenseMesher::new());
    for size in [[33, 34, 35], [65, 20, 20], [3, 3, 500], [3, 500, 3], [500, 3, 3]] {
        check_random(&mut rng, &mut mesher, size);
    }
}

#[test]
fn smooth_grids_with_empty_layers_are_meshed_like_cell_by_cell() {
    let mut mesher = DenseMesher::new();
    for side in [32, 33, 40, 64, 65] {
        for radius in [0.05, 0.3, 0.45] {
            check_all(&mut mesher, &sphere(side, radius), [side; 3]);
            let inverted: Vec<f32> = sphere(side, radius).iter().map(|sample| -sample).collect();
            check_all(&mut mesher, &inverted, [side; 3]);
        }
    }
}

/// The distance to a sphere, its radius given as a part of the side.
fn sphere(side: usize, radius: f32) -> Vec<f32> {
    let at = |index: usize| {
        let point = glam::Vec3::new(
            (index % side) as f32,
            (index / side % side) as f32,
            (index / side / side) as f32,
        );
        point.distance(glam::Vec3::splat(side as f32 / 2.0 - 0.37)) - side as f32 * radius
    };
    (0..side * side * side).map(at).collect()
}

#[test]
fn samples_too_far_apart_are_crossed_in_the_middle() {
    let most = f32::MAX;
    for (low, high, crossing) in [
        (-most, most, 0.5),
        (most, -most, 0.5),
        (f32::NEG_INFINITY, 5.0, 0.5),
        (-5.0, f32::INFINITY, 0.5),
        (-most / 2.0, most / 2.0, 0.5),
        (-1.0, 3.0, 0.25),
    ] {
        let (samples, mut mesh) = ([low, high].repeat(4), DenseMesh::default());
        let grid = DenseGrid::new(&samples, [2, 2, 2]).expect("a grid");
        DenseMesher::new().mesh(grid, Normals::None, &mut mesh);
        assert_eq!(mesh.positions.len(), 4);
        assert!(mesh.positions.iter().all(|position| position[0] == crossing), "{low} {high}: {mesh:?}");
    }
}

#[test]
fn no_number_upsets_the_mesher() {
    let special = [
        f32::NAN,
        -f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        0.0,
        -0.0,
        f32::from_bits(1),
        -f32::from_bits(1),
        f32::MIN_POSITIVE,
        -f32::MIN_POSITIVE,
        f32::MAX,
        f32::MIN,
        1e-20,
        -1e-20,
        1e20,
        -1e20,
        1.0,
        -1.0,
    ];
    let (mut rng, mut mesher) = (Rng::with_seed(4), DenseMesher::new());
    for round in 0..300 {
        let size = [rng.usize(2..40), rng.usize(2..8), rng.usize(2..8)];
        // First a few kinds at a time, so that neighbours are alike, then all.
        let kinds: Vec<f32> =
            (0..if round < 200 { 3 } else { 18 }).map(|_| special[rng.usize(..18)]).collect();
        let samples: Vec<f32> = (0..size.iter().product()).map(|_| kinds[rng.usize(..kinds.len())]).collect();
        check_all(&mut mesher, &samples, size);
        let mut mesh = DenseMesh::default();
        mesher.mesh(DenseGrid::new(&samples, size).expect("a grid"), Normals::Gradient, &mut mesh);
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            assert!(
                (0..3).all(|axis| (0.0..=(size[axis] - 1) as f32).contains(&position[axis])),
                "{position:?}"
            );
            let length = normal.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
            assert!((length - 1.0).abs() < 1e-6, "{normal:?}");
        }
    }
}

#[test]
fn minus_zero_and_nan_are_air() {
    let mut mesh = DenseMesh::default();
    DenseMesher::new().mesh(
        DenseGrid::new(&[-0.0, f32::NAN, 0.0, 1.0, -f32::NAN, 2.0, 3.0, -0.0], [2; 3]).expect("a grid"),
        Normals::Gradient,
        &mut mesh,
    );
    assert_eq!(mesh, DenseMesh::default());
}

#[test]
fn a_surface_away_from_the_border_is_closed() {
    let (mut rng, mut mesher) = (Rng::with_seed(5), DenseMesher::new());
    for _ in 0..50 {
        let size = [rng.usize(3..70), rng.usize(3..12), rng.usize(3..12)];
        let mut samples = random_samples(&mut rng, size);
        for (index, sample) in samples.iter_mut().enumerate() {
            let point = [index % size[0], index / size[0] % size[1], index / size[0] / size[1]];
            if (0..3).any(|axis| point[axis] == 0 || point[axis] == size[axis] - 1) {
                *sample = 7;
            }
        }
        let mut mesh = DenseMesh::default();
        mesher.mesh(DenseGrid::new(&samples, size).expect("a grid"), Normals::None, &mut mesh);
        let mut balance: HashMap<(u32, u32), i32> = HashMap::new();
        for triangle in mesh.indices.chunks_exact(3) {
            for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (triangle[i], triangle[j])) {
                assert_ne!(from, to);
                *balance.entry((from, to)).or_default() += 1;
                *balance.entry((to, from)).or_default() -= 1;
            }
        }
        assert!(balance.values().all(|&count| count == 0), "{size:?}");
    }
}

#[test]
fn normals_of_a_sphere_point_away_from_its_middle() {
    let mut mesh = DenseMesh::default();
    let samples = sphere(32, 0.4);
    DenseMesher::new().mesh(DenseGrid::new(&samples, [32; 3]).expect("a grid"), Normals::Gradient, &mut mesh);
    let middle = glam::Vec3::splat(16.0 - 0.37);
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        let away = (glam::Vec3::from(*position) - middle).normalize();
        assert!(away.dot(glam::Vec3::from(*normal)) > 0.999);
    }
    for triangle in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|i| glam::Vec3::from(mesh.positions[triangle[i] as usize]));
        assert!((b - a).cross(c - a).dot(a - middle) >= 0.0, "counter-clockwise seen from outside");
    }
}

#[test]
fn with_an_apron_only_the_inner_cells_are_meshed() {
    let samples = random_samples(&mut Rng::with_seed(6), [9, 8, 7]);
    let mut mesh = DenseMesh::default();
    let grid = DenseGrid::with_apron(&samples, [9, 8, 7]).expect("a grid");
    DenseMesher::new().mesh(grid, Normals::Gradient, &mut mesh);
    for position in mesh.positions {
        assert!((0..3).all(|axis| (1.0..=[7.0, 6.0, 5.0][axis]).contains(&position[axis])), "{position:?}");
    }
}

#[test]
fn what_a_mesh_held_before_does_not_show() {
    let (mut mesher, mut reused) = (DenseMesher::new(), DenseMesh::default());
    let mut rng = Rng::with_seed(7);
    for side in [20, 5, 40, 2, 64, 30] {
        for normals in [Normals::Gradient, Normals::None, Normals::Gradient] {
            let samples = random_samples(&mut rng, [side; 3]);
            let grid = DenseGrid::new(&samples, [side; 3]).expect("a grid");
            let mut fresh = DenseMesh::default();
            mesher.mesh(grid, normals, &mut reused);
            DenseMesher::new().mesh(grid, normals, &mut fresh);
            assert_eq!(reused, fresh);
        }
    }
}

#[test]
fn grids_that_cannot_be_are_refused() {
    let refused = |size, apron, samples: &[f32]| {
        if apron { DenseGrid::with_apron(samples, size) } else { DenseGrid::new(samples, size) }.err()
    };
    assert_eq!(refused([2, 2, 2], false, &[0.0; 8]), None);
    assert_eq!(refused([4, 4, 4], true, &[0.0; 64]), None);
    let length = |size, expected, found| Some(DenseGridError::Length { size, expected, found });
    assert_eq!(refused([2, 2, 3], false, &[0.0; 8]), length([2, 2, 3], Some(12), 8));
    assert_eq!(refused([usize::MAX; 3], false, &[]), length([usize::MAX; 3], None, 0));
    let too_small = |size, least| Some(DenseGridError::TooSmall { size, least });
    assert_eq!(refused([2, 1, 2], false, &[0.0; 4]), too_small([2, 1, 2], 2));
    assert_eq!(refused([0, 0, 0], false, &[]), too_small([0, 0, 0], 2));
    assert_eq!(refused([4, 3, 4], true, &[0.0; 48]), too_small([4, 3, 4], 4));
    let long = [DenseGrid::<f32>::MAX_SIDE + 1, 2, 2];
    assert_eq!(refused(long, false, &vec![0.0; long[0] * 4]), Some(DenseGridError::TooLarge { size: long }));
}

#[test]
fn the_longest_rows_are_meshed_like_cell_by_cell() {
    let (mut rng, mut mesher) = (Rng::with_seed(8), DenseMesher::new());
    let side = DenseGrid::<i16>::MAX_SIDE;
    for size in [[side, 2, 2], [2, side, 2], [2, 2, side]] {
        check_random(&mut rng, &mut mesher, size);
    }
}

#[test]
fn all_machines_agree_on_every_bit() {
    let samples = random_samples(&mut Rng::with_seed(9), [70, 20, 20]);
    let mut mesh = DenseMesh::default();
    let grid = DenseGrid::new(&samples, [70, 20, 20]).expect("a grid");
    DenseMesher::new().mesh(grid, Normals::Gradient, &mut mesh);
    let bits = mesh.positions.iter().chain(&mesh.normals).flatten().map(|number| number.to_bits());
    let fnv = |hash: u64, word: u32| (hash ^ u64::from(word)).wrapping_mul(0x100_0000_01b3);
    let hash = bits.chain(mesh.indices.iter().copied()).fold(0xcbf2_9ce4_8422_2325, fnv);
    assert_eq!(
        hash, 15_915_429_079_213_948_004,
        "new bits or a new order of vertices: if that was meant, put the new hash here"
    );
}
