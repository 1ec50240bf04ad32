//! Data that all blocks of one stack of bricks share: heights, cells of the mask and the world's rim, normals and
//! materials of columns.

use std::ops::RangeInclusive;

use glam::Vec3;

use super::layer_bits::{self, LayerBits, PLACES, SIDE};
use super::mask::WINDOW;
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
    pub mask: LayerBits,
    /// Lattice edges along x, y and z on the mask's border, once [`Self::is_border`] has been asked.
    borders: Option<[u128; 3]>,
    view: WorldView<'a>,
    /// Results of [`Self::normal`].
    normals: [Option<Vec3>; 81],
    /// Results of [`Self::mixes`].
    mixes: [Option<[MaterialMix; 2]>; 81],
    /// The material of all columns of the world, if they have only one.
    single: Option<MaterialMix>,
}

impl<'a> Stack<'a> {
    /// Looks at the stack of bricks (x, z).
    pub fn new(view: &WorldView<'a>, (x, z): (i32, i32)) -> Self {
        let (low, ground) = (Column::new(x * 8, z * 8), view.samples.ground());
        let own = view.mask.word((x, z));
        Self {
            ground,
            low,
            pristine: PristineStack::new(ground, (x, z)),
            mask: layer_bits::spread(own),
            borders: None,
            view: *view,
            normals: [None; 81],
            mixes: [None; 81],
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

    /// Returns `true` if the lattice edge from a corner along an axis lies between a volumetric cell and one
    /// that stays heightmap.
    pub fn is_border(&mut self, corner: usize, axis: usize) -> bool {
        let place = &PLACES[corner];
        let stack = self.pristine.stack;
        let WorldView { mask, grid, .. } = self.view;
        let edges = self.borders.get_or_insert_with(|| mask.border_edges(grid, stack));
        edges[axis] >> ((place.z + 1) * WINDOW + place.x + 1) & 1 == 1
    }

    /// The height over a corner.
    pub fn height(&self, corner: usize) -> i32 {
        self.pristine.heights.as_flattened()[PLACES[corner].padded]
    }

    fn column(&self, corner: usize) -> Column {
        self.low.offset(PLACES[corner].x, PLACES[corner].z)
    }

    /// The material of all ground, if it is the same everywhere.
    pub fn single_mix(&self) -> Option<MaterialMix> {
        self.single
    }

    /// Returns `true` if the ground's material differs from voxel to voxel.
    pub fn has_own_materials(&self) -> bool {
        self.ground.has_own_materials()
    }

    /// The pristine world.
    pub fn ground(&self) -> &'a Ground {
        self.ground
    }

    /// The tile's normal over a corner.
    pub fn normal(&mut self, corner: usize) -> Vec3 {
        let (column, at) = (self.column(corner), PLACES[corner].padded);
        *self.normals[corner].get_or_insert_with(|| {
            let height = |at: usize| self.pristine.heights.as_flattened()[at];
            let (x, z) = ([height(at - 1), height(at + 1)], [height(at - SIDE), height(at + SIDE)]);
            self.ground.inner_normal(column, x, z).unwrap_or_else(|| self.ground.normal(column))
        })
    }

    /// The materials of a corner's column: near the surface, and below the overlay.
    pub fn mixes(&mut self, corner: usize) -> [MaterialMix; 2] {
        let column = self.column(corner);
        *self.mixes[corner].get_or_insert_with(|| {
            let material = self.ground.column_material(column);
            [MaterialMix::column(material), MaterialMix::pure(material.base)]
        })
    }
}
