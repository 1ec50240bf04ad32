//! Pastes, resets and shapes from the world itself among all other edits, on ground with strata, under rules, with pieces
//! that fall and with another ground in between: whatever comes before or after, receipts balance, fields fit, steps
//! restore, and logs and files give the same world.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_burrow::brush::Edit;
use bevy_burrow::format::WorldId;
use bevy_burrow::ground::{ElevationGrid, ElevationScale, ImportOptions, MaterialMap, Repair};
use bevy_burrow::lattice::{Column, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::store::WorldFile;
use bevy_burrow::terrain::{Meshing, World};
use bevy_burrow::volume::MaterialCounts;
use fastrand::Rng;
use glam::{IVec3, Quat, Vec3};

use crate::laws::{some_box, terrain};
use crate::worlds::{
    any_random_brush, check_fields, random_ground_of_size, random_rules, random_strata, world_count,
};

/// Heights from a file with voids, which are as deep as the lowest sample.
fn with_voids(rng: &mut Rng, width: u32, depth: u32) -> Ground {
    let mut text = format!(
        "ncols {}\nnrows {}\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n",
        width + 1,
        depth + 1
    );
    for _ in 0..=depth {
        let row = (0..=width).map(|_| match rng.u32(..40) {
            0 => "-9999".to_owned(),
            1 => "-30".to_owned(),
            _ => format!("{:.2}", 10.0 + rng.f32() * 3.0),
        });
        text += &(row.collect::<Vec<_>>().join(" ") + "\n");
    }
    let options = ImportOptions { voids: Repair::Clamp, ..ImportOptions::default() };
    let (grid, _) = ElevationGrid::decode(text.as_bytes(), &options).expect("a valid file");
    grid.into_ground(&ElevationScale::default()).expect("valid heights")
}

/// Ground with strata; some of it is imported, some has materials from a map.
fn ground(rng: &mut Rng, index: u64, width: u32, depth: u32) -> Arc<Ground> {
    let ground = match index % 3 {
        2 => with_voids(rng, width, depth),
        _ => random_ground_of_size(rng, index, width, depth),
    };
    let column = |rng: &mut Rng| {
        let (base, overlay) = (MaterialId(rng.u8(..6)), MaterialId(rng.u8(..6)));
        ColumnMaterial { base, overlay, blend: rng.u8(..) }
    };
    let map = MaterialMap::from_columns(4, 3, (0..12).map(|_| column(rng)).collect()).expect("12 columns");
    let ground = match rng.bool() {
        true => ground.with_materials(&MaterialControl::Map(Arc::new(map))).expect("valid materials"),
        false => ground,
    };
    let (low, high) = ground.height_range();
    let strata = random_strata(rng, [low as f32 / 256.0 - 20.0, high as f32 / 256.0 + 2.0]);
    Arc::new(ground.with_strata(&strata).expect("valid strata"))
}

/// A place near the surface.
fn place(rng: &mut Rng, ground: &Ground) -> Vec3 {
    let (x, z) = (rng.i32(0..=ground.width()), rng.i32(0..=ground.depth()));
    let y = ground.height(Column::new(x, z)).div_euclid(256) + rng.i32(-9..12);
    IVec3::new(x, y, z).as_vec3()
}

fn rotation(rng: &mut Rng) -> Quat {
    Quat::from_scaled_axis(Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 4.0)
}

/// A brush with a piece of the world: a prefab or a shape.
fn own_brush(rng: &mut Rng, world: &World) -> Brush {
    let from = some_box(rng, world);
    let from = LatticeBox { min: from.min, max: from.max.min(from.min + 16) };
    let at = place(rng, world.ground());
    if rng.bool() {
        let prefab = world.copy(from, (from.min + from.max) / 2).expect("it lies in the world");
        let paste = Paste { mirror: rng.bool(), edited_only: rng.bool(), ..Paste::new(prefab, at) };
        let paste = match rng.u8(..4) {
            0 => Paste { scale: 0.5 + rng.f32(), at: at + rng.f32(), ..paste.rotated(rotation(rng)) },
            1 => paste.turned_about_x(rng.i32(0..4)).turned_about_z(rng.i32(0..4)),
            _ => paste.turned_about_y(rng.i32(0..4)),
        };
        return Brush::paste(if rng.bool() { paste.onto_ground(world.ground()) } else { paste });
    }
    let grid =
        world.shape_grid(LatticeBox { min: from.min - 1, max: from.max + 1 }).expect("3 to 19 samples");
    let shape = GridShape::new(grid, at).with_rotation(rotation(rng)).with_scale(0.5 + rng.f32());
    match rng.u8(..7) {
        0 | 1 => Brush::fill(shape, rng.f32() * 4.0),
        2 => Brush::carve(shape, rng.f32() * 4.0),
        3 => Brush::dig(shape),
        4 => Brush::add(shape, MaterialId(rng.u8(..))),
        5 => Brush::paint(shape, MaterialId(rng.u8(..))),
        _ => Brush::reset(shape),
    }
}

/// A wall or a road over the ground, or the reset of its surroundings.
fn line(rng: &mut Rng, ground: &Ground) -> Brush {
    let points: Vec<(Vec3, f32)> =
        (0..rng.usize(2..5)).map(|_| (place(rng, ground), 1.0 + rng.f32() * 2.0)).collect();
    let path = BrushPath::spline(points);
    match rng.u8(..5) {
        0 => Brush::dig(path),
        1 => Brush::add(path, MaterialId(7)),
        2 => Brush::road(Corridor::new(path, 6.0, 4.0), 2.0),
        3 => Brush::reset(path),
        _ => Brush::reset(Corridor::new(path, 6.0, 4.0)),
    }
}

fn brush(rng: &mut Rng, world: &World) -> Brush {
    let brush = match rng.u8(..8) {
        0..4 => own_brush(rng, world),
        4 => line(rng, world.ground()),
        5 => Brush { operation: Operation::Reset, ..any_random_brush(rng, world.ground()) },
        _ => any_random_brush(rng, world.ground()),
    };
    brush.with_power(rng.u8(..) | rng.u8(..) | rng.u8(..))
}

type ByMaterial = BTreeMap<MaterialId, i64>;

fn add(to: &mut ByMaterial, counts: &MaterialCounts, sign: i64) {
    counts.iter().for_each(|(material, voxels)| *to.entry(material).or_default() += sign * voxels as i64);
}

/// Solid voxels in the bricks of two worlds: how many more the second has, and how many of them got another material, by
/// the material.
fn difference(before: &World, after: &World) -> (ByMaterial, ByMaterial) {
    let (mut more, mut painted) = (ByMaterial::new(), ByMaterial::new());
    let all: BTreeMap<[i32; 3], LatticeBox> = [before, after]
        .into_iter()
        .flat_map(|world| world.bricks())
        .map(|(pos, _)| (pos.0.to_array(), pos.samples()))
        .collect();
    let (old, new) = (before.samples(), after.samples());
    for point in all.into_values().flat_map(|samples| samples.points()) {
        match (old.is_solid(point), new.is_solid(point)) {
            (true, false) => *more.entry(old.material(point)).or_default() -= 1,
            (false, true) => *more.entry(new.material(point)).or_default() += 1,
            (true, true) if old.material(point) != new.material(point) => {
                *painted.entry(new.material(point)).or_default() += 1;
            }
            _ => {}
        }
    }
    more.retain(|_, voxels| *voxels != 0);
    (more, painted)
}

/// Checks that a receipt of an edit or a step counts the difference between two worlds.
fn check_receipt(before: &World, after: &World, applied: &Applied, what: &str) {
    let (more, painted) = difference(before, after);
    let fallen: Vec<&LoosePiece> = applied.loose.iter().filter(|piece| piece.is_gone()).collect();
    let (mut expected, mut repainted) = (ByMaterial::new(), ByMaterial::new());
    add(&mut expected, &applied.added, 1);
    add(&mut expected, &applied.removed, -1);
    fallen.iter().for_each(|piece| add(&mut expected, &piece.materials, -1));
    add(&mut repainted, &applied.painted, 1);
    expected.retain(|_, voxels| *voxels != 0);
    repainted.retain(|_, voxels| *voxels != 0);
    if fallen.is_empty() {
        assert_eq!((more, painted), (expected, repainted), "{what}");
    } else {
        // A piece may have been painted by the edit that cut it off.
        let total = |counts: &ByMaterial| counts.values().sum::<i64>();
        assert_eq!(total(&more), total(&expected), "{what}");
    }
    assert_eq!(applied.bounds.is_none(), before.hash() == after.hash(), "{what}");
}

/// A receipt without what depends on the size of chunks.
fn without_chunks(receipts: Vec<Receipt>) -> Vec<Receipt> {
    let plain = |receipt: Receipt| Receipt {
        outcome: receipt.outcome.map(|applied| Applied { chunks: Vec::new(), ..applied }),
        ..receipt
    };
    receipts.into_iter().map(plain).collect()
}

/// One world twice: one copy gets edits together, on three threads; the other one by one, on one thread, with chunks of
/// another size, and without meshes.
struct Twins {
    together: Terrain,
    apart: Terrain,
    pools: [rayon::ThreadPool; 2],
}

impl Twins {
    fn new(ground: &Arc<Ground>, index: u64) -> Self {
        let sizes = [8, 25, 16, 40];
        let mut together = terrain(ground, sizes[index as usize % 4]);
        let mut apart = terrain(ground, sizes[(index as usize + 1) % 4]);
        apart.set_meshing(Meshing::Never);
        for own in [&mut together, &mut apart] {
            own.keep_log(Some(usize::MAX));
        }
        let pools = [3, 1]
            .map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads"));
        Self { together, apart, pools }
    }

    fn edit(&mut self, brushes: &[Brush], what: &str) {
        let Self { together, apart, pools } = self;
        let edits: Vec<Edit> = brushes
            .iter()
            .map(|brush| Edit::quantize(brush).unwrap_or_else(|why| panic!("{why}: {brush:?}")))
            .collect();
        let draft = together.draft(&edits);
        let receipts = pools[0].install(|| together.apply(brushes));
        assert_eq!((draft.hash, &draft.receipts), (together.world().hash(), &receipts), "{what}");
        let mut others = Vec::new();
        for brush in brushes {
            let before = apart.snapshot();
            let receipt = pools[1].install(|| apart.apply([brush])).remove(0);
            let what = format!("{what}, brush {}: {:?} {:?}", brush.tag, brush.operation, brush.custom);
            match &receipt.outcome {
                Ok(applied) => check_receipt(&before, apart.world(), applied, &what),
                Err(why) => assert_eq!(*why, Rejection::OutsideWorld, "{what}"),
            }
            others.push(receipt);
        }
        let (receipts, others) = (without_chunks(receipts), without_chunks(others));
        for (own, other) in receipts.iter().zip(&others) {
            assert_eq!(own, other, "{what}: receipts depend on batches, threads or chunks");
        }
        assert_eq!(receipts.len(), others.len());
    }

    /// Gives both an order; returns whether it was carried out.
    fn order(&mut self, order: &Order, what: &str) -> bool {
        let Self { together, apart, pools } = self;
        let before = together.snapshot();
        let receipt = pools[0].install(|| together.apply_one(order));
        let other = pools[1].install(|| apart.apply_one(order));
        if matches!(order, Order::Undo | Order::Redo)
            && let Ok(applied) = &receipt.outcome
        {
            check_receipt(&before, together.world(), applied, what);
        }
        let is_done = receipt.outcome.is_ok();
        assert_eq!(without_chunks(vec![receipt]), without_chunks(vec![other]), "{what}");
        is_done
    }

    fn check(&self, what: &str) {
        let worlds = [self.together.world(), self.apart.world()];
        assert_eq!(worlds[0].hash(), worlds[1].hash(), "{what}");
        assert_eq!(self.together.history().undos, self.apart.history().undos, "{what}");
        worlds.into_iter().for_each(|world| check_fields(world, what));
        let report = worlds[0].check_seams();
        assert!(report.is_flawless(), "{what}: {report}");
    }

    /// Reads the world from its parts and from its file.
    fn reload(&self, what: &str) {
        let (world, ground) = (self.together.world(), self.together.world().shared_ground());
        let settings = TerrainSettings { chunk_size: 13, ..TerrainSettings::default() };
        let restored = Terrain::restore(Arc::clone(&ground), &settings, self.together.parts());
        let restored = restored.unwrap_or_else(|why| panic!("{what}: {why}"));
        let bytes = WorldFile::to_bytes(&self.together, WorldId(1), &BTreeMap::new()).expect("it is small");
        let read = WorldFile::from_bytes(&bytes, ground).expect("its own bytes").terrain;
        for own in [&restored, &read] {
            assert_eq!(own.world().hash(), world.hash(), "{what}");
            check_fields(own.world(), what);
        }
        let fields = |terrain: &Terrain| terrain.parts().change.fields;
        assert_eq!(fields(&read), fields(&self.together), "{what}");
    }
}

#[test]
fn all_kinds_of_edits_on_strata_balance_and_come_back() {
    let (mut fallen, mut refused, mut steps, mut changed) = (0, 0, 0, 0);
    for index in 0..world_count(12) {
        let rng = &mut Rng::with_seed(index + 4000);
        let (width, depth) = (rng.u32(12..44), rng.u32(12..44));
        let grounds = [(); 2].map(|()| ground(rng, index, width, depth));
        let mut twins = Twins::new(&grounds[0], index);
        if index % 2 == 1 {
            twins.order(&Order::Rules(Some(Arc::new(random_rules(rng, &grounds[0])))), "rules");
        }
        let mut hashes = vec![twins.together.world().hash()];
        let mut is_cleared = false;
        for turn in 0..16_u64 {
            let what = format!("world {index}, turn {turn}");
            match rng.u8(..16) {
                0 | 1 => steps += usize::from(twins.order(&Order::Undo, &what)),
                2 => steps += usize::from(twins.order(&Order::Redo, &what)),
                3 => {
                    let rules = random_rules(rng, &grounds[0]);
                    twins.order(&Order::Rules((rng.u8(..4) > 0).then(|| Arc::new(rules))), &what);
                }
                4 | 5 => {
                    let loose = LooseSettings { largest: 3000, crumbs: 6, debris: rng.u32(6..3000) };
                    twins.order(&Order::Loose((rng.u8(..4) > 0).then_some(loose)), &what);
                }
                6 => {
                    let ground = Arc::clone(&grounds[rng.usize(..2)]);
                    assert!(twins.order(&Order::Ground(ground), &what));
                    (hashes, is_cleared) = (vec![twins.together.world().hash()], true);
                }
                _ => {
                    let stroke = index * 100 + turn;
                    let world = twins.together.snapshot();
                    let brushes: Vec<Brush> = (0..rng.u64(1..4))
                        .map(|tag| brush(rng, &world).with_tag(tag).with_stroke(stroke))
                        .collect();
                    let before = twins.together.world().hash();
                    twins.edit(&brushes, &what);
                    changed += usize::from(twins.together.world().hash() != before);
                }
            }
            twins.check(&what);
            if turn % 5 == 4 {
                twins.reload(&what);
            }
        }
        // The logs of both lead to the same world.
        for own in [&mut twins.together, &mut twins.apart] {
            let mut replayed = terrain(&grounds[0], own.world().grid().size() as u32);
            for record in own.take_log() {
                for receipt in replayed.replay(&record).expect("it follows") {
                    let Ok(applied) = receipt.outcome else { continue };
                    fallen += applied.loose.iter().filter(|piece| piece.is_gone()).count();
                    refused += usize::from(!applied.refused.is_empty());
                }
            }
            assert_eq!(replayed.world().hash(), own.world().hash(), "world {index}");
            assert_eq!(replayed.parts().change.fields, own.parts().change.fields, "world {index}");
        }
        // All the way back, and forth again.
        let (end, mut way) = (twins.together.world().hash(), 0);
        while twins.order(&Order::Undo, &format!("world {index}, step {way} back")) {
            way += 1;
            twins.check(&format!("world {index}, step {way} back"));
        }
        assert_eq!(twins.together.world().hash(), hashes[0], "world {index}: undone");
        if !is_cleared {
            assert_eq!(twins.together.world().bricks().count(), 0, "world {index}");
        }
        (0..way).for_each(|_| assert!(twins.order(&Order::Redo, "forth")));
        assert_eq!(twins.together.world().hash(), end, "world {index}: redone");
        twins.check(&format!("world {index}, redone"));
    }
    println!("{fallen} pieces, {refused} refused, {steps} steps, {changed} changes");
    assert!(fallen > 4 && refused > 8 && steps > 6 && changed > 40, "{fallen} {refused} {steps} {changed}");
}
