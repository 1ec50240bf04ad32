//! The player's input as actions: what keys, mouse buttons, the wheel and gamepads mean.
//!
//! Devices are read once a frame, into [`Actions`]. All other code asks for actions and knows no keys. The
//! [`Bindings`](crate::player::bindings::Bindings) are part of the settings, and the controls page changes them.

use bevy::input::InputSystems;
use bevy::input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll, MouseScrollUnit};
use bevy::platform::collections::HashSet;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::player::bindings::Binding;
use crate::ui::labels::{self, Labels};
use crate::ui::settings::Settings;
use crate::ui::texts;

/// Something that the player can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[rustfmt::skip]
pub enum Action {
    Forward, Back, Left, Right, Run, Jump, Use, Build, Slot1, Slot2, Slot3, Slot4, Slot5, Slot6, Slot7,
    Slot8, NextTool, PreviousTool, NextMaterial, PreviousMaterial, Grow, Shrink, BuildShape, Headlamp, Undo,
    Redo, Help, Panel, Pause,
}

impl Action {
    /// All actions with their default bindings, in the order of the controls page.
    pub const ALL: [(Self, &[Binding]); 29] = {
        use Binding::{Key, Mouse, Pad, WheelDown, WheelUp};
        use GamepadButton as G;
        use KeyCode as K;
        [
            (Self::Forward, &[Key(K::KeyW), Key(K::ArrowUp)]),
            (Self::Back, &[Key(K::KeyS), Key(K::ArrowDown)]),
            (Self::Left, &[Key(K::KeyA), Key(K::ArrowLeft)]),
            (Self::Right, &[Key(K::KeyD), Key(K::ArrowRight)]),
            (Self::Run, &[Key(K::ShiftLeft), Pad(G::LeftThumb)]),
            (Self::Jump, &[Key(K::Space), Pad(G::South)]),
            (Self::Use, &[Mouse(MouseButton::Left), Pad(G::RightTrigger2)]),
            (Self::Build, &[Mouse(MouseButton::Right), Pad(G::LeftTrigger2)]),
            (Self::Grow, &[WheelUp, Key(K::Equal), Pad(G::DPadUp)]),
            (Self::Shrink, &[WheelDown, Key(K::Minus), Pad(G::DPadDown)]),
            (Self::BuildShape, &[Key(K::KeyC), Pad(G::West)]),
            (Self::Headlamp, &[Key(K::KeyF), Pad(G::North)]),
            (Self::Slot1, &[Key(K::Digit1)]),
            (Self::Slot2, &[Key(K::Digit2)]),
            (Self::Slot3, &[Key(K::Digit3)]),
            (Self::Slot4, &[Key(K::Digit4)]),
            (Self::Slot5, &[Key(K::Digit5)]),
            (Self::Slot6, &[Key(K::Digit6)]),
            (Self::Slot7, &[Key(K::Digit7)]),
            (Self::Slot8, &[Key(K::Digit8)]),
            (Self::NextTool, &[Pad(G::RightTrigger)]),
            (Self::PreviousTool, &[Pad(G::LeftTrigger)]),
            (Self::NextMaterial, &[Key(K::KeyE), Pad(G::DPadRight)]),
            (Self::PreviousMaterial, &[Key(K::KeyQ), Pad(G::DPadLeft)]),
            (Self::Undo, &[Key(K::KeyZ), Pad(G::East)]),
            (Self::Redo, &[Key(K::KeyY), Pad(G::RightThumb)]),
            (Self::Help, &[Key(K::KeyH), Pad(G::Select)]),
            (Self::Panel, &[Key(K::F1)]),
            (Self::Pause, &[Key(K::Escape), Pad(G::Start)]),
        ]
    };

    pub fn label(self) -> &'static str {
        texts::ACTIONS[self as usize]
    }
}

/// What the player wants in this frame.
#[derive(Resource, Clone, Debug, Default)]
pub struct Actions {
    buttons: ButtonInput<Action>,
    /// Held since before [`release_all`](Self::release_all). They count again once they are released.
    ignored: HashSet<Action>,
    /// Steps by which the brush grows, or, if negative, shrinks.
    pub growth: i32,
    /// To the right and forward, at most 1 long.
    pub walk: Vec2,
    /// How far the head turns right and down, in radians at a sensitivity of 1.
    pub look: Vec2,
    /// Actions that a script holds down.
    pub scripted: Vec<Action>,
}

impl Actions {
    /// Whether it is held down. A press shorter than a frame counts as held for that frame.
    pub fn pressed(&self, action: Action) -> bool {
        self.buttons.pressed(action)
    }

    /// Whether it was pressed in this frame.
    pub fn just_pressed(&self, action: Action) -> bool {
        self.buttons.just_pressed(action)
    }

    /// Ignores whatever is held down now until it is pressed again.
    pub fn release_all(&mut self) {
        self.buttons.reset_all();
        self.ignored = Action::ALL.iter().map(|(action, ..)| *action).collect();
    }
}

/// In `PreUpdate`, when [`Actions`] are updated. Menus run after it, and before states change.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ActionSystems;

/// Reads devices into [`Actions`].
pub struct InputPlugin;

impl Plugin for InputPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Actions>().init_resource::<WheelSteps>().init_resource::<Labels>().add_systems(
            PreUpdate,
            (labels::learn, count_wheel_steps, update_actions)
                .chain()
                .in_set(ActionSystems)
                .after(InputSystems),
        );
    }
}

/// Steps that the wheel turned in this frame: up, or, if negative, down.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub struct WheelSteps {
    steps: i32,
    /// What a touchpad scrolled since the last whole step.
    rest: f32,
}

/// Pixels scrolled on a touchpad that count as one step of a wheel.
const PIXELS_PER_STEP: f32 = 40.0;

impl WheelSteps {
    /// Scrolls by steps or fractions of them.
    fn scroll(&mut self, by: f32) {
        if by * self.rest < 0.0 {
            self.rest = 0.0;
        }
        self.rest += by;
        // Ten times 0.1 is slightly less than 1.
        let whole = (self.rest + 1e-3_f32.copysign(self.rest)).trunc();
        (self.steps, self.rest) = (whole as i32, self.rest - whole);
    }

    /// The direction that the wheel turned, as a binding.
    pub fn binding(self) -> Option<Binding> {
        match self.steps {
            0 => None,
            1.. => Some(Binding::WheelUp),
            _ => Some(Binding::WheelDown),
        }
    }
}

fn count_wheel_steps(wheel: Res<AccumulatedMouseScroll>, mut steps: ResMut<WheelSteps>) {
    steps.scroll(match wheel.unit {
        MouseScrollUnit::Line => wheel.delta.y,
        MouseScrollUnit::Pixel => wheel.delta.y / PIXELS_PER_STEP,
    });
}

/// Radians per pixel of mouse motion, and per second with a stick pushed all the way.
const MOUSE_SPEED: f32 = 0.0024;
const STICK_SPEED: f32 = 2.6;

fn update_actions(
    time: Res<Time<Real>>,
    settings: Res<Settings>,
    keys: Res<ButtonInput<KeyCode>>,
    mouse: Res<ButtonInput<MouseButton>>,
    motion: Res<AccumulatedMouseMotion>,
    wheel: Res<WheelSteps>,
    pads: Query<&Gamepad>,
    mut actions: ResMut<Actions>,
) {
    let is_pressed = |binding: &Binding| match *binding {
        Binding::Key(key) => keys.pressed(key),
        Binding::Mouse(button) => mouse.pressed(button),
        Binding::WheelUp | Binding::WheelDown => wheel.binding() == Some(*binding),
        Binding::Pad(button) => pads.iter().any(|pad| pad.pressed(button)),
    };
    let is_just_pressed = |binding: &Binding| match *binding {
        Binding::Key(key) => keys.just_pressed(key),
        Binding::Mouse(button) => mouse.just_pressed(button),
        Binding::WheelUp | Binding::WheelDown => is_pressed(binding),
        Binding::Pad(button) => pads.iter().any(|pad| pad.just_pressed(button)),
    };
    let actions = &mut *actions;
    actions.buttons.clear();
    for (action, ..) in Action::ALL {
        let bindings = settings.bindings.of(action);
        let just_pressed = bindings.iter().any(is_just_pressed);
        let pressed = just_pressed || bindings.iter().any(is_pressed) || actions.scripted.contains(&action);
        if just_pressed || !pressed {
            actions.ignored.remove(&action);
            // Two presses may come within two frames, without a frame between them.
            actions.buttons.release(action);
        }
        if pressed && !actions.ignored.contains(&action) {
            actions.buttons.press(action);
        }
    }
    let step = |action: Action| if actions.just_pressed(action) { wheel.steps.abs().max(1) } else { 0 };
    actions.growth = step(Action::Grow) - step(Action::Shrink);
    let axis = |plus: Action, minus: Action| {
        f32::from(u8::from(actions.pressed(plus))) - f32::from(u8::from(actions.pressed(minus)))
    };
    let walk = Vec2::new(axis(Action::Right, Action::Left), axis(Action::Forward, Action::Back));
    let sticks = pads.iter().map(Gamepad::left_stick).sum::<Vec2>();
    actions.walk = (walk + sticks).clamp_length_max(1.0);
    // The square makes sticks precise near their middle.
    let stick = pads.iter().map(Gamepad::right_stick).sum::<Vec2>().clamp_length_max(1.0);
    let stick = stick * stick.length() * STICK_SPEED * time.delta_secs();
    actions.look = motion.delta * MOUSE_SPEED + Vec2::new(stick.x, -stick.y);
}

#[cfg(test)]
#[path = "input_tests.rs"]
mod tests;
