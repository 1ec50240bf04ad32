//! The page for playing together: the player's name, hosting the world, joining another one.

use std::net::SocketAddr;

use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::prelude::*;

use super::title::Start;
use super::{go_to, spawn_page, worlds};
use crate::party::connection::{Address, NoAddress, PORT, Party, own_address};
use crate::party::players::MOST_LETTERS;
use crate::player::game_state::MenuPage;
use crate::ui::settings::Settings;
use crate::ui::widgets::{self, Activated, GOLD, GREY, MenuInputDisabled, RED, WHITE, text};
use crate::world::saves::PlayedWorld;

/// Width of the rows.
const WIDTH: f32 = 520.0;
/// Most letters of an address.
const MAX_ADDRESS_LETTERS: usize = 48;

/// The page for playing together.
pub struct TogetherPagePlugin;

impl Plugin for TogetherPagePlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(MenuPage::Together), open)
            // After the key that activated a field.
            .add_systems(Update, (write, show).chain().run_if(in_state(MenuPage::Together)))
            .add_systems(OnExit(MenuPage::Together), stop_writing);
    }
}

/// A text that the player can write.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
enum Field {
    Name,
    Address,
}

impl Field {
    fn of(self, settings: &Settings) -> &String {
        match self {
            Self::Name => &settings.name,
            Self::Address => &settings.host_address,
        }
    }

    fn of_mut(self, settings: &mut Settings) -> (&mut String, usize) {
        match self {
            Self::Name => (&mut settings.name, MOST_LETTERS),
            Self::Address => (&mut settings.host_address, MAX_ADDRESS_LETTERS),
        }
    }
}

/// The field that is written, and what was there.
#[derive(Resource, Clone)]
struct Writing(Field, String);

/// What went wrong, or how others join.
#[derive(Component)]
struct Note;

fn open(mut commands: Commands, party: Res<Party>, played: Res<PlayedWorld>) {
    spawn_page(&mut commands, MenuPage::Together, "Together", WIDTH + 54.0, |column| {
        field(column, 0, "Your name", Field::Name);
        let port = if let Party::Host(port) = *party { port } else { PORT };
        let address = own_address().map(|address| SocketAddr::new(address, port));
        let address = address.map_or_else(|| "this machine's address".into(), |address| address.to_string());
        let (host, note) = match *party {
            Party::Alone if played.0.is_none() => {
                ("Host a new world", format!("others then join at {address}"))
            }
            Party::Alone => ("Let others join this world", format!("others then join at {address}")),
            Party::Host(_) => ("Let nobody join any more", format!("others join at {address}")),
            Party::Guest(host) => ("Leave", format!("you are at {host}")),
        };
        column.spawn(widgets::button(1, host, WIDTH)).observe(change_host);
        field(column, 2, "Address of a host", Field::Address);
        column.spawn(widgets::button(3, "Join", WIDTH)).observe(join);
        let line = Node { width: px(WIDTH - 28.0), margin: UiRect::axes(px(14), px(8)), ..default() };
        let is_saved = played.0.is_some() || matches!(*party, Party::Guest(_));
        let saved = if is_saved { "" } else { "; nothing is saved" };
        column.spawn((Note, text(format!("{note}{saved}"), 15.0, GREY), line));
        column.spawn(widgets::button(4, "Back", WIDTH)).observe(go_to(MenuPage::Menu));
    });
}

/// A row with a text that can be written.
fn field(column: &mut ChildSpawnerCommands, at: usize, label: &str, field: Field) {
    let row = Node {
        width: px(WIDTH),
        padding: UiRect::axes(px(18), px(9)),
        justify_content: JustifyContent::SpaceBetween,
        ..default()
    };
    let texts = children![text(label, 22.0, WHITE), (field, text("", 22.0, GOLD))];
    column.spawn((widgets::item(at, row), texts)).observe(
        move |_: On<Activated>, mut commands: Commands, settings: Res<Settings>| {
            commands.insert_resource(Writing(field, field.of(&settings).clone()));
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
    let (words, most) = field.of_mut(&mut settings);
    for press in presses {
        match &press.logical_key {
            Key::Enter => is_done = true,
            Key::Escape => {
                words.clone_from(before);
                is_done = true;
            }
            Key::Backspace => drop(words.pop()),
            Key::Space => words.push(' '),
            Key::Character(letters) => words.extend(letters.chars().filter(char::is_ascii_graphic)),
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

fn stop_writing(mut commands: Commands) {
    commands.remove_resource::<Writing>();
    commands.remove_resource::<MenuInputDisabled>();
}

fn show(
    settings: Res<Settings>,
    writing: Option<Res<Writing>>,
    mut fields: Query<(&Field, &mut Text, &mut TextColor)>,
) {
    for (field, mut text, mut color) in &mut fields {
        let is_written = writing.as_ref().is_some_and(|writing| writing.0 == *field);
        let words = match field.of(&settings) {
            words if is_written => format!("{words}_"),
            words if words.is_empty() => "...".into(),
            words => words.clone(),
        };
        text.set_if_neq(Text::new(words));
        color.set_if_neq(TextColor(if is_written { WHITE } else { GOLD }));
    }
}

/// Hosts the world that is played; a host or a guest plays alone again.
fn change_host(_: On<Activated>, mut commands: Commands, mut party: ResMut<Party>, mut start: ResMut<Start>) {
    *party = if *party == Party::Alone { Party::Host(PORT) } else { Party::Alone };
    worlds::begin(&mut commands, &mut start);
}

fn join(
    _: On<Activated>,
    mut commands: Commands,
    settings: Res<Settings>,
    mut party: ResMut<Party>,
    mut start: ResMut<Start>,
    mut note: Query<(&mut Text, &mut TextColor), With<Note>>,
) {
    let address: Result<Address, NoAddress> = settings.host_address.parse();
    match address {
        Ok(Address(host)) => {
            *party = Party::Guest(host);
            worlds::begin(&mut commands, &mut start);
        }
        Err(why) => {
            for (mut text, mut color) in &mut note {
                *text = Text::new(why.to_string());
                *color = TextColor(RED);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::player::game_state::GameState;
    use crate::test_support::tap_key;
    use crate::ui::menu::item_at;

    fn app() -> App {
        let plugin = |app: &mut App| {
            app.init_state::<GameState>()
                .init_resource::<Party>()
                .init_resource::<Start>()
                .init_resource::<PlayedWorld>()
                .add_plugins(TogetherPagePlugin);
        };
        crate::ui::menu::app_with(plugin, MenuPage::Together)
    }

    fn press(app: &mut App, logical_key: Key) {
        app.world_mut().write_message(KeyboardInput {
            key_code: KeyCode::KeyA,
            logical_key,
            state: ButtonState::Pressed,
            text: None,
            repeat: false,
            window: Entity::PLACEHOLDER,
        });
        app.update();
    }

    fn activate(app: &mut App, position: usize) {
        let entity = item_at(app, position);
        app.world_mut().trigger(Activated { entity });
        app.update();
    }

    fn write_text(app: &mut App, text: &str) {
        text.chars().for_each(|letter| press(app, Key::Character(letter.to_string().into())));
    }

    #[test]
    fn names_and_addresses_are_written_letter_by_letter() {
        let mut app = app();
        activate(&mut app, 0);
        write_text(&mut app, "Bobs");
        press(&mut app, Key::Backspace);
        assert!(app.world().contains_resource::<MenuInputDisabled>(), "letters are not for the menu");
        press(&mut app, Key::Enter);
        assert_eq!(app.world().resource::<Settings>().name, "Bob");
        assert!(!app.world().contains_resource::<MenuInputDisabled>());
        // Nothing is written any more.
        write_text(&mut app, "x");
        assert_eq!(app.world().resource::<Settings>().name, "Bob");
        activate(&mut app, 0);
        write_text(&mut app, &"y".repeat(40));
        assert_eq!(app.world().resource::<Settings>().name.len(), MOST_LETTERS);
        press(&mut app, Key::Escape);
        assert_eq!(app.world().resource::<Settings>().name, "Bob");
    }

    #[test]
    fn what_is_no_address_is_said_and_changes_nothing() {
        let mut app = app();
        app.world_mut().resource_mut::<Settings>().host_address = "nowhere".into();
        activate(&mut app, 3);
        assert_eq!(*app.world().resource::<Party>(), Party::Alone);
        let mut notes = app.world_mut().query_filtered::<&Text, With<Note>>();
        let note = notes.single(app.world()).expect("a note").0.clone();
        assert!(note.contains("nowhere"), "{note}");
        tap_key(&mut app, KeyCode::KeyA);
        app.world_mut().resource_mut::<Settings>().host_address = "10.0.0.3".into();
        activate(&mut app, 3);
        assert_eq!(*app.world().resource::<Party>(), Party::Guest(([10, 0, 0, 3], PORT).into()));
    }
}
