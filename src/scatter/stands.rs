//! Whether a plant stands in a world.

use super::plants::{Plant, Scatter};
use crate::lattice::{BRICK, Column, LatticeBox, ONE, ceil};
use crate::terrain::World;

impl Scatter {
    /// Whether a plant of this scatter stands in a world: its cell is drawn as heightmap, and in its clearance the ground is
    /// there and the air is free.
    pub fn stands(&self, world: &World, plant: &Plant) -> bool {
        let Some(rule) = self.rules.get(usize::from(plant.id.species)) else { return false };
        if world.stacks.is_empty() {
            return true;
        }
        let scaled = |length: i32| (i64::from(length) * i64::from(plant.size) / i64::from(ONE)) as i32;
        let (radius, cell) = (scaled(rule.clearance_radius), plant.cell());
        let low = Column::new((plant.x - radius).div_euclid(ONE), (plant.z - radius).div_euclid(ONE));
        let high =
            Column::new((plant.x + radius).div_euclid(ONE) + 1, (plant.z + radius).div_euclid(ONE) + 1);
        if !has_edits(world, low, high) {
            return true;
        }
        if world.mask().contains(cell) {
            return false;
        }
        // The unedited sheet of its own cell is all of its clearance.
        if rule.clearance_radius == 0 && rule.clearance_height == 0 {
            return true;
        }
        let top = (plant.y.div_euclid(i64::from(ONE)) as i32 + scaled(rule.clearance_height)).div_euclid(ONE);
        let squared = i64::from(radius).pow(2);
        let is_own = |at: Column| {
            let apart = |own: i32, at: i32| i64::from(at * ONE - own).pow(2);
            apart(plant.x, at.x) + apart(plant.z, at.z) <= squared
        };
        let columns = (low.z..=high.z).flat_map(|z| (low.x..=high.x).map(move |x| Column::new(x, z)));
        let mut columns = columns.filter(|&at| is_own(at) || cell.corners().contains(&at));
        columns.all(|at| is_clear(world, at, top))
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
