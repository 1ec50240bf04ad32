//! What stands on the keys. A key is bound by its place on the keyboard, whatever the layout; to the player it is called by
//! its letter. Nobody tells the game the layout, but each key that is pressed tells its own letter.

use std::collections::BTreeMap;

use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::prelude::*;

use crate::player::bindings::Binding;

/// Letters of the keys that were pressed so far.
#[derive(Resource, Clone, Debug, Default)]
pub struct Labels(BTreeMap<KeyCode, char>);

impl Labels {
    /// A key, a button or a turn of the wheel, as it is written on the screen.
    pub fn of(&self, binding: Binding) -> String {
        let name = binding.to_string();
        let Binding::Key(key) = binding else { return name };
        if let Some(letter) = self.0.get(&key) {
            return letter.to_string();
        }
        // Layouts exchange letters: where this one's is found elsewhere, that one's is most likely here.
        let other = self.0.iter().find(|(_, letter)| name == letter.to_string());
        other.map_or(name, |(other, _)| Binding::Key(*other).to_string())
    }
}

/// Only letters are learnt, and only those that the font has: digits and signs are others with Shift.
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

    /// What keys are called once some of them were pressed, each with the text that it types.
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

    fn called(labels: &Labels, key: KeyCode) -> String {
        labels.of(Binding::Key(key))
    }

    #[test]
    fn keys_are_called_what_stands_on_them() {
        let none = labels(&[]);
        assert_eq!([KeyCode::KeyZ, KeyCode::KeyY].map(|key| called(&none, key)), ["Z", "Y"]);
        // One of the two keys of a German keyboard that are exchanged tells of the other.
        let german = labels(&[(KeyCode::KeyY, "z")]);
        assert_eq!([KeyCode::KeyZ, KeyCode::KeyY].map(|key| called(&german, key)), ["Y", "Z"]);
        let both = labels(&[(KeyCode::KeyY, "z"), (KeyCode::KeyZ, "Y")]);
        assert_eq!([KeyCode::KeyZ, KeyCode::KeyY].map(|key| called(&both, key)), ["Y", "Z"]);
        // Who changes the layout is understood.
        let changed = labels(&[(KeyCode::KeyY, "z"), (KeyCode::KeyY, "y")]);
        assert_eq!([KeyCode::KeyZ, KeyCode::KeyY].map(|key| called(&changed, key)), ["Z", "Y"]);
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
        assert_eq!(keys.map(|key| called(&some, key)), ["1", "2", "W", "M", "X"]);
        assert_eq!(some.of(Binding::Mouse(MouseButton::Left)), "Mouse Left");
    }
}
