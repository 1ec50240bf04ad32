//! A ground with a source is the ground in memory that has the same heights.

use fastrand::Rng;
use glam::{IVec3, Vec3};

use super::*;
use crate::ground::world::RowBuffer;
use crate::ground::{
    Detail, GreyImage, Ground, GroundError, ImageScale, MAX_SOURCE_SIZE, MaterialControl, MaterialId,
    MaterialRule, NoiseHeights, NoiseKind, Strata,
};
use crate::worlds::random_strata;

/// Bytes that pages take beyond the budget.
const BUDGETS: [usize; 3] = [0, 200_000, 64 << 20];

/// Bumps between -30 and 30 voxels, from gentle to steep.
fn bumps(x: i32, z: i32) -> f64 {
    let [x, z] = [x, z].map(i64::from);
    let part = |at: i64, width: i64| (at * at * 37 + at * 11).rem_euclid(width) as f64 / width as f64;
    10.0 * (part(x >> 3, 17) + part(z >> 2, 13)) + 4.0 * part(x * 3 + z, 7) - (x * z % 11) as f64
}

fn source() -> FunctionSource<fn(i32, i32) -> f64> {
    FunctionSource::new(7, -40.0, 40.0, bumps)
}

/// Heights of a source, and materials by columns.
struct Striped;

fn stripe(Column { x, z }: Column) -> ColumnMaterial {
    let id = |number: i32| MaterialId(number.rem_euclid(5) as u8);
    ColumnMaterial { base: id(x / 3), overlay: id(x + z), blend: (x * 7 + z).rem_euclid(256) as u8 }
}

impl HeightSource for Striped {
    fn id(&self) -> u64 {
        99
    }
    fn bounds(&self) -> (i32, i32) {
        source().bounds()
    }
    fn fill_heights(&self, grid: ColumnGrid, heights: &mut [i32]) {
        source().fill_heights(grid, heights);
    }
    fn has_materials(&self) -> bool {
        true
    }
    fn fill_materials(&self, grid: ColumnGrid, materials: &mut [ColumnMaterial]) {
        materials.iter_mut().zip(grid.columns()).for_each(|(material, column)| *material = stripe(column));
    }
}

/// An equal ground with its heights in memory.
fn resident(ground: &Ground) -> Ground {
    let (width, depth) = (ground.width(), ground.depth());
    let columns = (0..=depth).flat_map(|z| (0..=width).map(move |x| Column::new(x, z)));
    let heights = columns.map(|column| ground.height(column)).collect();
    Ground::from_heights(width as u32, depth as u32, heights).expect("heights within the limit")
}

fn bits(normal: Vec3) -> [u32; 3] {
    normal.to_array().map(f32::to_bits)
}

/// Asks both grounds everything, at random places.
fn assert_alike(own: &Ground, other: &Ground, rng: &mut Rng, rounds: usize) {
    let (width, depth) = (own.width(), own.depth());
    assert_eq!((width, depth), (other.width(), other.depth()));
    assert_eq!(own.single_material(), other.single_material());
    let near = |rng: &mut Rng, last: i32| match rng.u8(..4) {
        0 => rng.i32(-70..4),
        1 => last + rng.i32(-4..140),
        _ => rng.i32(0..=last),
    };
    for _ in 0..rounds {
        let column = Column::new(near(rng, width), near(rng, depth));
        assert_eq!(own.height(column), other.height(column), "{column:?}");
        assert_eq!(bits(own.normal(column)), bits(other.normal(column)), "{column:?}");
        assert_eq!(own.slope(column).to_bits(), other.slope(column).to_bits(), "{column:?}");
        assert_eq!(own.column_material(column), other.column_material(column), "{column:?}");
        assert_eq!(own.surface_material(column), other.surface_material(column), "{column:?}");
        let point = column.at(own.height(column) / 256 + rng.i32(-20..4));
        assert_eq!(own.distance(point), other.distance(point), "{point}");
        assert_eq!(own.material(point), other.material(point), "{point}");
        let brick = Column::new(column.x & !7, column.z & !7);
        assert_eq!(own.heights::<8>(brick), other.heights::<8>(brick), "{brick:?}");
        assert_eq!(own.heights::<11>(brick.offset(-1, -1)), other.heights::<11>(brick.offset(-1, -1)));
        assert_eq!(own.heights::<10>(column), other.heights::<10>(column), "{column:?}");
        let place = (column.x >> 3, column.z >> 3);
        let word = |ground: &Ground| ground.steep_cells().map_or(0, |steep| steep.word(place));
        assert_eq!(word(own), word(other), "{place:?}");
        let count = rng.usize(0..150);
        let (mut buffer, mut other_buffer) = (RowBuffer::default(), RowBuffer::default());
        let rows = (own.row(column, count, &mut buffer), other.row(column, count, &mut other_buffer));
        assert!(rows.0.eq(rows.1), "{count} from {column:?}");
        let (stride, count) = (1 << rng.u32(0..8), [rng.usize(0..9), rng.usize(0..9)]);
        let (page, expected) = (own.page(column, stride, count), other.page(column, stride, count));
        assert_eq!(page.heights, expected.heights, "{count:?} each {stride} from {column:?}");
        assert!(page.normals.iter().map(|&n| bits(n)).eq(expected.normals.iter().map(|&n| bits(n))));
        assert_eq!(page.materials, expected.materials, "{count:?} each {stride} from {column:?}");
        assert_eq!(own.page_heights(column, stride, count), expected.heights);
    }
}

#[test]
fn pages_are_the_columns() {
    let ground = resident(&Ground::from_source(90, 70, Striped).unwrap());
    for (low, stride, count) in [(Column::new(-9, 3), 16, [9, 7]), (Column::new(5, -1), 1, [33, 33])] {
        let page = ground.page(low, stride, count);
        let columns = (0..count[1] as i32).flat_map(|z| (0..count[0] as i32).map(move |x| (x, z)));
        for (at, (x, z)) in columns.enumerate() {
            let column = low.offset(x * stride, z * stride);
            assert_eq!(page.heights[at], ground.height(column));
            assert_eq!(bits(page.normals[at]), bits(ground.normal(column)));
            assert_eq!(page.materials[at], ground.surface_material(column));
        }
    }
}

#[test]
fn a_source_is_the_ground_with_its_heights() {
    let rng = &mut Rng::with_seed(1);
    for (width, depth) in [(1, 1), (3, 200), (64, 63), (65, 64), (150, 131)] {
        let made = || Ground::from_source(width, depth, source()).unwrap();
        let expected = Ground::from_fn(width, depth, bumps).unwrap();
        for budget in BUDGETS {
            assert_alike(&made().with_page_budget(budget), &expected, rng, 60);
        }
    }
}

#[test]
fn materials_of_columns_are_the_same() {
    let rng = &mut Rng::with_seed(2);
    let (rock, grass) = (MaterialId(1), MaterialId(2));
    let mask = GreyImage::from_samples(5, 4, (0..20).map(|i| i * 3001).collect()).unwrap();
    let rule = MaterialRule { overlay: grass, slope: (0.0, 0.5), slope_fade: 0.7, ..Default::default() };
    let high = MaterialRule { overlay: MaterialId(3), height: (9.0, 99.0), height_fade: 5.0, ..rule };
    for control in [
        MaterialControl::Uniform(ColumnMaterial { base: rock, overlay: grass, blend: 140 }),
        MaterialControl::Rules { base: rock, rules: vec![high, rule] },
        MaterialControl::Blend { mask: mask.clone(), base: rock, overlay: grass },
        MaterialControl::Ids { map: mask, base: rock },
    ] {
        let made = Ground::from_source(150, 131, source()).unwrap().with_materials(&control).unwrap();
        let expected = Ground::from_fn(150, 131, bumps).unwrap().with_materials(&control).unwrap();
        let strata = random_strata(rng, [-30.0, 30.0]);
        assert_alike(&made, &expected, rng, 100);
        let with = |ground: Ground| ground.with_strata(&strata).unwrap();
        assert_alike(&with(made), &with(expected), rng, 100);
    }
}

#[test]
fn a_source_gives_materials_until_others_are_given() {
    let striped = Ground::from_source(100, 90, Striped).unwrap();
    for (x, z) in (-9..130).flat_map(|z| (-9..130).map(move |x| (x, z))) {
        let column = Column::new(x, z);
        assert_eq!(striped.surface_material(column), stripe(Column::new(x.clamp(0, 100), z.clamp(0, 90))));
    }
    let page = striped.page(Column::new(-20, 0), 16, [9, 9]);
    assert_eq!(page.materials[4], stripe(Column::new(44, 0)));
    let rock = ColumnMaterial::solid(MaterialId(3));
    let rocky = striped.with_materials(&MaterialControl::Uniform(rock)).unwrap();
    assert_eq!(rocky.column_material(Column::new(5, 5)), rock);
    assert_eq!(rocky.single_material(), Some(MaterialId(3)));
}

#[test]
fn strata_are_the_same() {
    for seed in 0..24 {
        let rng = &mut Rng::with_seed(seed);
        let strata = match seed % 4 {
            0 => Strata::alpine(),
            _ => random_strata(rng, [-40.0, 30.0]),
        };
        let size = (rng.u32(1..160), rng.u32(1..160));
        let expected = Ground::from_fn(size.0, size.1, bumps).unwrap().with_strata(&strata).unwrap();
        let made = Ground::from_source(size.0, size.1, source()).unwrap().with_strata(&strata).unwrap();
        let made = if seed % 3 == 0 { made.with_page_budget(0) } else { made };
        assert_alike(&made, &expected, rng, 40);
    }
    let material = |point: IVec3, depth| (point.x & 3 == 0).then_some(MaterialId((depth / 256) as u8 & 7));
    let expected = Ground::from_fn(99, 70, bumps).unwrap().with_material_fn(3, material).unwrap();
    let made = Ground::from_source(99, 70, source()).unwrap().with_material_fn(3, material).unwrap();
    assert_alike(&made, &expected, &mut Rng::with_seed(5), 100);
}

#[test]
fn noise_and_images_give_the_heights_of_grounds_in_memory() {
    let rng = &mut Rng::with_seed(3);
    for kind in [NoiseKind::Fractal, NoiseKind::Ridged] {
        let noise = NoiseHeights { kind, seed: 5, scale: 60.0, amplitude: -25.0, ..NoiseHeights::default() };
        let made = Ground::from_source(140, 90, NoiseSource::new(&noise).unwrap()).unwrap();
        assert_alike(&made, &Ground::from_noise(140, 90, &noise).unwrap(), rng, 100);
    }
    for (step, detail) in [(1, None), (3, None), (10, Some(Detail::default())), (64, Some(Detail::default()))]
    {
        let (width, depth) = (rng.u32(2..9), rng.u32(2..9));
        let samples = (0..width * depth).map(|_| rng.u16(..)).collect();
        let image = GreyImage::from_samples(width, depth, samples).unwrap();
        let scale = ImageScale { voxels_per_sample: step, low: 9.0, high: -60.0, detail };
        let expected = Ground::from_image(&image, &scale).unwrap();
        let source = ImageSource::new(image, &scale).unwrap();
        assert_eq!(source.size(), [expected.width(), expected.depth()]);
        let (low, high) = (source.bounds(), expected.height_range());
        assert!(low.0 <= high.0 && low.1 >= high.1, "{low:?} does not hold {high:?}");
        let made = Ground::from_source(expected.width() as u32, expected.depth() as u32, source).unwrap();
        assert_alike(&made, &expected, rng, 100);
    }
}

#[test]
fn an_inset_is_one_source_inside_and_the_other_outside() {
    let (low, size, margin) = (Column::new(50, -20), [100, 90], 16);
    let inner = FunctionSource::new(1, 0.0, 99.0, |x, z| {
        assert!((0..=100).contains(&x) && (0..=90).contains(&z), "asked for ({x}, {z})");
        50.0 + f64::from(x)
    });
    let inset = InsetSource::new(inner, source(), low, size, margin);
    let ground = Ground::from_source(220, 130, inset).unwrap();
    let height = |x, z| ground.height(Column::new(x, z));
    let outside = |x, z| (bumps(x, z) * 256.0).round() as i32;
    for (x, z) in (0..=130).flat_map(|z| (0..=220).map(move |x| (x, z))) {
        let inside = [x - 50, 150 - x, z + 20, 70 - z].into_iter().min().unwrap();
        let inner = (50 + x - 50) * 256;
        match inside {
            ..=0 => assert_eq!(height(x, z), outside(x, z), "({x}, {z})"),
            16.. => assert_eq!(height(x, z), inner.min(99 * 256), "({x}, {z})"),
            _ => {
                let ends = [inner.min(99 * 256), outside(x, z)];
                assert!(
                    ends.iter().min().unwrap() <= &height(x, z)
                        && &height(x, z) <= ends.iter().max().unwrap()
                );
            }
        }
    }
    assert_alike(&ground, &resident(&ground), &mut Rng::with_seed(4), 200);
}

#[test]
fn threads_share_a_cache_that_keeps_to_its_budget() {
    let expected = Ground::from_fn(700, 500, bumps).unwrap().with_strata(&Strata::mine()).unwrap();
    for budget in [0, 30_000, 300_000, 3_000_000] {
        let ground = Ground::from_source(700, 500, source()).unwrap();
        let ground = ground.with_page_budget(budget).with_strata(&Strata::mine()).unwrap();
        let least = ground.bytes();
        std::thread::scope(|scope| {
            for seed in 0..4 {
                let (ground, expected) = (&ground, &expected);
                scope.spawn(move || assert_alike(ground, expected, &mut Rng::with_seed(seed), 40));
            }
        });
        assert!(ground.bytes() - least <= budget, "{} bytes of {budget}", ground.bytes() - least);
        assert_eq!(ground.bytes() > least, budget >= 30_000);
    }
}

#[test]
fn heights_stay_within_what_was_promised() {
    let wild = |x: i32, z: i32| match (x + z) % 5 {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => -1e300,
        _ => 7.0,
    };
    let ground = Ground::from_source(80, 80, FunctionSource::new(1, -3.0, 1e9, wild)).unwrap();
    assert_eq!(ground.height_range(), (-3 * 256, LIMIT * ONE));
    let heights = [0, 1, 2, 3].map(|x| ground.height(Column::new(x, 0)));
    assert_eq!(heights, [0, LIMIT * ONE, -3 * 256, 7 * 256]);
    assert_eq!(ground.page_heights(Column::new(0, 0), 20, [3, 1]), [0, 0, 0]);
    assert_eq!(ground.page_heights(Column::new(1, 0), 20, [3, 1]), [LIMIT * ONE; 3]);
}

#[test]
fn the_hash_is_of_the_source_and_what_it_is_made_of() {
    let made =
        |width, id| Ground::from_source(width, 90, FunctionSource::new(id, -40.0, 40.0, bumps)).unwrap();
    let rock = MaterialControl::Uniform(ColumnMaterial::solid(MaterialId(4)));
    let rules = MaterialControl::Rules { base: MaterialId(4), rules: vec![MaterialRule::default()] };
    let all = || {
        [
            made(90, 1),
            made(90, 2),
            made(91, 1),
            made(90, 1).with_materials(&rock).unwrap(),
            made(90, 1).with_materials(&rules).unwrap(),
            made(90, 1).with_strata(&Strata::mine()).unwrap(),
            Ground::from_fn(90, 90, bumps).unwrap(),
        ]
    };
    for (i, own) in all().iter().enumerate() {
        for (k, other) in all().iter().enumerate() {
            assert_eq!(own.hash() == other.hash(), i == k, "{i} {k}");
            assert_eq!(own == other, i == k, "{i} {k}");
        }
    }
    assert_eq!(made(90, 1).with_page_budget(9), made(90, 1));
}

#[test]
fn the_hashes_of_sources_are_the_same_on_every_machine() {
    // If this fails, worlds saved with the old hashes are no longer recognised: say so in the changelog.
    let noise = NoiseSource::new(&NoiseHeights::default()).unwrap();
    let samples = (0..6).map(|i| i * 999).collect();
    let image = ImageSource::new(GreyImage::from_samples(3, 2, samples).unwrap(), &ImageScale::default());
    let ids = [noise.id(), image.unwrap().id()];
    let ground = Ground::from_source(200_000, 100_000, noise).unwrap();
    assert_eq!(ids, [0xF07F_2668_638D_7F27, 0x17C0_2704_F30F_82DB]);
    assert_eq!(ground.hash(), 0x2692_26FB_C4C5_DCC7);
}

#[test]
fn sizes_are_checked() {
    for size in [0, MAX_SOURCE_SIZE + 1, u32::MAX] {
        let refused = GroundError::SourceSize { width: size, depth: 5 };
        assert_eq!(Ground::from_source(size, 5, source()), Err(refused));
    }
    let whole = Ground::from_source(MAX_SOURCE_SIZE, MAX_SOURCE_SIZE, source()).unwrap();
    let last = MAX_SOURCE_SIZE as i32;
    for (x, z) in [(last, last), (0, last), (last - 65, 3), (i32::MAX, i32::MAX), (i32::MIN, i32::MAX)] {
        let (column, inside) = (Column::new(x, z), (x.clamp(0, last), z.clamp(0, last)));
        assert_eq!(whole.height(column), (bumps(inside.0, inside.1) * 256.0).round() as i32);
        assert_eq!(whole.heights::<8>(column)[0][0], whole.height(column));
        assert_eq!(bits(whole.normal(column)), bits(whole.normal(Column::new(inside.0, inside.1))));
        let page = whole.page(column, 1024, [3, 3]);
        assert_eq!(page.heights[0], whole.height(column));
    }
    assert!(whole.bytes() < 3 << 20);
}
