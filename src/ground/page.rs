//! Columns at equal distances, as coarse levels of detail draw them.

use std::iter::zip;

use glam::Vec3;

use super::material::ColumnMaterial;
use super::pages::Pages;
use super::rise::{Rise, normal_of, slope_of, squared_slope_of};
use super::stored_materials::Materials;
use super::world::Ground;
use crate::lattice::Column;

/// The coarsest stride at which a ground with a source computes pages, to keep them. Coarser, points are fewer.
const FINE: i32 = 2;

/// Heights, normals and surface materials of columns at equal distances, x fastest: what [`Ground::height`],
/// [`Ground::normal`] and [`Ground::surface_material`] give for each.
pub(crate) struct GroundPage {
    /// In 1/256 voxel.
    pub heights: Vec<i32>,
    pub normals: Vec<Vec3>,
    pub materials: Vec<ColumnMaterial>,
}

/// Coordinates along x and along z of columns at equal distances, those beyond the rim clamped to it.
struct Coordinates([Vec<i32>; 2]);

impl Coordinates {
    fn new(ground: &Ground, low: Column, stride: i32, [width, depth]: [usize; 2]) -> Self {
        let along = |low: i32, count: usize, last: i32| {
            let at = |step: usize| i64::from(low) + i64::from(stride) * step as i64;
            (0..count).map(|step| at(step).clamp(0, last.into()) as i32).collect()
        };
        Self([along(low.x, width, ground.width()), along(low.z, depth, ground.depth())])
    }

    /// The coordinates of the neighbours, one step along an axis.
    fn beside(&self, ground: &Ground, axis: usize, step: i32) -> Self {
        let Self([x, z]) = self;
        let beside = |list: &[i32], last: i32| list.iter().map(|at| (at + step).clamp(0, last)).collect();
        Self(match axis {
            0 => [beside(x, ground.width()), z.clone()],
            _ => [x.clone(), beside(z, ground.depth())],
        })
    }

    fn columns(&self) -> impl Iterator<Item = Column> {
        let Self([xs, zs]) = self;
        zs.iter().flat_map(|&z| xs.iter().map(move |&x| Column::new(x, z)))
    }

    /// Heights asked of a source.
    fn points(&self, pages: &Pages, stride: i32) -> Vec<i32> {
        let Self([xs, zs]) = self;
        pages.points([xs, zs], stride)
    }
}

impl Ground {
    /// Heights, normals and surface materials of a grid of columns a stride apart, from `low` on. Columns
    /// beyond the rim are like the nearest ones on it. With a source, coarse strides ask only for these
    /// columns and their neighbours.
    pub(crate) fn page(&self, low: Column, stride: i32, count: [usize; 2]) -> GroundPage {
        let columns = Coordinates::new(self, low, stride, count);
        match self.pages().filter(|_| stride > FINE) {
            Some(pages) => self.point_page(pages, &columns, stride),
            None => GroundPage {
                heights: columns.columns().map(|column| self.height(column)).collect(),
                normals: columns.columns().map(|column| self.normal(column)).collect(),
                materials: columns.columns().map(|column| self.surface_material(column)).collect(),
            },
        }
    }

    /// Heights of a page's columns, in 1/256 voxel.
    pub(crate) fn page_heights(&self, low: Column, stride: i32, count: [usize; 2]) -> Vec<i32> {
        let columns = Coordinates::new(self, low, stride, count);
        // Every other column is a quarter of them: cheaper than whole pages, which heights with normals would need.
        match self.pages().filter(|_| stride > 1) {
            Some(pages) => columns.points(pages, stride),
            None => columns.columns().map(|column| self.height(column)).collect(),
        }
    }

    fn point_page(&self, pages: &Pages, columns: &Coordinates, stride: i32) -> GroundPage {
        let heights = columns.points(pages, stride);
        let around = |axis| {
            let ends = [-1, 1].map(|step| columns.beside(self, axis, step).points(pages, stride));
            let lasts = [self.width(), self.depth()];
            let [before, after] = ends;
            let run = move |column: Column| {
                let at = [column.x, column.z][axis];
                if at == 0 || at == lasts[axis] { 1 } else { 2 }
            };
            zip(zip(before, after), columns.columns())
                .map(move |((before, after), column)| Rise { rise: after - before, run: run(column) })
        };
        let rises: Vec<[Rise; 2]> = zip(around(0), around(1)).map(|(x, z)| [x, z]).collect();
        let normals = rises.iter().map(|&rises| normal_of(rises)).collect();

        let Coordinates([xs, zs]) = columns;
        let places = || zip(columns.columns(), zip(&heights, &rises));
        let mut materials: Vec<ColumnMaterial> = match self.materials() {
            Materials::OnDemand(None) => pages.point_materials([xs, zs], stride),
            Materials::OnDemand(Some(control)) => places()
                .map(|(column, (&height, &rises))| {
                    control.of_column(self, column, || (height, slope_of(rises)))
                })
                .collect(),
            Materials::Uniform(material) => vec![*material; heights.len()],
            Materials::Columns(_) => columns.columns().map(|column| self.column_material(column)).collect(),
        };
        if self.has_own_materials() {
            for (material, (column, (&height, &rises))) in zip(&mut materials, places()) {
                let squared_slope = squared_slope_of(rises);
                *material = ColumnMaterial::solid(self.lone_top((column, height, squared_slope), *material));
            }
        }
        GroundPage { heights, normals, materials }
    }
}
