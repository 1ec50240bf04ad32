//! Whether a plant stands in a world.

use std::ops::RangeInclusive;

use super::plants::{Plant, Scatter};
use super::species::Rule;
use crate::lattice::{BRICK, Column, LatticeBox, ONE, ceil};
use crate::surface::mask::cell_sheet;
use crate::terrain::World;
use crate::volume::Sample;

impl Scatter {
    /// Whether a plant of this scatter stands in a world: its cell is drawn as heightmap, and in its clearance the
    /// ground is there and the air is free.
    pub fn stands(&self, world: &World, plant: &Plant) -> bool {
        let Some(rule) = self.rules.get(usize::from(plant.id.species)) else { return false };
        if world.stacks.is_empty() {
            return true;
        }
        let (low, high) = clearance(rule, plant);
        if !has_edits(world, low, high) {
            return true;
        }
        !world.mask().contains(plant.cell()) && has_clearance(rule, world, plant)
    }

    /// Whether a plant of this scatter is gone although the ground at its foot and in its clearance is the one it grew
    /// on: its [`removal`](Plant::removal), that of a neighbour, or a coat of
    /// [`MaterialId::GROUND`](crate::ground::MaterialId::GROUND) took it away. Returns `false` for a plant that stands,
    /// and for one whose ground was dug, built over or painted.
    pub fn is_felled(&self, world: &World, plant: &Plant) -> bool {
        let Some(rule) = self.rules.get(usize::from(plant.id.species)) else { return false };
        let (cell, sheet) = (plant.cell(), cell_sheet(world.ground(), plant.cell()));
        let is_as_it_was = |at: Column| is_as_it_was(world, at, sheet.start..=sheet.end);
        world.mask().contains(cell)
            && cell.corners().into_iter().all(is_as_it_was)
            && has_clearance(rule, world, plant)
    }

    /// How far, in voxels along x and z, an edit may lie from the plants that it removes.
    pub fn reach(&self) -> i32 {
        self.rules.iter().map(super::species::Rule::reach).max().unwrap_or_default()
    }

    /// The columns whose plants may go or return when these samples change: lowest and highest cell.
    pub fn affected(&self, samples: LatticeBox) -> (Column, Column) {
        let reach = self.reach();
        let low = Column::of(samples.min).offset(-reach, -reach);
        (low, Column::of(samples.max).offset(reach, reach))
    }
}

/// A length of a plant's rule at the plant's size.
fn scaled(length: i32, plant: &Plant) -> i32 {
    (i64::from(length) * i64::from(plant.size) / i64::from(ONE)) as i32
}

/// The columns around a plant's clearance: lowest and highest.
fn clearance(rule: &Rule, plant: &Plant) -> (Column, Column) {
    let radius = scaled(rule.clearance_radius, plant);
    let along = |from: i32| ((from - radius).div_euclid(ONE), (from + radius).div_euclid(ONE) + 1);
    let ((low_x, high_x), (low_z, high_z)) = (along(plant.x), along(plant.z));
    (Column::new(low_x, low_z), Column::new(high_x, high_z))
}

/// Whether the ground is there and the air is free in a plant's clearance.
fn has_clearance(rule: &Rule, world: &World, plant: &Plant) -> bool {
    // The sheet of its own cell is all of its clearance.
    if rule.clearance_radius == 0 && rule.clearance_height == 0 {
        return true;
    }
    let (radius, cell, (low, high)) =
        (scaled(rule.clearance_radius, plant), plant.cell(), clearance(rule, plant));
    let height = scaled(rule.clearance_height, plant);
    let top = (plant.y.div_euclid(i64::from(ONE)) as i32 + height).div_euclid(ONE);
    let squared = i64::from(radius).pow(2);
    let is_own = |at: Column| {
        let apart = |own: i32, at: i32| i64::from(at * ONE - own).pow(2);
        apart(plant.x, at.x) + apart(plant.z, at.z) <= squared
    };
    let columns = (low.z..=high.z).flat_map(|z| (low.x..=high.x).map(move |x| Column::new(x, z)));
    let mut columns = columns.filter(|&at| is_own(at) || cell.corners().contains(&at));
    columns.all(|at| is_clear(world, at, top))
}

/// Whether there are bricks over any of these columns.
fn has_edits(world: &World, low: Column, high: Column) -> bool {
    (low.z >> 3..=high.z >> 3).any(|z| (low.x >> 3..=high.x >> 3).any(|x| world.stacks.contains_key(&(x, z))))
}

/// Whether the topmost ground of a column is there, and the air above it is free up to some height.
fn is_clear(world: &World, at: Column, top: i32) -> bool {
    let Some(stack) = world.stacks.get(&(at.x >> 3, at.z >> 3)) else { return true };
    let surface = ceil(world.ground().height(at)) - 1;
    let samples = world.samples();
    let mut bricks = stack.iter().map(|y| y * BRICK);
    bricks.all(|low| {
        let mut rows = low.max(surface)..=(low + BRICK - 1).min(top);
        rows.all(|y| samples.is_solid(at.at(y)) == (y == surface))
    })
}

/// Whether the samples of some rows of a column have the density and the material of the ground, edited or not.
fn is_as_it_was(world: &World, at: Column, rows: RangeInclusive<i32>) -> bool {
    let Some(stack) = world.stacks.get(&(at.x >> 3, at.z >> 3)) else { return true };
    let (samples, ground) = (world.samples(), world.ground());
    let mut bricks = stack.iter().map(|y| y * BRICK);
    bricks.all(|low| {
        let mut rows = low.max(*rows.start())..=(low + BRICK - 1).min(*rows.end());
        rows.all(|y| {
            let point = at.at(y);
            let is_same = samples.distance(point) == ground.distance(point)
                || samples.sample(point) == Sample::edited(ground.distance(point));
            is_same && samples.material(point) == ground.material(point)
        })
    })
}
