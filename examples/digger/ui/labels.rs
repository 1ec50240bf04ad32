//! Labels of keys. Keys are bound by their position on the keyboard, independent of the layout, but the player should
//! see their letters. The layout cannot be queried, so the letter of each key is learnt when the key is pressed.

use std::collections::BTreeMap;

use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::prelude::*;

use crate::player::bindings::Binding;

/// The letters of the keys that have been pressed.
#[derive(Resource, Clone, Debug, Default)]
pub struct Labels(BTreeMap<KeyCode, char>);

impl Labels {
    /// The label of a binding.
    pub fn of(&self, binding: Binding) -> String {
        let name = binding.to_string();
        let Binding::Key(key) = binding else { return name };
        if let Some(letter) = self.0.get(&key) {
            return letter.to_string();
        }
        // Layouts swap letters. If this key's letter is on another key, then that key's letter is most likely on this
        // one.
        let other = self.0.iter().find(|(_, letter)| name == letter.to_string());
        other.map_or(name, |(other, _)| Binding::Key(*other).to_string())
    }
}

/// Learns letters only, and only those that the font has: Shift changes digits and punctuation.
pub fn learn(mut presses: MessageReader<KeyboardInput>, mut labels: ResMut<Labels>) {
    for press in presses.read().filter(|press| press.state == ButtonState::Pressed) {
        let Key::Character(text) = &press.logical_key else { continue };
        let mut letters = text.chars();
        let (Some(letter), None) = (letters.next(), letters.next()) else { continue };
        let letter = letter.to_ascii_uppercase();
        if letter.is_ascii_uppercase() && labels.0.get(&press.key_code) != Some(&letter) {
            labels.0.insert(press.key_code, letter);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The labels after these keys were pressed, each typing a text.
    fn labels(presses: &[(KeyCode, &str)]) -> Labels {
        let mut app = App::new();
        app.init_resource::<Labels>().add_message::<KeyboardInput>().add_systems(Update, learn);
        for &(key_code, text) in presses {
            app.world_mut().write_message(KeyboardInput {
                key_code,
                logical_key: Key::Character(text.into()),
                state: ButtonState::Pressed,
                text: None,
                repeat: false,
                window: Entity::PLACEHOLDER,
            });
        }
        app.update();
        app.world().resource::<Labels>().clone()
    }

    fn label(labels: &Labels, key: KeyCode) -> String {
        labels.of(Binding::Key(key))
    }

    #[test]
    fn keys_are_labelled_with_their_letters() {
        let none = labels(&[]);
        assert_eq!([KeyCode::KeyZ, KeyCode::KeyY].map(|key| label(&none, key)), ["Z", "Y"]);
        // Y and Z are swapped on a German keyboard: one tells about the other.
        let german = labels(&[(KeyCode::KeyY, "z")]);
        assert_eq!([KeyCode::KeyZ, KeyCode::KeyY].map(|key| label(&german, key)), ["Y", "Z"]);
        let both = labels(&[(KeyCode::KeyY, "z"), (KeyCode::KeyZ, "Y")]);
        assert_eq!([KeyCode::KeyZ, KeyCode::KeyY].map(|key| label(&both, key)), ["Y", "Z"]);
        // The player changes the layout.
        let changed = labels(&[(KeyCode::KeyY, "z"), (KeyCode::KeyY, "y")]);
        assert_eq!([KeyCode::KeyZ, KeyCode::KeyY].map(|key| label(&changed, key)), ["Z", "Y"]);
    }

    #[test]
    fn only_letters_are_learnt() {
        let some = labels(&[
            (KeyCode::Digit1, "&"),
            (KeyCode::Digit2, "é"),
            (KeyCode::KeyW, "ц"),
            (KeyCode::KeyM, ","),
            (KeyCode::KeyX, "xx"),
        ]);
        let keys = [KeyCode::Digit1, KeyCode::Digit2, KeyCode::KeyW, KeyCode::KeyM, KeyCode::KeyX];
        assert_eq!(keys.map(|key| label(&some, key)), ["1", "2", "W", "M", "X"]);
        assert_eq!(some.of(Binding::Mouse(MouseButton::Left)), "Left mouse");
    }
}
