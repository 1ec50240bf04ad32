//! Non-finite numbers, numbers outside the world, and numbers of any magnitude.

use fastrand::Rng;
use glam::DVec3;

use crate::inputs::small_terrain;

#[test]
fn queries_with_non_finite_numbers_have_no_answer() {
    let terrain = small_terrain();
    let world = terrain.world();
    let (place, down) = (DVec3::new(20.5, 40.0, 15.2), DVec3::NEG_Y);
    assert!(world.raycast(place, down, 100.0).is_some());
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for broken in [
            DVec3::new(bad, 1.0, 1.0),
            DVec3::new(1.0, bad, 1.0),
            DVec3::new(1.0, 1.0, bad),
            DVec3::splat(bad),
        ] {
            assert_eq!(world.raycast(broken, down, 100.0), None, "{broken}");
            assert_eq!(world.raycast(place, broken, 100.0), None, "{broken}");
            // Columns depend on x and z only.
            if !broken.x.is_finite() || !broken.z.is_finite() {
                assert_eq!(world.normal(broken), None, "{broken}");
                assert!(!world.is_solid(broken), "{broken}");
            } else {
                // Below the world, everything is ground.
                assert_eq!(world.is_solid(broken), bad == f64::NEG_INFINITY, "{broken}");
                let _ = world.normal(broken);
            }
            assert!(!world.is_buried(broken), "{broken}");
            let _ = world.material_under(broken);
        }
        for (x, z) in [(bad, 3.0), (3.0, bad), (bad, bad)] {
            assert_eq!(world.spans(x, z), [], "{x}, {z}");
            assert_eq!(world.height(x, z), None, "{x}, {z}");
        }
    }
    assert_eq!(world.raycast(place, DVec3::ZERO, 100.0), None);
    assert_eq!(world.raycast(place, down, f64::NAN), None);
    assert_eq!(world.raycast(place, down, -1.0), None);
    assert_eq!(world.raycast(place, down, f64::NEG_INFINITY), None);
    assert_eq!(world.raycast(place, down, 0.0), None);
}

#[test]
fn outside_the_world_there_is_nothing() {
    let terrain = small_terrain();
    let world = terrain.world();
    for (x, z) in [
        (-0.001, 5.0),
        (40.001, 5.0),
        (5.0, -0.001),
        (5.0, 30.001),
        (-1e300, 5.0),
        (5.0, 1e300),
        (f64::MAX, f64::MIN),
    ] {
        assert_eq!(world.spans(x, z), [], "{x}, {z}");
        assert_eq!(world.height(x, z), None, "{x}, {z}");
        assert_eq!(world.normal(DVec3::new(x, 10.0, z)), None, "{x}, {z}");
        assert!(!world.is_solid(DVec3::new(x, -50.0, z)), "{x}, {z}");
        assert_eq!(world.raycast(DVec3::new(x, 50.0, z), DVec3::NEG_Y, f64::INFINITY), None, "{x}, {z}");
    }
    // The rim belongs to the world.
    for (x, z) in [(0.0, 0.0), (40.0, 0.0), (0.0, 30.0), (40.0, 30.0), (-0.0, 12.5)] {
        assert!(world.height(x, z).is_some(), "{x}, {z}");
        assert!(world.is_solid(DVec3::new(x, 0.0, z)), "{x}, {z}");
        assert!(world.raycast(DVec3::new(x, 50.0, z), DVec3::NEG_Y, f64::INFINITY).is_some(), "{x}, {z}");
    }
}

#[test]
fn queries_with_numbers_of_any_magnitude_return() {
    let terrain = small_terrain();
    let world = terrain.world();
    let tiny = f64::from_bits(1);
    let sizes = [
        0.0,
        -0.0,
        tiny,
        -tiny,
        1e-300,
        1e-160,
        -1e-9,
        1.0,
        -1.0,
        15.0,
        1e9,
        -1e15,
        1e160,
        1e300,
        -1e300,
        f64::MAX,
    ];
    let mut rng = Rng::with_seed(6);
    for _ in 0..4000 {
        let mut pick = || sizes[rng.usize(0..sizes.len())];
        let (origin, direction) = (DVec3::new(pick(), pick(), pick()), DVec3::new(pick(), pick(), pick()));
        let max = [0.0, 1.0, 1e9, f64::MAX, f64::INFINITY, tiny][rng.usize(0..6)];
        if let Some(hit) = world.raycast(origin, direction, max) {
            assert!(hit.distance >= 0.0 && hit.distance <= max, "{origin} {direction} {max}: {hit:?}");
            assert!(
                hit.position.is_finite() && hit.normal.is_finite(),
                "{origin} {direction} {max}: {hit:?}"
            );
        }
        let _ = (
            world.spans(origin.x, origin.z),
            world.is_solid(origin),
            world.normal(origin),
            world.material_under(origin),
        );
    }
}
