//! The inventory: what the player dug and has not used yet, in voxels of each material.
//!
//! A brush's receipt arrives some frames after the brush was sent. Until then, what the brush may use is reserved, so
//! that a second brush cannot use it too. The receipt says what really changed. This change is stored under the brush's
//! tag: undo and redo name the tags of the brushes that they undid or redid, and the inventory follows.
//!
//! The amount of a material can become negative: the player is in debt. This happens when the shovel fills more than
//! the player carries, or when a dig is undone whose material was used. Whatever is dug next pays the debt back. So
//! ground and inventory together always hold the same amount of material.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_burrow::plugin::{HistoryMoved, Redo, Undo};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{Applied, OrderKind, PieceFate};
use serde::{Deserialize, Serialize};

use crate::player::PlayerControlSystems;
use crate::player::game_state::GameState;
use crate::player::input::{Action, Actions};
use crate::tools::hardness;
use crate::ui::hud::Hint;
use crate::ui::settings::Settings;
use crate::ui::texts;
use crate::world::landscape::{CONCRETE, MATERIALS, NewGame, name};

/// Tags from here on are those of the player's brushes. Scripts use smaller ones, and their brushes are free.
pub const FIRST_PLAYER_TAG: u64 = 1 << 32;
/// Changes that are stored for undo. The terrain's own undo history is shorter.
const MAX_CHANGES: usize = 1 << 16;
/// Voxels of concrete that the player starts with, because no hill has any.
const INITIAL_CONCRETE: i64 = 600;

/// Voxels by material, positive or negative.
type Amounts = [i64; MATERIALS.len()];

/// An inventory as it is saved: changes of single brushes are left out, as the terrain's history is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedInventory {
    amounts: Vec<i64>,
    next_tag: u64,
}

#[derive(Resource, Clone, Debug)]
pub struct Inventory {
    /// Negative where the player is in debt.
    amounts: Amounts,
    /// Tag, material and voxels of brushes without a receipt.
    reserved: Vec<(u64, MaterialId, i64)>,
    next_tag: u64,
    /// What each brush changed, by its tag.
    changes: BTreeMap<u64, Amounts>,
}

impl Default for Inventory {
    fn default() -> Self {
        let mut inventory = Self {
            amounts: default(),
            reserved: Vec::new(),
            next_tag: FIRST_PLAYER_TAG,
            changes: BTreeMap::new(),
        };
        inventory.gain(CONCRETE, INITIAL_CONCRETE);
        inventory
    }
}

impl Inventory {
    /// A tag for the player's next brush.
    pub fn next_tag(&mut self) -> u64 {
        self.next_tag += 1;
        self.next_tag - 1
    }

    /// All voxels of a material; negative for a debt.
    pub fn amount(&self, material: MaterialId) -> i64 {
        self.amounts.get(usize::from(material.0)).copied().unwrap_or(0)
    }

    /// Voxels of a material that no brush has reserved.
    pub fn available(&self, material: MaterialId) -> i64 {
        let reserved = self.reserved.iter().filter(|reserved| reserved.1 == material);
        self.amount(material) - reserved.map(|reserved| reserved.2).sum::<i64>()
    }

    /// Reserves voxels until the receipt of the brush with this tag arrives.
    pub fn reserve(&mut self, tag: u64, material: MaterialId, voxels: i64) {
        self.reserved.push((tag, material, voxels));
    }

    /// Adds voxels of a material, or removes them.
    pub fn gain(&mut self, material: MaterialId, voxels: i64) {
        if let Some(amount) = self.amounts.get_mut(usize::from(material.0)) {
            *amount += voxels;
        }
    }

    /// Applies what one of the player's brushes changed, and returns it. Pieces that broke off count as dug. Without
    /// `allow_debt`, what the player does not have is free.
    pub fn apply_receipt(&mut self, receipt: &Receipt, allow_debt: bool) -> Vec<(MaterialId, i64)> {
        self.reserved.retain(|reserved| reserved.0 != receipt.tag);
        let Ok(applied) = &receipt.outcome else { return Vec::new() };
        if receipt.tag < FIRST_PLAYER_TAG {
            return Vec::new();
        }
        let pieces = applied.loose.iter().filter(|piece| piece.fate != PieceFate::Left);
        let gained = pieces.map(|piece| &piece.materials).chain([&applied.removed]).map(|counts| (1, counts));
        let used = [(-1, &applied.added), (-1, &applied.painted)];
        // The shovel digs and fills at the same time: only the difference counts.
        let mut change = Amounts::default();
        for (sign, counts) in gained.chain(used) {
            for (material, voxels) in counts.iter() {
                if let Some(sum) = change.get_mut(usize::from(material.0)) {
                    *sum += sign * voxels as i64;
                }
            }
        }
        if !allow_debt {
            for (sum, amount) in change.iter_mut().zip(&self.amounts) {
                *sum = (*sum).max(-(*amount).max(0));
            }
        }
        if change != Amounts::default() {
            self.changes.insert(receipt.tag, change);
            while self.changes.len() > MAX_CHANGES {
                self.changes.pop_first();
            }
        }
        self.apply(&change)
    }

    /// Applies an undo or redo of the brushes with these tags, and returns what it changed.
    pub fn apply_history(&mut self, step: OrderKind, tags: &[u64]) -> Vec<(MaterialId, i64)> {
        let sign = if step == OrderKind::Undo { -1 } else { 1 };
        let mut total = Amounts::default();
        for change in tags.iter().filter_map(|tag| self.changes.get(tag)) {
            total.iter_mut().zip(change).for_each(|(sum, by)| *sum += sign * by);
        }
        self.apply(&total)
    }

    /// Applies the voxels that an undo or redo step restored, and returns the changes.
    fn apply_restored(&mut self, restored: &Applied) -> Vec<(MaterialId, i64)> {
        let mut total = Amounts::default();
        for (sign, counts) in [(1, &restored.removed), (-1, &restored.added), (-1, &restored.painted)] {
            for (material, voxels) in counts.iter() {
                if let Some(sum) = total.get_mut(usize::from(material.0)) {
                    *sum += sign * voxels as i64;
                }
            }
        }
        self.apply(&total)
    }

    /// What is saved of it.
    pub fn saved(&self) -> SavedInventory {
        SavedInventory { amounts: self.amounts.to_vec(), next_tag: self.next_tag }
    }

    /// Takes over what was saved. Materials that came later than the save are not there.
    pub fn restore(&mut self, saved: &SavedInventory) {
        let next_tag = self.next_tag.max(saved.next_tag);
        *self = Self { amounts: default(), next_tag, ..default() };
        self.amounts.iter_mut().zip(&saved.amounts).for_each(|(amount, saved)| *amount = *saved);
    }

    /// Empties the inventory for a new game. Tags keep counting, because receipts of the old game may still arrive.
    pub fn reset(&mut self) {
        *self = Self { next_tag: self.next_tag, ..default() };
    }

    fn apply(&mut self, change: &Amounts) -> Vec<(MaterialId, i64)> {
        let materials = MATERIALS.into_iter().zip(change.iter().copied());
        let changes: Vec<_> = materials.filter(|(_, by)| *by != 0).collect();
        changes.iter().for_each(|&(material, by)| self.gain(material, by));
        changes
    }
}

/// The amount of a material changed.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct AmountChanged {
    pub material: MaterialId,
    pub by: i64,
}

/// Keeps the [`Inventory`] up to date.
pub struct InventoryPlugin;

impl Plugin for InventoryPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Inventory>()
            .add_message::<AmountChanged>()
            .add_observer(|_: On<NewGame>, mut inventory: ResMut<Inventory>| inventory.reset())
            .add_systems(
                Update,
                (
                    send_undo.in_set(PlayerControlSystems).run_if(in_state(GameState::Playing)),
                    (read_receipts, read_history)
                        .chain()
                        .after(BurrowSystems::Commit)
                        .after(hardness::explain),
                ),
            );
    }
}

fn send_undo(actions: Res<Actions>, mut undo: MessageWriter<Undo>, mut redo: MessageWriter<Redo>) {
    if actions.just_pressed(Action::Undo) {
        undo.write_default();
    }
    if actions.just_pressed(Action::Redo) {
        redo.write_default();
    }
}

fn read_receipts(
    mut receipts: MessageReader<BrushApplied>,
    settings: Res<Settings>,
    mut inventory: ResMut<Inventory>,
    mut changes: MessageWriter<AmountChanged>,
    mut hints: MessageWriter<Hint>,
) {
    for BrushApplied { receipt, .. } in receipts.read() {
        for (material, by) in inventory.apply_receipt(receipt, settings.survival) {
            let amount = inventory.amount(material);
            // Only once; after that the number is red.
            if amount < 0 && amount - by >= 0 {
                hints.write(Hint(texts::debt(-amount, name(material))));
            }
            changes.write(AmountChanged { material, by });
        }
    }
}

pub fn read_history(
    mut steps: MessageReader<HistoryMoved>,
    mut inventory: ResMut<Inventory>,
    mut changes: MessageWriter<AmountChanged>,
    mut hints: MessageWriter<Hint>,
) {
    for HistoryMoved { receipt, .. } in steps.read() {
        match &receipt.outcome {
            Ok(restored) => {
                // Where players share the ground, a step has no tags, but is always this player's own.
                let applied = match restored.tags[..] {
                    [] => inventory.apply_restored(restored),
                    _ => inventory.apply_history(receipt.kind, &restored.tags),
                };
                changes.write_batch(applied.into_iter().map(|(material, by)| AmountChanged { material, by }));
            }
            Err(nothing) => drop(hints.write(Hint(nothing.to_string()))),
        }
    }
}

#[cfg(test)]
#[path = "inventory_tests.rs"]
mod tests;
