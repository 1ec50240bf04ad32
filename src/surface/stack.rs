//! What all blocks of one stack of bricks share: heights, cells of the mask and the world's rim, normals and materials of
//! columns.

use std::ops::RangeInclusive;

use glam::Vec3;

use super::corners::{self, Corners, PLACES, SIDE};
use super::mesh::MaterialMix;
use super::pristine::PristineStack;
use super::vertex::WorldView;
use crate::ground::Ground;
use crate::lattice::Column;

/// A stack of bricks, all with the same x and z, and the columns around it.
pub(super) struct Stack<'a> {
    ground: &'a Ground,
    /// The lowest column.
    pub low: Column,
    /// The surface without edits.
    pub pristine: PristineStack,
    /// Cells of the mask.
    pub mask: Corners,
    /// Lattice edges along x, y and z on the mask's border, once [`Self::is_border`] has been asked.
    borders: Option<[u128; 3]>,
    view: WorldView<'a>,
    normals: [Vec3; 81],
    has_normal: [bool; 81],
    /// Near the surface, and deeper than the overlay.
    mixes: [[MaterialMix; 2]; 81],
    has_mix: [bool; 81],
    /// Where all columns of the world are of one material.
    single: Option<MaterialMix>,
}

/// Cells along a side of the window in which the mask's border is found: one more on each side.
const WINDOW: i32 = 10;

impl<'a> Stack<'a> {
    /// Looks at the stack of bricks (x, z).
    pub fn new(view: &WorldView<'a>, (x, z): (i32, i32)) -> Self {
        let (low, ground) = (Column::new(x * 8, z * 8), view.samples.ground());
        let own = view.mask.word((x, z));
        Self {
            ground,
            low,
            pristine: PristineStack::new(ground, (x, z)),
            mask: corners::spread(own),
            borders: None,
            view: *view,
            normals: [Vec3::ZERO; 81],
            has_normal: [false; 81],
            mixes: [[MaterialMix::default(); 2]; 81],
            has_mix: [false; 81],
            single: ground.single_material().map(MaterialMix::pure),
        }
    }

    /// The world's columns along x and along z among those of the padded samples; `None` where all are.
    pub fn rim(&self) -> Option<[RangeInclusive<usize>; 2]> {
        let (grid, all) = (self.view.grid, 0..=SIDE - 1);
        let own = |low: i32, cells: i32| {
            let place = |at: i32| (at - low + 1).clamp(0, SIDE as i32 - 1) as usize;
            place(0)..=place(cells)
        };
        let columns = [own(self.low.x, grid.width()), own(self.low.z, grid.depth())];
        (columns != [all.clone(), all]).then_some(columns)
    }

    /// Does the lattice edge from a corner along an axis lie between a volumetric cell and one that stays heightmap?
    pub fn is_border(&mut self, corner: usize, axis: usize) -> bool {
        let place = &PLACES[corner];
        let stack = self.pristine.stack;
        let own = self.borders.get_or_insert_with(|| borders(&self.view, stack, self.view.mask.word(stack)));
        own[axis] >> ((place.z + 1) * WINDOW + place.x + 1) & 1 == 1
    }

    /// The height over a corner.
    pub fn height(&self, corner: usize) -> i32 {
        self.pristine.heights.as_flattened()[PLACES[corner].padded]
    }

    fn column(&self, corner: usize) -> Column {
        self.low.offset(PLACES[corner].x, PLACES[corner].z)
    }

    /// What all ground is made of, if it is the same everywhere.
    pub fn single_mix(&self) -> Option<MaterialMix> {
        self.single
    }

    /// The tile's normal over a corner.
    pub fn normal(&mut self, corner: usize) -> Vec3 {
        if !self.has_normal[corner] {
            self.has_normal[corner] = true;
            let (column, at) = (self.column(corner), PLACES[corner].padded);
            let height = |at: usize| self.pristine.heights.as_flattened()[at];
            let (x, z) = ([height(at - 1), height(at + 1)], [height(at - SIDE), height(at + SIDE)]);
            let inner = self.ground.inner_normal(column, x, z);
            self.normals[corner] = inner.unwrap_or_else(|| self.ground.normal(column));
        }
        self.normals[corner]
    }

    /// What a corner's column is made of: near the surface, and deeper than the overlay.
    pub fn mixes(&mut self, corner: usize) -> [MaterialMix; 2] {
        if !self.has_mix[corner] {
            self.has_mix[corner] = true;
            let material = self.ground.column_material(self.column(corner));
            self.mixes[corner] = [MaterialMix::column(material), MaterialMix::pure(material.base)];
        }
        self.mixes[corner]
    }
}

/// Edges along x, y, z between a cell of the mask and one of the heightmap, at bit `(z + 1) * 10 + x + 1`.
pub(crate) fn borders(view: &WorldView, (x, z): (i32, i32), own: u64) -> [u128; 3] {
    // Rows of a word are bytes. A window row is one bit of the word before, eight of the own, one of the word after.
    let row = |words: [u64; 3], z: i32| {
        let [before, own, after] = words.map(|word| u128::from(word >> (z * 8) & 0xff));
        before >> 7 | own << 1 | (after & 1) << 9
    };
    let words = |dz: i32| {
        [-1, 0, 1].map(|dx| if (dx, dz) == (0, 0) { own } else { view.mask.word((x + dx, z + dz)) })
    };
    let (before, level, after) = (words(-1), words(0), words(1));
    if [before, level, after].iter().flatten().all(|&word| word == 0) {
        return [0; 3];
    }
    let mut mask = row(before, 7) | row(after, 0) << (9 * WINDOW);
    for z in 0..8 {
        mask |= row(level, z) << ((z + 1) * WINDOW);
    }
    let (mut world, inside) = (0u128, |at: i32, cells: i32| (0..cells).contains(&at));
    let rim = (0..WINDOW).filter(|&dx| inside(x * 8 + dx - 1, view.grid.width()));
    let row = rim.fold(0u128, |row, dx| row | 1 << dx);
    for dz in (0..WINDOW).filter(|&dz| inside(z * 8 + dz - 1, view.grid.depth())) {
        world |= row << (dz * WINDOW);
    }
    let around = |cells: u128, axis: usize| match axis {
        0 => cells | cells << WINDOW,
        1 => cells | cells << 1 | cells << WINDOW | cells << (WINDOW + 1),
        _ => cells | cells << 1,
    };
    std::array::from_fn(|axis| around(mask, axis) & around(world & !mask, axis))
}
