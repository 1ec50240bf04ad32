//! The vertex of a lattice edge of any length (rules 8 and 9).
//!
//! A vertex depends on heights, edits and its edge alone, so changing the level of detail moves none. Where nodes of
//! different levels meet, vertices of edges of different lengths may lie at the same place; there, all of them are the
//! vertex of the shortest.

use glam::IVec3;

use super::Fault;
use super::view::LodView;
use crate::ground::{Ground, MaterialId};
use crate::lattice::{Column, ONE, SNAP};
use crate::surface::Vertex;
use crate::surface::vertex::{
    Lattice, WorldView, ground_materials, height_vertex, lerp_normal_over, linear_over, sheet_vertex, vertex,
};

const AXES: [IVec3; 3] = [IVec3::X, IVec3::Y, IVec3::Z];

/// An edge of some level's lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Edge {
    /// The edge's lower end.
    pub p: IVec3,
    /// The axis it runs along.
    pub axis: usize,
    /// In voxels.
    pub length: i32,
}

/// The world seen by vertices that do not lie on the mask's border.
struct Borderless<'a>(WorldView<'a>);

impl Lattice for Borderless<'_> {
    fn distance(&self, point: IVec3) -> i32 {
        self.0.distance(point)
    }
    fn is_edited(&self, point: IVec3) -> bool {
        self.0.is_edited(point)
    }
    fn stored_material(&self, point: IVec3) -> MaterialId {
        self.0.stored_material(point)
    }
    fn ground(&self) -> &Ground {
        self.0.ground()
    }
    fn is_volumetric(&self, _: Column) -> Option<bool> {
        None
    }
}

impl Edge {
    /// The edge between two points that differ along one axis.
    pub fn between(a: IVec3, b: IVec3) -> Self {
        let (p, size) = (a.min(b), (a - b).abs());
        let axis = (0..3).find(|&axis| size[axis] != 0).unwrap_or_default();
        Self { p, axis, length: size[axis] }
    }

    /// The edge's upper end.
    pub fn q(self) -> IVec3 {
        self.p + AXES[self.axis] * self.length
    }

    pub fn is_pristine(self, view: &LodView) -> bool {
        !view.is_edited(self.p) && !view.is_edited(self.q())
    }

    fn is_crossed(self, view: &LodView) -> bool {
        view.is_solid(self.p) != view.is_solid(self.q())
    }

    /// Both halves of the edge.
    fn halves(self) -> [Self; 2] {
        let length = self.length / 2;
        [Self { length, ..self }, Self { p: self.p + AXES[self.axis] * length, length, ..self }]
    }

    /// The half of a crossed edge that is itself crossed.
    #[cfg(test)]
    pub fn half(self, view: &LodView) -> Self {
        let [low, high] = self.halves();
        if low.is_crossed(view) { low } else { high }
    }

    /// Rule 8: while an end is edited, an edge gives way to its half whose ends differ in sign.
    pub fn descended(mut self, view: &LodView) -> Self {
        if view.has(Fault::NoDescent) {
            return self;
        }
        let own = if view.has(Fault::OwnDescent) { stride_at(view, self.p) } else { 1 };
        let [mut low, mut high] = [self.p, self.q()].map(|end| view.state(end));
        while self.length > own && (low.0 || high.0) {
            let halves = self.halves();
            let middle = view.state(halves[1].p);
            // The half whose ends differ in sign.
            (self, low, high) =
                if low.1 != middle.1 { (halves[0], low, middle) } else { (halves[1], middle, high) };
        }
        self
    }

    /// Rule 9: the edge as it is drawn.
    pub fn drawn(self, view: &LodView) -> Self {
        if view.has(Fault::OverTheRim) {
            return self;
        }
        let (p, q) = (view.drawn(self.p), view.drawn(self.q()));
        Self { p, length: (q - p)[self.axis], ..self }
    }

    /// The vertex of an edge with a crossing, relative to `origin`. `is_between_levels` says whether nodes of
    /// different levels meet at it, `is_on_border` whether it lies on the border of the mask of its level.
    pub fn vertex(
        self,
        view: &LodView,
        origin: IVec3,
        is_between_levels: bool,
        is_on_border: impl FnOnce() -> bool,
    ) -> Vertex {
        let last = self.descended(view);
        let drawn = last.drawn(view);
        if last.is_pristine(view) {
            if is_between_levels {
                return last.shortest(view, origin);
            }
            if last.length > 1 || is_on_border() {
                return drawn.sheet_vertex(view.ground(), origin);
            }
        }
        drawn.edited_vertex(view, origin)
    }

    /// The vertex of an edge of one voxel that is not on the mask's border.
    fn edited_vertex(self, view: &LodView, origin: IVec3) -> Vertex {
        if self.length != 1 {
            // Only where a rule is broken.
            return self.linear_vertex(view, origin);
        }
        vertex(&Borderless(view.world), self.p, self.axis, origin)
    }

    /// The vertex of an edge that is not descended. Only for broken rules.
    pub fn linear_vertex(self, view: &LodView, origin: IVec3) -> Vertex {
        let drawn = self.drawn(view);
        let sheet = drawn.sheet_vertex(view.ground(), origin);
        if self.is_pristine(view) {
            return sheet;
        }
        let [p, q] = [self.p, self.q()].map(|end| view.world.samples.distance(view.drawn(end)));
        let step = linear_over(p, q, drawn.length.max(1));
        Vertex { position: (drawn.p - origin) * SNAP + AXES[self.axis] * step, ..sheet }
    }

    /// The vertex where the pristine surface crosses a drawn edge.
    fn sheet_vertex(self, ground: &Ground, origin: IVec3) -> Vertex {
        let (p, q, length) = (self.p, self.q(), self.length);
        match (self.axis, length) {
            (1, _) => height_vertex(ground, Column::of(p), origin),
            (axis, 1) => sheet_vertex(ground, p, axis, origin),
            (axis, _) => {
                let step = self.sheet_step(ground);
                let solid = if ground.distance(p) < 0 { p } else { q };
                let [a, b] = [p, q].map(|end| ground.normal(Column::of(end)));
                Vertex {
                    position: (p - origin) * SNAP + AXES[axis] * step,
                    normal: lerp_normal_over(a, b, step, length),
                    materials: ground_materials(ground, [p, q], step / length.max(1), solid),
                }
            }
        }
    }

    /// Where the pristine surface crosses an edge that lies level, in 1/4096 voxel from its lower end.
    fn sheet_step(self, ground: &Ground) -> i32 {
        linear_over(ground.distance(self.p), ground.distance(self.q()), self.length.max(1))
    }

    /// Where the vertex of an edge that descends no further is, in 1/4096 voxel.
    fn place(self, view: &LodView) -> IVec3 {
        let drawn = self.drawn(view);
        let step = match (self.is_pristine(view), self.axis) {
            (true, 1) => (view.ground().height(Column::of(drawn.p)) - drawn.p.y * ONE) * (SNAP / ONE),
            (true, _) => drawn.sheet_step(view.ground()),
            (false, _) => {
                linear_over(view.world.distance(drawn.p), view.world.distance(drawn.q()), drawn.length.max(1))
            }
        };
        drawn.p * SNAP + AXES[self.axis] * step
    }

    /// Where levels meet: the vertex of a pristine edge, or that of the shortest of its parts which have one at the
    /// same place.
    fn shortest(mut self, view: &LodView, origin: IVec3) -> Vertex {
        if view.has(Fault::OwnVertices) {
            return self.drawn(view).sheet_vertex(view.ground(), origin);
        }
        if self.axis == 1 {
            return shared_height_vertex(view, Column::of(view.drawn(self.p)), origin);
        }
        let place = self.place(view);
        while self.length > 1 {
            let [low, high] = self.halves();
            let middle = view.drawn(high.p);
            if place == middle * SNAP {
                if view.ground().height(Column::of(middle)) == middle.y * ONE {
                    return shared_height_vertex(view, Column::of(middle), origin);
                }
                break;
            }
            let half = if place[self.axis] < middle[self.axis] * SNAP { low } else { high };
            if !half.is_crossed(view) {
                break;
            }
            let next = half.descended(view);
            if next.place(view) != place {
                break;
            }
            self = next;
            if !self.is_pristine(view) {
                return self.drawn(view).edited_vertex(view, origin);
            }
        }
        self.drawn(view).sheet_vertex(view.ground(), origin)
    }
}

/// The heightmap's vertex over a column where levels meet. Where edits left the surface at the same height, finer nodes
/// may have the vertex of an edge of one voxel there, so it is that one.
pub(super) fn shared_height_vertex(view: &LodView, column: Column, origin: IVec3) -> Vertex {
    let height = view.ground().height(column);
    let edge = Edge { p: column.at(crate::lattice::ceil(height) - 1), axis: 1, length: 1 };
    let is_shared =
        !edge.is_pristine(view) && edge.is_crossed(view) && edge.place(view).y == height * (SNAP / ONE);
    if is_shared { edge.edited_vertex(view, origin) } else { height_vertex(view.ground(), column, origin) }
}

/// The stride of the node over a point.
fn stride_at(view: &LodView, point: IVec3) -> i32 {
    let last = view.last();
    let cell = Column::new(point.x.min(last.x - 1), point.z.min(last.z - 1));
    1 << view.level_at(cell).unwrap_or_default()
}
