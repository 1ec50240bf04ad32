//! A node of level 1 or above: its cells as two triangles each, as fans where they meet finer or volumetric ones (rules
//! 3 and 7), or as cubes.

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::Fault;
use super::builder::{Builder, Number, page_vertex};
use super::edge::{Edge, shared_height_vertex};
use super::shares::FinerShares;
use super::sides::{Cell, Interval, SIDES};
use super::view::LodView;
use super::volumetric::Volumetric;
use crate::lattice::{Column, ONE};
use crate::lod::Node;
use crate::surface::tile::fan;
use crate::surface::vertex::height_vertex;
use crate::surface::{SurfaceMesh, Vertex, cases};

/// The mesh of a node whose level is 1 at least, relative to its lowest column at y = 0.
pub(super) fn mesh(view: &LodView, node: Node) -> SurfaceMesh {
    let mut drawing = Drawing::new(view, node);
    drawing.draw();
    let counts = drawing.builder.column_counts();
    let Drawing { low, high, stride, beside, .. } = drawing;
    drawing.builder.finish(&FinerShares::new(view, low, high, stride, beside, counts))
}

/// A node under construction.
pub(super) struct Drawing<'a> {
    pub view: LodView<'a>,
    pub volumetric: Volumetric<'a>,
    level: u8,
    pub stride: i32,
    low: Column,
    high: Column,
    /// The strides of the nodes across its sides, `None` at the rim.
    beside: [Option<i32>; 4],
    /// Whether there is a brick over its columns.
    has_bricks: bool,
    /// The edited samples of its lattice by their columns, those in its cells' corners only.
    edited: FxHashMap<Column, Vec<i32>>,
    pub builder: Builder,
    /// The heightmap's vertices between the columns of sides towards finer nodes, where nothing was edited.
    between: FxHashMap<Column, Vertex>,
    /// The vertices of lattice edges.
    pub edges: FxHashMap<Edge, Number>,
}

impl<'a> Drawing<'a> {
    pub fn new(view: &LodView<'a>, node: Node) -> Self {
        let (low, high) = view.cut.grid().columns(node);
        let stride = node.stride();
        let size = stride * view.world.grid.size();
        let beside = SIDES.map(|(dx, dz)| {
            let by = |step: i32| if step > 0 { size } else { step };
            view.level_at(low.offset(by(dx), by(dz))).map(|level| 1 << level)
        });
        let mut drawing = Self {
            view: *view,
            volumetric: Volumetric::new(view, node),
            level: node.level,
            stride,
            low,
            high,
            beside,
            has_bricks: view.stacks.has_any(low, high),
            edited: FxHashMap::default(),
            builder: Builder::new(view.ground(), low, high, stride),
            between: FxHashMap::default(),
            edges: FxHashMap::default(),
        };
        drawing.gather();
        drawing.share_columns();
        drawing.ask_between();
        drawing
    }

    /// Gathers the edited samples of the node's own lattice.
    fn gather(&mut self) {
        let Volumetric { near, .. } = &self.volumetric;
        let is_own = |low: i32, high: i32, at: i32| low <= at && at < high + self.stride;
        for column in near.columns(self.stride) {
            if is_own(self.low.x, self.high.x, column.x) && is_own(self.low.z, self.high.z, column.z) {
                let mut rows = Vec::new();
                near.edited_rows(column, self.stride, &mut rows);
                if !rows.is_empty() {
                    self.edited.insert(column, rows);
                }
            }
        }
    }

    /// Columns where levels meet have the vertex that all of them have there.
    fn share_columns(&mut self) {
        if !self.has_bricks {
            return;
        }
        let [across, down] = self.builder.column_counts();
        for (z, x) in (0..down).flat_map(|z| (0..across).map(move |x| (z, x))) {
            if x == 0 || x + 1 == across || z == 0 || z + 1 == down {
                let at = |low: i32, high: i32, place: usize| (low + place as i32 * self.stride).min(high);
                let column = Column::new(at(self.low.x, self.high.x, x), at(self.low.z, self.high.z, z));
                if self.view.is_between_levels(column.at(0), 1) {
                    let vertex = shared_height_vertex(&self.view, column, self.low.at(0));
                    self.builder.set_column(self.builder.column([x, z]), vertex);
                }
            }
        }
    }

    /// Asks the ground at once for the columns between those of sides towards finer nodes.
    fn ask_between(&mut self) {
        if self.has_bricks {
            return;
        }
        let (low, [across, down]) = (self.low, self.builder.column_counts());
        for (side, &(dx, dz)) in SIDES.iter().enumerate() {
            let Some(finer) = self.beside[side].filter(|&other| other < self.stride) else { continue };
            let first = Column::new(
                if dx > 0 { self.high.x } else { low.x },
                if dz > 0 { self.high.z } else { low.z },
            );
            let fine = |columns: usize| (columns - 1) * (self.stride / finer) as usize + 1;
            let (count, step) =
                if dx != 0 { ([1, fine(down)], (0, finer)) } else { ([fine(across), 1], (finer, 0)) };
            let page = self.view.ground().page(first, finer, count);
            for number in 0..count[0] * count[1] {
                let column = first.offset(step.0 * number as i32, step.1 * number as i32);
                let column = Column::of(self.view.drawn(column.at(0)));
                self.between.insert(column, page_vertex(&page, number, column, low));
            }
        }
    }

    /// The lattice point that positions count from.
    pub fn origin(&self) -> IVec3 {
        self.low.at(0)
    }

    /// The node's cells along x and z, by their places.
    fn cell_counts(&self) -> [usize; 2] {
        self.builder.column_counts().map(|columns| columns - 1)
    }

    fn cell_at(&self, [x, z]: [usize; 2]) -> Cell {
        Cell::new(self.low.offset(x as i32 * self.stride, z as i32 * self.stride), self.stride)
    }

    pub fn draw(&mut self) {
        let [across, down] = self.cell_counts();
        let volumetric = self.volumetric_cells();
        let is_volumetric = |x: usize, z: usize| volumetric.get(z * across + x) == Some(&true);
        let (mut cubes, has_edits) = (Vec::new(), !self.edited.is_empty());
        for (z, x) in (0..down).flat_map(|z| (0..across).map(move |x| (z, x))) {
            let cell = self.cell_at([x, z]);
            if self.view.has(Fault::WholeCells) && !self.is_whole(cell) {
                continue;
            }
            let is_cubes = is_volumetric(x, z);
            if has_edits || is_cubes {
                self.cube_rows(cell, is_cubes, &mut cubes);
                self.cubes(cell, &cubes);
            }
            if is_cubes {
                continue;
            }
            // Flags of bent sides, in the order of `SIDES`.
            let beside = [
                (x > 0).then(|| is_volumetric(x - 1, z)),
                (z + 1 < down).then(|| is_volumetric(x, z + 1)),
                (x + 1 < across).then(|| is_volumetric(x + 1, z)),
                (z > 0).then(|| is_volumetric(x, z - 1)),
            ];
            let bent: [bool; 4] = std::array::from_fn(|side| match (beside[side], self.beside[side]) {
                (Some(is_volumetric), _) => is_volumetric,
                (None, Some(other)) if other == self.stride => {
                    self.volumetric.contains(cell.beside(SIDES[side]))
                }
                (None, Some(other)) => other < self.stride && !self.view.has(Fault::StraightSides),
                (None, None) => false,
            });
            if bent == [false; 4] {
                let [a, b, c, d] =
                    [[x, z], [x, z + 1], [x + 1, z + 1], [x + 1, z]].map(|at| self.builder.column(at));
                if self.builder.splits_across([x, z]) {
                    self.builder.emit([d, a, b]);
                    self.builder.emit([b, c, d]);
                } else {
                    self.builder.emit([a, b, c]);
                    self.builder.emit([c, d, a]);
                }
            } else {
                let is_at_border = beside.map(|own| own.is_none());
                self.heightmap_cell(cell, self.builder.splits_across([x, z]), bent, is_at_border);
            }
        }
        self.close_sides();
    }

    /// Returns `true` if a cell ends inside the world.
    fn is_whole(&self, Cell { low, stride }: Cell) -> bool {
        let last = self.view.last();
        low.x + stride <= last.x && low.z + stride <= last.z
    }

    /// Which of the node's cells are volumetric, row by row; an empty list if none is.
    fn volumetric_cells(&mut self) -> Vec<bool> {
        if self.volumetric.near.is_empty() {
            return Vec::new();
        }
        let [across, down] = self.cell_counts();
        let mut asked = vec![false; across * down];
        for column in self.edited.keys() {
            let (x, z) = ((column.x - self.low.x) / self.stride, (column.z - self.low.z) / self.stride);
            for (x, z) in [(x - 1, z - 1), (x, z - 1), (x - 1, z), (x, z)] {
                if (0..across as i32).contains(&x) && (0..down as i32).contains(&z) {
                    asked[z as usize * across + x as usize] = true;
                }
            }
        }
        // Any cell at a node of another level may be promoted.
        let is_other = |side: usize| self.beside[side].is_some_and(|other| other != self.stride);
        for z in 0..down {
            asked[z * across] |= is_other(0);
            asked[z * across + across - 1] |= is_other(2);
        }
        for x in 0..across {
            asked[(down - 1) * across + x] |= is_other(1);
            asked[x] |= is_other(3);
        }
        if self.view.has(Fault::NodePromotion) {
            asked.fill(true);
        }
        let cells = asked.into_iter().enumerate();
        cells
            .map(|(at, asked)| asked && self.volumetric.contains(self.cell_at([at % across, at / across])))
            .collect()
    }

    /// The lattice y of the cubes that marching cubes draws over a cell: those that touch an edited sample, and all of
    /// a volumetric cell's sheet; of another cell's sheet none.
    fn cube_rows(&self, cell: Cell, is_volumetric: bool, rows: &mut Vec<i32>) {
        rows.clear();
        let corners = cell.corners();
        for edited in corners.iter().filter_map(|column| self.edited.get(column)) {
            rows.extend(edited.iter().flat_map(|&y| [y - self.stride, y]));
        }
        if !is_volumetric && rows.is_empty() {
            return;
        }
        let sheet = self.view.sheet(&corners, self.stride);
        if is_volumetric {
            rows.extend(sheet.step_by(self.stride as usize));
        } else {
            rows.retain(|y| !sheet.contains(y));
        }
        rows.sort_unstable();
        rows.dedup();
    }

    /// Marching cubes in some cubes over a cell, from below.
    fn cubes(&mut self, cell: Cell, rows: &[i32]) {
        // Which corners of the last cube's upper face are solid, and where it lies.
        let mut upper = None;
        for &y in rows {
            let (low, stride) = (cell.low.at(y), self.stride);
            let at = |index: usize| low + IVec3::from_array(cases::corner(index)) * stride;
            let face = |indices: [usize; 4]| {
                indices.into_iter().fold(0, |case, i| case | usize::from(self.view.is_solid(at(i))) << i)
            };
            let below = match upper {
                Some((at, solid)) if at == y => solid,
                _ => face([0, 1, 4, 5]),
            };
            let above = face([2, 3, 6, 7]);
            upper = Some((y + stride, above >> 2));
            for triangle in cases::table()[below | above].triangles() {
                let triangle = triangle.map(|edge| {
                    let (corner, axis) = cases::edge_corners(edge);
                    self.edge_number(Edge { p: at(corner), axis, length: stride })
                });
                self.builder.emit(triangle);
            }
        }
    }

    /// The vertex of a lattice edge that the surface crosses, of this level or of the next finer one.
    pub fn edge_number(&mut self, edge: Edge) -> Number {
        if let Some(&number) = self.edges.get(&edge) {
            return number;
        }
        let (view, origin) = (self.view, self.low.at(0));
        let is_between_levels = self.is_between_levels(edge);
        let vertex = edge.vertex(&view, origin, is_between_levels, || self.is_on_border(edge));
        let number = self.builder.number(vertex);
        self.edges.insert(edge, number);
        number
    }

    /// Returns `true` if nodes of different levels meet at an edge.
    fn is_between_levels(&self, edge: Edge) -> bool {
        let drawn = edge.drawn(&self.view);
        let is_inside = |low: i32, high: i32, at: i32| low < at && at < high;
        let is_inner = (edge.axis == 0 || is_inside(self.low.x, self.high.x, drawn.p.x))
            && (edge.axis == 2 || is_inside(self.low.z, self.high.z, drawn.p.z));
        !is_inner && self.view.is_between_levels(drawn.p, edge.axis)
    }

    /// Returns `true` if an edge of this level lies between a volumetric cell and one that stays heightmap.
    fn is_on_border(&mut self, edge: Edge) -> bool {
        if edge.length != self.stride {
            return false;
        }
        let (Column { x, z }, s) = (Column::of(edge.p), self.stride);
        let cells: &[(i32, i32)] = match edge.axis {
            0 => &[(x, z - s), (x, z)],
            1 => &[(x - s, z - s), (x, z - s), (x - s, z), (x, z)],
            _ => &[(x - s, z), (x, z)],
        };
        let (mut some, mut all) = (false, true);
        for &(x, z) in cells {
            let low = Column::new(x, z);
            if self.view.level_at(low) == Some(self.level) {
                let is = self.volumetric.contains(Cell::new(low, s));
                (some, all) = (some || is, all && is);
            }
        }
        some && !all
    }

    /// The vertex of the heightmap over a column, which may lie between two of the node's columns, or beyond the rim.
    fn height_number(&mut self, column: Column) -> Number {
        let column = Column::of(self.view.drawn(column.at(0)));
        if let Some(number) = self.builder.column_at(column) {
            return number;
        }
        let origin = self.low.at(0);
        let vertex = if self.has_bricks {
            shared_height_vertex(&self.view, column, origin)
        } else {
            let between = self.between.get(&column).copied();
            between.unwrap_or_else(|| height_vertex(self.view.ground(), column, origin))
        };
        self.builder.number(vertex)
    }

    /// Two triangles whose sides may be lines of several vertices.
    fn heightmap_cell(&mut self, cell: Cell, is_across: bool, bent: [bool; 4], is_at_border: [bool; 4]) {
        let [a, b, c, d] = cell.corners();
        let ends = [(a, b), (b, c), (c, d), (d, a)];
        let lines: [Vec<Number>; 4] = std::array::from_fn(|side| {
            let (from, to) = ends[side];
            match self.beside[side] {
                Some(other) if is_at_border[side] && other < self.stride && bent[side] => {
                    let interval = Interval::at(cell, SIDES[side], other);
                    let mut line = self.border(interval, interval.is_fine_above());
                    if side >= 2 {
                        line.reverse();
                    }
                    line
                }
                _ => {
                    let mut line = Vec::new();
                    self.line(from, to, bent[side], &mut line);
                    line
                }
            }
        });
        let [ab, bc, cd, da] = &lines;
        let halves = if is_across { [(da, ab), (bc, cd)] } else { [(ab, bc), (cd, da)] };
        halves
            .into_iter()
            .for_each(|(first, second)| fan(first, second, |triangle| self.builder.emit(triangle)));
    }

    /// What the cells on one side of an undisturbed interval draw of the ground: straight edges and chains.
    pub fn border(&mut self, interval: Interval, is_above: bool) -> Vec<Number> {
        let (stride, mut line) = (interval.stride(is_above), Vec::new());
        let steep = self.view.ground().steep_cells().filter(|_| stride == 1);
        for at in (interval.start..interval.start + interval.coarse()).step_by(stride as usize) {
            let cell = interval.cell(at, is_above);
            // Steep cells bend the sides of their neighbours, even where they are not drawn themselves.
            let is_steep = steep.is_some_and(|steep| {
                let Column { x, z } = interval.column(at);
                let across = if interval.axis == 0 { Column::new(x - 1, z) } else { Column::new(x, z - 1) };
                steep.contains(Column::new(x, z)) || steep.contains(across)
            });
            let has_cell = self.view.world.grid.has_cell(cell.low);
            let is_chain = is_steep || has_cell && self.volumetric.contains(cell);
            line.pop();
            self.line(interval.column(at), interval.column(at + stride), is_chain, &mut line);
        }
        // Beyond the rim, vertices repeat.
        line.dedup();
        line
    }

    /// Adds one side of a cell: both its ends, and between them the vertices of the pristine surface if it is a chain.
    fn line(&mut self, from: Column, to: Column, is_chain: bool, line: &mut Vec<Number>) {
        line.push(self.height_number(from));
        if is_chain {
            let ground = self.view.ground();
            let stride = (to.x - from.x).abs() + (to.z - from.z).abs();
            let (h_from, h_to) = (ground.height(from), ground.height(to));
            let before = line.len();
            for y in self.view.sheet(&[from, to], stride).step_by(stride as usize) {
                if (y * ONE < h_from) != (y * ONE < h_to) {
                    line.push(self.edge_number(Edge::between(from.at(y), to.at(y))));
                }
            }
            if h_to < h_from {
                line[before..].reverse();
            }
        }
        line.push(self.height_number(to));
    }

    /// Closes the sides of cells towards finer nodes.
    fn close_sides(&mut self) {
        if self.volumetric.near.is_empty() {
            return;
        }
        let [across, down] = self.cell_counts();
        for (side, step) in SIDES.into_iter().enumerate() {
            let Some(other) = self.beside[side].filter(|&other| other < self.stride) else { continue };
            let (count, at): (usize, fn(usize, [usize; 2]) -> [usize; 2]) = match side {
                0 => (down, |at, _| [0, at]),
                1 => (across, |at, [_, down]| [at, down - 1]),
                2 => (down, |at, [across, _]| [across - 1, at]),
                _ => (across, |at, _| [at, 0]),
            };
            for place in 0..count {
                let cell = self.cell_at(at(place, [across, down]));
                self.close_side(cell, Interval::at(cell, step, other));
            }
        }
    }

    /// The edited samples of the next finer lattice under a column.
    pub fn finer_rows(&self, column: Column, step: i32, rows: &mut Vec<i32>) {
        self.volumetric.near.edited_rows(column, step, rows);
    }
}
