//! Tiles of several files.

use bevy_burrow::ground::{ElevationGrid, ElevationTile, ImportError, ImportNote, TileEdges};

/// Cuts a grid into tiles of `cells` x `cells`, with or without shared edges.
fn cut(whole: &ElevationGrid, cells: u32, is_shared: bool) -> Vec<ElevationTile> {
    let side = cells + u32::from(is_shared);
    let across = (whole.width() - u32::from(is_shared)) / cells;
    let down = (whole.height() - u32::from(is_shared)) / cells;
    let tile = |column: u32, row: u32| {
        let place = |x: u32, z: u32| whole.value(column * cells + x, row * cells + z);
        let samples = (0..side).flat_map(|z| (0..side).map(move |x| place(x, z))).collect();
        let grid = ElevationGrid::from_samples(side, side, samples).expect("a tile");
        ElevationTile { column: column as i32 - 3, row: row as i32 + 7, grid }
    };
    (0..down).flat_map(|row| (0..across).map(move |column| tile(column, row))).collect()
}

fn whole(width: u32, height: u32) -> ElevationGrid {
    let value = |x: u32, z: u32| (x * 7 + z * 13) as f32 + ((x * x + 3 * z) % 17) as f32;
    let samples = (0..height).flat_map(|z| (0..width).map(move |x| value(x, z))).collect();
    ElevationGrid::from_samples(width, height, samples).expect("a grid")
}

#[test]
fn cut_and_joined_is_as_before() {
    let mut rng = fastrand::Rng::with_seed(5);
    for (is_shared, edges) in [(true, TileEdges::Shared), (false, TileEdges::Apart)] {
        let side = |tiles: u32| tiles * 16 + u32::from(is_shared);
        let before = whole(side(4), side(3));
        for edges in [edges, TileEdges::Guess] {
            let mut tiles = cut(&before, 16, is_shared);
            rng.shuffle(&mut tiles);
            let (joined, notes) = ElevationGrid::join(tiles, edges).expect("tiles that fit");
            assert_eq!((joined.width(), joined.height()), (before.width(), before.height()));
            assert_eq!(joined.samples(), before.samples());
            let guessed = notes.contains(&ImportNote::EdgesGuessed { are_shared: is_shared });
            assert_eq!(guessed, edges == TileEdges::Guess, "{notes:?}");
        }
    }
}

#[test]
fn level_tiles_are_guessed_by_their_size() {
    for (side, is_shared) in [(17, true), (16, false)] {
        let tile = |column| {
            let grid =
                ElevationGrid::from_samples(side, side, vec![5.0; (side * side) as usize]).expect("a tile");
            ElevationTile { column, row: 0, grid }
        };
        let (joined, _) =
            ElevationGrid::join(vec![tile(0), tile(1)], TileEdges::Guess).expect("tiles that fit");
        assert_eq!(joined.width(), 2 * side - u32::from(is_shared));
    }
}

#[test]
fn tiles_that_differ_at_shared_edges_are_reported() {
    let mut tiles = cut(&whole(33, 17), 16, true);
    let samples = tiles[1].grid.samples().iter().map(|value| value + 2.5).collect();
    tiles[1].grid = ElevationGrid::from_samples(17, 17, samples).expect("a tile");
    let (_, notes) = ElevationGrid::join(tiles, TileEdges::Shared).expect("tiles that fit");
    assert_eq!(notes, [ImportNote::EdgesDiffer { count: 17, largest: 2.5 }]);
}

#[test]
fn tiles_that_do_not_fit_are_named() {
    let tiles = || cut(&whole(49, 33), 16, true);
    let problem = |tiles: Vec<ElevationTile>| match ElevationGrid::join(tiles, TileEdges::Guess) {
        Err(ImportError::Tile { column, row, problem }) => (column, row, problem),
        other => panic!("{other:?}"),
    };
    let mut missing = tiles();
    missing.remove(1);
    assert_eq!(problem(missing), (-2, 7, "is missing".into()));
    let mut twice = tiles();
    twice.push(twice[4].clone());
    assert_eq!(problem(twice), (-2, 8, "is given twice".into()));
    let mut other_size = tiles();
    other_size[5].grid = whole(9, 17);
    assert_eq!(problem(other_size).0, -1);
    let mut far = tiles();
    far[0].column = i32::MIN;
    assert_eq!(problem(far).2, "is missing");
    assert!(matches!(ElevationGrid::join(Vec::new(), TileEdges::Guess), Err(ImportError::Empty)));
}

#[test]
fn places_are_read_from_names() {
    for (name, place) in [
        ("maps/island_x3_y5.png", Some((3, 5))),
        ("island_y5_x3.r16", Some((3, 5))),
        ("island_x03_y12.tif", Some((3, 12))),
        ("Max_Y2_X1.exr", Some((1, 2))),
        ("island_3_5.png", Some((3, 5))),
        ("4-7.tif", Some((4, 7))),
        ("N46E007.hgt", Some((7, -46))),
        ("S03W071.hgt", Some((-71, 3))),
        ("t_-1_0.png", Some((-1, 0))),
        ("t_0_-1.png", Some((0, -1))),
        ("t_-1_-2.png", Some((-1, -2))),
        ("-1_0.tif", Some((-1, 0))),
        ("3--5.tif", Some((3, -5))),
        ("t_0-1.png", Some((0, 1))),
        ("island_x-1_y0.png", Some((-1, 0))),
        ("island_y-4x-2.png", Some((-2, -4))),
        ("island_1025x1025_x3_y5.png", Some((3, 5))),
        ("island1025x1025_x3_y5.png", Some((3, 5))),
        ("x3_y5_1025x1025.png", Some((3, 5))),
        ("x64_x3_y5.png", Some((3, 5))),
        ("island_1025x1025_3_5.png", Some((3, 5))),
        ("tile1x3y5.png", Some((3, 5))),
        ("n46_e007_1arc_v3.hgt", Some((7, -46))),
        ("x3_y5_x64.png", None),
        ("map-x-1-y-2.png", None),
        ("island_1025x1025.png", None),
        ("island.png", None),
        ("", None),
        ("x_y", None),
        ("island_x99999999999_y1", None),
    ] {
        assert_eq!(ElevationTile::place_of(name), place, "{name}");
    }
}
