//! Texts that the player can type: names, an address, a seed.

use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::prelude::*;

use crate::party::players::MAX_LETTERS;
use crate::player::game_state::MenuPage;
use crate::ui::settings::Settings;
use crate::ui::widgets::{self, Activated, GOLD, MenuInputDisabled, MenuPointerSystems, WHITE, text};

/// Lets the player type.
pub struct FieldsPlugin;

impl Plugin for FieldsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Draft>()
            // After the key that activated a field, and before the click that ends typing chooses another item.
            .add_systems(
                Update,
                (write, show).chain().before(MenuPointerSystems).run_if(not(in_state(MenuPage::None))),
            )
            .add_systems(StateTransition, stop_writing.run_if(state_changed::<MenuPage>));
    }
}

/// A text that the player can type.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    PlayerName,
    Address,
    WorldName,
    Seed,
}

/// The input for a world that is being created or renamed.
#[derive(Resource, Clone, Debug, Default)]
pub struct Draft {
    pub name: String,
    pub seed: String,
}

impl Field {
    fn of(self, settings: &Settings, draft: &Draft) -> String {
        match self {
            Self::PlayerName => &settings.name,
            Self::Address => &settings.host_address,
            Self::WorldName => &draft.name,
            Self::Seed => &draft.seed,
        }
        .clone()
    }

    /// The text to change, and how many letters it may have.
    fn of_mut<'a>(self, settings: &'a mut Settings, draft: &'a mut Draft) -> (&'a mut String, usize) {
        match self {
            Self::PlayerName => (&mut settings.name, MAX_LETTERS),
            Self::Address => (&mut settings.host_address, 48),
            Self::WorldName => (&mut draft.name, 24),
            Self::Seed => (&mut draft.seed, 9),
        }
    }

    fn takes(self, letter: char) -> bool {
        if self == Self::Seed { letter.is_ascii_digit() } else { letter.is_ascii_graphic() || letter == ' ' }
    }
}

/// The field that is written, and what was there.
#[derive(Resource, Clone)]
struct Writing(Field, String);

/// The width that a field's text may have. A long text is smaller.
#[derive(Component)]
struct Room(f32);

/// A row with a text that can be typed.
pub fn spawn_field(column: &mut ChildSpawnerCommands, at: usize, label: &str, field: Field, width: f32) {
    let row = Node {
        width: px(width),
        padding: UiRect::axes(px(18), px(9)),
        justify_content: JustifyContent::SpaceBetween,
        ..default()
    };
    let room = Room(width - 60.0 - widgets::width(label, 22.0));
    let texts = children![text(label, 22.0, WHITE), (field, room, text("", 22.0, GOLD))];
    column.spawn((widgets::item(at, row), texts)).observe(
        move |_: On<Activated>, mut commands: Commands, settings: Res<Settings>, draft: Res<Draft>| {
            commands.insert_resource(Writing(field, field.of(&settings, &draft)));
            commands.insert_resource(MenuInputDisabled);
        },
    );
}

/// Writes what is typed. Enter and a click end it, and Escape brings back what was there.
fn write(
    mut commands: Commands,
    writing: Option<Res<Writing>>,
    mut presses: MessageReader<KeyboardInput>,
    mouse: Res<ButtonInput<MouseButton>>,
    mut settings: ResMut<Settings>,
    mut draft: ResMut<Draft>,
) {
    let presses = presses.read().filter(|press| press.state == ButtonState::Pressed);
    // The press that chose the field is not written.
    let Some(writing) = writing.filter(|writing| !writing.is_added()) else { return presses.for_each(drop) };
    let Writing(field, before) = &*writing;
    let mut is_done = mouse.just_pressed(MouseButton::Left);
    let presses: Vec<_> = presses.collect();
    if presses.is_empty() && !is_done {
        return;
    }
    let (words, most) = field.of_mut(&mut settings, &mut draft);
    for press in presses {
        match &press.logical_key {
            Key::Enter => is_done = true,
            Key::Escape => {
                words.clone_from(before);
                is_done = true;
            }
            Key::Backspace => drop(words.pop()),
            Key::Space => words.extend([' '].iter().filter(|letter| field.takes(**letter))),
            Key::Character(letters) => words.extend(letters.chars().filter(|letter| field.takes(*letter))),
            _ => {}
        }
        while words.chars().count() > most {
            words.pop();
        }
    }
    if is_done {
        commands.run_system_cached(stop_writing);
    }
}

fn stop_writing(mut commands: Commands, writing: Option<Res<Writing>>) {
    if writing.is_some() {
        commands.remove_resource::<Writing>();
        commands.remove_resource::<MenuInputDisabled>();
    }
}

fn show(
    settings: Res<Settings>,
    draft: Res<Draft>,
    writing: Option<Res<Writing>>,
    mut fields: Query<(&Field, &Room, &mut Text, &mut TextFont, &mut TextColor)>,
) {
    for (field, room, mut text, mut font, mut color) in &mut fields {
        let is_written = writing.as_ref().is_some_and(|writing| writing.0 == *field);
        let words = match field.of(&settings, &draft) {
            words if is_written => format!("{words}_"),
            words if words.is_empty() => "...".into(),
            words => words,
        };
        font.set_if_neq(TextFont::from_font_size(widgets::fitting(&words, room.0)));
        text.set_if_neq(Text::new(words));
        color.set_if_neq(TextColor(if is_written { WHITE } else { GOLD }));
    }
}
