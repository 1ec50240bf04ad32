//! Cells of any level, and the intervals where cells of two levels meet.

use glam::IVec3;

use crate::lattice::Column;

/// A cell of some level, named by its lowest column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Cell {
    pub low: Column,
    pub stride: i32,
}

/// Steps to the neighbours of a cell, in the order of its sides a-b, b-c, c-d, d-a.
pub(super) const SIDES: [(i32, i32); 4] = [(-1, 0), (0, 1), (1, 0), (0, -1)];

impl Cell {
    pub const fn new(low: Column, stride: i32) -> Self {
        Self { low, stride }
    }

    /// The cell's four columns, counter-clockwise seen from above.
    pub const fn corners(self) -> [Column; 4] {
        let (low, stride) = (self.low, self.stride);
        [low, low.offset(0, stride), low.offset(stride, stride), low.offset(stride, 0)]
    }

    /// The cell one stride away.
    pub const fn beside(self, (dx, dz): (i32, i32)) -> Self {
        Self { low: self.low.offset(dx * self.stride, dz * self.stride), ..self }
    }
}

/// A side of a coarse cell that it shares with two finer ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    /// The axis across it, x (0) or z (2).
    pub axis: usize,
    /// Where the interval is along that axis.
    plane: i32,
    /// Where the interval begins along the other one.
    pub start: i32,
    /// The strides of the cells below and above the plane.
    strides: [i32; 2],
}

impl Interval {
    /// The one that a cell's side lies in, across which cells have another stride.
    pub fn at(cell: Cell, side: (i32, i32), other: i32) -> Self {
        let (Column { x, z }, own) = (cell.low, cell.stride);
        let (axis, across, along) = if side.0 != 0 { (0, x, z) } else { (2, z, x) };
        let start = along.div_euclid(own.max(other)) * own.max(other);
        if side.0 + side.1 > 0 {
            Self { axis, plane: across + own, start, strides: [own, other] }
        } else {
            Self { axis, plane: across, start, strides: [other, own] }
        }
    }

    pub fn coarse(self) -> i32 {
        self.strides[0].max(self.strides[1])
    }

    pub fn fine(self) -> i32 {
        self.strides[0].min(self.strides[1])
    }

    /// The stride of the cells below or above the plane.
    pub fn stride(self, is_above: bool) -> i32 {
        self.strides[usize::from(is_above)]
    }

    /// Returns `true` if the finer cells are those above the plane.
    pub fn is_fine_above(self) -> bool {
        self.strides[1] < self.strides[0]
    }

    /// The axis along it.
    pub fn along(self) -> usize {
        2 - self.axis
    }

    pub fn column(self, along: i32) -> Column {
        if self.axis == 0 { Column::new(self.plane, along) } else { Column::new(along, self.plane) }
    }

    pub fn point(self, along: i32, y: i32) -> IVec3 {
        self.column(along).at(y)
    }

    /// The interval's columns at the finer stride.
    pub fn columns(self) -> [Column; 3] {
        [0, self.fine(), self.coarse()].map(|step| self.column(self.start + step))
    }

    /// The cell below or above the plane that begins here along it.
    pub fn cell(self, along: i32, is_above: bool) -> Cell {
        let stride = self.stride(is_above);
        let by = if is_above { 0 } else { -stride };
        let Column { x, z } = self.column(along);
        Cell::new(if self.axis == 0 { Column::new(x + by, z) } else { Column::new(x, z + by) }, stride)
    }
}
