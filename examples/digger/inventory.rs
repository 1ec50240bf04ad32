//! What was dug and not yet built: receipts fill it, and what is built is taken from it.
//!
//! A brush is answered some frames after it was sent. Until then what it may take is pledged, so that a fast hand
//! can't spend the same ground twice; the receipt says what it really took.

use bevy::prelude::*;
use bevy_burrow::plugin::{HistoryMoved, Redo, Undo};
use bevy_burrow::prelude::*;
use bevy_burrow::volume::Tally;

use crate::hud::Hint;
use crate::input::{Action, Actions};
use crate::landscape::{CONCRETE, MATERIALS};
use crate::phase::Phase;
use crate::player::Playing;

/// Tags from here on belong to the hand. Brushes of scripts have others, and cost nothing.
const FIRST: u64 = 1 << 32;

/// Voxels of each material.
#[derive(Resource, Clone, Debug)]
pub struct Inventory {
    stock: [i64; MATERIALS.len()],
    pledges: Vec<(u64, MaterialId, i64)>,
    next: u64,
}

impl Default for Inventory {
    /// Nothing but some concrete, which no hill has.
    fn default() -> Self {
        let mut inventory = Self { stock: default(), pledges: Vec::new(), next: FIRST };
        inventory.gain(CONCRETE, 600);
        inventory
    }
}

impl Inventory {
    /// A number for the hand's next brush.
    pub fn tag(&mut self) -> u64 {
        self.next += 1;
        self.next - 1
    }

    /// All voxels of a material.
    pub fn stock(&self, material: MaterialId) -> i64 {
        self.stock.get(usize::from(material.0)).copied().unwrap_or(0)
    }

    /// Voxels of a material that no brush under way may take.
    pub fn free(&self, material: MaterialId) -> i64 {
        let pledged = self.pledges.iter().filter(|pledge| pledge.1 == material).map(|pledge| pledge.2);
        self.stock(material) - pledged.sum::<i64>()
    }

    /// Keeps some of a material for a brush that is under way.
    pub fn pledge(&mut self, tag: u64, material: MaterialId, voxels: i64) {
        self.pledges.push((tag, material, voxels));
    }

    /// More of a material, or less.
    pub fn gain(&mut self, material: MaterialId, voxels: i64) {
        if let Some(stock) = self.stock.get_mut(usize::from(material.0)) {
            *stock += voxels;
        }
    }

    /// Enters what became of a brush, if it was the hand's; says what came and went.
    pub fn enter(&mut self, receipt: &Receipt) -> Vec<(MaterialId, i64)> {
        if receipt.tag < FIRST {
            return Vec::new();
        }
        self.pledges.retain(|pledge| pledge.0 != receipt.tag);
        let Ok(applied) = &receipt.outcome else { return Vec::new() };
        self.enter_tallies(&applied.removed, &applied.added)
    }

    /// Enters what came and what went; says the same as a list.
    fn enter_tallies(&mut self, removed: &Tally, added: &Tally) -> Vec<(MaterialId, i64)> {
        let came = removed.iter().map(|(material, voxels)| (material, voxels as i64));
        let went = added.iter().map(|(material, voxels)| (material, -(voxels as i64)));
        let changes: Vec<_> = came.chain(went).collect();
        for &(material, voxels) in &changes {
            self.gain(material, voxels);
        }
        changes
    }
}

/// Undo and redo give back and take, as digging and building did.
fn enter_history(
    mut steps: MessageReader<HistoryMoved>,
    mut inventory: ResMut<Inventory>,
    mut changes: MessageWriter<StockChanged>,
    mut hints: MessageWriter<Hint>,
) {
    for HistoryMoved { receipt, .. } in steps.read() {
        match &receipt.outcome {
            Ok(restored) => {
                let entered = inventory.enter_tallies(&restored.removed, &restored.added);
                changes.write_batch(entered.into_iter().map(|(material, by)| StockChanged { material, by }));
            }
            Err(nothing) => {
                hints.write(Hint::new(nothing.to_string()));
            }
        }
    }
}

/// What the keys for it say.
fn step_through_history(actions: Res<Actions>, mut undo: MessageWriter<Undo>, mut redo: MessageWriter<Redo>) {
    if actions.just_pressed(Action::Undo) {
        undo.write_default();
    }
    if actions.just_pressed(Action::Redo) {
        redo.write_default();
    }
}

/// Some of a material came or went.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct StockChanged {
    pub material: MaterialId,
    pub by: i64,
}

/// Keeps the [`Inventory`].
pub struct InventoryPlugin;

impl Plugin for InventoryPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Inventory>()
            .add_message::<StockChanged>()
            .add_systems(Update, (enter_receipts, enter_history).after(BurrowSystems::Commit))
            .add_systems(Update, step_through_history.in_set(Playing).run_if(in_state(Phase::Playing)));
    }
}

fn enter_receipts(
    mut receipts: MessageReader<BrushApplied>,
    mut inventory: ResMut<Inventory>,
    mut changes: MessageWriter<StockChanged>,
) {
    for BrushApplied { receipt, .. } in receipts.read() {
        let entered = inventory.enter(receipt);
        changes.write_batch(entered.into_iter().map(|(material, by)| StockChanged { material, by }));
    }
}

#[cfg(test)]
#[path = "inventory_tests.rs"]
mod tests;
