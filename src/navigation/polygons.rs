//! Polygons of walkable cells.

use glam::IVec3;

use super::border::{Border, FINE};
use super::links::Axis;
use super::tiles::NavTilePos;
use super::walkable::WalkableTile;
use crate::lattice::SNAP;

/// Convex polygons that cover the walkable cells of a tile: rectangles seen from above, with further vertices on their
/// sides where other rectangles begin.
///
/// Two polygons that meet have an edge in common. Polygons at the tile's border have edges in the same lines as those
/// of the next tile, whose ends may lie elsewhere on it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct NavPolygons {
    pos: NavTilePos,
    vertices: Vec<IVec3>,
    indices: Vec<u32>,
    /// Where the indices of each polygon end.
    ends: Vec<u32>,
    cells: u32,
}

impl NavPolygons {
    /// The tile's position.
    pub fn pos(&self) -> NavTilePos {
        self.pos
    }

    /// Vertices in 1/4096 voxel, from the tile's lowest column at y = 0.
    pub fn vertices(&self) -> &[IVec3] {
        &self.vertices
    }

    /// The polygons: indices of vertices, counter-clockwise seen from above.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.indices[start as usize..end as usize])
    }

    /// Number of polygons.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Returns `true` if no cell of the tile is walkable.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Number of cells that they cover.
    pub fn cell_count(&self) -> usize {
        self.cells as usize
    }

    /// Bytes that they take.
    pub fn bytes(&self) -> usize {
        size_of::<Self>()
            + self.vertices.len() * size_of::<IVec3>()
            + (self.indices.len() + self.ends.len()) * size_of::<u32>()
    }
}

/// A rectangle of cells while it grows.
struct Rectangle {
    width: usize,
    depth: usize,
    /// The floors at the cells' lowest corners, row by row; a row has room for all cells of a tile.
    cells: Vec<u32>,
    /// Heights of its columns, likewise.
    heights: Vec<i32>,
}

/// Columns along a side of a tile: the length of a row.
const ROW: usize = NavTilePos::SIZE as usize + 1;

impl WalkableTile {
    /// Polygons of the walkable cells.
    pub fn polygons(&self) -> NavPolygons {
        let border = Border::new(self);
        let mut is_corner = vec![false; self.floors.len()];
        border.corners.iter().for_each(|&floor| is_corner[floor] = true);
        let rectangles = self.rectangles();
        for rectangle in &rectangles {
            self.outline(rectangle)
                .filter(|(_, turns)| *turns)
                .for_each(|(floor, _)| is_corner[floor] = true);
        }
        let mut polygons = NavPolygons {
            pos: self.pos(),
            vertices: Vec::new(),
            indices: Vec::new(),
            ends: Vec::with_capacity(rectangles.len()),
            cells: 0,
        };
        let mut index_of = vec![u32::MAX; self.floors.len()];
        for rectangle in &rectangles {
            for (floor, _) in self.outline(rectangle).filter(|(floor, _)| is_corner[*floor]) {
                if index_of[floor] == u32::MAX {
                    index_of[floor] = polygons.vertices.len() as u32;
                    let height = self.floors.floor[floor] * FINE;
                    let height = border.heights.get(&floor).copied().unwrap_or(height);
                    polygons.vertices.push(self.position(floor).with_y(height));
                }
                polygons.indices.push(index_of[floor]);
            }
            polygons.ends.push(polygons.indices.len() as u32);
            polygons.cells += rectangle.width as u32 * rectangle.depth as u32;
        }
        polygons
    }

    /// Where the column of a floor is, from the tile's lowest one, in 1/4096 voxel, at y = 0.
    pub(super) fn position(&self, floor: usize) -> IVec3 {
        let column = self.floors.starts.partition_point(|&start| start as usize <= floor) - 1;
        let (x, z) = (column % self.floors.side, column / self.floors.side);
        let (origin, low) = (self.pos().origin(), self.floors.low);
        IVec3::new(x as i32 + low.x - origin.x, 0, z as i32 + low.z - origin.z) * SNAP
    }

    /// Covers the walkable cells with rectangles that are nearly flat, none over another one.
    fn rectangles(&self) -> Vec<Rectangle> {
        let mut is_free: Vec<bool> = vec![false; self.floors.len()];
        for (_, column) in self.columns() {
            self.floors.of(column).for_each(|floor| is_free[floor] = self.is_walkable(floor));
        }
        let mut rectangles = Vec::new();
        for (at, column) in self.columns() {
            let origin = self.pos().origin();
            let room = [NavTilePos::SIZE - (at.x - origin.x), NavTilePos::SIZE - (at.z - origin.z)]
                .map(|room| room as usize);
            for floor in self.floors.of(column) {
                if is_free[floor] {
                    let rectangle = self.rectangle(floor, room, &is_free);
                    for z in 0..rectangle.depth {
                        let row = &rectangle.cells[z * ROW..][..rectangle.width];
                        row.iter().for_each(|&cell| is_free[cell as usize] = false);
                    }
                    rectangles.push(rectangle);
                }
            }
        }
        rectangles
    }

    /// The rectangle that grows from a cell, first along x, then along z, in turn.
    fn rectangle(&self, first: usize, room: [usize; 2], is_free: &[bool]) -> Rectangle {
        let mut own = Rectangle { width: 1, depth: 1, cells: Vec::new(), heights: Vec::new() };
        own.cells.resize(ROW, 0);
        own.heights.resize(2 * ROW, 0);
        own.cells[0] = first as u32;
        let height = |floor: usize| self.floors.floor[floor];
        let corners = self.links.corners(first).unwrap_or([first; 4]);
        (own.heights[0], own.heights[ROW]) = (height(corners[0]), height(corners[1]));
        (own.heights[ROW + 1], own.heights[1]) = (height(corners[2]), height(corners[3]));
        let mut can_grow = [true; 2];
        while can_grow != [false; 2] {
            for (axis, size) in [(Axis::X, own.width), (Axis::Z, own.depth)] {
                let grows = can_grow[axis as usize]
                    && size < room[axis as usize]
                    && self.grow(&mut own, axis, is_free);
                can_grow[axis as usize] = grows;
            }
        }
        own
    }

    /// Adds a row of cells, if all of them are free, and the rectangle stays nearly flat.
    fn grow(&self, own: &mut Rectangle, axis: Axis, is_free: &[bool]) -> bool {
        let (width, depth) = (own.width, own.depth);
        let [count, step, edge] = match axis {
            Axis::X => [depth, ROW, width - 1],
            Axis::Z => [width, 1, (depth - 1) * ROW],
        };
        if axis == Axis::Z {
            own.cells.resize((depth + 1) * ROW, 0);
            own.heights.resize((depth + 2) * ROW, 0);
        }
        let beyond = if axis == Axis::X { 1 } else { ROW };
        for place in 0..count {
            let at = edge + place * step;
            let Some(next) = self.links.next(own.cells[at] as usize, axis) else { return false };
            let Some([_, z, opposite, x]) = self.links.corners(next).filter(|_| is_free[next]) else {
                return false;
            };
            own.cells[at + beyond] = next as u32;
            let height = |floor: usize| self.floors.floor[floor];
            // The corners of the new cell that are not those of cells of the rectangle.
            own.heights[at + beyond + if axis == Axis::X { 1 } else { ROW }] =
                height(if axis == Axis::X { x } else { z });
            own.heights[at + beyond + 1 + ROW] = height(opposite);
        }
        match axis {
            Axis::X => own.width += 1,
            Axis::Z => own.depth += 1,
        }
        if own.is_flat(self.precision) {
            return true;
        }
        (own.width, own.depth) = (width, depth);
        false
    }

    /// The floors around a rectangle, counter-clockwise seen from above, and whether the outline turns there.
    fn outline<'a>(&'a self, own: &'a Rectangle) -> impl Iterator<Item = (usize, bool)> + 'a {
        let (width, depth) = (own.width, own.depth);
        let corner = move |x: usize, z: usize| {
            let cell = own.cells[z.min(depth - 1) * ROW + x.min(width - 1)] as usize;
            let corners = self.links.corners(cell).unwrap_or([cell; 4]);
            match (x == width, z == depth) {
                (false, false) => corners[0],
                (false, true) => corners[1],
                (true, true) => corners[2],
                (true, false) => corners[3],
            }
        };
        let west = (0..depth).map(|z| (0, z));
        let south = (0..width).map(move |x| (x, depth));
        let east = (1..=depth).rev().map(move |z| (width, z));
        let north = (1..=width).rev().map(|x| (x, 0));
        let around = west.chain(south).chain(east).chain(north);
        around.map(move |(x, z)| (corner(x, z), (x == 0 || x == width) && (z == 0 || z == depth)))
    }
}

impl Rectangle {
    /// Whether all of its columns are near to the plane through the middle of its corners.
    fn is_flat(&self, precision: i32) -> bool {
        let (width, depth) = (self.width as i64, self.depth as i64);
        let base = i64::from(self.heights[0]);
        let height = |x: usize, z: usize| i64::from(self.heights[z * ROW + x]) - base;
        let (b, c, d) = (height(0, self.depth), height(self.width, self.depth), height(self.width, 0));
        // Four times the area times the plane's height.
        let (middle, rise_x, rise_z) =
            ((b + c + d) * width * depth, (d + c - b) * depth, (b + c - d) * width);
        let (scale, most) = (4 * width * depth, 4 * width * depth * i64::from(precision));
        (0..=self.depth).all(|z| {
            let row = middle + rise_z * (2 * z as i64 - depth) - rise_x * width;
            let heights = &self.heights[z * ROW..][..=self.width];
            heights.iter().zip(0..).all(|(&height, x)| {
                let plane = row + 2 * rise_x * x;
                (scale * (i64::from(height) - base) - plane).abs() <= most
            })
        })
    }
}
