//! What the search for pieces may cost.

use glam::DVec3;

use super::*;

/// A comb: a block whose upper part is poles of 2 x 2 voxels, `height` voxels high, from x = `low` on.
fn comb(height: i32) -> Terrain {
    let mut terrain = terrain(Ground::flat(64, 64, 8.0).expect("flat ground"), 32);
    // It stands in the ground.
    let (middle, half) = (4.0 + height as f32 / 2.0, height as f32 / 2.0);
    let block = Shape::cuboid(Vec3::new(32.0, middle, 32.0), Vec3::new(16.0, half, 16.0));
    let gaps = (0..10).flat_map(|at| {
        let at = 17.0 + 3.0 * at as f32;
        let gap = |x: f32, z: f32, half: Vec3| Brush::dig(Shape::cuboid(Vec3::new(x, middle + 8.0, z), half));
        [gap(at, 32.0, Vec3::new(0.5, half + 1.0, 18.0)), gap(32.0, at, Vec3::new(18.0, half + 1.0, 0.5))]
    });
    terrain.apply(std::iter::once(Brush::add(block, MaterialId(1))).chain(gaps));
    terrain
}

/// Cuts all poles of a comb near their feet.
fn cut_comb() -> Brush {
    Brush::dig(Shape::cuboid(Vec3::new(32.0, 20.0, 32.0), Vec3::new(18.0, 1.0, 18.0)))
}

#[test]
fn what_an_edit_costs_bounds_what_its_search_finds() {
    let settings = LooseSettings { debris: 4096, ..LooseSettings::default() };
    let cut = |terrain: &mut Terrain| {
        let receipt = terrain.apply([cut_comb()]).remove(0);
        receipt.outcome.expect("it reaches the comb")
    };
    // A short comb falls whole.
    let mut short = comb(40);
    short.set_loose(Some(settings));
    let applied = cut(&mut short);
    assert!(!applied.has_unsearched);
    assert!(applied.loose.len() > 60, "{} pieces", applied.loose.len());

    let mut tall = comb(900);
    let in_air = |terrain: &Terrain| {
        let cut = LatticeBox { min: IVec3::new(14, 21, 14), max: IVec3::new(50, 23, 50) };
        terrain.world().loose_pieces(cut, &settings).len()
    };
    assert_eq!(in_air(&tall), 0, "all poles stand");
    assert!(tall.world().is_solid(DVec3::new(18.5, 890.0, 18.5)), "up to the top");
    tall.set_loose(Some(settings));
    let applied = cut(&mut tall);
    assert!(applied.has_unsearched, "the receipt says that not all is found");
    let runs: usize = applied.loose.iter().map(|piece| piece.runs.len()).sum();
    let voxels: u64 = applied.loose.iter().map(|piece| piece.voxels).sum();
    assert!(voxels <= 4 * u64::from(settings.largest) && runs <= voxels as usize);
    let left = in_air(&tall);
    assert!(left > 0, "pieces beyond the budget stay as ground");
    assert!(tall.world().check_seams().is_flawless());

    // The result does not depend on how edits are batched, and it is undone as a whole.
    let mut other = comb(900);
    let before = other.world().hash();
    other.set_loose(Some(settings));
    let brushes = [Brush::dig(Shape::sphere(Vec3::new(4.0, 8.0, 4.0), 2.0)), cut_comb()];
    let again = other.apply(&brushes).remove(1).outcome.expect("it reaches the comb");
    assert_eq!((again.loose, again.has_unsearched), (applied.loose.clone(), true));
    assert!(other.undo().outcome.is_ok());
    assert_eq!(other.world().hash(), before);

    // Later digs next to the other pieces find them.
    let mut turns = 0;
    while in_air(&tall) > 0 {
        tall.apply([Brush::dig(Shape::cuboid(
            Vec3::new(32.0, 23.0 + turns as f32, 32.0),
            Vec3::new(18.0, 1.0, 18.0),
        ))]);
        turns += 1;
        assert!(turns < 60, "{} of {left} are left", in_air(&tall));
    }
}

#[test]
fn an_honest_search_ends_before_its_budget() {
    // A sheet one voxel thick with as many voxels as a search looks for, on a neck.
    let mut terrain = terrain(Ground::flat(128, 64, 8.0).expect("flat ground"), 32);
    let sheet = Shape::cuboid(Vec3::new(64.0, 280.0, 32.0), Vec3::new(31.2, 256.0, 0.6));
    let neck = Shape::cuboid(Vec3::new(64.0, 16.0, 32.0), Vec3::new(2.2, 12.0, 2.2));
    terrain.apply([Brush::add(sheet, MaterialId(2)), Brush::add(neck, MaterialId(1))]);
    terrain.set_loose(Some(LooseSettings::default()));
    let cut = Brush::dig(Shape::cuboid(Vec3::new(64.0, 16.0, 32.0), Vec3::new(4.0, 1.2, 4.0)));
    let applied = terrain.apply([cut]).remove(0).outcome.expect("it reaches the neck");
    assert!(!applied.has_unsearched);
    assert_eq!(applied.loose.len(), 1);
    assert!(applied.loose[0].voxels > 31_000, "{} voxels", applied.loose[0].voxels);
}
