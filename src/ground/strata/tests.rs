//! Strata by their definition, asked one voxel at a time, and as bricks have them.

use fastrand::Rng;
use glam::IVec3;

use super::conditions::LoneVoxel;
use super::*;
use crate::ground::{ColumnMaterial, GreyImage, Ground, MaterialControl, NoiseHeights};
use crate::lattice::{Column, ONE};
use crate::worlds;

fn random_strata(rng: &mut Rng) -> Strata {
    worlds::random_strata(rng, [-30.0, 30.0])
}

fn random_ground(rng: &mut Rng) -> Ground {
    let hills = NoiseHeights { seed: rng.u32(..), scale: 17.0, amplitude: 15.0, ..NoiseHeights::default() };
    let (width, depth) = (rng.u32(5..50), rng.u32(5..50));
    let skin = ColumnMaterial { base: MaterialId(1), overlay: MaterialId(2), blend: 200 };
    let ground = Ground::from_noise(width, depth, &hills).unwrap();
    ground.with_materials(&MaterialControl::Uniform(skin)).unwrap()
}

#[test]
fn bricks_hold_what_the_definition_says() {
    let mut found = [0; 2];
    for seed in 0..60 {
        let rng = &mut Rng::with_seed(seed);
        let bare = random_ground(rng);
        let hash = bare.hash();
        let strata = random_strata(rng);
        let ground = bare.with_strata(&strata).unwrap();
        assert_ne!(ground.hash(), hash);
        let records = ground.strata_records().unwrap();
        let low = IVec3::new(rng.i32(-12..40), rng.i32(-30..24), rng.i32(-12..40));
        for point in (LatticeBox { min: low, max: low + 12 }).points() {
            let column = ground.nearest_column(point);
            let voxel = LoneVoxel {
                column,
                y: point.y,
                depth: (ground.height(column) - point.y * ONE - 1).max(0),
                squared_slope: ground.squared_slope(column),
            };
            let holding = records.strata.iter().position(|record| records.holds(record, &ground, voxel));
            let expected = match holding {
                Some(number) => strata.strata[number].material,
                None => ground.column_material(Column::of(point)).at_distance(ground.distance(point)),
            };
            assert_eq!(ground.material(point), expected, "world {seed} at {point}: {strata:?}");
            assert_eq!(ground.material(point), expected, "again");
            found[usize::from(holding.is_some())] += 1;
        }
    }
    assert!(found[0] > 9000 && found[1] > 9000, "{found:?}");
}

#[test]
fn the_surface_shows_the_highest_solid_voxel() {
    for seed in 0..20 {
        let rng = &mut Rng::with_seed(seed);
        let ground = random_ground(rng).with_strata(&random_strata(rng)).unwrap();
        for (x, z) in (-3..55).flat_map(|z| (-3..55).map(move |x| (x, z))) {
            let column = Column::new(x, z);
            let top =
                (-40..40).rev().map(|y| column.at(y)).find(|&point| ground.distance(point) < 0).unwrap();
            let shown = ground.surface_material(column);
            assert_eq!(shown, ColumnMaterial::solid(ground.material(top)), "{x} {z} of world {seed}");
        }
    }
}

#[test]
fn materials_and_strata_come_in_any_order() {
    let rng = &mut Rng::with_seed(5);
    let (strata, control) =
        (random_strata(rng), MaterialControl::Uniform(ColumnMaterial::solid(MaterialId(9))));
    let ground = || random_ground(&mut Rng::with_seed(8));
    let before = ground().with_materials(&control).unwrap().with_strata(&strata).unwrap();
    let after = ground().with_strata(&strata).unwrap().with_materials(&control).unwrap();
    assert!(before == after);
    assert_eq!(before.hash(), after.hash());
    assert_eq!(after.strata(), Some(&strata));
    // Strata take the place of others.
    let twice = ground().with_strata(&Strata::mine()).unwrap().with_strata(&strata).unwrap();
    assert_eq!(twice.hash(), ground().with_strata(&strata).unwrap().hash());
}

#[test]
fn hashes_tell_strata_apart() {
    let ground = || Ground::flat(20, 20, 5.0).unwrap();
    let hash = |strata: &Strata| ground().with_strata(strata).unwrap().hash();
    let ore = Stratum::pocket(MaterialId(3), 16, 0.1);
    let base = Strata { strata: vec![ore.clone(), Stratum::fill(MaterialId(4))], ..Strata::default() };
    let image = |grey| {
        let image = GreyImage::from_samples(2, 1, vec![0, grey]).unwrap();
        StratumBounds::Image(Arc::new(image))
    };
    let with = |own: Stratum| Strata { strata: vec![own, Stratum::fill(MaterialId(4))], ..Strata::default() };
    let all = [
        base.clone(),
        Strata { seed: 1, ..base.clone() },
        Strata { bedding: Bedding { fold: 1.0, ..Bedding::default() }, ..base.clone() },
        Strata { strata: base.strata.iter().rev().cloned().collect(), ..base },
        with(Stratum { seed: 1, ..ore.clone() }),
        with(Stratum { slope: Interval::below(1.0), ..ore.clone() }),
        with(Stratum { depth: Interval::above(1.0), ..ore.clone() }),
        with(Stratum { bounds: image(7), ..ore.clone() }),
        with(Stratum { bounds: image(8), ..ore.clone() }),
        with(Stratum { bounds: StratumBounds::Box(LatticeBox::point(IVec3::ZERO)), ..ore }),
    ];
    let mut hashes: Vec<u64> = all.iter().map(hash).chain([ground().hash()]).collect();
    hashes.sort_unstable();
    hashes.dedup();
    assert_eq!(hashes.len(), all.len() + 1);
}

#[test]
fn a_game_may_have_a_function_of_its_own() {
    let checkers = |point: IVec3, depth: i32| {
        (depth >= 2 * ONE).then(|| MaterialId((point.x + point.y + point.z).rem_euclid(2) as u8 + 5))
    };
    let ground = |id| Ground::flat(9, 9, 4.5).unwrap().with_material_fn(id, checkers).unwrap();
    let own = ground(1);
    assert!(own.has_material_fn() && own.strata().is_none());
    assert_eq!([4, 3, 2, 1].map(|y| own.material(IVec3::new(3, y, 4)).0), [0, 0, 6, 5]);
    assert_eq!(own.material(IVec3::new(-7, 2, 4)), own.material(IVec3::new(0, 2, 4)), "beyond the rim");
    assert!(own == ground(1) && own != ground(2) && own.hash() != ground(2).hash());
    let bad = Ground::flat(9, 9, 4.5).unwrap().with_material_fn(1, |_, _| Some(MaterialId::GROUND)).unwrap();
    assert_eq!(bad.material(IVec3::ZERO), MaterialId(0));
}

#[test]
fn far_away_points_have_an_answer() {
    let ground = Ground::flat(9, 9, 4.5).unwrap().with_strata(&Strata::alpine()).unwrap();
    for at in [i32::MIN, -(1 << 24), 1 << 24, i32::MAX] {
        for point in [IVec3::splat(at), IVec3::new(at, 3, 4), IVec3::new(4, at, 4), IVec3::new(4, 3, at)] {
            assert_ne!(ground.material(point), MaterialId::GROUND);
        }
    }
}
