//! The views: each draws what a world holds around a place.

use bevy::prelude::*;

use super::DebugView;
use super::lines::LineBuffer;
use super::place::Place;
use super::wires::{SeamWires, around, edges_of, voxels};
use crate::lattice::{BrickPos, ChunkPos, Column, LatticeBox, ONE, SNAP};
use crate::lod::{Cut, Node};
use crate::terrain::{MeshKey, Terrain, World};

const CHUNK: LinearRgba = LinearRgba::rgb(0.08, 0.60, 1.0);
const TILE: LinearRgba = LinearRgba::rgb(0.85, 0.85, 0.9);
const MASK: LinearRgba = LinearRgba::new(0.75, 0.03, 0.35, 1.0);
const RIM: LinearRgba = LinearRgba::rgb(1.0, 0.25, 0.60);
const RING: LinearRgba = LinearRgba::rgb(1.0, 0.55, 0.02);
const GOLD: LinearRgba = LinearRgba::rgb(1.0, 0.65, 0.05);
const BLUE: LinearRgba = LinearRgba::rgb(0.10, 0.60, 1.0);

/// How far above the ground lines on it lie, in voxels.
const LIFT: f32 = 0.06;
/// Length of a normal, in voxels.
const NORMAL: f32 = 0.8;

/// A brick that an edit may have changed, and how fresh that is: 1 now, 0 forgotten.
pub type Dirty = (BrickPos, f32);

/// Draws a view.
pub fn draw(view: DebugView, terrain: &Terrain, place: Place, dirty: &[Dirty], out: &mut LineBuffer) {
    let world = terrain.world();
    let Some(bounds) = around(place.focus, place.radius) else { return };
    match view {
        DebugView::Chunks => chunks(world, place, bounds, out),
        DebugView::Fields => fields(world, bounds, out),
        DebugView::Mask => mask(world, bounds, out),
        DebugView::Rings => rings(world, bounds, out),
        DebugView::Dirty => bricks(dirty, bounds, out),
        DebugView::Normals => normals(world, place, out),
        DebugView::Wires => SeamWires::around(world, place.focus, place.near).draw(out),
        DebugView::Levels => match terrain.drawn_cut() {
            Some(drawn) => levels(world, drawn.cut(), place, out),
            None => levels(world, &Cut::coarsest(world.lod_grid(0)), place, out),
        },
        #[cfg(feature = "navigation")]
        DebugView::Walkable => super::walkable::draw(world, place, out),
    }
}

/// The edges of the nodes within the radius, the nearest nodes first, should there not be room for all.
fn levels(world: &World, cut: &Cut, place: Place, out: &mut LineBuffer) {
    let distance = |node: Node| {
        let (low, high) = cut.grid().columns(node);
        let [low, high] = [low, high].map(|column| Vec2::new(column.x as f32, column.z as f32));
        place.focus.xz().distance(place.focus.xz().clamp(low, high.max(low)))
    };
    let near = cut.nodes().map(|node| (distance(node), node));
    let mut near: Vec<(f32, Node)> = near.filter(|(distance, _)| *distance <= place.radius).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    out.width(1.5);
    for (_, node) in near {
        if out.is_full() {
            return;
        }
        let color = LinearRgba::from(Oklcha::sequential_dispersed(u32::from(node.level)));
        let mut edges: Vec<_> =
            edges_of(&world.node_mesh(cut, node), cut.grid().columns(node).0.at(0) * SNAP).collect();
        edges.sort_unstable_by_key(|edge| edge.map(|end| end.to_array()));
        edges.dedup();
        for [from, to] in edges {
            out.line(voxels(from) + Vec3::Y * LIFT, voxels(to) + Vec3::Y * LIFT, color);
        }
    }
}

fn chunks(world: &World, place: Place, bounds: LatticeBox, out: &mut LineBuffer) {
    let grid = world.grid();
    let mut chunks = world.chunks_near(bounds);
    let cells = |chunk: ChunkPos| grid.chunk_cells(chunk);
    let middle = |chunk: ChunkPos| (cells(chunk).min.as_vec3() + cells(chunk).max.as_vec3()) / 2.0;
    // The nearest first, should there not be room for all.
    chunks.sort_by(|&a, &b| {
        let distance = |chunk| middle(chunk).distance_squared(place.focus);
        distance(a).total_cmp(&distance(b))
    });
    out.width(1.5);
    for tile in world.drawn_near(bounds) {
        let MeshKey::Tile(tile) = tile else { continue };
        let (low, high) = grid.tile_cells(tile);
        let sides = [(1, 0, high.x - low.x), (0, 1, high.z - low.z)];
        for (dx, dz, count) in sides {
            let at = |step: i32| on_ground(world, low.offset(dx * step, dz * step));
            (0..count).for_each(|step| out.line(at(step), at(step + 1), TILE));
        }
    }
    out.width(2.0);
    for chunk in chunks {
        let cells = cells(chunk);
        out.cuboid(cells.min.as_vec3(), (cells.max + 1).as_vec3(), CHUNK);
    }
}

fn fields(world: &World, bounds: LatticeBox, out: &mut LineBuffer) {
    out.width(2.5);
    for field in world.fields_near(bounds) {
        let color = LinearRgba::from(Oklcha::sequential_dispersed(field.id.0 as u32));
        out.cuboid(field.bounds.min.as_vec3() - 0.1, field.bounds.max.as_vec3() + 0.1, color);
    }
}

fn mask(world: &World, bounds: LatticeBox, out: &mut LineBuffer) {
    let mut cells: Vec<Column> = world.mask_cells(Column::of(bounds.min), Column::of(bounds.max)).collect();
    cells.sort_unstable();
    let sides = |cell: Column| {
        let [a, b, c, d] = cell.corners();
        [((-1, 0), a, b), ((0, 1), b, c), ((1, 0), c, d), ((0, -1), d, a)]
    };
    out.width(4.0);
    for &cell in &cells {
        for ((dx, dz), from, to) in sides(cell) {
            if !world.mask().contains(cell.offset(dx, dz)) {
                out.line(on_ground(world, from), on_ground(world, to), RIM);
            }
        }
    }
    out.width(1.0);
    for &cell in &cells {
        // Each line between two cells once.
        for ((dx, dz), from, to) in sides(cell) {
            if dx + dz < 0 && world.mask().contains(cell.offset(dx, dz)) {
                out.line(on_ground(world, from), on_ground(world, to), MASK);
            }
        }
    }
}

fn rings(world: &World, bounds: LatticeBox, out: &mut LineBuffer) {
    out.width(2.0);
    for drawn in world.drawn_near(bounds) {
        let MeshKey::Tile(tile) = drawn else { continue };
        for triangle in world.ring_triangles(tile) {
            if triangle.iter().all(|corner| bounds.contains(corner.floor().as_ivec3())) {
                out.triangle(triangle, RING);
            }
        }
        if out.is_full() {
            return;
        }
    }
}

fn bricks(dirty: &[Dirty], bounds: LatticeBox, out: &mut LineBuffer) {
    out.width(2.0);
    for &(brick, fresh) in dirty {
        let samples = brick.samples();
        if samples.intersection(bounds).is_some() {
            let fresh = fresh.clamp(0.0, 1.0);
            let color = LinearRgba::new(1.0, 0.10 + 0.55 * fresh, 0.04, fresh);
            out.cuboid(samples.min.as_vec3(), (samples.max + 1).as_vec3(), color);
        }
    }
}

fn normals(world: &World, place: Place, out: &mut LineBuffer) {
    let Some(near) = around(place.focus, place.near) else { return };
    out.width(1.5);
    for drawn in world.drawn_near(near) {
        if out.is_full() {
            return;
        }
        let origin = world.origin(drawn).as_vec3();
        let mut draw = |position: [f32; 3], normal: Vec3, color| {
            let from = origin + Vec3::from(position);
            if from.distance_squared(place.focus) < place.near * place.near {
                out.line(from, from + normal * NORMAL, color);
            }
        };
        match drawn {
            MeshKey::Tile(tile) => {
                let mesh = world.tile_mesh(tile);
                // Of columns in the mask no triangle is left.
                let mut is_used = vec![false; mesh.vertices.len()];
                for index in mesh.indices.iter() {
                    if let Some(used) = is_used.get_mut(index as usize) {
                        *used = true;
                    }
                }
                let used = mesh.vertices.iter().zip(is_used).filter(|(_, used)| *used);
                used.for_each(|(vertex, _)| draw(vertex.position_f32(), vertex.normal, GOLD));
            }
            MeshKey::Chunk(chunk) => {
                let vertices = world.chunk_surface(chunk).into_iter().flat_map(|mesh| &mesh.vertices);
                vertices.for_each(|vertex| draw(vertex.position_f32(), vertex.normal, BLUE));
            }
        }
    }
}

/// The place of a column on the ground as it was before digging, a little above it.
fn on_ground(world: &World, column: Column) -> Vec3 {
    let height = world.ground().height(column) as f32 / ONE as f32;
    Vec3::new(column.x as f32, height + LIFT, column.z as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::{Ground, NoiseHeights};
    use crate::terrain::TerrainSettings;

    fn hills(side: u32) -> Terrain {
        let noise = NoiseHeights { amplitude: 14.0, scale: 20.0, ..NoiseHeights::default() };
        let ground = Ground::from_noise(side, side, &noise).expect("valid");
        Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size: 1.0 }).expect("valid")
    }

    fn dug(side: u32) -> (Terrain, Place) {
        let mut terrain = hills(side);
        let focus = Vec3::new(32.0, terrain.world().height(32.0, 32.0).unwrap_or_default() as f32, 32.0);
        terrain.apply([Brush::dig(Shape::sphere(focus, 6.0))]);
        (terrain, place_at(focus, 40.0, 12.0))
    }

    fn place_at(focus: Vec3, radius: f32, near: f32) -> Place {
        Place {
            focus,
            radius,
            near,
            #[cfg(feature = "navigation")]
            agent: crate::navigation::WalkSettings { slope: 2.0, ..Default::default() },
        }
    }

    fn count(view: DebugView, terrain: &Terrain, place: Place, most: usize) -> usize {
        let bricks = terrain.world().bricks().map(|(brick, _)| (brick, 0.5)).collect::<Vec<_>>();
        let mut out = LineBuffer::new(most);
        draw(view, terrain, place, &bricks, &mut out);
        out.finish().iter().map(|layer| layer.lines.len()).sum()
    }

    #[test]
    fn each_view_draws_what_there_is() {
        let (terrain, place) = dug(64);
        let counts = DebugView::ALL.map(|view| count(view, &terrain, place, 100_000));
        assert!(counts.iter().all(|&count| count > 10), "{counts:?}");
        let world = terrain.world();
        // Twelve edges each.
        let fields: usize = world.fields().map(|(_, fields)| fields.len()).sum();
        assert_eq!(counts[1], 12 * fields);
        assert_eq!(counts[4], 12 * world.bricks().count());
        // A cell has four sides, and those inside belong to two cells.
        let cells = world.mask().len();
        let beside =
            |cell: Column| [(1, 0), (0, 1)].map(|(dx, dz)| world.mask().contains(cell.offset(dx, dz)));
        let inside = world.mask().iter().flat_map(beside).filter(|is_in| *is_in).count();
        assert_eq!(counts[2], 4 * cells - inside);
        let rings: usize = world.grid().tiles().map(|tile| world.ring_triangles(tile).count()).sum();
        assert_eq!(counts[3], 3 * rings);
    }

    #[test]
    fn where_nobody_dug_only_the_ground_is_drawn() {
        let place = place_at(Vec3::new(32.0, 0.0, 32.0), 40.0, 40.0);
        let counts = DebugView::ALL.map(|view| count(view, &hills(64), place, 100_000));
        assert!(counts[0] > 0 && counts[5] > 0 && counts[6] > 0, "{counts:?}");
        assert_eq!(counts[1..5], [0; 4]);
    }

    #[test]
    fn no_view_draws_more_than_allowed_nor_far_away() {
        let (terrain, place) = dug(64);
        for view in DebugView::ALL {
            assert_eq!(count(view, &terrain, place, 7), 7, "{view:?}");
            assert_eq!(count(view, &terrain, place, 0), 0, "{view:?}");
            let far = Place { focus: Vec3::splat(900.0), ..place };
            assert_eq!(count(view, &terrain, far, 1000), 0, "{view:?}");
        }
        for odd in [f32::NAN, f32::INFINITY, -1.0, 1e30] {
            for view in DebugView::ALL {
                count(view, &terrain, Place { radius: odd, near: odd, ..place }, 100);
                count(view, &terrain, Place { focus: Vec3::splat(odd), ..place }, 100);
            }
        }
    }

    #[test]
    fn the_cost_does_not_grow_with_the_world() {
        let (small, place) = dug(64);
        let (large, _) = dug(256);
        let near = Place { radius: 12.0, near: 8.0, ..place };
        for view in DebugView::ALL {
            let (a, b) = (count(view, &small, near, 1_000_000), count(view, &large, near, 1_000_000));
            assert!(b <= a + a / 2 + 64, "{view:?}: {a} {b}");
        }
    }
}
