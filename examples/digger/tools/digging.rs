//! What pickaxe, shovel, drill, builder and painter do to the ground: each hit is a [`Brush`] message, the game's only
//! way into it. What the receipt says was broken flies off as chips.

use std::collections::VecDeque;

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::player::Tremor;
use crate::tools::inventory::Inventory;
use crate::tools::shape::Aim;
use crate::tools::voxel_cost;
use crate::tools::{Hand, Strike, Tool};
use crate::ui::hud::Hint;
use crate::ui::settings::Settings;
use crate::world::particles::{Burst, Matter};

/// Hits whose receipts are awaited at most; older ones are forgotten.
const AWAITED: usize = 64;

/// Lets tools work.
pub struct WorkPlugin;

impl Plugin for WorkPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Blows>()
            .add_observer(dig)
            .add_observer(build)
            .add_observer(paint)
            .add_systems(Update, throw_chips.after(BurrowSystems::Commit));
    }
}

/// Where the hand hit, until the receipt comes.
#[derive(Resource, Default)]
pub struct Blows(VecDeque<Blow>);

#[derive(Clone, Copy)]
struct Blow {
    tag: u64,
    place: Vec3,
    /// Where chips fly.
    out: Vec3,
    chips: f32,
}

impl Blows {
    /// Chips will fly from there once the receipt of a brush is in: `chips` for each voxel that it took.
    pub fn await_receipt(&mut self, tag: u64, place: Vec3, out: Vec3, chips: f32) {
        if self.0.len() == AWAITED {
            self.0.pop_front();
        }
        self.0.push_back(Blow { tag, place, out, chips });
    }
}

/// Bumps as large as the tool allows make walls look broken, not milled.
fn broken(brush: Brush, radius: f32) -> Brush {
    brush.with_roughness(Roughness::new(0.14 * radius.min(6.0), 1.2 + 0.8 * radius, 1))
}

fn dig(
    strike: On<Strike>,
    hand: Res<Hand>,
    mut inventory: ResMut<Inventory>,
    mut blows: ResMut<Blows>,
    mut tremor: ResMut<Tremor>,
    mut brushes: MessageWriter<Brush>,
) {
    let Some(Aim { place, along, normal, .. }) = strike.aim else { return };
    let radius = hand.radius(strike.tool);
    let (brush, chips) = match strike.tool {
        Tool::Pickaxe => {
            (broken(Brush::dig(Shape::sphere(place + along * 0.3 * radius, radius)), radius), 0.8)
        }
        Tool::Shovel => (Brush::smooth(Shape::sphere(place, radius), 0.7), 0.4),
        Tool::Drill => {
            let (from, to) = (place - along * 0.5, place + along * 1.4);
            (broken(Brush::dig(Shape::capsule(from, to, radius)), radius), 0.25)
        }
        _ => return,
    };
    let tag = inventory.tag();
    brushes.write(brush.with_power(strike.tool.power()).with_tag(tag));
    blows.await_receipt(tag, place, (normal - 0.4 * along).normalize_or(Vec3::Y), chips);
    tremor.nudge(if strike.tool == Tool::Drill { 0.12 } else { 0.3 });
}

fn build(
    strike: On<Strike>,
    hand: Res<Hand>,
    settings: Res<Settings>,
    mut inventory: ResMut<Inventory>,
    mut brushes: MessageWriter<Brush>,
    mut hints: MessageWriter<Hint>,
    mut bursts: MessageWriter<Burst>,
) {
    if strike.tool != Tool::Builder {
        return;
    }
    let Some(aim) = strike.aim else { return };
    let tag = inventory.tag();
    let shape = |radius: f32| hand.form.shape(&aim, radius);
    let Some(radius) = afford(&settings, &hand, Tool::Builder, shape, tag, &mut inventory) else {
        hints.write(too_little(&hand));
        return;
    };
    brushes.write(Brush::add(shape(radius), hand.material).with_tag(tag));
    bursts.write(Burst {
        place: aim.place + aim.normal * 0.5,
        out: aim.normal,
        count: 3,
        speed: 1.5,
        matter: Matter::Dust(hand.material),
    });
}

/// As large as what is left of the material allows, which is pledged; `None` where that is next to nothing.
fn afford(
    settings: &Settings,
    hand: &Hand,
    tool: Tool,
    shape: impl Fn(f32) -> Shape,
    tag: u64,
    inventory: &mut Inventory,
) -> Option<f32> {
    let wish = hand.radius(tool);
    if !settings.survival {
        return Some(wish);
    }
    let (radius, voxels) = voxel_cost::affordable(tool, wish, inventory.free(hand.material), shape)?;
    inventory.pledge(tag, hand.material, voxels);
    Some(radius)
}

fn too_little(hand: &Hand) -> Hint {
    Hint::new(format!("not enough {}: dig some first", crate::world::landscape::name(hand.material)))
}

/// Paint is made of the material, so it takes some.
fn paint(
    strike: On<Strike>,
    hand: Res<Hand>,
    settings: Res<Settings>,
    mut inventory: ResMut<Inventory>,
    mut brushes: MessageWriter<Brush>,
    mut hints: MessageWriter<Hint>,
) {
    let Some(aim) = strike.aim.filter(|_| strike.tool == Tool::Painter) else { return };
    let tag = inventory.tag();
    let shape = |radius: f32| Shape::sphere(aim.place, radius);
    match afford(&settings, &hand, Tool::Painter, shape, tag, &mut inventory) {
        Some(radius) => drop(brushes.write(Brush::paint(shape(radius), hand.material).with_tag(tag))),
        None => drop(hints.write(too_little(&hand))),
    }
}

/// Chips of each material that was broken, as many as it was.
fn throw_chips(
    mut receipts: MessageReader<BrushApplied>,
    mut blows: ResMut<Blows>,
    mut bursts: MessageWriter<Burst>,
) {
    for BrushApplied { receipt, .. } in receipts.read() {
        let Some(at) = blows.0.iter().position(|blow| blow.tag == receipt.tag) else { continue };
        let Some(blow) = blows.0.remove(at) else { continue };
        let Ok(applied) = &receipt.outcome else { continue };
        for (material, voxels) in applied.removed.iter() {
            let count = (voxels as f32 * blow.chips).clamp(1.0, 40.0) as usize;
            let burst = Burst {
                place: blow.place,
                out: blow.out,
                count,
                speed: 4.5,
                matter: Matter::Chips(material),
            };
            bursts.write(burst.clone());
            let puffs = (count / 10).clamp(1, 4);
            bursts.write(Burst { count: puffs, speed: 1.2, matter: Matter::Dust(material), ..burst });
        }
    }
}

#[cfg(test)]
#[path = "digging_tests.rs"]
mod tests;
