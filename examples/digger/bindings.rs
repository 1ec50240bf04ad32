//! Which keys, buttons and turns of the wheel mean which actions, as the page of controls and the file of settings have it.

use std::collections::{BTreeMap, HashSet};
use std::fmt;

use bevy::prelude::*;
use bevy::reflect::Typed;
use bevy::reflect::enums::{DynamicEnum, DynamicVariant, VariantType};
use serde::de::IntoDeserializer;
use serde::de::value::StringDeserializer;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use crate::input::Action;

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
#[derive(Clone, Copy, PartialEq, Eq)]
enum Device {
    Keyboard,
    Mouse,
    Pad,
}

impl Binding {
    const fn device(self) -> Device {
        match self {
            Self::Key(_) => Device::Keyboard,
            Self::Mouse(_) | Self::WheelUp | Self::WheelDown => Device::Mouse,
            Self::Pad(_) => Device::Pad,
        }
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
    let texts = BTreeMap::<String, Value>::deserialize(reader)?;
    let action = |name: String| {
        let name: StringDeserializer<D::Error> = name.into_deserializer();
        Action::deserialize(name).ok()
    };
    let known = |texts: Value| {
        let texts = texts.as_array().into_iter().flatten().filter_map(Value::as_str);
        texts.filter_map(|text| Binding::try_from(text.to_owned()).ok()).collect()
    };
    Ok(texts.into_iter().filter_map(|(name, texts)| Some((action(name)?, known(texts)))).collect())
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

    /// Gives an action a key or button in place of those of the same device: a gamepad's button leaves the keys alone, and
    /// so does the mouse. Whoever had it loses it, and is returned.
    pub fn rebind(&mut self, action: Action, binding: Binding) -> Option<Action> {
        let loser = self
            .0
            .iter()
            .find(|(other, bindings)| **other != action && bindings.contains(&binding))
            .map(|(other, _)| *other);
        if let Some(bindings) = loser.and_then(|loser| self.0.get_mut(&loser)) {
            bindings.retain(|other| *other != binding);
        }
        let own = self.0.entry(action).or_default();
        own.retain(|old| old.device() != binding.device());
        own.insert(0, binding);
        loser
    }

    /// What a file leaves open: no key has two actions, the first one keeps it; and actions without any key get those
    /// that they have by default, unless they are taken. Escape is the pause's own.
    pub fn complete(&mut self) {
        let mut taken = HashSet::new();
        for (action, bindings) in &mut self.0 {
            bindings.retain(|binding| {
                (*action == Action::Pause || *binding != Binding::Key(KeyCode::Escape))
                    && taken.insert(*binding)
            });
        }
        for (action, bindings) in Self::default().0 {
            let own = self.0.entry(action).or_default();
            if own.is_empty() {
                own.extend(bindings.into_iter().filter(|binding| taken.insert(*binding)));
            }
        }
    }
}

#[cfg(test)]
#[path = "bindings_tests.rs"]
mod tests;
