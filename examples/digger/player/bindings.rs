//! Which keys, buttons and turns of the wheel mean which actions, as the page of controls and the file of settings have it.

use std::collections::{BTreeMap, HashSet};
use std::fmt;
use std::str::FromStr;

use bevy::prelude::*;
use bevy::reflect::Typed;
use bevy::reflect::enums::{DynamicEnum, DynamicVariant, VariantType};
use serde::de::IntoDeserializer;
use serde::de::value::{Error, StringDeserializer};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::player::input::Action;
use crate::ui::labels::Labels;

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

/// What a binding belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Device {
    Keyboard,
    Mouse,
    Pad,
}

impl Device {
    /// What a text was meant for, though it names nothing there.
    fn meant_by(text: &str) -> Self {
        match text.split_once(' ') {
            Some(("Mouse" | "Wheel", _)) => Self::Mouse,
            Some(("Pad", _)) => Self::Pad,
            _ => Self::Keyboard,
        }
    }
}

impl Binding {
    const fn device(self) -> Device {
        match self {
            Self::Key(_) => Device::Keyboard,
            Self::Mouse(_) | Self::WheelUp | Self::WheelDown => Device::Mouse,
            Self::Pad(_) => Device::Pad,
        }
    }

    /// Is it read again as what it was written? Keys that no layout knows have no name, but only a number on one platform.
    pub fn can_be_kept(self) -> bool {
        Self::try_from(String::from(self)) == Ok(self)
    }
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

/// The number of a button without a name, as in `Other(9)`.
fn number<N: FromStr>(name: &str) -> Option<N> {
    name.strip_prefix("Other(")?.strip_suffix(')')?.parse().ok()
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
            Some(("Mouse", button)) => {
                variant_named(button).or_else(|| number(button).map(MouseButton::Other)).map(Self::Mouse)
            }
            Some(("Pad", button)) => {
                variant_named(button).or_else(|| number(button).map(GamepadButton::Other)).map(Self::Pad)
            }
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
#[serde(from = "BTreeMap<String, Value>", into = "BTreeMap<Action, Vec<Binding>>")]
pub struct Bindings {
    all: BTreeMap<Action, Vec<Binding>>,
    /// What a file had for an action, and nobody could read; it is made good by [`complete`](Self::complete).
    lost: Vec<(Action, Device)>,
}

impl From<BTreeMap<String, Value>> for Bindings {
    /// Actions and keys of another version of the game are left out, and cost nobody the others.
    fn from(file: BTreeMap<String, Value>) -> Self {
        let mut bindings = Self { all: BTreeMap::new(), lost: Vec::new() };
        for (name, texts) in file {
            let name: StringDeserializer<Error> = name.into_deserializer();
            let Ok(action) = Action::deserialize(name) else { continue };
            let own = bindings.all.entry(action).or_default();
            let Value::Array(texts) = texts else {
                bindings.lost.push((action, Device::Keyboard));
                continue;
            };
            for text in &texts {
                let text = text.as_str().unwrap_or_default();
                match Binding::try_from(text.to_owned()) {
                    Ok(binding) => own.push(binding),
                    Err(_) => bindings.lost.push((action, Device::meant_by(text))),
                }
            }
        }
        bindings
    }
}

impl From<Bindings> for BTreeMap<Action, Vec<Binding>> {
    fn from(bindings: Bindings) -> Self {
        bindings.all
    }
}

impl Default for Bindings {
    fn default() -> Self {
        use Action as A;
        use Binding::{Key, Mouse, Pad, WheelDown, WheelUp};
        use GamepadButton as G;
        use KeyCode as K;
        let all: [(Action, &[Binding]); 30] = [
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
            (A::Slot8, &[Key(K::Digit8)]),
            (A::NextTool, &[Pad(G::RightTrigger)]),
            (A::PreviousTool, &[Pad(G::LeftTrigger)]),
            (A::NextMaterial, &[Key(K::KeyE), Pad(G::DPadRight)]),
            (A::PreviousMaterial, &[Key(K::KeyQ), Pad(G::DPadLeft)]),
            (A::Grow, &[WheelUp, Key(K::Equal), Pad(G::DPadUp)]),
            (A::Shrink, &[WheelDown, Key(K::Minus), Pad(G::DPadDown)]),
            (A::Form, &[Key(K::KeyC), Pad(G::West)]),
            (A::Headlamp, &[Key(K::KeyF), Pad(G::North)]),
            (A::Undo, &[Key(K::KeyZ), Pad(G::East)]),
            (A::Redo, &[Key(K::KeyY), Pad(G::RightThumb)]),
            (A::Help, &[Key(K::KeyH), Pad(G::Select)]),
            (A::Figures, &[Key(K::F3)]),
            (A::Panel, &[Key(K::F1)]),
            (A::Pause, &[Key(K::Escape), Pad(G::Start)]),
        ];
        let all = all.into_iter().map(|(action, bindings)| (action, bindings.to_vec())).collect();
        Self { all, lost: Vec::new() }
    }
}

impl Bindings {
    /// The keys and buttons of an action.
    pub fn of(&self, action: Action) -> &[Binding] {
        self.all.get(&action).map_or(&[], Vec::as_slice)
    }

    /// The first key or button of an action, as it is written on the screen.
    pub fn first(&self, action: Action, labels: &Labels) -> String {
        self.of(action).first().map_or_else(|| "-".into(), |binding| labels.of(*binding))
    }

    /// Gives an action a key or button in place of those of the same device: a gamepad's button leaves the keys alone, and
    /// so does the mouse. Whoever had it loses it, and is returned.
    pub fn rebind(&mut self, action: Action, binding: Binding) -> Option<Action> {
        let loser = self
            .all
            .iter()
            .find(|(other, bindings)| **other != action && bindings.contains(&binding))
            .map(|(other, _)| *other);
        if let Some(bindings) = loser.and_then(|loser| self.all.get_mut(&loser)) {
            bindings.retain(|other| *other != binding);
        }
        let own = self.all.entry(action).or_default();
        own.retain(|old| old.device() != binding.device());
        own.insert(0, binding);
        loser
    }

    /// What a file leaves open: no key has two actions, the first one keeps it; and actions without any key get those
    /// that they have by default, unless they are taken. Escape is the pause's own. Who lost a key or a button that could
    /// not be read, and has no other of that kind, gets it back in the same way; says who did.
    pub fn complete(&mut self) -> Vec<Action> {
        let mut taken = HashSet::new();
        for (action, bindings) in &mut self.all {
            bindings.retain(|binding| {
                (*action == Action::Pause || *binding != Binding::Key(KeyCode::Escape))
                    && taken.insert(*binding)
            });
        }
        let mut mended = Vec::new();
        for (action, defaults) in Self::default().all {
            let own = self.all.entry(action).or_default();
            let mut fill = |own: &mut Vec<Binding>, belongs: &dyn Fn(&Binding) -> bool| {
                own.extend(defaults.iter().copied().filter(|one| belongs(one) && taken.insert(*one)));
            };
            let before = own.len();
            if own.is_empty() {
                fill(own, &|_| true);
            }
            for &(_, device) in self.lost.iter().filter(|lost| lost.0 == action) {
                // Nobody is left with a gamepad alone that he may not have.
                let (is_such, is_near) = (
                    |one: &Binding| one.device() == device,
                    |one: &Binding| (one.device() == Device::Pad) == (device == Device::Pad),
                );
                if !own.iter().any(is_near) {
                    fill(own, &is_near);
                } else if !own.iter().any(is_such) {
                    fill(own, &is_such);
                }
            }
            if own.len() > before && self.lost.iter().any(|lost| lost.0 == action) {
                mended.push(action);
            }
        }
        self.lost.clear();
        mended
    }
}

#[cfg(test)]
#[path = "bindings_tests.rs"]
mod tests;
