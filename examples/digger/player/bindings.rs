//! Bindings: the keys, buttons and turns of the wheel for each action, and how the settings file stores them.

use std::collections::{BTreeMap, HashSet};
use std::fmt;
use std::str::FromStr;

use bevy::prelude::*;
use bevy::reflect::Typed;
use bevy::reflect::enums::{DynamicEnum, DynamicVariant, VariantType};
use serde::de::IntoDeserializer;
use serde::de::value::{Error, StringDeserializer};
use serde::{Deserialize, Serialize};

use crate::player::input::Action;
use crate::ui::labels::Labels;
use crate::ui::texts;

/// A key, a button, or a turn of the wheel. The settings file has it as a text such as `KeyW`, `Mouse Left` or `Pad
/// South`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Binding {
    Key(KeyCode),
    Mouse(MouseButton),
    WheelUp,
    WheelDown,
    Pad(GamepadButton),
}

impl Binding {
    fn is_of_same_device(self, other: Self) -> bool {
        let device = |binding: Self| match binding {
            Self::Key(_) => 0,
            Self::Mouse(_) | Self::WheelUp | Self::WheelDown => 1,
            Self::Pad(_) => 2,
        };
        device(self) == device(other)
    }

    /// Whether its text can be read again. Keys that no layout knows have only a number of the platform.
    pub fn can_be_saved(self) -> bool {
        Self::try_from(String::from(self)) == Ok(self)
    }
}

/// A text that names no key or button.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("there is no key or button {0:?}")]
pub struct UnknownBinding(String);

/// Finds the unit variant with this name by reflection, because Bevy has hundreds of keys.
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

/// The usual name, for players.
impl fmt::Display for Binding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&match self {
            Self::Key(key) => texts::key(&format!("{key:?}")),
            Self::Mouse(button) => texts::mouse(&format!("{button:?}")),
            Self::WheelUp => texts::WHEEL[0].into(),
            Self::WheelDown => texts::WHEEL[1].into(),
            Self::Pad(button) => texts::pad(&format!("{button:?}")),
        })
    }
}

/// The bindings of each action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "BTreeMap<String, Vec<String>>", into = "BTreeMap<Action, Vec<Binding>>")]
pub struct Bindings(BTreeMap<Action, Vec<Binding>>);

impl From<Bindings> for BTreeMap<Action, Vec<Binding>> {
    fn from(bindings: Bindings) -> Self {
        bindings.0
    }
}

impl From<BTreeMap<String, Vec<String>>> for Bindings {
    /// Reads what a settings file has. Another version of the game may have written it, or a player by hand:
    /// - Unknown actions are ignored. Actions that are missing, or have a text that cannot be read, get their default
    ///   bindings, except those that another action has.
    /// - A binding belongs to the first action that has it. Escape belongs to the pause.
    fn from(file: BTreeMap<String, Vec<String>>) -> Self {
        let known = file.into_iter().filter_map(|(name, texts)| {
            let name: StringDeserializer<Error> = name.into_deserializer();
            Some((Action::deserialize(name).ok()?, texts))
        });
        let known: BTreeMap<Action, Vec<String>> = known.collect();
        let mut taken = HashSet::new();
        let mut unreadable = HashSet::new();
        let mut all = BTreeMap::<Action, Vec<Binding>>::new();
        for (action, texts) in known {
            let own = all.entry(action).or_default();
            for text in texts {
                match Binding::try_from(text) {
                    Ok(Binding::Key(KeyCode::Escape)) if action != Action::Pause => {}
                    Ok(binding) if taken.insert(binding) => own.push(binding),
                    Ok(_) => {}
                    Err(_) => drop(unreadable.insert(action)),
                }
            }
        }
        for (action, defaults) in Action::ALL {
            let own = all.entry(action).or_default();
            if own.is_empty() || unreadable.contains(&action) {
                own.extend(defaults.iter().filter(|binding| taken.insert(**binding)));
            }
        }
        Self(all)
    }
}

impl Default for Bindings {
    fn default() -> Self {
        Self(Action::ALL.iter().map(|(action, bindings)| (*action, bindings.to_vec())).collect())
    }
}

impl Bindings {
    /// The bindings of an action.
    pub fn of(&self, action: Action) -> &[Binding] {
        self.0.get(&action).map_or(&[], Vec::as_slice)
    }

    /// The label of an action's first binding, "-" if it has none. Gamepads count only where they are compiled in.
    pub fn first(&self, action: Action, labels: &Labels) -> String {
        let mut usable = self
            .of(action)
            .iter()
            .filter(|binding| cfg!(feature = "gamepad") || !matches!(binding, Binding::Pad(_)));
        usable.next().map_or_else(|| "-".into(), |binding| labels.of(*binding))
    }

    /// Replaces an action's bindings of the same device: a gamepad button leaves keys and mouse buttons as they are. If
    /// another action has the binding, that action loses it and is returned.
    pub fn rebind(&mut self, action: Action, binding: Binding) -> Option<Action> {
        let mut others = self.0.iter_mut().filter(|(other, _)| **other != action);
        let loser = others.find(|(_, bindings)| bindings.contains(&binding));
        let loser = loser.map(|(loser, bindings)| {
            bindings.retain(|other| *other != binding);
            *loser
        });
        let own = self.0.entry(action).or_default();
        own.retain(|old| !old.is_of_same_device(binding));
        own.insert(0, binding);
        loser
    }
}

#[cfg(test)]
#[path = "bindings_tests.rs"]
mod tests;
