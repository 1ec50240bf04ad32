//! Transactions large enough for threads to share the cheap work per brick (slabs of bricks along x, batches of edits)
//! give the same result as small ones, which share nothing.

use std::sync::Arc;

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use glam::Vec3;

use crate::bits::mesh_bits;

/// A ground, and the brushes of each transaction.
struct Script {
    ground: Arc<Ground>,
    chunk_size: u32,
    transactions: Vec<Vec<Brush>>,
}

impl Script {
    fn terrain(&self) -> Terrain {
        let settings = TerrainSettings { chunk_size: self.chunk_size, ..Default::default() };
        Terrain::new(Arc::clone(&self.ground), &settings).expect("valid settings")
    }

    /// Plays the script several times: in parts of `part` brushes, and with each transaction at once on all, 1, 2 and 5
    /// threads. The first transaction has to edit at least `bricks` bricks.
    fn check(&self, part: usize, bricks: usize, what: &str) {
        let pool = |count| rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads");
        let mut pooled = [1, 2, 5].map(|count| (pool(count), self.terrain()));
        let (mut once, mut parted) = (self.terrain(), self.terrain());
        for (number, brushes) in self.transactions.iter().enumerate() {
            let what = format!("{what}, transaction {number}");
            let receipts = once.apply(brushes);
            let parts = brushes.chunks(part).flat_map(|brushes| parted.apply(brushes));
            assert_eq!(counted(&receipts), counted(&parts.collect::<Vec<_>>()), "{what}");
            let edited = once.world().bricks().count();
            assert!(edited >= bricks, "{what}: only {edited} bricks were edited");
            assert_same(once.world(), parted.world(), &what);
            let report = once.world().check_seams();
            assert!(report.is_flawless(), "{what}: {report}");
            for (pool, terrain) in &mut pooled {
                let what = format!("{what}, {} threads", pool.current_num_threads());
                assert!(pool.install(|| terrain.apply(brushes)) == receipts, "{what}: receipts");
                assert_same(once.world(), terrain.world(), &what);
            }
        }
    }
}

/// What each brush changed, without the scenarios.
fn counted(receipts: &[Receipt]) -> Vec<Applied> {
    let counts = |receipt: &Receipt| {
        let applied = receipt.outcome.clone().expect("every brush reaches the world");
        // Scenarios depend on how the brushes are split into transactions.
        Applied { chunks: Vec::new(), ..applied }
    };
    receipts.iter().map(counts).collect()
}

fn assert_same(once: &World, parted: &World, what: &str) {
    assert_eq!(once.hash(), parted.hash(), "{what}: hash");
    assert_eq!(once.mask().len(), parted.mask().len(), "{what}: mask");
    let mut others = parted.drawn();
    for (drawn, mesh) in once.drawn() {
        let (other, theirs) = others.next().expect("as many meshes");
        assert_eq!(drawn, other, "{what}");
        assert!(mesh_bits(&mesh) == mesh_bits(&theirs), "{what}: mesh of {drawn:?}");
    }
    assert!(others.next().is_none(), "{what}: as many meshes");
}

fn at(x: i32, y: f32, z: i32) -> Vec3 {
    Vec3::new(x as f32, y, z as f32)
}

#[test]
fn more_bricks_than_one_slab_give_the_same_meshes() {
    // A row of balls from the first slab of bricks to the last; their ends lie at all offsets within a brick.
    for (shift, chunk_size) in [(0, 32), (3, 25)] {
        let height = |x: i32, z: i32| 20.0 + f64::from(x * 7 % 11 + z * 5 % 13) * 0.4;
        let ground = Ground::from_fn(226, 190, height).expect("finite heights");
        let centers: Vec<(i32, i32)> =
            (0..13).flat_map(|i| (0..11).map(move |k| (10 + shift + 17 * i, 11 + 17 * k))).collect();
        let balls = |y: f32, brush: &dyn Fn(Shape, usize) -> Brush| -> Vec<Brush> {
            let ball = |(i, &(x, z)): (usize, &(i32, i32))| {
                brush(Shape::sphere(at(x, y, z), 2.0 + (i % 4) as f32), i)
            };
            centers.iter().enumerate().map(ball).collect()
        };
        let script = Script {
            ground: ground.into(),
            chunk_size,
            transactions: vec![
                balls(22.0, &|shape, _| Brush::dig(shape)),
                balls(24.0, &|shape, i| Brush::add(shape, MaterialId(i as u8 % 7))),
                balls(21.0, &|shape, i| Brush::paint(shape, MaterialId(i as u8 % 5))),
                balls(19.0, &|shape, i| {
                    if i % 3 == 0 { Brush::smooth(shape, 1.0) } else { Brush::dig(shape) }
                }),
            ],
        };
        script.check(6, 600, &format!("moved by {shift}"));
    }
}

#[test]
fn more_bricks_than_fit_into_one_batch_give_the_same_world() {
    // Columns of air that together form one hall of ten thousand bricks; some of them break through the surface.
    let height = |x: i32, z: i32| 39.0 + f64::from(x * z % 5) * 0.3;
    let ground = Ground::from_fn(268, 268, height).expect("finite heights");
    let half = Vec3::new(18.0, 36.0, 18.0);
    let pillar = |i: i32| {
        let center = at(22 + i % 7 * 37, (i % 3 * 4) as f32 - 3.0, 22 + i / 7 * 37);
        Brush::dig(Shape::cuboid(center, half))
    };
    let ball = |i: i32| Brush::add(Shape::sphere(at(20 + 40 * i, 0.0, 130), 6.0), MaterialId(3));
    let mut brushes: Vec<Brush> = (0..49).map(pillar).collect();
    brushes.extend((0..6).map(ball));
    let script = Script { ground: ground.into(), chunk_size: 32, transactions: vec![brushes] };
    script.check(1, 8192 + 1, "a hall");
}

#[test]
fn edits_near_too_many_bricks_for_one_list_equal_single_edits() {
    // Diagonal shafts in boxes of some 300,000 bricks, all through one place in the middle.
    let ground = Ground::flat(400, 400, 0.0).expect("valid");
    let shaft = |i: i32| {
        let (from, to) = (at(0, -990.0, 10 * i), at(400, 10.0, 400 - 10 * i));
        let shape = Shape::capsule(from, to, 1.5 + i as f32 * 0.1);
        if i % 3 == 1 { Brush::add(shape, MaterialId(i as u8)) } else { Brush::dig(shape) }
    };
    let shafts: Vec<Brush> = (0..8).map(shaft).collect();
    let around = |brush: &Brush| {
        let reach = Edit::quantize(brush).expect("valid").reach();
        LatticeBox { min: reach.min >> 3, max: reach.max >> 3 }.volume()
    };
    assert!(shafts.iter().map(around).sum::<u64>() > 2 << 20, "too few bricks for two lists");
    let script = Script { ground: ground.into(), chunk_size: 32, transactions: vec![] };
    let [mut once, mut single] = [0, 1].map(|_| script.terrain());
    let pristine = once.world().hash();
    let receipts = once.apply(&shafts);
    let singles: Vec<Receipt> = shafts.iter().flat_map(|shaft| single.apply([shaft])).collect();
    assert_eq!(receipts, singles);
    assert!(receipts.iter().any(|own| own.outcome.as_ref().is_ok_and(|own| own.added.total() > 0)));
    assert_same(once.world(), single.world(), "shafts");
    // All of them are one step of history.
    assert!(once.undo().outcome.is_ok());
    assert_eq!(once.world().hash(), pristine);
    assert!(once.redo().outcome.is_ok());
    assert_eq!(once.world().hash(), single.world().hash());
}
