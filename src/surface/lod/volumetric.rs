//! Which cells of which level marching cubes draws (rule 2): those over whose sheet something is edited, and those that
//! are promoted because something is edited at an interval between two levels.

use rustc_hash::FxHashMap;

use super::Fault;
use super::near_bricks::NearBricks;
use super::sides::{Cell, Interval, SIDES};
use super::view::LodView;
use crate::lattice::Column;
use crate::lod::Node;

/// The volumetric cells in and around a node.
pub(super) struct Volumetric<'a> {
    pub view: LodView<'a>,
    pub near: NearBricks<'a>,
    known: FxHashMap<Cell, bool>,
}

impl<'a> Volumetric<'a> {
    /// The volumetric cells in a node, and around it as far as its mesh depends on them.
    pub fn new(view: &LodView<'a>, node: Node) -> Self {
        let (low, high) = view.cut.grid().columns(node);
        let (stride, last) = (node.stride(), view.last());
        // A neighbouring cell may be promoted by an interval twice its width.
        let by = 2 * stride;
        let clamp = |column: Column| Column::new(column.x.clamp(0, last.x), column.z.clamp(0, last.z));
        let around = [clamp(low.offset(-by, -by)), clamp(high.offset(by, by))];
        let near = NearBricks::new(&view.world.samples, &view.stacks, around, (stride / 2).max(1), last);
        Self { view: *view, near, known: FxHashMap::default() }
    }

    /// Returns `true` if marching cubes draws the sheet of this cell, which must lie in a node of its level.
    pub fn contains(&mut self, cell: Cell) -> bool {
        if self.near.is_empty() {
            return false;
        }
        if let Some(&known) = self.known.get(&cell) {
            return known;
        }
        let is = self.is_disturbed(cell) || self.is_promoted(cell);
        self.known.insert(cell, is);
        is
    }

    /// Rule 2: returns `true` if a sample of the cell's sheet is edited.
    fn is_disturbed(&self, cell: Cell) -> bool {
        match cell.stride {
            1 => self.view.world.mask.contains(cell.low),
            stride => self.is_sheet_edited(&cell.corners(), stride, stride),
        }
    }

    fn is_sheet_edited(&self, columns: &[Column], stride: i32, step: i32) -> bool {
        let sheet = self.view.sheet(columns, stride);
        columns.iter().any(|&column| self.near.is_any_edited(column, sheet.start..=sheet.end, step))
    }

    /// Where levels meet, a disturbed interval makes all cells along it volumetric, on both sides.
    pub fn is_promoted(&self, cell: Cell) -> bool {
        if self.view.has(Fault::NodePromotion) {
            return self.is_any_promoted(cell);
        }
        !self.view.has(Fault::NoPromotion) && self.is_promoted_itself(cell)
    }

    fn is_promoted_itself(&self, cell: Cell) -> bool {
        SIDES
            .into_iter()
            .filter_map(|side| self.interval(cell, side))
            .any(|at| self.is_interval_disturbed(at))
    }

    /// The interval at a cell's side, if cells across it are of another level.
    pub fn interval(&self, cell: Cell, side: (i32, i32)) -> Option<Interval> {
        let other = 1 << self.view.level_at(cell.beside(side).low)?;
        (other != cell.stride).then(|| Interval::at(cell, side, other))
    }

    /// The sheet of an interval is of coarse cubes over all its columns, and every fine sample in it counts.
    pub fn is_interval_disturbed(&self, interval: Interval) -> bool {
        self.is_sheet_edited(&interval.columns(), interval.coarse(), interval.fine())
    }

    /// Returns `true` if a cell in the same node is promoted. Only for a rule broken on purpose.
    fn is_any_promoted(&self, cell: Cell) -> bool {
        let (grid, level) = (self.view.cut.grid(), cell.stride.trailing_zeros() as u8);
        let (low, high) = grid.columns(Node::over(grid.chunks().tile_of_cell(cell.low), level));
        let along = |low: i32, high: i32| (low..high).step_by(cell.stride as usize);
        along(low.z, high.z)
            .flat_map(|z| along(low.x, high.x).map(move |x| Column::new(x, z)))
            .any(|low| self.is_promoted_itself(Cell { low, ..cell }))
    }
}
