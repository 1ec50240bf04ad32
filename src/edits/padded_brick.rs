//! A brick with the samples around it, as they were before an edit.

use std::ops::RangeInclusive;

use glam::{IVec3, USizeVec3};

use super::prepared_edit::PreparedEdit;
use super::surface_distance::SurfaceDistance;
use crate::brush::{DEPTH, FARTHEST, Stencil, is_moved};
use crate::lattice::{BRICK, BrickPos, Column, ONE};
use crate::volume::{Brick, SampleView, row};

/// Samples along a side: the brick's and one on each side.
const SIDE: usize = BRICK as usize + 2;

/// The densities of a brick and of one sample more on all sides.
pub(super) struct PaddedBrick {
    densities: [[[i32; SIDE]; SIDE]; SIDE],
    /// Which densities are cut off, at the depth of digs and adds or at the limit of storage: a bit for each x.
    cut: [[u16; SIDE]; SIDE],
    /// Which densities are farther from zero than the pristine ones, likewise.
    moved: [[u16; SIDE]; SIDE],
    /// How far its samples are from the surface, for edits that round edges.
    pub surface: Option<SurfaceDistance>,
}

impl PaddedBrick {
    /// The samples of a brick and those around it.
    ///
    /// Not inlined, or plain edits would pay for its large stack frame.
    #[inline(never)]
    pub fn new(view: &SampleView, pos: BrickPos) -> Self {
        let low = pos.origin() - 1;
        let heights = view.ground().heights::<SIDE>(Column::of(low));
        let mut own = Self {
            densities: [[[0; SIDE]; SIDE]; SIDE],
            cut: [[0; SIDE]; SIDE],
            moved: [[0; SIDE]; SIDE],
            surface: None,
        };
        for (y, layer) in (low.y..).zip(&mut own.densities) {
            for (row, heights) in layer.iter_mut().zip(&heights) {
                row.iter_mut().zip(heights).for_each(|(density, height)| *density = y * ONE - height);
            }
        }
        for step in (0..27).map(|i| IVec3::new(i % 3, i / 9, i / 3 % 3)) {
            if let Some(brick) = view.brick(BrickPos(pos.0 + step - 1)) {
                own.enter(brick, step.as_usizevec3());
            }
        }
        let (width, depth) = (view.ground().width(), view.ground().depth());
        own.repeat_rim(inside(low.x, width), inside(low.z, depth));
        own
    }

    /// The samples of a brick and those around it, with what an edit that rounds edges needs in addition.
    pub fn for_edit(view: &SampleView, pos: BrickPos, edit: &PreparedEdit) -> Self {
        let surface = edit.rounding().map(|rounding| SurfaceDistance::new(view, pos, rounding.horizon()));
        Self { surface, ..Self::new(view, pos) }
    }

    /// Beyond the world's rim, where nothing can be edited, samples repeat those at the rim.
    fn repeat_rim(&mut self, xs: RangeInclusive<usize>, zs: RangeInclusive<usize>) {
        if (xs.clone(), zs.clone()) == (0..=SIDE - 1, 0..=SIDE - 1) {
            return;
        }
        let copy =
            |bits: &mut u16, x: usize, from: usize| *bits = *bits & !(1 << x) | (*bits >> from & 1) << x;
        let marks = self.cut.iter_mut().zip(&mut self.moved);
        for (layer, (cut, moved)) in self.densities.iter_mut().zip(marks) {
            for ((row, cut), moved) in layer.iter_mut().zip(&mut *cut).zip(&mut *moved) {
                for x in (0..SIDE).filter(|x| !xs.contains(x)) {
                    let from = x.clamp(*xs.start(), *xs.end());
                    row[x] = row[from];
                    copy(cut, x, from);
                    copy(moved, x, from);
                }
            }
            for z in (0..SIDE).filter(|z| !zs.contains(z)) {
                let from = z.clamp(*zs.start(), *zs.end());
                (layer[z], cut[z], moved[z]) = (layer[from], cut[from], moved[from]);
            }
        }
    }

    /// Enters the samples of the brick at this step, 0 to 2 along each axis, of the 27 bricks.
    fn enter(&mut self, brick: &Brick, step: USizeVec3) {
        // Where its samples go, and the first of them in the brick.
        let range = |step: usize| match step {
            0 => (0..1, 7),
            1 => (1..SIDE - 1, 0),
            _ => (SIDE - 1..SIDE, 0),
        };
        let ((xs, dx), (ys, dy), (zs, dz)) = (range(step.x), range(step.y), range(step.z));
        for (y, own_y) in ys.zip(dy..) {
            for (z, own_z) in zs.clone().zip(dz..) {
                let row = row(brick.samples(), own_y * 64 + own_z * 8);
                for (x, &sample) in xs.clone().zip(&row[dx..]) {
                    if sample != i16::MIN {
                        let density = i32::from(sample);
                        let is_cut = density.abs() == DEPTH || density.abs() == FARTHEST;
                        self.cut[y][z] |= u16::from(is_cut) << x;
                        self.moved[y][z] |= u16::from(is_moved(density, self.densities[y][z][x])) << x;
                        self.densities[y][z][x] = density;
                    }
                }
            }
        }
    }

    /// The density of one of the brick's own samples.
    pub fn density(&self, [x, y, z]: [usize; 3]) -> i32 {
        self.densities[y + 1][z + 1][x + 1]
    }

    /// One of the brick's own samples and what is around it.
    pub fn around(&self, [x, y, z]: [usize; 3]) -> Stencil {
        let mut around = Stencil { densities: [0; 27], cut: 0, moved: 0 };
        for (i, (dy, dz)) in (0..3).flat_map(|dy| (0..3).map(move |dz| (dy, dz))).enumerate() {
            let (y, z) = (y + dy, z + dz);
            around.densities[i * 3..i * 3 + 3].copy_from_slice(&self.densities[y][z][x..x + 3]);
            around.cut |= u32::from(self.cut[y][z] >> x & 7) << (i * 3);
            around.moved |= u32::from(self.moved[y][z] >> x & 7) << (i * 3);
        }
        around
    }
}

/// The padded samples along an axis that lie in a world of `cells` cells; at least one, even where none does.
fn inside(low: i32, cells: i32) -> RangeInclusive<usize> {
    let local = |at: i32| (at.saturating_sub(low)).clamp(0, SIDE as i32 - 1) as usize;
    local(0)..=local(cells)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::ground::Ground;
    use crate::volume::Bricks;

    #[test]
    fn padded_bricks_hold_the_samples_of_the_view() {
        let ground = Ground::from_fn(30, 30, |x, z| f64::from(x * 7 % 5) + f64::from(z) * 0.3).unwrap();
        let pos = BrickPos(IVec3::new(1, 0, 2));
        let mut bricks = Bricks::default();
        for (i, step) in [IVec3::ZERO, IVec3::X, IVec3::NEG_Y, IVec3::new(-1, 1, 1)].into_iter().enumerate() {
            let value = |at: usize| match at % 5 {
                kind if kind == i => DEPTH,
                kind if kind == i + 1 => -FARTHEST,
                _ => at as i32 * 7 - 900,
            };
            let samples = std::array::from_fn(|at| value(at) as i16);
            bricks.insert(BrickPos(pos.0 + step), Arc::new(Brick::of_edited(&samples)));
        }
        let view = SampleView::new(&ground, &bricks);
        let own = PaddedBrick::new(&view, pos);
        for at in pos.samples().points() {
            let local = (at - pos.origin()).as_usizevec3().to_array();
            assert_eq!(own.density(local), view.distance(at));
            let around = own.around(local);
            for (i, step) in (0..27).map(|i| (i, IVec3::new(i % 3, i / 9, i / 3 % 3) - 1)) {
                let distance = view.distance(at + step);
                assert_eq!(around.densities[i as usize], distance, "{at} {step}");
                let is_edited = view.is_edited(at + step);
                let is_cut = is_edited && (distance == DEPTH || distance == -FARTHEST);
                assert_eq!(around.cut >> i & 1 == 1, is_cut, "{at} {step}");
                let pristine = (at + step).y * ONE - ground.height(Column::of(at + step));
                let is_moved = is_edited && is_moved(distance, pristine);
                assert_eq!(around.moved >> i & 1 == 1, is_moved, "{at} {step}");
            }
        }
    }
}
