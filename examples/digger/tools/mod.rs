//! The eight tools: choosing one, aiming it and using it.
//!
//! A held button uses the tool again and again. Each use starts a [`Swing`]; in the moment of the hit, [`ToolUsed`] is
//! triggered. The file of each tool observes it.

pub mod aim;
pub mod balls;
pub mod bombs;
pub mod digging;
pub mod hardness;
pub mod inventory;
pub mod lamps;
pub mod thrown;
pub mod tool_in_hand;

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use serde::{Deserialize, Serialize};

use self::aim::{Aim, BuildShape};
use crate::player::PlayerControlSystems;
use crate::player::camera::PlayerCamera;
use crate::player::game_state::GameState;
use crate::player::input::{Action, Actions};
use crate::ui::settings::Settings;
use crate::ui::texts;
use crate::world::landscape::{MATERIALS, NewGame, ROCK};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Tool {
    #[default]
    Pickaxe,
    Shovel,
    Drill,
    Builder,
    Painter,
    Bomb,
    Lamp,
    Ball,
}

struct ToolStats {
    /// The action that selects it.
    slot: Action,
    /// Seconds of a swing, and from its start to the hit.
    period: f32,
    hit: f32,
    /// Metres that it reaches.
    reach: f32,
    /// The radius of its brush: minimum, maximum and initial value.
    radius: (f32, f32, f32),
    /// The hardness of material that it breaks at once, see [`DiggingRules`].
    power: u8,
}

/// The tools, in the order of their slots.
#[rustfmt::skip]
const STATS: [ToolStats; 8] = [
    ToolStats { slot: Action::Slot1, period: 0.44, hit: 0.20, reach: 9.0, radius: (1.0, 3.5, 1.8), power: 150 },
    ToolStats { slot: Action::Slot2, period: 0.36, hit: 0.20, reach: 9.0, radius: (1.5, 6.0, 3.0), power: 75 },
    ToolStats { slot: Action::Slot3, period: 0.20, hit: 0.12, reach: 8.0, radius: (1.0, 3.5, 2.1), power: 190 },
    ToolStats { slot: Action::Slot4, period: 0.26, hit: 0.10, reach: 40.0, radius: (1.0, 12.0, 2.0), power: u8::MAX },
    ToolStats { slot: Action::Slot5, period: 0.26, hit: 0.12, reach: 40.0, radius: (1.0, 12.0, 2.5), power: u8::MAX },
    ToolStats { slot: Action::Slot6, period: 0.80, hit: 0.28, reach: 40.0, radius: (5.5, 5.5, 5.5), power: u8::MAX },
    ToolStats { slot: Action::Slot7, period: 0.50, hit: 0.16, reach: 14.0, radius: (0.3, 0.3, 0.3), power: u8::MAX },
    ToolStats { slot: Action::Slot8, period: 0.50, hit: 0.20, reach: 40.0, radius: (0.3, 0.3, 0.3), power: u8::MAX },
];

impl Tool {
    /// All tools, in the order of their slots.
    pub const ALL: [Self; 8] = [
        Self::Pickaxe,
        Self::Shovel,
        Self::Drill,
        Self::Builder,
        Self::Painter,
        Self::Bomb,
        Self::Lamp,
        Self::Ball,
    ];

    const fn stats(self) -> &'static ToolStats {
        &STATS[self as usize]
    }

    pub const fn label(self) -> &'static str {
        texts::TOOLS[self as usize].0
    }

    pub const fn purpose(self) -> &'static str {
        texts::TOOLS[self as usize].1
    }

    /// The minimum and maximum radius of its brush.
    pub const fn radii(self) -> (f32, f32) {
        (self.stats().radius.0, self.stats().radius.1)
    }

    /// The hardness of material that it breaks at once, see [`DiggingRules`].
    pub const fn power(self) -> u8 {
        self.stats().power
    }

    /// The action that selects it.
    pub const fn slot(self) -> Action {
        self.stats().slot
    }

    /// What the camera looks at, if the tool reaches it.
    fn aim(self, terrains: &Terrains, camera: &Transform) -> Option<Aim> {
        let direction = camera.forward();
        let hit = terrains.raycast(Ray3d::new(camera.translation, direction), self.stats().reach)?;
        Some(Aim { point: hit.position, direction: *direction, normal: hit.normal })
    }
}

/// The element `by` places after another one, in a cyclic list.
fn cycle<T: Copy + PartialEq>(all: &[T], from: T, by: usize) -> T {
    let at = all.iter().position(|one| *one == from).unwrap_or(0);
    all[(at + by) % all.len()]
}

/// A [`Hand`] as it is saved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedHand {
    tool: Tool,
    shape: BuildShape,
    material: u8,
    radii: [f32; 8],
}

/// The player's tool, and how it is set up.
#[derive(Resource)]
pub struct Hand {
    pub tool: Tool,
    pub shape: BuildShape,
    pub material: MaterialId,
    radii: [f32; 8],
    /// What the selected tool aims at, if it reaches it. During a swing, another tool may be in use.
    pub aim: Option<Aim>,
    /// Show what the tool would change?
    pub preview: bool,
}

impl Hand {
    /// The first tool, with brushes as the settings have them.
    pub fn new(settings: &Settings) -> Self {
        let radii = Tool::ALL.map(|tool| match tool {
            Tool::Pickaxe | Tool::Builder => settings.radius.clamp(tool.radii().0, tool.radii().1),
            _ => tool.stats().radius.2,
        });
        Self { tool: default(), shape: settings.shape, material: ROCK, radii, aim: None, preview: true }
    }

    /// What is saved of it.
    pub fn saved(&self) -> SavedHand {
        SavedHand { tool: self.tool, shape: self.shape, material: self.material.0, radii: self.radii }
    }

    /// Takes over what was saved.
    pub fn restore(&mut self, saved: &SavedHand) {
        (self.tool, self.shape) = (saved.tool, saved.shape);
        if MATERIALS.contains(&MaterialId(saved.material)) {
            self.material = MaterialId(saved.material);
        }
        for (tool, radius) in Tool::ALL.into_iter().zip(saved.radii).filter(|(_, radius)| radius.is_finite())
        {
            self.set_radius(tool, radius);
        }
    }

    /// The radius of a tool's brush.
    pub fn radius(&self, tool: Tool) -> f32 {
        self.radii[tool as usize]
    }

    /// Sets the radius of a tool's brush, within the tool's limits.
    pub fn set_radius(&mut self, tool: Tool, radius: f32) {
        let (low, high) = tool.radii();
        self.radii[tool as usize] = radius.clamp(low, high);
    }
}

/// The swing of a tool.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub struct Swing {
    pub tool: Tool,
    /// Seconds since it began; `None` if there is none.
    time: Option<f32>,
    has_hit: bool,
}

impl Swing {
    /// The phase of the swing: -1 to 0 before the hit, 0 to 1 after it. `None` if there is no swing.
    pub fn phase(&self) -> Option<f32> {
        let ToolStats { period, hit, .. } = *self.tool.stats();
        self.time.map(|time| if time < hit { time / hit - 1.0 } else { (time - hit) / (period - hit) })
    }

    /// Advances the swing, or starts one with the wanted tool. Returns whether the tool hits in this frame.
    pub fn advance(&mut self, wanted: Option<Tool>, dt: f32) -> bool {
        let Some(time) = &mut self.time else {
            if let Some(tool) = wanted {
                *self = Self { tool, time: Some(0.0), has_hit: false };
            }
            return false;
        };
        *time += dt;
        let ToolStats { period, hit, .. } = *self.tool.stats();
        let hits = !self.has_hit && *time >= hit;
        self.has_hit |= hits;
        if *time >= period {
            // The rest of the frame belongs to the next swing, so that the rate does not depend on the frame rate.
            let rest = (*time - period).min(hit * 0.5);
            self.time = wanted.map(|_| rest);
            self.tool = wanted.unwrap_or(self.tool);
            self.has_hit = false;
        }
        hits
    }
}

/// Ends the swing without a hit.
pub fn cancel_swing(mut swing: ResMut<Swing>) {
    *swing = default();
}

/// A tool hits.
#[derive(Event, Clone, Copy, Debug)]
pub struct ToolUsed {
    pub tool: Tool,
    /// What is in its reach.
    pub aim: Option<Aim>,
    /// Position and direction of the camera.
    pub eye: Vec3,
    pub direction: Vec3,
}

/// Lets the player choose, aim and use tools.
pub struct ToolsPlugin;

impl Plugin for ToolsPlugin {
    fn build(&self, app: &mut App) {
        let hand = Hand::new(app.world().resource::<Settings>());
        app.insert_resource(hand)
            .init_resource::<Swing>()
            .add_observer(|_: On<NewGame>, settings: Res<Settings>, mut hand: ResMut<Hand>| {
                *hand = Hand::new(&settings);
            })
            .add_systems(
                Update,
                (
                    apply_settings,
                    (aim, choose, swing)
                        .chain()
                        .in_set(PlayerControlSystems)
                        .run_if(in_state(GameState::Playing)),
                ),
            );
    }
}

/// Applies a changed radius or shape. Other settings leave the hand as the player set it up.
fn apply_settings(
    settings: Res<Settings>,
    mut hand: ResMut<Hand>,
    mut last: Local<Option<(f32, BuildShape)>>,
) {
    let Some((radius, shape)) = last.replace((settings.radius, settings.shape)) else { return };
    if radius != settings.radius {
        hand.set_radius(Tool::Pickaxe, settings.radius);
        hand.set_radius(Tool::Builder, settings.radius);
    }
    if shape != settings.shape {
        hand.shape = settings.shape;
    }
}

fn aim(terrains: Terrains, camera: Single<&Transform, With<PlayerCamera>>, mut hand: ResMut<Hand>) {
    hand.aim = hand.tool.aim(&terrains, &camera);
}

fn choose(actions: Res<Actions>, mut hand: ResMut<Hand>) {
    if let Some(tool) = Tool::ALL.into_iter().find(|tool| actions.just_pressed(tool.slot())) {
        hand.tool = tool;
    }
    for (action, by) in [(Action::NextTool, 1), (Action::PreviousTool, Tool::ALL.len() - 1)] {
        if actions.just_pressed(action) {
            hand.tool = cycle(&Tool::ALL, hand.tool, by);
        }
    }
    for (action, by) in [(Action::NextMaterial, 1), (Action::PreviousMaterial, MATERIALS.len() - 1)] {
        if actions.just_pressed(action) {
            hand.material = cycle(&MATERIALS, hand.material, by);
        }
    }
    if actions.just_pressed(Action::BuildShape) {
        hand.shape = hand.shape.next();
    }
    if actions.growth != 0 {
        let tool = hand.tool;
        let radius = hand.radius(tool) + 0.25 * actions.growth as f32;
        hand.set_radius(tool, radius);
    }
}

fn swing(
    mut commands: Commands,
    time: Res<Time>,
    actions: Res<Actions>,
    hand: Res<Hand>,
    terrains: Terrains,
    camera: Single<&Transform, With<PlayerCamera>>,
    mut swing: ResMut<Swing>,
) {
    let wanted = if actions.pressed(Action::Use) {
        Some(hand.tool)
    } else {
        actions.pressed(Action::Build).then_some(Tool::Builder)
    };
    let tool = swing.tool;
    if swing.advance(wanted, time.delta_secs()) {
        let aim = tool.aim(&terrains, &camera);
        commands.trigger(ToolUsed { tool, aim, eye: camera.translation, direction: *camera.forward() });
    }
}

#[cfg(test)]
mod tests;
