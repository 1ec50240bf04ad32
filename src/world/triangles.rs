//! The triangles that are drawn over one cell of the world, without a mesh.

use std::ops::Range;

use glam::{DVec3, IVec3};

use super::ray::Triangle;
use super::state::World;
use crate::lattice::{BRICK, Column, LatticeBox, ONE, SNAP};
use crate::surface::cases;
use crate::surface::cell_outline::CellOutline;
use crate::surface::mask::{Borders, cell_sheet};
use crate::surface::vertex::{Lattice, WorldView, position};

/// Calls `found` with the drawn triangles of a cell whose cubes may reach into `low..=high`.
pub(crate) fn for_triangles(
    world: &World,
    view: &WorldView,
    cell: Column,
    low: f64,
    high: f64,
    mut found: impl FnMut(Triangle),
) {
    let ground = view.ground();
    let sheet = cell_sheet(ground, cell);
    let is_volumetric = view.mask.contains(cell);
    let meets = |rows: &Range<i32>| f64::from(rows.start) <= high && low <= f64::from(rows.end);
    if !is_volumetric && meets(&sheet) {
        heightmap_triangles(view, cell, &mut found);
    }
    let mut rows = edited_rows(world, cell);
    if is_volumetric {
        rows.push(sheet.clone());
    }
    rows.sort_unstable_by_key(|rows| rows.start);
    let mut next = i32::MIN;
    for rows in rows.into_iter().filter(meets) {
        let bottom = rows.start.max(next).max((low.floor() - 1.0) as i32);
        let top = rows.end.min((high.floor() + 2.0) as i32);
        for y in bottom..top {
            cube_triangles(view, cell.at(y), is_volumetric && sheet.contains(&y), &mut found);
        }
        next = next.max(rows.end);
    }
}

/// The triangles that a tile draws for a cell.
fn heightmap_triangles(view: &WorldView, cell: Column, found: &mut impl FnMut(Triangle)) {
    let ground = view.ground();
    let corner =
        |at: Column, height: i32| DVec3::new(at.x.into(), f64::from(height) / f64::from(ONE), at.z.into());
    let is_steep = |cell| ground.steep_cells().is_some_and(|steep| steep.contains(cell));
    let bends = |(dx, dz)| view.mask.contains(cell.offset(dx, dz)) || is_steep(cell.offset(dx, dz));
    let bordering =
        (0..).zip(Borders::SIDES).fold(0, |flags, (side, step)| flags | u8::from(bends(step)) << side);
    let flags = if is_steep(cell) { Borders::STEEP } else { bordering };
    if flags == 0 {
        let [a, b, c, d] = cell.corners().map(|at| corner(at, ground.height(at)));
        found([a, b, c]);
        found([c, d, a]);
        return;
    }
    let mut outline = CellOutline::with_capacity(0);
    outline.trace(ground, cell, flags, corner, |p, axis| {
        position(view, p, axis, IVec3::ZERO).as_dvec3() / f64::from(SNAP)
    });
    outline.triangles(|vertex| vertex.y, found);
}

/// Rows of cubes over a cell that may touch an edited sample.
fn edited_rows(world: &World, cell: Column) -> Vec<Range<i32>> {
    let mut rows = Vec::new();
    for bx in cell.x >> 3..=(cell.x + 1) >> 3 {
        for bz in cell.z >> 3..=(cell.z + 1) >> 3 {
            for by in world.stacks.get(&(bx, bz)).into_iter().flatten() {
                rows.push(by * BRICK - 1..by * BRICK + BRICK);
            }
        }
    }
    rows
}

/// The triangles of one cube, where it is drawn by marching cubes.
fn cube_triangles(view: &WorldView, cube: IVec3, in_sheet: bool, found: &mut impl FnMut(Triangle)) {
    let mut corners = LatticeBox { min: cube, max: cube + 1 }.points();
    if !in_sheet && !corners.any(|corner| view.is_edited(corner)) {
        return;
    }
    let case = cases::case_of(cube, |corner| view.distance(corner) < 0);
    for triangle in cases::table()[case].triangles() {
        found(triangle.map(|edge| {
            let (start, axis) = cases::lattice_edge(cube, edge);
            let local = position(view, start, axis, cube);
            cube.as_dvec3() + local.as_dvec3() / f64::from(SNAP)
        }));
    }
}
