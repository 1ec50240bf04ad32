//! Pickaxe, shovel, drill, builder and painter: each hit sends a [`Brush`], and chips fly when its receipt arrives.

use std::collections::VecDeque;

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::player::camera::CameraShake;
use crate::tools::aim::Aim;
use crate::tools::inventory::Inventory;
use crate::tools::{Hand, Tool, ToolUsed};
use crate::ui::hud::Hint;
use crate::ui::settings::Settings;
use crate::ui::texts;
use crate::world::landscape;
use crate::world::particles::{Burst, ParticleKind};

/// Hits that wait for their receipts. If there are more, the oldest is forgotten.
const MAX_PENDING: usize = 64;

/// Seconds of blows that all miss, after which a hint says why.
const MISSES: f32 = 1.0;

/// Turns uses of tools into brushes.
pub struct DiggingPlugin;

impl Plugin for DiggingPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<PendingHits>()
            .init_resource::<Misses>()
            .add_observer(dig)
            .add_observer(build_or_paint)
            .add_observer(tell_reach)
            .add_systems(Update, throw_chips.after(BurrowSystems::Commit));
    }
}

/// Hits whose receipts have not arrived.
#[derive(Resource, Default)]
pub struct PendingHits(VecDeque<PendingHit>);

#[derive(Clone, Copy)]
pub struct PendingHit {
    /// The tag of its brush.
    pub tag: u64,
    pub point: Vec3,
    /// Where chips fly.
    pub direction: Vec3,
    /// Chips for each voxel that was dug.
    pub chips: f32,
}

impl PendingHits {
    pub fn push(&mut self, hit: PendingHit) {
        if self.0.len() == MAX_PENDING {
            self.0.pop_front();
        }
        self.0.push_back(hit);
    }
}

/// Large bumps make walls look broken instead of milled.
fn rough(brush: Brush, radius: f32) -> Brush {
    brush.with_roughness(Roughness::new(0.14 * radius.min(6.0), 1.2 + 0.8 * radius, 1))
}

fn dig(
    used: On<ToolUsed>,
    hand: Res<Hand>,
    mut inventory: ResMut<Inventory>,
    mut hits: ResMut<PendingHits>,
    mut shake: ResMut<CameraShake>,
    mut brushes: MessageWriter<Brush>,
) {
    let Some(Aim { point, direction, normal }) = used.aim else { return };
    let radius = hand.radius(used.tool);
    let (brush, chips) = match used.tool {
        Tool::Pickaxe => {
            let shape = Shape::sphere(point + direction * 0.3 * radius, radius);
            (rough(Brush::dig(shape), radius), 0.8)
        }
        Tool::Shovel => (Brush::smooth(Shape::sphere(point, radius), 0.7), 0.4),
        Tool::Drill => {
            let shape = Shape::capsule(point - direction * 0.5, point + direction * 1.4, radius);
            (rough(Brush::dig(shape), radius), 0.25)
        }
        _ => return,
    };
    let tag = inventory.next_tag();
    brushes.write(brush.with_power(used.tool.power()).with_tag(tag));
    hits.push(PendingHit { tag, point, direction: (normal - 0.4 * direction).normalize_or(Vec3::Y), chips });
    shake.add(if used.tool == Tool::Drill { 0.12 } else { 0.3 });
}

/// When the first and the last of the latest blows missed, if they did.
#[derive(Resource, Default)]
pub struct Misses(Option<(f32, f32)>);

impl Misses {
    /// A blow hit something.
    pub fn end(&mut self) {
        self.0 = None;
    }
}

/// Tells the player why nothing happens. At the edge of the reach some blows hit and others don't: only when none has
/// hit for a while, the player needs the hint.
fn tell_reach(
    used: On<ToolUsed>,
    time: Res<Time>,
    mut hints: MessageWriter<Hint>,
    mut misses: ResMut<Misses>,
) {
    if used.aim.is_some() || matches!(used.tool, Tool::Bomb | Tool::Ball) {
        return misses.end();
    }
    let now = time.elapsed_secs();
    let first = misses.0.filter(|(_, last)| now - last < MISSES).map_or(now, |(first, _)| first);
    misses.0 = Some((first, now));
    if now - first >= MISSES {
        hints.write(Hint(texts::TOO_FAR.into()));
    }
}

/// Building and painting both use up the material.
fn build_or_paint(
    used: On<ToolUsed>,
    hand: Res<Hand>,
    settings: Res<Settings>,
    mut inventory: ResMut<Inventory>,
    mut brushes: MessageWriter<Brush>,
    mut hints: MessageWriter<Hint>,
    mut bursts: MessageWriter<Burst>,
) {
    let Some(aim) = used.aim.filter(|_| matches!(used.tool, Tool::Builder | Tool::Painter)) else { return };
    let builds = used.tool == Tool::Builder;
    let material = hand.material;
    let shape =
        |radius: f32| if builds { hand.shape.at(&aim, radius) } else { Shape::sphere(aim.point, radius) };
    let tag = inventory.next_tag();
    let mut radius = hand.radius(used.tool);
    if settings.survival {
        let available = inventory.available(material);
        let Some((affordable, voxels)) = affordable_radius(used.tool, radius, available, shape) else {
            hints.write(Hint(texts::not_enough(landscape::name(material))));
            return;
        };
        inventory.reserve(tag, material, voxels);
        radius = affordable;
    }
    let brush = if builds { Brush::add } else { Brush::paint };
    brushes.write(brush(shape(radius), material).with_tag(tag));
    if builds {
        bursts.write(Burst {
            place: aim.point + aim.normal * 0.5,
            direction: aim.normal,
            count: 3,
            speed: 1.5,
            kind: ParticleKind::Dust(material),
        });
    }
}

/// The largest radius up to the wanted one for which there are enough voxels, and the number of voxels that it needs.
/// `None` if even the tool's smallest brush would need more.
pub fn affordable_radius(
    tool: Tool,
    wanted: f32,
    available: i64,
    shape: impl Fn(f32) -> Shape,
) -> Option<(f32, i64)> {
    let mut radius = wanted;
    while radius >= 0.8 * tool.radii().0 {
        let cost = Brush::dig(shape(radius)).voxel_count().ok()? as i64;
        if cost <= available {
            return Some((radius, cost));
        }
        // Volume grows with the cube of the radius.
        radius *= (available.max(0) as f32 / cost as f32).cbrt().clamp(0.2, 0.985);
    }
    None
}

fn throw_chips(
    mut receipts: MessageReader<BrushApplied>,
    mut hits: ResMut<PendingHits>,
    mut bursts: MessageWriter<Burst>,
) {
    for BrushApplied { receipt, .. } in receipts.read() {
        let Some(at) = hits.0.iter().position(|hit| hit.tag == receipt.tag) else { continue };
        let Some(PendingHit { point, direction, chips, .. }) = hits.0.remove(at) else { continue };
        let Ok(applied) = &receipt.outcome else { continue };
        for (material, voxels) in applied.removed.iter() {
            let count = (voxels as f32 * chips).clamp(1.0, 40.0) as usize;
            let kind = ParticleKind::Chips(material);
            bursts.write(Burst { place: point, direction, count, speed: 4.5, kind });
            let (count, kind) = ((count / 10).clamp(1, 4), ParticleKind::Dust(material));
            bursts.write(Burst { place: point, direction, count, speed: 1.2, kind });
        }
    }
}

#[cfg(test)]
#[path = "digging_tests.rs"]
mod tests;
