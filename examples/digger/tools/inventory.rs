//! What was dug and not yet built: receipts fill it, and what is built is taken from it.
//!
//! A brush is answered some frames after it was sent. Until then what it may take is pledged, so that a fast hand
//! can't spend the same ground twice; the receipt says what it really took. What each brush did to the stock is kept under
//! its tag: a step through history names the brushes that it takes back or does again, and the stock follows. What was
//! dug, spent and then undone is owed.
//!
//! A shovel fills as well as it takes, and nobody knows how much of what before it did. What it fills is paid for like
//! what is built: where there is too little, the rest is owed, and what is dug next pays that off first. So all ground
//! and all stock together stay what they were, however often something is dug and smoothed over.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_burrow::plugin::{HistoryMoved, Redo, Undo};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{HistoryStep, PieceFate};

use crate::player::Playing;
use crate::player::game_state::Phase;
use crate::player::input::{Action, Actions};
use crate::tools::hardness;
use crate::ui::hud::Hint;
use crate::ui::settings::Settings;
use crate::world::landscape::{CONCRETE, MATERIALS, NewGame, name};

/// Tags from here on belong to the hand. Brushes of scripts have others, and cost nothing.
pub const FIRST: u64 = 1 << 32;
/// Brushes that can be undone at most; the ground's own history ends long before.
const REMEMBERED: usize = 1 << 16;

/// So many voxels of each material more, or less.
type Change = [i64; MATERIALS.len()];

/// Voxels of each material.
#[derive(Resource, Clone, Debug)]
pub struct Inventory {
    /// Below 0 where some is owed.
    stock: Change,
    pledges: Vec<(u64, MaterialId, i64)>,
    next: u64,
    /// What brushes came to, by tag.
    worth: BTreeMap<u64, Change>,
}

impl Default for Inventory {
    /// Nothing but some concrete, which no hill has.
    fn default() -> Self {
        let mut inventory =
            Self { stock: default(), pledges: Vec::new(), next: FIRST, worth: BTreeMap::new() };
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

    /// All voxels of a material, or, negative, what is owed of it.
    pub fn stock(&self, material: MaterialId) -> i64 {
        self.stock.get(usize::from(material.0)).copied().unwrap_or(0)
    }

    /// Voxels of a material that brushes under way do not take.
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

    /// Enters what became of a brush; if it was the hand's, says what came and went. Whatever fell off is the player's
    /// as well, and paint is used up as what is built is. What there was too little of is owed, or a present.
    pub fn enter(&mut self, receipt: &Receipt, owes: bool) -> Vec<(MaterialId, i64)> {
        self.pledges.retain(|pledge| pledge.0 != receipt.tag);
        let Ok(applied) = &receipt.outcome else { return Vec::new() };
        if receipt.tag < FIRST {
            return Vec::new();
        }
        let fallen = applied.loose.iter().filter(|piece| piece.fate != PieceFate::Left);
        let came = fallen.map(|piece| &piece.materials).chain([&applied.removed]);
        let came = came.flat_map(|tally| tally.iter()).map(|(material, voxels)| (material, voxels as i64));
        let went = [&applied.added, &applied.painted].into_iter().flat_map(|tally| tally.iter());
        // A shovel takes and fills at once: only the difference counts.
        let mut sums = Change::default();
        for (material, voxels) in came.chain(went.map(|(material, voxels)| (material, -(voxels as i64)))) {
            if let Some(sum) = sums.get_mut(usize::from(material.0)) {
                *sum += voxels;
            }
        }
        if !owes {
            for (sum, stock) in sums.iter_mut().zip(&self.stock) {
                *sum = (*sum).max(-(*stock).max(0));
            }
        }
        if sums != Change::default() {
            self.worth.insert(receipt.tag, sums);
            while self.worth.len() > REMEMBERED {
                self.worth.pop_first();
            }
        }
        self.change(&sums)
    }

    /// Enters a step through history that took back or did again the brushes of these tags; says what came and went.
    pub fn step(&mut self, step: HistoryStep, tags: &[u64]) -> Vec<(MaterialId, i64)> {
        let sign = match step {
            HistoryStep::Undo => -1,
            HistoryStep::Redo => 1,
        };
        let mut sums = Change::default();
        for change in tags.iter().filter_map(|tag| self.worth.get(tag)) {
            sums.iter_mut().zip(change).for_each(|(sum, by)| *sum += sign * by);
        }
        self.change(&sums)
    }

    /// As it was at first, for a new game; brushes that are under way are still the old ones.
    pub fn empty(&mut self) {
        *self = Self { next: self.next, ..default() };
    }

    fn change(&mut self, change: &Change) -> Vec<(MaterialId, i64)> {
        let each = MATERIALS.iter().map(|&(material, _)| material).zip(change.iter().copied());
        let changes: Vec<_> = each.filter(|(_, by)| *by != 0).collect();
        changes.iter().for_each(|&(material, by)| self.gain(material, by));
        changes
    }
}

fn empty(_: On<NewGame>, mut inventory: ResMut<Inventory>) {
    inventory.empty();
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
                let entered = inventory.step(receipt.step, &restored.tags);
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
            .add_observer(empty)
            .add_systems(
                Update,
                (enter_receipts, enter_history).chain().after(BurrowSystems::Commit).after(hardness::explain),
            )
            .add_systems(Update, step_through_history.in_set(Playing).run_if(in_state(Phase::Playing)));
    }
}

/// Each brush is answered once, in the frame in which it shows.
fn enter_receipts(
    mut receipts: MessageReader<BrushApplied>,
    settings: Res<Settings>,
    mut inventory: ResMut<Inventory>,
    mut changes: MessageWriter<StockChanged>,
    mut hints: MessageWriter<Hint>,
) {
    for BrushApplied { receipt, .. } in receipts.read() {
        let entered = inventory.enter(receipt, settings.survival);
        for &(material, by) in &entered {
            let stock = inventory.stock(material);
            // Once: from then on, the number is red.
            if stock < 0 && stock - by >= 0 {
                let words = format!("{} {} owed: what is dug next pays for it", -stock, name(material));
                hints.write(Hint::new(words));
            }
        }
        changes.write_batch(entered.into_iter().map(|(material, by)| StockChanged { material, by }));
    }
}

#[cfg(test)]
#[path = "inventory_tests.rs"]
mod tests;
