//! Random terrains and brushes, and statistics of what the brushes did.

use std::collections::BTreeMap;

use bevy_burrow::brush::CustomShape;
use bevy_burrow::prelude::*;
use bevy_burrow::volume::MaterialCounts;
use fastrand::Rng;

use crate::worlds::{any_random_brush, random_brush_at_a_face, random_rules};

const OPERATIONS: [&str; 16] = [
    "dig", "add", "paint", "smooth", "sharpen", "flatten", "level", "raise", "lower", "stamp", "terrace",
    "reset", "road", "paste", "fill", "carve",
];

const SHAPES: [&str; 10] =
    ["sphere", "box", "cylinder", "capsule", "cone", "torus", "curve", "path", "corridor", "grid"];

const EFFECTS: [&str; 6] =
    ["protected", "unbreakable", "too hard", "slowed", "crumbs removed", "debris broken off"];

/// Any brush: all operations and shapes, at the rim and at chunk faces too, and of any power.
pub fn any_brush(rng: &mut Rng, ground: &Ground, chunk_size: u32) -> Brush {
    let brush = match rng.u32(0..6) {
        0 => random_brush_at_a_face(rng, ground, chunk_size),
        _ => any_random_brush(rng, ground),
    };
    brush.with_power(rng.u8(..) | rng.u8(..))
}

/// A terrain without edits. Of every four indices, two have digging rules and two search for loose pieces; one has
/// both.
pub fn terrain(rng: &mut Rng, ground: Ground, chunk_size: u32, index: u64) -> Terrain {
    let rules = random_rules(rng, &ground);
    let mut terrain =
        Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid settings");
    if matches!(index % 4, 1 | 2) {
        terrain.set_rules(rules).expect("valid rules");
    }
    if matches!(index % 4, 2 | 3) {
        terrain.set_loose(Some(LooseSettings { largest: 3000, crumbs: 6, debris: 400 }));
    }
    terrain
}

/// How often each kind of brush was used and changed something, and the effects of rules and loose pieces.
#[derive(Debug, Default)]
pub struct EditStatistics {
    kinds: BTreeMap<&'static str, (usize, usize)>,
    effects: BTreeMap<&'static str, u64>,
}

impl EditStatistics {
    pub fn record(&mut self, brush: &Brush, receipt: &Receipt) {
        let Ok(applied) = &receipt.outcome else { return };
        for kind in [operation(brush), shape(brush)] {
            let (came, changed) = self.kinds.entry(kind).or_default();
            *came += 1;
            *changed += usize::from(applied.bounds.is_some());
        }
        let refused = &applied.refused;
        let voxels = [&refused.protected, &refused.unbreakable, &refused.too_hard, &refused.slowed];
        let fell =
            |fate| applied.loose.iter().filter(|piece| piece.fate == fate).map(|piece| piece.voxels).sum();
        let counts = voxels
            .map(MaterialCounts::total)
            .into_iter()
            .chain([fell(PieceFate::Removed), fell(PieceFate::BrokeOff)]);
        for (effect, count) in EFFECTS.into_iter().zip(counts) {
            *self.effects.entry(effect).or_default() += count;
        }
    }

    /// Checks that each operation and each shape changed something at least `least` times, and that each kind of
    /// refusal and each fate of loose pieces occurred.
    pub fn check(&self, least: usize) {
        println!("{self:?}");
        for kind in OPERATIONS.iter().chain(&SHAPES) {
            let changed = self.kinds.get(kind).map_or(0, |&(_, changed)| changed);
            assert!(changed >= least, "{kind} changed something {changed} times: {self:?}");
        }
        for effect in EFFECTS {
            assert!(self.effects.get(effect).is_some_and(|&voxels| voxels > 0), "{effect}: {self:?}");
        }
    }
}

fn operation(brush: &Brush) -> &'static str {
    match brush.operation {
        Operation::Dig => "dig",
        Operation::Add { .. } => "add",
        Operation::Paint { .. } => "paint",
        Operation::Smooth => "smooth",
        Operation::Sharpen => "sharpen",
        Operation::Flatten { .. } => "flatten",
        Operation::Level { .. } => "level",
        Operation::Raise { .. } => "raise",
        Operation::Lower { .. } => "lower",
        Operation::Stamp { .. } => "stamp",
        Operation::Terrace { .. } => "terrace",
        Operation::Reset => "reset",
        Operation::Road => "road",
        Operation::Paste { .. } => "paste",
        Operation::Fill => "fill",
        Operation::Carve => "carve",
        _ => panic!("{brush:?}"),
    }
}

fn shape(brush: &Brush) -> &'static str {
    match brush.custom.as_deref() {
        None => {}
        Some(CustomShape::Path(_)) => return "path",
        Some(CustomShape::Corridor(_)) => return "corridor",
        Some(CustomShape::Grid(_)) => return "grid",
        Some(_) => panic!("{brush:?}"),
    }
    match brush.shape {
        Shape::Sphere(_) => "sphere",
        Shape::Cuboid(_) => "box",
        Shape::Cylinder(_) => "cylinder",
        Shape::Capsule(_) => "capsule",
        Shape::Cone(_) => "cone",
        Shape::Torus(_) => "torus",
        Shape::Curve(_) => "curve",
        _ => panic!("{brush:?}"),
    }
}
