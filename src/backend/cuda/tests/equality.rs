//! Worlds computed on the device equal those of the CPU.

use crate::brush::shapes::Cuboid;
use glam::IVec3;

use super::*;
use crate::lattice::LatticeBox;

#[test]
fn worlds_of_a_device_equal_the_cpus() {
    let Some(device) = device() else { return };
    let (name, engine) = (device.name(), engine(device, 64 << 20));
    assert_eq!(engine.state(), EngineState::Cuda(name));
    let mut rng = Rng::with_seed(11);
    let worlds = worlds::world_count(40);
    (0..worlds).for_each(|index| compare(&mut rng, index, &engine));
    let figures = engine.figures();
    assert!(matches!(engine.state(), EngineState::Cuda(_)), "{:?}", engine.state());
    assert!(figures.cuda > figures.cpu * 20, "{figures:?}");
    assert!(!figures.opening.is_zero());
    println!("{worlds} worlds, {} stages on the device", figures.cuda);
}

#[test]
fn history_and_loose_pieces_of_a_device_equal_the_cpus() {
    let Some(device) = device() else { return };
    let engine = engine(device, 64 << 20);
    for index in 0..worlds::world_count(12) {
        let mut rng = Rng::with_seed(1700 + index);
        let (ground, chunk_size) = worlds::random_ground(&mut rng, index);
        let (settings, ground) = (TerrainSettings { chunk_size, ..Default::default() }, Arc::new(ground));
        let [mut expected, mut found] =
            [(); 2].map(|()| Terrain::new(Arc::clone(&ground), &settings).expect("valid settings"));
        found.set_engine(engine.clone());
        for terrain in [&mut expected, &mut found] {
            terrain.set_loose(Some(LooseSettings { largest: 4000, crumbs: 20, debris: 4000 }));
        }
        for _ in 0..8 {
            match rng.u32(0..5) {
                0 => assert_eq!(expected.undo(), found.undo(), "world {index}"),
                1 => assert_eq!(expected.redo(), found.redo(), "world {index}"),
                _ => {
                    let brushes = [(); 3].map(|()| worlds::any_random_brush(&mut rng, &ground));
                    assert_eq!(expected.apply(&brushes), found.apply(&brushes), "world {index}");
                }
            }
            assert_same(expected.world(), found.world(), index);
        }
        assert_eq!(expected.history(), found.history(), "world {index}");
    }
    assert!(matches!(engine.state(), EngineState::Cuda(_)), "{:?}", engine.state());
}

#[test]
fn a_small_budget_is_kept_and_nothing_is_lost() {
    let Some(device) = device() else { return };
    // The device has room for the bricks of a handful of brushes; larger transactions go to the CPU.
    let engine = engine(device, 1 << 20);
    let mut rng = Rng::with_seed(5);
    (0..worlds::world_count(40) / 4).for_each(|index| compare(&mut rng, index, &engine));
    let ball = |x: f32, z: f32, radius| vec![Brush::dig(Shape::sphere(glam::Vec3::new(x, 30.0, z), radius))];
    let mut transactions = vec![ball(80.0, 80.0, 45.0)];
    for i in 0..24 {
        transactions.push(ball(10.0 + (i % 6 * 28) as f32, 12.0 + (i / 6 * 44) as f32, 6.0));
    }
    transactions.insert(12, ball(70.0, 90.0, 50.0));
    compare_on(Ground::flat(160, 160, 30.0).expect("valid"), 32, &[&engine], &transactions);
    let figures = engine.figures();
    assert!(figures.cuda > 0, "{figures:?}");
    // After a failed attempt, the CPU's choice has no estimate.
    let mut given_up =
        figures.choices.iter().filter(|choice| !choice.is_cuda && choice.amount > 0).peekable();
    assert!(given_up.peek().is_some() && given_up.all(|choice| choice.estimate.is_none()), "{figures:?}");
}

#[test]
fn kernels_that_reach_the_hosts_memory_make_the_same_worlds() {
    let Some(engine) = zero_copy() else { return };
    let mut rng = Rng::with_seed(12);
    (0..worlds::world_count(40) / 2).for_each(|index| compare(&mut rng, index, &engine));
    assert!(matches!(engine.state(), EngineState::Cuda(_)), "{:?}", engine.state());
}

#[test]
fn a_brick_without_materials_any_more_equals_the_cpus() {
    let Some(device) = device() else { return };
    let engine = engine(device, 64 << 20);
    let sphere = |radius| Shape::sphere(glam::Vec3::new(48.0, 80.0, 48.0), radius);
    let transactions = [
        vec![Brush::add(sphere(24.0), MaterialId(3))],
        vec![Brush::dig(sphere(25.0))],
        vec![Brush::paint(sphere(30.0), MaterialId(3)), Brush::dig(sphere(26.0))],
        vec![Brush::add(sphere(20.0), MaterialId::GROUND)],
    ];
    compare_on(Ground::flat(96, 96, 40.0).expect("valid"), 32, &[&engine], &transactions);
}

#[test]
fn short_and_long_transactions_take_turns() {
    let small = |i: i32| {
        let center = glam::Vec3::new(20.0 + 7.0 * i as f32, 30.0, 30.0);
        [Brush::dig(Shape::sphere(center, 5.0)), Brush::add(Shape::sphere(center, 3.0), MaterialId(i as u8))]
    };
    let large = |y: f32| {
        let half = glam::Vec3::new(44.0, 13.0, 40.0);
        let center = glam::Vec3::new(60.0, y, 60.0);
        let cuboid = Shape::Cuboid(Cuboid { center, half, rotation: Default::default() });
        Brush::dig(cuboid).with_roughness(Roughness::new(2.0, 3.0, 5))
    };
    // Many edits of few bricks: short lists that overflow, and lists that are long only because of the edits.
    let many = |n: i32| (0..n).flat_map(|i| small(i % 9)).collect::<Vec<_>>();
    let transactions = [
        small(0).to_vec(),
        many(90),
        small(1).to_vec(),
        vec![large(20.0)],
        small(2).to_vec(),
        many(200),
        vec![],
        vec![large(10.0), large(30.0)],
        vec![Brush::dig(Shape::sphere(glam::Vec3::splat(-900.0), 5.0))],
        small(3).to_vec(),
    ];
    let ground = || Ground::from_fn(120, 120, |x, z| 30.0 + f64::from(x * z % 7)).expect("valid");
    let rule = MaterialRule { overlay: MaterialId(2), height: (0.0, 33.0), ..Default::default() };
    let control = MaterialControl::Rules { base: MaterialId(1), rules: vec![rule] };
    let with_materials = || ground().with_materials(&control).expect("valid");
    let (Some(mapped), Some(copied)) = (zero_copy(), async_copies()) else { return };
    compare_on(ground(), 32, &[&copied], &transactions);
    compare_on(with_materials(), 25, &[&copied], &transactions);
    compare_on(ground(), 32, &[&mapped], &transactions);
    compare_on(with_materials(), 25, &[&mapped], &transactions);
}

#[test]
fn engines_take_turns_with_the_same_bricks() {
    let Some(first) = zero_copy() else { return };
    let Some(second) = device() else { return };
    let second = engine(second, 1 << 20);
    let mut rng = Rng::with_seed(21);
    let (ground, chunk_size) = worlds::random_ground(&mut rng, 3);
    let transactions: Vec<Vec<Brush>> =
        (0..24).map(|_| (0..3).map(|_| worlds::random_gpu_brush(&mut rng, &ground)).collect()).collect();
    compare_on(ground, chunk_size, &[&first, &second], &transactions);
}

#[test]
fn a_high_cliff_at_the_end_of_the_lattice_equals_the_cpus() {
    let Some(device) = device() else { return };
    let engine = engine(device, 64 << 20);
    let top = f64::from(crate::lattice::LIMIT);
    let low = top - 1500.0;
    let ground = Ground::from_fn(24, 20, |x, _| if x < 20 { low } else { top }).expect("valid");
    let at = |x: f32, y: f64, z: f32| glam::Vec3::new(x, y as f32, z);
    let transactions = [
        vec![Brush::dig(Shape::sphere(at(21.0, top - 700.0, 8.0), 4.0))],
        vec![Brush::add(Shape::sphere(at(24.0, top, 20.0), 6.0), MaterialId(4))],
        vec![Brush::paint(Shape::sphere(at(21.0, low, 0.0), 9.0), MaterialId(1))],
    ];
    compare_on(ground, 8, &[&engine], &transactions);
}

#[test]
fn sculpting_of_any_kind_equals_the_cpus() {
    let Some(first) = zero_copy() else { return };
    let Some(second) = device() else { return };
    let second = engine(second, 64 << 20);
    let mut rng = Rng::with_seed(31);
    for index in 0..worlds::world_count(40).div_ceil(2) {
        let (ground, chunk_size) = worlds::random_ground(&mut rng, index);
        // Many brushes in one place, so that most read what others change.
        let brushes = |rng: &mut Rng| {
            let place = worlds::random_sculpting_brush(rng, &ground).shape;
            let near = |rng: &mut Rng| match rng.u32(0..3) {
                0 => worlds::random_gpu_brush(rng, &ground),
                1 => Brush { shape: place, ..worlds::random_gpu_brush(rng, &ground) },
                _ => Brush { shape: place, ..worlds::random_sculpting_brush(rng, &ground) },
            };
            (0..6).map(|_| near(rng)).collect()
        };
        let transactions: Vec<Vec<Brush>> = (0..4).map(|_| brushes(&mut rng)).collect();
        compare_on(ground, chunk_size, &[&first, &second], &transactions);
    }
    for engine in [&first, &second] {
        let figures = engine.figures();
        assert!(figures.cuda > figures.cpu * 10, "{figures:?}");
    }
}

#[test]
fn ground_lowered_and_raised_far_equals_the_cpus() {
    let Some(first) = zero_copy() else { return };
    let Some(second) = device() else { return };
    let second = engine(second, 64 << 20);
    let mut rng = Rng::with_seed(33);
    for index in 0..worlds::world_count(40).div_ceil(2) {
        let (ground, chunk_size) = worlds::random_ground(&mut rng, index);
        let (lower, raise) = worlds::random_lower_and_raise(&mut rng, &ground);
        let brushes = if rng.bool() { [lower, raise] } else { [raise, lower] };
        let count = rng.usize(1..6);
        let mut transactions = vec![vec![worlds::random_gpu_brush(&mut rng, &ground)]];
        transactions.extend(brushes.iter().flat_map(|brush| vec![vec![brush.clone()]; count]));
        // Sculpt what is left.
        transactions.push(vec![Brush { operation: Operation::Smooth, ..brushes[0].clone() }; 2]);
        transactions.push(vec![worlds::sculpting_brush(&mut rng, brushes[0].shape, glam::Vec3::splat(20.0))]);
        compare_on(ground, chunk_size, &[&first, &second], &transactions);
    }
}

#[test]
fn fills_and_carves_of_any_shape_equal_the_cpus() {
    let Some(first) = zero_copy() else { return };
    let Some(second) = device() else { return };
    let second = engine(second, 64 << 20);
    let mut rng = Rng::with_seed(41);
    for index in 0..worlds::world_count(40).div_ceil(4) {
        let (ground, chunk_size) = worlds::random_ground(&mut rng, index);
        // Many brushes in one place, so that most read what others change.
        let brushes = |rng: &mut Rng| {
            let place = worlds::random_sculpting_brush(rng, &ground).shape;
            let near = |rng: &mut Rng| match rng.u32(0..4) {
                0 => worlds::random_gpu_brush(rng, &ground),
                1 => Brush { shape: place, custom: None, ..worlds::random_rounded_brush(rng, &ground) },
                _ => worlds::random_rounded_brush(rng, &ground),
            };
            (0..4).map(|_| Brush { power: rng.u8(..) | rng.u8(..), ..near(rng) }).collect()
        };
        let transactions: Vec<Vec<Brush>> = (0..3).map(|_| brushes(&mut rng)).collect();
        let rules =
            if index % 2 == 0 { DiggingRules::default() } else { worlds::random_rules(&mut rng, &ground) };
        compare_under(rules, ground, chunk_size, &[&first, &second], &transactions);
    }
    for engine in [&first, &second] {
        let figures = engine.figures();
        assert!(figures.cuda > figures.cpu * 10, "{figures:?}");
    }
}

#[test]
fn a_fill_with_the_materials_of_its_grid_runs_on_the_device() {
    let Some(device) = device() else { return };
    let engine = engine(device, 64 << 20);
    let size = glam::UVec3::new(17, 13, 15);
    let ball = ShapeGrid::from_fn(size, |at| (at - IVec3::new(8, 6, 7)).as_vec3().length() - 5.3);
    let layers = |at: IVec3| MaterialId([4, 5, 255, 6][at.y as usize % 4]);
    let place =
        GridShape::new(ball.expect("valid").with_materials(layers), glam::Vec3::new(20.3, 33.0, 21.0));
    let turned = place.clone().with_rotation(glam::Quat::from_rotation_x(0.7)).with_scale(1.4);
    let brush = Brush::fill(turned, 3.0);
    let mut terrain =
        Terrain::new(Ground::flat(60, 60, 30.0).expect("valid"), &TerrainSettings::default()).expect("valid");
    terrain.set_engine(engine.clone());
    let receipt = terrain.apply_one(brush.clone());
    let added = receipt.outcome.expect("applied").added;
    assert!([4, 5, 6].iter().all(|&material| added.of(MaterialId(material)) > 50), "{added:?}");
    assert_eq!(engine.figures().cpu, 0);
    compare_on(Ground::flat(60, 60, 30.0).expect("valid"), 32, &[&engine], &[vec![brush]]);
}

#[test]
fn new_ground_far_from_all_other_finds_its_material() {
    let Some(first) = zero_copy() else { return };
    let Some(second) = device() else { return };
    let second = engine(second, 64 << 20);
    let high = |x: i32, z: i32| if (x / 7 + z / 9) % 2 == 0 { 30.0 } else { -40.0 };
    let rule = |overlay, from, to| MaterialRule {
        overlay: MaterialId(overlay),
        height: (from, to),
        ..Default::default()
    };
    let control =
        MaterialControl::Rules { base: MaterialId(1), rules: vec![rule(2, -50.0, 0.0), rule(3, 0.0, 60.0)] };
    let ground =
        Ground::from_fn(22, 20, high).and_then(|ground| ground.with_materials(&control)).expect("valid");
    let at = |x: f32, y: f32, z: f32| glam::Vec3::new(x, y, z);
    let all = |y: f32, half: f32| Shape::cuboid(at(11.0, y, 10.0), at(12.0, half, 11.0));
    let ball = |x: f32, y: f32, material| Brush::add(Shape::sphere(at(x, y, 9.0), 3.0), MaterialId(material));
    let transactions = [
        vec![ball(6.0, 20.0, 5), ball(13.0, 58.0, 6), ball(19.0, -20.0, 7)],
        vec![Brush::level(all(0.0, 46.0), 24.0)],
        vec![Brush::dig(all(-12.0, 9.0)), Brush::dig(all(12.0, 4.0))],
        vec![Brush::flatten(all(0.0, 70.0), at(11.0, 40.0, 10.0), at(0.2, 1.0, 0.1))],
        // Below a roof, and in the open where nothing is within reach.
        vec![
            Brush::dig(all(-20.0, 50.0)),
            Brush::lower(all(0.0, 90.0), 3.0),
            Brush::level(all(110.0, 9.0), 112.0),
        ],
        vec![Brush::raise(all(20.0, 110.0), 6.0)],
    ];
    compare_on(ground, 32, &[&first, &second], &transactions);
    // Between a floor and a roof: within reach of one, of the other, or of neither. In the last case between walls
    // one voxel apart.
    let slab = |y: f32, material| Brush::add(all(y, 2.0), MaterialId(material));
    let between = Brush::flatten(all(70.0, 20.0), at(11.0, 70.0, 10.0), at(0.5, 1.0, 0.2)).with_falloff(0.0);
    let wall = |x: f32, z: f32, half: [f32; 2], material| {
        let half = at(half[0], 3.0, half[1]);
        Brush::add(Shape::cuboid(at(x, 70.0, z), half), MaterialId(material))
    };
    let mut first_ones = vec![slab(0.0, 5), slab(140.0, 6)];
    first_ones.extend([wall(6.0, 10.0, [1.5, 7.0], 3), wall(10.0, 10.0, [1.5, 7.0], 4)]);
    first_ones.extend([wall(17.0, 5.0, [4.0, 1.5], 1), wall(17.0, 9.0, [4.0, 1.5], 2)]);
    let transactions = [first_ones, vec![between]];
    let flat = || Ground::flat(22, 20, -100.0).expect("valid");
    compare_on(flat(), 25, &[&first, &second], &transactions);
    // Prevented changes are counted by the material that the voxel would have had.
    let samples = LatticeBox { min: IVec3::new(-9, 20, -9), max: IVec3::new(99, 120, 99) };
    let rules = DiggingRules::default().with_protected(samples);
    compare_under(rules, flat(), 25, &[&first, &second], &transactions);
}

#[test]
fn edits_under_rules_equal_the_cpus() {
    let Some(engine) = zero_copy() else { return };
    let mut rng = Rng::with_seed(32);
    for index in 0..worlds::world_count(40).div_ceil(4) {
        let (ground, chunk_size) = worlds::random_ground(&mut rng, index);
        let rules = worlds::random_rules(&mut rng, &ground);
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let ground = Arc::new(ground);
        let [mut expected, mut found] =
            [0, 1].map(|_| Terrain::new(Arc::clone(&ground), &settings).expect("valid settings"));
        found.set_engine(engine.clone());
        for number in 0..4 {
            let rules = if number % 2 == 0 { rules.clone() } else { DiggingRules::default() };
            expected.set_rules(rules.clone()).expect("valid rules");
            found.set_rules(rules).expect("valid rules");
            let brush = |rng: &mut Rng| Brush { power: rng.u8(..), ..worlds::random_gpu_brush(rng, &ground) };
            let brushes: Vec<Brush> = (0..4).map(|_| brush(&mut rng)).collect();
            assert_eq!(expected.apply(&brushes), found.apply(&brushes), "world {index}");
            assert_same(expected.world(), found.world(), index);
        }
    }
    let figures = engine.figures();
    assert!(figures.cuda > figures.cpu * 10, "{figures:?}");
}
