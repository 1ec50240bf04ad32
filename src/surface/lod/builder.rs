//! A node's mesh under construction: columns first, then further vertices, each place once.

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::shares::{FinerShares, Shares, shares_in};
use crate::ground::{Ground, GroundPage};
use crate::lattice::{Column, ONE, SNAP};
use crate::surface::{Indices, MaterialMix, SurfaceMesh, Vertex};

/// A vertex by its number.
pub(super) type Number = u32;

/// Vertices and triangles of a node.
pub(super) struct Builder {
    /// Along x and along z, where columns are drawn: the last one may lie nearer, at the rim.
    columns: [Vec<i32>; 2],
    stride: i32,
    vertices: Vec<Vertex>,
    indices: Vec<Number>,
    places: FxHashMap<IVec3, Number>,
    /// Shares of the columns.
    shares: Shares,
    /// Which cells are split across, row by row; see [`splits_across`](Self::splits_across).
    splits: Vec<bool>,
}

/// The vertex of a page's column with this number, relative to the column `low` at y = 0.
pub(super) fn page_vertex(page: &GroundPage, number: usize, column: Column, low: Column) -> Vertex {
    let y = page.heights[number] * (SNAP / ONE);
    Vertex {
        position: IVec3::new((column.x - low.x) * SNAP, y, (column.z - low.z) * SNAP),
        normal: page.normals[number],
        materials: MaterialMix::column(page.materials[number]),
    }
}

impl Builder {
    /// A builder that begins with the columns of a node whose cells have this stride.
    pub fn new(ground: &Ground, low: Column, high: Column, stride: i32) -> Self {
        let along =
            |low: i32, high: i32| (low..high).step_by(stride as usize).chain([high]).collect::<Vec<i32>>();
        let columns = [along(low.x, high.x), along(low.z, high.z)];
        let [xs, zs] = &columns;
        let mut vertices = Vec::with_capacity(xs.len() * zs.len() + 4 * (xs.len() + zs.len()));
        let counts @ [across, down] = [xs.len(), zs.len()];
        // With those around, by which shares are found.
        let page = ground.page(low.offset(-stride, -stride), stride, [across + 2, down + 2]);
        let shares = shares_in(ground, &page, low, stride, counts);
        let inside = |at: usize| (at / across + 1) * (across + 2) + at % across + 1;
        let places = zs.iter().flat_map(|&z| xs.iter().map(move |&x| Column::new(x, z)));
        vertices.extend(places.enumerate().map(|(at, column)| page_vertex(&page, inside(at), column, low)));
        let indices = Vec::with_capacity((xs.len() - 1) * (zs.len() - 1) * 6);
        let middles = ground.page_heights(low.offset(stride / 2, stride / 2), stride, [across - 1, down - 1]);
        let is_across = |(cell, &middle): (usize, &i32)| {
            let a = cell / (across - 1) * across + cell % (across - 1);
            let height = |at: usize| i64::from(page.heights[inside(at)]);
            let miss = |from: usize, to: usize| (height(from) + height(to) - 2 * i64::from(middle)).abs();
            miss(a + across, a + 1) < miss(a, a + across + 1)
        };
        let splits = middles.iter().enumerate().map(is_across).collect();
        Self { columns, stride, vertices, indices, places: FxHashMap::default(), shares, splits }
    }

    /// Whether the cell with its lowest corner at these places is split along (x, z + s)-(x + s, z), and not along
    /// (x, z)-(x + s, z + s): the line whose middle is nearer to the ground. On a ridge that runs along the other one,
    /// each cell would be a tooth.
    pub fn splits_across(&self, [x, z]: [usize; 2]) -> bool {
        self.splits[z * (self.columns[0].len() - 1) + x]
    }

    /// How many columns there are along x and along z.
    pub fn column_counts(&self) -> [usize; 2] {
        [self.columns[0].len(), self.columns[1].len()]
    }

    /// The number of the column at these places along x and z.
    pub fn column(&self, [x, z]: [usize; 2]) -> Number {
        (z * self.columns[0].len() + x) as Number
    }

    /// The number of a column that the node has; `None` of others.
    pub fn column_at(&self, column: Column) -> Option<Number> {
        let at = |columns: &[i32], at: i32| {
            let last = columns.len() - 1;
            let place = usize::try_from((at - columns[0]).div_euclid(self.stride)).ok()?;
            let place = if at == columns[last] { last } else { place };
            (columns.get(place) == Some(&at)).then_some(place)
        };
        Some(self.column([at(&self.columns[0], column.x)?, at(&self.columns[1], column.z)?]))
    }

    /// Replaces the vertex over a column.
    pub fn set_column(&mut self, number: Number, vertex: Vertex) {
        self.vertices[number as usize] = vertex;
    }

    /// The number of a vertex; one at the same place has the same one.
    pub fn number(&mut self, vertex: Vertex) -> Number {
        let low = Column::new(self.columns[0][0], self.columns[1][0]);
        if (vertex.position.x | vertex.position.z) & (SNAP - 1) == 0
            && let Some(number) =
                self.column_at(low.offset(vertex.position.x / SNAP, vertex.position.z / SNAP))
            && self.vertices[number as usize].is_same(&vertex)
        {
            return number;
        }
        *self.places.entry(vertex.position).or_insert_with(|| {
            self.vertices.push(vertex);
            self.vertices.len() as Number - 1
        })
    }

    /// The position of a vertex.
    pub fn position(&self, number: Number) -> IVec3 {
        self.vertices[number as usize].position
    }

    /// Adds a triangle, unless two of its corners are the same vertex.
    pub fn emit(&mut self, [a, b, c]: [Number; 3]) {
        if a != b && b != c && c != a {
            self.indices.extend_from_slice(&[a, b, c]);
        }
    }

    /// The mesh, whose vertices of untouched ground have the shares of the materials that they stand for.
    pub fn finish(mut self, finer: &FinerShares) -> SurfaceMesh {
        let low = Column::new(self.columns[0][0], self.columns[1][0]);
        for number in 0..self.vertices.len() {
            let position = self.vertices[number].position;
            if (position.x | position.z) & (SNAP - 1) != 0 {
                continue;
            }
            let column = low.offset(position.x / SNAP, position.z / SNAP);
            let own = || {
                let own = self.column_at(column)? as usize;
                Some((self.shares.alone[own], self.shares.mixes[own]))
            };
            let Some((alone, mix)) = finer.get(column).or_else(own) else { continue };
            // Where edits show, a vertex has their materials.
            if self.vertices[number].materials == MaterialMix::column(alone) {
                self.vertices[number].materials = mix;
            }
        }
        SurfaceMesh { indices: Indices::new(self.vertices.len(), self.indices), vertices: self.vertices }
    }
}
