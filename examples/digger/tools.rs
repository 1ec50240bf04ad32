//! The seven tools, and what the hand does with them: aim, choose, swing.
//!
//! A held button swings the tool again and again; in the moment of the hit a [`Strike`] is triggered, and whoever is
//! responsible for the tool observes it.

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use serde::{Deserialize, Serialize};

use crate::input::{Action, Actions};
use crate::landscape::{MATERIALS, ROCK};
use crate::light::Eyes;
use crate::phase::Phase;
use crate::player::Playing;
use crate::settings::Settings;

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
}

const MANNERS: [Manner; 7] = [
    Manner {
        label: "pickaxe",
        purpose: "breaks the ground, blow by blow",
        period: 0.44,
        hit: 0.20,
        reach: 6.5,
        radius: (1.0, 3.5, 1.8),
    },
    Manner {
        label: "shovel",
        purpose: "smooths what is rough",
        period: 0.36,
        hit: 0.20,
        reach: 9.0,
        radius: (1.5, 6.0, 3.0),
    },
    Manner {
        label: "drill",
        purpose: "drives a tunnel straight ahead",
        period: 0.20,
        hit: 0.12,
        reach: 6.0,
        radius: (1.0, 3.5, 2.1),
    },
    Manner {
        label: "builder",
        purpose: "puts down what was dug",
        period: 0.26,
        hit: 0.10,
        reach: 40.0,
        radius: (1.0, 12.0, 2.0),
    },
    Manner {
        label: "painter",
        purpose: "turns the ground into the chosen material",
        period: 0.26,
        hit: 0.12,
        reach: 40.0,
        radius: (1.0, 12.0, 2.5),
    },
    Manner {
        label: "bomb",
        purpose: "flies, bounces, and takes a room out of a hill",
        period: 0.80,
        hit: 0.28,
        reach: 40.0,
        radius: (5.5, 5.5, 5.5),
    },
    Manner {
        label: "lamp",
        purpose: "stays where it is put, and lights a cave",
        period: 0.50,
        hit: 0.16,
        reach: 8.0,
        radius: (0.3, 0.3, 0.3),
    },
];

impl Tool {
    /// In the order of their slots.
    pub const ALL: [Self; 7] =
        [Self::Pickaxe, Self::Shovel, Self::Drill, Self::Builder, Self::Painter, Self::Bomb, Self::Lamp];

    const SLOTS: [Action; 7] = [
        Action::Slot1,
        Action::Slot2,
        Action::Slot3,
        Action::Slot4,
        Action::Slot5,
        Action::Slot6,
        Action::Slot7,
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

    /// The tool that lies `by` slots further.
    fn after(self, by: usize) -> Self {
        Self::ALL[(self as usize + by) % Self::ALL.len()]
    }
}

/// The form of what is built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    #[default]
    Sphere,
    Cube,
    /// From where the player looks further along the look.
    Capsule,
}

impl Form {
    pub const fn next(self) -> Self {
        match self {
            Self::Sphere => Self::Cube,
            Self::Cube => Self::Capsule,
            Self::Capsule => Self::Sphere,
        }
    }

    pub const fn label(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Cube => "cube",
            Self::Capsule => "beam",
        }
    }

    /// The shape of this form for a look that met the ground.
    pub fn shape(self, aim: &Aim, radius: f32) -> Shape {
        match self {
            Self::Sphere => Shape::sphere(aim.place, radius),
            Self::Cube => Shape::cuboid(aim.place, Vec3::splat(radius)),
            Self::Capsule => Shape::capsule(aim.place, aim.place + aim.along * 3.0 * radius, radius),
        }
    }

    /// Voxels in a shape of radius 1.
    pub const fn volume(self) -> f32 {
        const BALL: f32 = 4.0 / 3.0 * std::f32::consts::PI;
        match self {
            Self::Sphere => BALL,
            Self::Cube => 8.0,
            Self::Capsule => BALL + 3.0 * std::f32::consts::PI,
        }
    }
}

/// Where the look meets the ground.
#[derive(Clone, Copy, Debug)]
pub struct Aim {
    pub place: Vec3,
    /// The way of the look.
    pub along: Vec3,
    /// Out of the ground.
    pub normal: Vec3,
}

/// What the hand holds and what it is about to do.
#[derive(Resource)]
pub struct Hand {
    pub tool: Tool,
    pub form: Form,
    pub material: MaterialId,
    radii: [f32; 7],
    /// What is aimed at, if the tool reaches it.
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

/// A tool hits.
#[derive(Event, Clone, Copy, Debug)]
pub struct Strike {
    pub tool: Tool,
    /// What is in its reach.
    pub aim: Option<Aim>,
    pub eye: Vec3,
    pub along: Vec3,
}

/// Aims, chooses and swings.
pub struct ToolsPlugin;

impl Plugin for ToolsPlugin {
    fn build(&self, app: &mut App) {
        let hand = Hand::new(app.world().resource::<Settings>());
        app.insert_resource(hand).init_resource::<Swing>().add_systems(Startup, lift_gizmos).add_systems(
            Update,
            (aim, choose, swing, show_preview).chain().in_set(Playing).run_if(in_state(Phase::Playing)),
        );
    }
}

fn aim(terrains: Terrains, eyes: Single<&Transform, With<Eyes>>, mut hand: ResMut<Hand>) {
    let along = eyes.forward();
    let reach = hand.tool.manner().reach;
    let hit = terrains.raycast(Ray3d::new(eyes.translation, along), reach);
    hand.aim = hit.map(|hit| Aim { place: hit.position, along: *along, normal: hit.normal });
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
        commands.trigger(Strike { tool, aim: hand.aim, eye: eyes.translation, along: *eyes.forward() });
    }
}

/// A brush is half inside the ground, and all of it should be seen.
fn lift_gizmos(mut store: ResMut<GizmoConfigStore>) {
    let (config, _) = store.config_mut::<DefaultGizmoConfigGroup>();
    config.depth_bias = -1.0;
    config.line.width = 1.5;
}

/// The rim of what a tool would change, laid on the ground.
fn show_preview(hand: Res<Hand>, mut gizmos: Gizmos) {
    let Some(aim) = hand.aim.filter(|_| hand.preview) else { return };
    let colour = Color::srgba(1.0, 0.85, 0.25, 0.75);
    let radius = hand.radius(hand.tool);
    match (hand.tool, hand.form) {
        (Tool::Pickaxe | Tool::Shovel | Tool::Drill | Tool::Painter, _) => {
            let flat = Quat::from_rotation_arc(Vec3::Z, aim.normal.normalize_or(Vec3::Y));
            let place = aim.place + aim.normal * 0.05;
            gizmos.circle(Isometry3d::new(place, flat), radius, colour).resolution(48);
        }
        (Tool::Builder, Form::Sphere) => {
            gizmos.sphere(aim.place, radius, colour).resolution(48);
        }
        (Tool::Builder, Form::Cube) => {
            gizmos.cube(Transform::from_translation(aim.place).with_scale(Vec3::splat(2.0 * radius)), colour);
        }
        (Tool::Builder, Form::Capsule) => {
            let end = aim.place + aim.along * 3.0 * radius;
            gizmos.sphere(aim.place, radius, colour).resolution(32);
            gizmos.sphere(end, radius, colour).resolution(32);
            gizmos.line(aim.place, end, colour);
        }
        (Tool::Bomb | Tool::Lamp, _) => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_button_hits_in_rhythm_whatever_the_frame_rate() {
        for tool in [Tool::Pickaxe, Tool::Builder, Tool::Drill] {
            for fps in [30, 60, 144] {
                let mut swing = Swing::default();
                let hits = (0..10 * fps).filter(|_| swing.advance(Some(tool), 1.0 / fps as f32)).count();
                let due = 10.0 / tool.manner().period;
                assert!((hits as f32 - due).abs() <= 2.0, "{tool:?} at {fps}: {hits} of {due}");
            }
        }
    }

    #[test]
    fn a_click_hits_once_and_comes_to_rest() {
        let mut swing = Swing::default();
        let hits = (0..200).filter(|i| swing.advance((*i == 0).then_some(Tool::Pickaxe), 0.01)).count();
        assert_eq!((hits, swing.phase()), (1, None));
    }
}
