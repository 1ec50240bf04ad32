//! The eight tools, and what the hand does with them: aim, choose, swing.
//!
//! A held button swings the tool again and again; in the moment of the hit a [`Strike`] is triggered, and whoever is
//! responsible for the tool observes it.

pub mod aim;
pub mod balls;
pub mod bombs;
pub mod digging;
pub mod hardness;
pub mod inventory;
pub mod lamps;
pub mod shape;
pub mod thrown;
pub mod tool_in_hand;
pub mod voxel_cost;

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::player::Playing;
use crate::player::game_state::Phase;
use crate::player::input::{Action, Actions};
use crate::tools::shape::{Aim, Form};
use crate::ui::settings::Settings;
use crate::world::landscape::{MATERIALS, NewGame, ROCK};
use crate::world::light::Eyes;

/// Something to hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
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

/// How a tool is used.
struct Manner {
    label: &'static str,
    purpose: &'static str,
    /// Seconds from swing to swing, and from its begin to the hit.
    period: f32,
    hit: f32,
    /// Metres that it reaches.
    reach: f32,
    /// Its brush: least radius, greatest, and the one it begins with.
    radius: (f32, f32, f32),
    /// How hard the ground may be that it breaks at once.
    power: u8,
}

const MANNERS: [Manner; 8] = [
    Manner {
        label: "pickaxe",
        purpose: "breaks the ground, blow by blow",
        period: 0.44,
        hit: 0.20,
        reach: 6.5,
        radius: (1.0, 3.5, 1.8),
        power: 150,
    },
    Manner {
        label: "shovel",
        purpose: "smooths what is rough",
        period: 0.36,
        hit: 0.20,
        reach: 9.0,
        radius: (1.5, 6.0, 3.0),
        power: 75,
    },
    Manner {
        label: "drill",
        purpose: "drives a tunnel straight ahead",
        period: 0.20,
        hit: 0.12,
        reach: 6.0,
        radius: (1.0, 3.5, 2.1),
        power: 190,
    },
    Manner {
        label: "builder",
        purpose: "puts down what was dug",
        period: 0.26,
        hit: 0.10,
        reach: 40.0,
        radius: (1.0, 12.0, 2.0),
        power: u8::MAX,
    },
    Manner {
        label: "painter",
        purpose: "paints the ground with what was dug",
        period: 0.26,
        hit: 0.12,
        reach: 40.0,
        radius: (1.0, 12.0, 2.5),
        power: u8::MAX,
    },
    Manner {
        label: "bomb",
        purpose: "flies, bounces, and takes a room out of a hill",
        period: 0.80,
        hit: 0.28,
        reach: 40.0,
        radius: (5.5, 5.5, 5.5),
        power: u8::MAX,
    },
    Manner {
        label: "lamp",
        purpose: "stays where it is put, and lights a cave",
        period: 0.50,
        hit: 0.16,
        // Across a room.
        reach: 14.0,
        radius: (0.3, 0.3, 0.3),
        power: u8::MAX,
    },
    Manner {
        label: "ball",
        purpose: "bounces, and rolls to where it is deepest",
        period: 0.50,
        hit: 0.20,
        reach: 40.0,
        radius: (0.3, 0.3, 0.3),
        power: u8::MAX,
    },
];

impl Tool {
    /// In the order of their slots.
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

    const SLOTS: [Action; 8] = [
        Action::Slot1,
        Action::Slot2,
        Action::Slot3,
        Action::Slot4,
        Action::Slot5,
        Action::Slot6,
        Action::Slot7,
        Action::Slot8,
    ];

    const fn manner(self) -> &'static Manner {
        &MANNERS[self as usize]
    }

    pub const fn label(self) -> &'static str {
        self.manner().label
    }

    pub const fn purpose(self) -> &'static str {
        self.manner().purpose
    }

    /// The least and the greatest radius of its brush.
    pub const fn radii(self) -> (f32, f32) {
        (self.manner().radius.0, self.manner().radius.1)
    }

    /// How hard the ground may be that it breaks at once, see [`DiggingRules`].
    pub const fn power(self) -> u8 {
        self.manner().power
    }

    /// The action that takes it.
    pub const fn slot(self) -> Action {
        Self::SLOTS[self as usize]
    }

    /// Where the look meets the ground, if the tool reaches it.
    fn aim(self, terrains: &Terrains, eyes: &Transform) -> Option<Aim> {
        let along = eyes.forward();
        let hit = terrains.raycast(Ray3d::new(eyes.translation, along), self.manner().reach)?;
        Some(Aim { place: hit.position, along: *along, normal: hit.normal })
    }

    /// The tool that lies `by` slots further.
    fn after(self, by: usize) -> Self {
        Self::ALL[(self as usize + by) % Self::ALL.len()]
    }
}

/// What the hand holds and what it is about to do.
#[derive(Resource)]
pub struct Hand {
    pub tool: Tool,
    pub form: Form,
    pub material: MaterialId,
    radii: [f32; 8],
    /// What is aimed at, if the tool in hand reaches it; the one that swings may be another.
    pub aim: Option<Aim>,
    /// Show what a dig would take?
    pub preview: bool,
}

impl Hand {
    /// Empty, with brushes as the settings have them.
    pub fn new(settings: &Settings) -> Self {
        let radii = Tool::ALL.map(|tool| match tool {
            Tool::Pickaxe | Tool::Builder => settings.radius.clamp(tool.radii().0, tool.radii().1),
            _ => tool.manner().radius.2,
        });
        Self { tool: default(), form: settings.form, material: ROCK, radii, aim: None, preview: true }
    }

    /// The radius of a tool's brush.
    pub fn radius(&self, tool: Tool) -> f32 {
        self.radii[tool as usize]
    }

    /// Sets it, as far as the tool allows.
    pub fn set_radius(&mut self, tool: Tool, radius: f32) {
        let (low, high) = tool.radii();
        self.radii[tool as usize] = radius.clamp(low, high);
    }
}

/// The tool on its way: how long it has been swung, and whether it has hit.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub struct Swing {
    pub tool: Tool,
    /// Seconds since it began; `None` while the hand rests.
    since: Option<f32>,
    has_hit: bool,
}

impl Swing {
    /// How far it is: -1 to 0 before the hit, 0 to 1 after it; `None` at rest.
    pub fn phase(&self) -> Option<f32> {
        let Manner { period, hit, .. } = *self.tool.manner();
        self.since.map(|since| if since < hit { since / hit - 1.0 } else { (since - hit) / (period - hit) })
    }

    /// Lets time pass while a tool is wanted or not, and says whether it hits now.
    pub fn advance(&mut self, wanted: Option<Tool>, dt: f32) -> bool {
        let Some(since) = &mut self.since else {
            if let Some(tool) = wanted {
                *self = Self { tool, since: Some(0.0), has_hit: false };
            }
            return false;
        };
        *since += dt;
        let Manner { period, hit, .. } = *self.tool.manner();
        let hits = !self.has_hit && *since >= hit;
        self.has_hit |= hits;
        if *since >= period {
            // What is left of the frame belongs to the next swing, so that the rhythm keeps its time.
            let rest = (*since - period).min(hit * 0.5);
            self.since = wanted.map(|_| rest);
            self.tool = wanted.unwrap_or(self.tool);
            self.has_hit = false;
        }
        hits
    }
}

/// The tool sinks, and what it was about to do it does not.
pub fn put_down(mut swing: ResMut<Swing>) {
    *swing = default();
}

/// A tool hits.
#[derive(Event, Clone, Copy, Debug)]
pub struct Strike {
    pub tool: Tool,
    /// What is in its own reach.
    pub aim: Option<Aim>,
    pub eye: Vec3,
    pub along: Vec3,
}

/// Aims, chooses and swings.
pub struct ToolsPlugin;

impl Plugin for ToolsPlugin {
    fn build(&self, app: &mut App) {
        let hand = Hand::new(app.world().resource::<Settings>());
        app.insert_resource(hand).init_resource::<Swing>().add_observer(begin_anew).add_systems(
            Update,
            (follow_settings, (aim, choose, swing).chain().in_set(Playing).run_if(in_state(Phase::Playing))),
        );
    }
}

fn begin_anew(_: On<NewGame>, settings: Res<Settings>, mut hand: ResMut<Hand>) {
    *hand = Hand::new(&settings);
}

/// A radius or a form that was just set is in the hand at once; other settings leave it alone.
fn follow_settings(settings: Res<Settings>, mut hand: ResMut<Hand>, mut last: Local<Option<(f32, Form)>>) {
    let now = (settings.radius, settings.form);
    let Some((radius, form)) = last.replace(now) else { return };
    if radius != now.0 {
        hand.set_radius(Tool::Pickaxe, now.0);
        hand.set_radius(Tool::Builder, now.0);
    }
    if form != now.1 {
        hand.form = now.1;
    }
}

fn aim(terrains: Terrains, eyes: Single<&Transform, With<Eyes>>, mut hand: ResMut<Hand>) {
    hand.aim = hand.tool.aim(&terrains, &eyes);
}

fn choose(actions: Res<Actions>, mut hand: ResMut<Hand>) {
    let slot = Tool::SLOTS.into_iter().zip(Tool::ALL).find(|(slot, _)| actions.just_pressed(*slot));
    if let Some((_, tool)) = slot {
        hand.tool = tool;
    }
    if actions.just_pressed(Action::NextTool) {
        hand.tool = hand.tool.after(1);
    }
    if actions.just_pressed(Action::PreviousTool) {
        hand.tool = hand.tool.after(Tool::ALL.len() - 1);
    }
    let further = |hand: &Hand, by: usize| {
        let at = MATERIALS.iter().position(|(id, _)| *id == hand.material).unwrap_or(0);
        MATERIALS[(at + by) % MATERIALS.len()].0
    };
    if actions.just_pressed(Action::NextMaterial) {
        hand.material = further(&hand, 1);
    }
    if actions.just_pressed(Action::PreviousMaterial) {
        hand.material = further(&hand, MATERIALS.len() - 1);
    }
    if actions.just_pressed(Action::Form) {
        hand.form = hand.form.next();
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
    eyes: Single<&Transform, With<Eyes>>,
    mut swing: ResMut<Swing>,
) {
    let wanted = if actions.pressed(Action::Use) {
        Some(hand.tool)
    } else if actions.pressed(Action::Build) {
        Some(Tool::Builder)
    } else {
        None
    };
    let tool = swing.tool;
    if swing.advance(wanted, time.delta_secs()) {
        let aim = tool.aim(&terrains, &eyes);
        commands.trigger(Strike { tool, aim, eye: eyes.translation, along: *eyes.forward() });
    }
}

#[cfg(test)]
mod tests;
