//! What the player wants, whatever it was said with: actions, their keys and buttons, and both sticks.
//!
//! A device is read once a frame, into [`Actions`]; everything else asks for actions and knows no key. The
//! [`Bindings`] are part of the settings, and the page of controls changes them.

use std::collections::BTreeMap;
use std::fmt;

use bevy::input::InputSystems;
use bevy::input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy::reflect::Typed;
use bevy::reflect::enums::{DynamicEnum, DynamicVariant, VariantType};
use serde::de::IntoDeserializer;
use serde::de::value::StringDeserializer;
use serde::{Deserialize, Deserializer, Serialize};

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
    pub const ALL: [(Self, &str); 29] = [
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

/// A key, a button, or a turn of the wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Binding {
    Key(KeyCode),
    Mouse(MouseButton),
    WheelUp,
    WheelDown,
    Pad(GamepadButton),
}

/// A text that names no key and no button.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("there is no key or button {0:?}")]
pub struct UnknownBinding(String);

/// The variant of an enum without fields that has a name, found by reflection: Bevy's keys are many.
fn variant_named<E: Typed + FromReflect>(name: &str) -> Option<E> {
    let variant = E::type_info().as_enum().ok()?.variant(name)?;
    if variant.variant_type() != VariantType::Unit {
        return None;
    }
    E::from_reflect(&DynamicEnum::new(name, DynamicVariant::Unit))
}

impl From<Binding> for String {
    fn from(binding: Binding) -> Self {
        match binding {
            Binding::Key(key) => format!("{key:?}"),
            Binding::Mouse(button) => format!("Mouse {button:?}"),
            Binding::WheelUp => "Wheel Up".into(),
            Binding::WheelDown => "Wheel Down".into(),
            Binding::Pad(button) => format!("Pad {button:?}"),
        }
    }
}

impl TryFrom<String> for Binding {
    type Error = UnknownBinding;

    fn try_from(text: String) -> Result<Self, UnknownBinding> {
        let found = match text.split_once(' ') {
            Some(("Mouse", button)) => variant_named(button).map(Self::Mouse),
            Some(("Pad", button)) => variant_named(button).map(Self::Pad),
            Some(("Wheel", "Up")) => Some(Self::WheelUp),
            Some(("Wheel", "Down")) => Some(Self::WheelDown),
            Some(_) => None,
            None => variant_named(&text).map(Self::Key),
        };
        found.ok_or(UnknownBinding(text))
    }
}

impl fmt::Display for Binding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = String::from(*self);
        let short = text.strip_prefix("Key").or_else(|| text.strip_prefix("Digit")).unwrap_or(&text);
        f.write_str(short)
    }
}

/// Which keys and buttons each action has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Bindings(#[serde(deserialize_with = "known_bindings")] BTreeMap<Action, Vec<Binding>>);

/// Actions and keys of another version of the game are left out, and cost nobody the others.
fn known_bindings<'de, D: Deserializer<'de>>(reader: D) -> Result<BTreeMap<Action, Vec<Binding>>, D::Error> {
    let texts = BTreeMap::<String, Vec<String>>::deserialize(reader)?;
    let action = |name: String| {
        let name: StringDeserializer<D::Error> = name.into_deserializer();
        Action::deserialize(name).ok()
    };
    let known =
        |texts: Vec<String>| texts.into_iter().filter_map(|text| Binding::try_from(text).ok()).collect();
    Ok(texts.into_iter().filter_map(|(name, texts)| Some((action(name)?, known(texts)))).collect())
}

impl Default for Bindings {
    fn default() -> Self {
        use Action as A;
        use Binding::{Key, Mouse, Pad, WheelDown, WheelUp};
        use GamepadButton as G;
        use KeyCode as K;
        let all: [(Action, &[Binding]); 29] = [
            (A::Forward, &[Key(K::KeyW), Key(K::ArrowUp)]),
            (A::Back, &[Key(K::KeyS), Key(K::ArrowDown)]),
            (A::Left, &[Key(K::KeyA), Key(K::ArrowLeft)]),
            (A::Right, &[Key(K::KeyD), Key(K::ArrowRight)]),
            (A::Run, &[Key(K::ShiftLeft), Pad(G::LeftThumb)]),
            (A::Jump, &[Key(K::Space), Pad(G::South)]),
            (A::Use, &[Mouse(MouseButton::Left), Pad(G::RightTrigger2)]),
            (A::Build, &[Mouse(MouseButton::Right), Pad(G::LeftTrigger2)]),
            (A::Slot1, &[Key(K::Digit1)]),
            (A::Slot2, &[Key(K::Digit2)]),
            (A::Slot3, &[Key(K::Digit3)]),
            (A::Slot4, &[Key(K::Digit4)]),
            (A::Slot5, &[Key(K::Digit5)]),
            (A::Slot6, &[Key(K::Digit6)]),
            (A::Slot7, &[Key(K::Digit7)]),
            (A::NextTool, &[Pad(G::RightTrigger)]),
            (A::PreviousTool, &[Pad(G::LeftTrigger)]),
            (A::NextMaterial, &[Key(K::KeyE), Pad(G::DPadRight)]),
            (A::PreviousMaterial, &[Key(K::KeyQ), Pad(G::DPadLeft)]),
            (A::Grow, &[WheelUp, Key(K::Equal), Pad(G::DPadUp)]),
            (A::Shrink, &[WheelDown, Key(K::Minus), Pad(G::DPadDown)]),
            (A::Form, &[Key(K::KeyC), Pad(G::West)]),
            (A::Headlamp, &[Key(K::KeyF), Pad(G::North)]),
            (A::Undo, &[Key(K::KeyZ), Pad(G::East)]),
            (A::Redo, &[Key(K::KeyY)]),
            (A::Help, &[Key(K::KeyH), Pad(G::Select)]),
            (A::Figures, &[Key(K::F3)]),
            (A::Panel, &[Key(K::F1)]),
            (A::Pause, &[Key(K::Escape), Pad(G::Start)]),
        ];
        Self(all.into_iter().map(|(action, bindings)| (action, bindings.to_vec())).collect())
    }
}

impl Bindings {
    /// The keys and buttons of an action.
    pub fn of(&self, action: Action) -> &[Binding] {
        self.0.get(&action).map_or(&[], Vec::as_slice)
    }

    /// The first key or button of an action, as it is written on the screen.
    pub fn first(&self, action: Action) -> String {
        self.of(action).first().map_or_else(|| "-".into(), Binding::to_string)
    }

    /// Gives an action a key or button in place of those of the same kind: a gamepad's button leaves the keys alone.
    /// Whoever had it loses it, and is returned.
    pub fn rebind(&mut self, action: Action, binding: Binding) -> Option<Action> {
        let loser = self
            .0
            .iter()
            .find(|(other, bindings)| **other != action && bindings.contains(&binding))
            .map(|(other, _)| *other);
        if let Some(bindings) = loser.and_then(|loser| self.0.get_mut(&loser)) {
            bindings.retain(|other| *other != binding);
        }
        let is_pad = |binding: &Binding| matches!(binding, Binding::Pad(_));
        let own = self.0.entry(action).or_default();
        own.retain(|old| is_pad(old) != is_pad(&binding));
        own.insert(0, binding);
        loser
    }

    /// Actions that a file does not know get what they have by default, unless that is taken.
    pub fn complete(&mut self) {
        for (action, bindings) in Self::default().0 {
            if self.0.contains_key(&action) {
                continue;
            }
            let free = bindings.into_iter().filter(|new| !self.0.values().flatten().any(|old| old == new));
            let free = free.collect();
            self.0.insert(action, free);
        }
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
    /// Is it held down?
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
        app.init_resource::<Actions>()
            .add_systems(PreUpdate, read_devices.in_set(ReadsDevices).after(InputSystems));
    }
}

/// Radians for each pixel that the mouse moves, and for each second with a stick pushed all the way.
const MOUSE: f32 = 0.0024;
const STICK: f32 = 2.6;

fn read_devices(
    time: Res<Time<Real>>,
    settings: Res<crate::settings::Settings>,
    keys: Res<ButtonInput<KeyCode>>,
    mouse: Res<ButtonInput<MouseButton>>,
    motion: Res<AccumulatedMouseMotion>,
    wheel: Res<AccumulatedMouseScroll>,
    pads: Query<&Gamepad>,
    mut actions: ResMut<Actions>,
) {
    let turned = match wheel.unit {
        MouseScrollUnit::Line => wheel.delta.y,
        MouseScrollUnit::Pixel => wheel.delta.y / 40.0,
    };
    let is_held = |binding: &Binding| match *binding {
        Binding::Key(key) => keys.pressed(key),
        Binding::Mouse(button) => mouse.pressed(button),
        Binding::WheelUp => turned > 0.0,
        Binding::WheelDown => turned < 0.0,
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
    actions.stale &= held & !fresh;
    actions.held = held & !actions.stale;
    actions.just = fresh | (actions.held & !before);
    let steps = (turned.abs().ceil() as i32).max(1);
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
