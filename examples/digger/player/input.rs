//! What the player wants, whatever it was said with: actions, their keys and buttons, and both sticks.
//!
//! A device is read once a frame, into [`Actions`]; everything else asks for actions and knows no key. The
//! [`Bindings`](crate::player::bindings::Bindings) are part of the settings, and the page of controls changes them.

use bevy::input::InputSystems;
use bevy::input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::player::bindings::Binding;
use crate::ui::labels::{self, Labels};

/// Something that the player can want.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum Action {
    Forward,
    Back,
    Left,
    Right,
    Run,
    Jump,
    Use,
    Build,
    Slot1,
    Slot2,
    Slot3,
    Slot4,
    Slot5,
    Slot6,
    Slot7,
    Slot8,
    NextTool,
    PreviousTool,
    NextMaterial,
    PreviousMaterial,
    Grow,
    Shrink,
    Form,
    Headlamp,
    Undo,
    Redo,
    Help,
    Figures,
    Panel,
    Pause,
}

impl Action {
    /// All of them, in the order of the page of controls, with what they are called there.
    pub const ALL: [(Self, &str); 30] = [
        (Self::Forward, "forward"),
        (Self::Back, "back"),
        (Self::Left, "left"),
        (Self::Right, "right"),
        (Self::Run, "run"),
        (Self::Jump, "jump"),
        (Self::Use, "use the tool"),
        (Self::Build, "build"),
        (Self::Grow, "larger brush"),
        (Self::Shrink, "smaller brush"),
        (Self::Form, "form of what is built"),
        (Self::Headlamp, "headlamp"),
        (Self::Slot1, "pickaxe"),
        (Self::Slot2, "shovel"),
        (Self::Slot3, "drill"),
        (Self::Slot4, "builder"),
        (Self::Slot5, "painter"),
        (Self::Slot6, "bomb"),
        (Self::Slot7, "lamp"),
        (Self::Slot8, "ball"),
        (Self::NextTool, "next tool"),
        (Self::PreviousTool, "previous tool"),
        (Self::NextMaterial, "next material"),
        (Self::PreviousMaterial, "previous material"),
        (Self::Undo, "undo"),
        (Self::Redo, "redo"),
        (Self::Help, "help"),
        (Self::Figures, "frame times"),
        (Self::Panel, "panel"),
        (Self::Pause, "pause"),
    ];

    const fn bit(self) -> u64 {
        1 << self as u8
    }

    /// What it is called.
    pub fn label(self) -> &'static str {
        Self::ALL.iter().find(|(action, _)| *action == self).map_or("?", |(_, label)| label)
    }
}

/// What the player wants in this frame.
#[derive(Resource, Clone, Debug, Default)]
pub struct Actions {
    held: u64,
    just: u64,
    /// Held since before the game began to listen; it counts only once it was let go.
    stale: u64,
    /// How often the wheel or the keys ask for a larger brush, or, negative, for a smaller one.
    pub growth: i32,
    /// Right and ahead, at most 1 long.
    pub walk: Vec2,
    /// How far the head is to turn: right and down, in radians at a sensitivity of 1.
    pub look: Vec2,
    /// What a script holds down, beside all devices.
    pub puppet: Vec<Action>,
}

impl Actions {
    /// Is it held down? What is shorter than a frame is held for one.
    pub fn pressed(&self, action: Action) -> bool {
        self.held & action.bit() != 0
    }

    /// Was it not, a frame ago?
    pub fn just_pressed(&self, action: Action) -> bool {
        self.just & action.bit() != 0
    }

    /// Whatever is held down now means nothing until it is pressed again.
    pub fn forget(&mut self) {
        (self.held, self.just, self.stale) = (0, 0, u64::MAX);
    }
}

/// In `PreUpdate`, when [`Actions`] are read. Menus come after it, and before the states change.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ReadsDevices;

/// Reads devices into [`Actions`].
pub struct InputPlugin;

impl Plugin for InputPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Actions>().init_resource::<Turns>().init_resource::<Labels>().add_systems(
            PreUpdate,
            (labels::learn, turn_wheel, read_devices).chain().in_set(ReadsDevices).after(InputSystems),
        );
    }
}

/// By how many notches the wheel was turned in this frame: up, or, negative, down.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub struct Turns {
    notches: i32,
    /// What a touchpad has scrolled since its latest notch.
    rest: f32,
}

/// Pixels that a touchpad scrolls for one notch of a wheel.
const NOTCH: f32 = 40.0;

impl Turns {
    /// Scrolls on, by notches and parts of them.
    fn scroll(&mut self, by: f32) {
        if by * self.rest < 0.0 {
            self.rest = 0.0;
        }
        self.rest += by;
        // Ten tenths are a whole one, though not to the last bit.
        let whole = (self.rest + 1e-3_f32.copysign(self.rest)).trunc();
        (self.notches, self.rest) = (whole as i32, self.rest - whole);
    }

    /// The wheel as a key.
    pub fn binding(self) -> Option<Binding> {
        match self.notches {
            0 => None,
            1.. => Some(Binding::WheelUp),
            _ => Some(Binding::WheelDown),
        }
    }
}

fn turn_wheel(wheel: Res<AccumulatedMouseScroll>, mut turns: ResMut<Turns>) {
    turns.scroll(match wheel.unit {
        MouseScrollUnit::Line => wheel.delta.y,
        MouseScrollUnit::Pixel => wheel.delta.y / NOTCH,
    });
}

/// Radians for each pixel that the mouse moves, and for each second with a stick pushed all the way.
const MOUSE: f32 = 0.0024;
const STICK: f32 = 2.6;

fn read_devices(
    time: Res<Time<Real>>,
    settings: Res<crate::ui::settings::Settings>,
    keys: Res<ButtonInput<KeyCode>>,
    mouse: Res<ButtonInput<MouseButton>>,
    motion: Res<AccumulatedMouseMotion>,
    turns: Res<Turns>,
    pads: Query<&Gamepad>,
    mut actions: ResMut<Actions>,
) {
    let is_held = |binding: &Binding| match *binding {
        Binding::Key(key) => keys.pressed(key),
        Binding::Mouse(button) => mouse.pressed(button),
        Binding::WheelUp | Binding::WheelDown => turns.binding() == Some(*binding),
        Binding::Pad(button) => pads.iter().any(|pad| pad.pressed(button)),
    };
    // Shorter than a frame: pressed and released between two of them.
    let is_fresh = |binding: &Binding| match *binding {
        Binding::Key(key) => keys.just_pressed(key),
        Binding::Mouse(button) => mouse.just_pressed(button),
        Binding::WheelUp | Binding::WheelDown => is_held(binding),
        Binding::Pad(button) => pads.iter().any(|pad| pad.just_pressed(button)),
    };
    let before = actions.held;
    let (mut held, mut fresh) = (0, 0);
    for (action, _) in Action::ALL {
        let bindings = settings.bindings.of(action);
        let puppet = actions.puppet.contains(&action);
        held |= if puppet || bindings.iter().any(is_held) { action.bit() } else { 0 };
        fresh |= if bindings.iter().any(is_fresh) { action.bit() } else { 0 };
    }
    held |= fresh;
    actions.stale &= held & !fresh;
    actions.held = held & !actions.stale;
    actions.just = fresh | (actions.held & !before);
    let steps = turns.notches.abs().max(1);
    let step = |action: Action| if actions.just_pressed(action) { steps } else { 0 };
    actions.growth = step(Action::Grow) - step(Action::Shrink);
    let axis = |plus: Action, minus: Action| {
        f32::from(u8::from(actions.pressed(plus))) - f32::from(u8::from(actions.pressed(minus)))
    };
    let way = Vec2::new(axis(Action::Right, Action::Left), axis(Action::Forward, Action::Back));
    let sticks = pads.iter().map(Gamepad::left_stick).sum::<Vec2>();
    actions.walk = (way + sticks).clamp_length_max(1.0);
    // Sticks are gentle near their middle.
    let stick = pads.iter().map(Gamepad::right_stick).sum::<Vec2>().clamp_length_max(1.0);
    let stick = stick * stick.length() * STICK * time.delta_secs();
    actions.look = motion.delta * MOUSE + Vec2::new(stick.x, -stick.y);
}

#[cfg(test)]
#[path = "input_tests.rs"]
mod tests;
