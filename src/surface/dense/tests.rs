//! The mesher against the one by the book, on grids of every size and kind.

use std::collections::HashMap;

use fastrand::Rng;

use super::*;

/// Bits of a triangle's corners: 0.0 is not -0.0.
fn bits(triangles: &[[([f32; 3], [f32; 3]); 3]]) -> Vec<[[u32; 6]; 3]> {
    let corner = |&(p, n): &([f32; 3], [f32; 3])| [p[0], p[1], p[2], n[0], n[1], n[2]].map(f32::to_bits);
    triangles.iter().map(|t| [corner(&t[0]), corner(&t[1]), corner(&t[2])]).collect()
}

fn check<S: Density>(mesher: &mut DenseMesher, grid: DenseGrid<S>, what: &str) {
    let (mut mesh, mut bare) = (DenseMesh::default(), DenseMesh::default());
    mesher.mesh(grid, Normals::Gradient, &mut mesh);
    mesher.mesh(grid, Normals::None, &mut bare);
    let (triangles, vertices) = plain::triangles(&grid);
    let (ours, expected) = (plain::corners(&mesh), triangles);
    assert_eq!(ours.len(), expected.len(), "{what}: triangles");
    let differs = bits(&ours).iter().zip(&bits(&expected)).position(|(a, b)| a != b);
    if let Some(at) = differs {
        panic!("{what}: triangle {at} is {:?}, not {:?}", ours[at], expected[at]);
    }
    assert_eq!(mesh.positions.len(), vertices, "{what}: every crossed edge has one vertex");
    assert_eq!(mesh.normals.len(), vertices, "{what}");
    assert_eq!((&bare.positions, &bare.indices), (&mesh.positions, &mesh.indices), "{what}: without normals");
    assert!(bare.normals.is_empty());
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        let within = |(&at, side): (&f32, usize)| (0.0..=(side - 1) as f32).contains(&at);
        let sides = grid.corners().map(|side| side + 2 * grid.apron());
        assert!(position.iter().zip(sides).all(within), "{what}: {position:?}");
        let length: f32 = normal.iter().map(|c| c * c).sum();
        assert!((length - 1.0).abs() < 1e-5, "{what}: {normal:?}");
    }
}

fn check_both<S: Density>(mesher: &mut DenseMesher, samples: &[S], size: [usize; 3]) {
    check(mesher, DenseGrid::new(samples, size).unwrap(), &format!("{size:?}"));
    if size.iter().all(|&side| side >= 4) {
        check(mesher, DenseGrid::with_apron(samples, size).unwrap(), &format!("{size:?} with apron"));
    }
}

/// Noise, or bumps that are mostly one sign.
fn sample(rng: &mut Rng, kind: usize) -> f32 {
    match kind {
        0 => rng.f32() - 0.5,
        1 => rng.f32() - 0.03,
        2 => 0.97 - rng.f32(),
        _ => [0.0, -0.0, 1.0, -1.0, f32::MIN_POSITIVE, -1e-40, 1e30, -1e30][rng.usize(0..8)],
    }
}

#[test]
fn small_grids_of_all_sizes_are_as_by_the_book() {
    let (mut rng, mut mesher) = (Rng::with_seed(1), DenseMesher::new());
    for i in 0..600 {
        let size = [rng.usize(2..=9), rng.usize(2..=9), rng.usize(2..=9)];
        let samples: Vec<f32> = (0..size.iter().product()).map(|_| sample(&mut rng, i % 4)).collect();
        check_both(&mut mesher, &samples, size);
    }
}

#[test]
fn rows_of_any_number_of_words_are_as_by_the_book() {
    let (mut rng, mut mesher) = (Rng::with_seed(2), DenseMesher::new());
    for (i, width) in
        [31, 32, 33, 34, 62, 63, 64, 65, 66, 67, 100, 126, 127, 128, 129, 130, 131, 193].iter().enumerate()
    {
        let size = [*width, 5, 4 + i % 3];
        let samples: Vec<f32> = (0..size.iter().product()).map(|_| sample(&mut rng, i % 3)).collect();
        check_both(&mut mesher, &samples, size);
    }
}

#[test]
fn integers_are_meshed_as_the_same_floats() {
    let (mut rng, mut mesher) = (Rng::with_seed(3), DenseMesher::new());
    for i in 0..60 {
        let size = [rng.usize(2..=70), rng.usize(2..=9), rng.usize(2..=9)];
        let range = [3, 40, 32_000][i % 3];
        let integers: Vec<i16> = (0..size.iter().product()).map(|_| rng.i16(-range..=range)).collect();
        let floats: Vec<f32> = integers.iter().map(|&v| f32::from(v)).collect();
        check_both(&mut mesher, &integers, size);
        let (mut a, mut b) = (DenseMesh::default(), DenseMesh::default());
        mesher.mesh(DenseGrid::new(&integers, size).unwrap(), Normals::Gradient, &mut a);
        mesher.mesh(DenseGrid::new(&floats, size).unwrap(), Normals::Gradient, &mut b);
        assert_eq!(a, b);
    }
}

#[test]
fn no_number_breaks_it() {
    let special = [
        f32::NAN,
        -f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MAX,
        f32::MIN,
        1e-45,
        -1e-45,
        0.0,
        -0.0,
        1.0,
        -1.0,
    ];
    let (mut rng, mut mesher) = (Rng::with_seed(4), DenseMesher::new());
    for _ in 0..300 {
        let size = [rng.usize(2..=12), rng.usize(2..=6), rng.usize(2..=6)];
        let samples: Vec<f32> =
            (0..size.iter().product()).map(|_| special[rng.usize(0..special.len())]).collect();
        check_both(&mut mesher, &samples, size);
    }
}

#[test]
fn what_does_not_touch_the_rim_is_closed() {
    let (mut rng, mut mesher, mut mesh) = (Rng::with_seed(5), DenseMesher::new(), DenseMesh::default());
    for _ in 0..100 {
        let size = [rng.usize(3..=70), rng.usize(3..=12), rng.usize(3..=12)];
        let is_inside = |i: usize| {
            let at = [i % size[0], i / size[0] % size[1], i / size[0] / size[1]];
            at.iter().zip(size).all(|(&at, side)| at > 0 && at + 1 < side)
        };
        let samples: Vec<f32> =
            (0..size.iter().product()).map(|i| if is_inside(i) { rng.f32() - 0.5 } else { 1.0 }).collect();
        mesher.mesh(DenseGrid::new(&samples, size).unwrap(), Normals::None, &mut mesh);
        let mut sides: HashMap<(u32, u32), i32> = HashMap::new();
        for t in mesh.indices.chunks_exact(3) {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *sides.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert!(sides.values().all(|&balance| balance == 0), "{size:?}");
    }
}

#[test]
fn one_solid_sample_is_an_octahedron_that_faces_the_air() {
    let mut samples = vec![1.0f32; 27];
    samples[13] = -1.0;
    let mut mesh = DenseMesh::default();
    DenseMesher::new().mesh(DenseGrid::new(&samples, [3, 3, 3]).unwrap(), Normals::Gradient, &mut mesh);
    assert_eq!((mesh.positions.len(), mesh.indices.len()), (6, 24));
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        let outwards: f32 = position.iter().zip(normal).map(|(p, n)| (p - 1.0) * n).sum();
        assert!((outwards - 0.5).abs() < 1e-6);
    }
}

#[test]
fn what_is_no_grid_is_refused() {
    let samples = [0.0f32; 64];
    let new = |size| DenseGrid::new(&samples, size).map(|_| ()).unwrap_err();
    assert_eq!(new([4, 4, 5]), DenseGridError::Length { size: [4, 4, 5], expected: 80, given: 64 });
    assert_eq!(new([64, 1, 1]), DenseGridError::Thin { size: [64, 1, 1], least: 2 });
    assert!(matches!(new([usize::MAX, 2, 2]), DenseGridError::Large { .. }));
    assert!(matches!(new([1 << 17, 2, 2]), DenseGridError::Large { .. }));
    assert!(matches!(new([60_000, 60_000, 2]), DenseGridError::Large { .. }));
    let thin = DenseGrid::with_apron(&samples[..36], [3, 3, 4]).map(|_| ()).unwrap_err();
    assert_eq!(thin, DenseGridError::Thin { size: [3, 3, 4], least: 4 });
}
