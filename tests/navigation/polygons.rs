//! Polygons cover walkable cells, are near to the ground, and join within and across tiles.

use std::collections::HashMap;

use bevy_burrow::ground::MaterialId;
use bevy_burrow::lattice::{Column, SNAP};
use bevy_burrow::navigation::{NavPolygons, NavTilePos, WalkSettings, WalkableCell, WalkableTile};
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{IVec3, Vec3};

use crate::{random_dug_world, random_settings, walker, world_count};

/// The polygon below the middle of a cell that is nearest to its ground, and how far it is from it, in voxels.
fn polygon_under(polygons: &NavPolygons, cell: &WalkableCell) -> Option<(usize, f64)> {
    let origin = polygons.pos().origin();
    let (x, z) = (f64::from(cell.cell.x - origin.x) + 0.5, f64::from(cell.cell.z - origin.z) + 0.5);
    let middle = cell.heights.iter().map(|&height| f64::from(height)).sum::<f64>() / 4.0 / 256.0;
    let at = |index: u32| polygons.vertices()[index as usize].as_dvec3() / f64::from(SNAP);
    let mut best: Option<(usize, f64)> = None;
    for (number, polygon) in polygons.iter().enumerate() {
        for pair in polygon[1..].windows(2) {
            let [a, b, c] = [at(polygon[0]), at(pair[0]), at(pair[1])];
            let normal = (b - a).cross(c - a);
            let inside = [(a, b), (b, c), (c, a)]
                .iter()
                .all(|(p, q)| (q.z - p.z) * (x - p.x) - (q.x - p.x) * (z - p.z) >= 0.0);
            if normal.y > 0.0 && inside {
                let height = a.y - (normal.x * (x - a.x) + normal.z * (z - a.z)) / normal.y;
                let apart = (height - middle).abs();
                if best.is_none_or(|(_, least)| apart < least) {
                    best = Some((number, apart));
                }
            }
        }
    }
    best
}

fn root(parents: &mut [usize], mut at: usize) -> usize {
    while parents[at] != at {
        parents[at] = parents[parents[at]];
        at = parents[at];
    }
    at
}

#[test]
fn polygons_cover_the_cells_near_to_their_ground() {
    for index in 0..world_count(12) {
        let mut rng = Rng::with_seed(3000 + index);
        let terrain = random_dug_world(&mut rng, index);
        let settings = random_settings(&mut rng);
        for pos in NavTilePos::all(terrain.world()) {
            let tile = WalkableTile::new(terrain.world(), pos, &walker(&settings));
            let polygons = tile.polygons();
            assert_eq!(polygons.cell_count(), tile.cells().count());
            // Twice the area, in voxels.
            let mut area = 0;
            for polygon in polygons.iter() {
                let at = |index: usize| {
                    let vertex = polygons.vertices()[polygon[index % polygon.len()] as usize];
                    assert_eq!((vertex.x % SNAP, vertex.z % SNAP), (0, 0));
                    vertex / IVec3::new(SNAP, 1, SNAP)
                };
                for corner in 0..polygon.len() {
                    let [a, b, c] = [0, 1, 2].map(|more| at(corner + more));
                    let turn = (b.z - a.z) * (c.x - b.x) - (b.x - a.x) * (c.z - b.z);
                    assert!(turn >= 0 && a != b, "world {index}: not convex");
                    area += (a.z * b.x - a.x * b.z) as i64;
                }
            }
            assert_eq!(area, 2 * tile.cells().count() as i64);
            for cell in tile.cells() {
                let (_, apart) = polygon_under(&polygons, &cell).expect("a polygon below each cell");
                // Of the plane that its vertices are near to, of those vertices, and of the middle between corners.
                let most =
                    3.0 * f64::from(settings.precision) + 2.0 * f64::from(settings.step.max(settings.slope));
                assert!(apart <= most, "world {index}: {apart} over {cell:?}");
            }
        }
    }
}

/// Numbers polygons of a world one after the other.
struct Numbered {
    tiles: HashMap<NavTilePos, (usize, NavPolygons)>,
    parents: Vec<usize>,
}

impl Numbered {
    /// All polygons, joined where they have an edge in common, or edges in the same line along the border of two tiles.
    fn new(terrain: &Terrain, settings: &WalkSettings) -> Self {
        let (mut tiles, mut count) = (HashMap::new(), 0);
        for pos in NavTilePos::all(terrain.world()) {
            let polygons = WalkableTile::new(terrain.world(), pos, &walker(settings)).polygons();
            let len = polygons.len();
            tiles.insert(pos, (count, polygons));
            count += len;
        }
        let mut parents: Vec<usize> = (0..count).collect();
        let mut border: Vec<(usize, NavTilePos, IVec3, IVec3)> = Vec::new();
        for (&pos, (first, polygons)) in &tiles {
            let mut edges: HashMap<(u32, u32), Vec<usize>> = HashMap::new();
            for (number, polygon) in polygons.iter().enumerate() {
                for place in 0..polygon.len() {
                    let (a, b) = (polygon[place], polygon[(place + 1) % polygon.len()]);
                    edges.entry((a.min(b), a.max(b))).or_default().push(first + number);
                    let [p, q] = [a, b].map(|index| polygons.vertices()[index as usize]);
                    let is_border = |low: i32, high: i32| low == high && low % (NavTilePos::SIZE * SNAP) == 0;
                    if is_border(p.x, q.x) || is_border(p.z, q.z) {
                        let origin = pos.origin().at(0) * SNAP;
                        border.push((first + number, pos, p + origin, q + origin));
                    }
                }
            }
            for owners in edges.values() {
                assert!(owners.len() <= 2, "an edge of three polygons");
                if let [a, b] = owners[..] {
                    let (a, b) = (root(&mut parents, a), root(&mut parents, b));
                    parents[a] = b;
                }
            }
        }
        for (number, &(a, tile, p, q)) in border.iter().enumerate() {
            for &(b, other, r, s) in &border[..number] {
                if tile != other && overlap_in_line([p, q], [r, s]) {
                    let (a, b) = (root(&mut parents, a), root(&mut parents, b));
                    parents[a] = b;
                }
            }
        }
        Self { tiles, parents }
    }

    fn of(&mut self, cell: &WalkableCell) -> usize {
        let (first, polygons) = &self.tiles[&NavTilePos::of_cell(cell.cell)];
        let number = first + polygon_under(polygons, cell).expect("a polygon below each cell").0;
        root(&mut self.parents, number)
    }
}

/// Whether two edges run in opposite directions in one line along x or z, with a part in common at equal heights, to two units.
fn overlap_in_line([p, q]: [IVec3; 2], [r, s]: [IVec3; 2]) -> bool {
    let along = |point: IVec3| if p.x == q.x { point.z } else { point.x };
    let across = |point: IVec3| if p.x == q.x { point.x } else { point.z };
    if across(r) != across(p)
        || across(s) != across(p)
        || (along(q) - along(p)).signum() != (along(r) - along(s)).signum()
    {
        return false;
    }
    let (low, high) = (
        along(p).min(along(q)).max(along(r).min(along(s))),
        along(p).max(along(q)).min(along(r).max(along(s))),
    );
    let height = |[a, b]: [IVec3; 2], at: i32| {
        f64::from(a.y) + f64::from(b.y - a.y) * f64::from(at - along(a)) / f64::from(along(b) - along(a))
    };
    low < high && [low, high].iter().all(|&at| (height([p, q], at) - height([r, s], at)).abs() <= 2.0)
}

#[test]
fn polygons_are_connected_where_cells_are() {
    for index in 0..world_count(8) {
        let mut rng = Rng::with_seed(4000 + index);
        let terrain = random_dug_world(&mut rng, index);
        let settings = WalkSettings { precision: 0.1 + rng.f32() * 0.4, ..random_settings(&mut rng) };
        let mut polygons = Numbered::new(&terrain, &settings);
        let cells = crate::all_cells(terrain.world(), &walker(&settings));
        let at = |column: Column| {
            let first = cells.partition_point(|cell| cell.cell < column);
            cells[first..].iter().take_while(move |cell| cell.cell == column)
        };
        let mut parents: Vec<usize> = (0..cells.len()).collect();
        for (number, cell) in cells.iter().enumerate() {
            let [_, b, c, d] = cell.heights;
            let [east, south] = [(1, 0), (0, 1)].map(|(x, z)| cell.cell.offset(x, z));
            // Cells are neighbours when they have two floors in common.
            let next_east = at(east).find(|next| (next.heights[0], next.heights[1]) == (d, c));
            let next_south = at(south).find(|next| (next.heights[0], next.heights[3]) == (b, c));
            for next in [next_east, next_south].into_iter().flatten() {
                let other = cells.binary_search(next).expect("one of them");
                let (a, b) = (root(&mut parents, number), root(&mut parents, other));
                parents[a] = b;
            }
        }
        // Each connected group of cells is one connected group of polygons.
        let mut pairs: Vec<(usize, usize)> = (0..cells.len())
            .map(|number| (root(&mut parents, number), polygons.of(&cells[number])))
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let mut groups: Vec<usize> = pairs.iter().map(|pair| pair.1).collect();
        let count = pairs.len();
        groups.sort_unstable();
        groups.dedup();
        let firsts = pairs.chunk_by(|a, b| a.0 == b.0).count();
        assert_eq!((firsts, groups.len()), (count, count), "world {index}, {settings:?}");
    }
}

/// Polygons of a fixed world, as one number: equal on every machine. If the definition of what is walkable changes on purpose, so
/// does this number.
#[test]
fn polygons_are_the_same_on_every_machine_and_for_every_chunk_size() {
    for chunk_size in [8, 16, 32] {
        let heights = |x: i32, z: i32| 20.0 + f64::from((x * 7 + z * 3) % 11) / 8.0 + f64::from(x / 16);
        let ground = Ground::from_fn(80, 80, heights).expect("finite");
        let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("a valid terrain");
        let [from, to] = [Vec3::new(10.0, 14.0, 20.0), Vec3::new(70.0, 17.0, 50.0)];
        terrain.apply([
            Brush::dig(Shape::capsule(from, to, 3.5)),
            Brush::dig(Shape::sphere(Vec3::new(40.0, 22.0, 40.0), 6.0)),
            Brush::add(Shape::cuboid(Vec3::new(60.0, 28.0, 20.0), Vec3::new(9.0, 1.0, 3.0)), MaterialId(1)),
        ]);
        let walker = walker(&WalkSettings { radius: 0.4, height: 1.8, ..WalkSettings::default() });
        let mut hash = 0xcbf2_9ce4_8422_2325u64;
        let mut count = |number: i32| hash = (hash ^ u64::from(number as u32)).wrapping_mul(0x0100_0000_01b3);
        for pos in NavTilePos::all(terrain.world()) {
            let polygons = WalkableTile::new(terrain.world(), pos, &walker).polygons();
            polygons.vertices().iter().for_each(|vertex| vertex.to_array().into_iter().for_each(&mut count));
            for polygon in polygons.iter() {
                count(polygon.len() as i32);
                polygon.iter().for_each(|&index| count(index as i32));
            }
        }
        assert_eq!(hash, 0x4ed3_f0c6_a3bc_26d9, "chunks of {chunk_size}: {hash:#018x}");
    }
}
