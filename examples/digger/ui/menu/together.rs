//! The page for playing together: the player's name, hosting the world, joining another one.

use std::net::SocketAddr;

use bevy::prelude::*;

use super::fields::{Field, spawn_field};
use super::{spawn_back, spawn_page, worlds};
use crate::party::connection::{Address, NoAddress, PORT, Party, own_address};
use crate::player::game_state::MenuPage;
use crate::ui::settings::Settings;
use crate::ui::texts;
use crate::ui::widgets::{self, Activated, GREY, RED};
use crate::world::folders::WorldsFolder;
use crate::world::saves::{self, PlayedWorld};

/// Width of the rows.
const WIDTH: f32 = 520.0;

/// The page for playing together.
pub struct TogetherPagePlugin;

impl Plugin for TogetherPagePlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(MenuPage::Together), open);
    }
}

/// What went wrong, or how others join.
#[derive(Component)]
struct Note;

fn open(mut commands: Commands, party: Res<Party>, worlds: Res<WorldsFolder>, played: Res<PlayedWorld>) {
    spawn_page(&mut commands, MenuPage::Together, texts::MULTIPLAYER, WIDTH + 54.0, |column| {
        spawn_field(column, 0, texts::YOUR_NAME, Field::PlayerName, WIDTH);
        let port = if let Party::Host(port) = *party { port } else { PORT };
        let address = own_address()
            .map(|address| Address(SocketAddr::new(address, port), saves::seed(&played, &party)));
        let address = address.map_or_else(|| texts::THIS_MACHINE.into(), |address| address.to_string());
        let (host, note) = match *party {
            Party::Alone => (texts::HOST, texts::would_join_at(address)),
            Party::Host(_) => (texts::STOP_HOSTING, texts::join_at(address)),
            Party::Guest(host, seed) => (texts::LEAVE, texts::joined(Address(host, seed))),
        };
        column.spawn(widgets::button(1, host, WIDTH)).observe(change_host);
        spawn_field(column, 2, texts::HOST_ADDRESS, Field::Address, WIDTH);
        column.spawn(widgets::button(3, texts::JOIN, WIDTH)).observe(join);
        let line = Node { width: px(WIDTH - 28.0), margin: UiRect::axes(px(14), px(8)), ..default() };
        let is_saved = match *party {
            Party::Alone => worlds.0.is_some(),
            Party::Host(_) => played.0.is_some(),
            Party::Guest(..) => true,
        };
        let saved = if is_saved { "" } else { texts::NOT_SAVED };
        column.spawn((Note, widgets::paragraph(format!("{note}{saved}"), 15.0, GREY), line));
        spawn_back(column, 4, WIDTH, MenuPage::Together);
    });
}

/// Hosts the world that is played; a host or a guest plays alone again.
fn change_host(_: On<Activated>, mut commands: Commands, party: Res<Party>) {
    worlds::begin(&mut commands, if *party == Party::Alone { Party::Host(PORT) } else { Party::Alone });
}

fn join(
    _: On<Activated>,
    mut commands: Commands,
    settings: Res<Settings>,
    mut note: Query<(&mut Text, &mut TextColor), With<Note>>,
) {
    let address: Result<Address, NoAddress> = settings.host_address.parse();
    match address {
        Ok(Address(host, seed)) => worlds::begin(&mut commands, Party::Guest(host, seed)),
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
    use bevy::input::ButtonState;
    use bevy::input::keyboard::{Key, KeyboardInput};

    use super::*;
    use crate::party::players::MAX_LETTERS;
    use crate::test_support::tap_key;
    use crate::ui::menu::title::Start;
    use crate::ui::menu::{click, item_at, words};
    use crate::ui::widgets::MenuInputDisabled;

    /// On a machine without a folder for data.
    fn app() -> App {
        let plugin = |app: &mut App| {
            app.init_resource::<Party>()
                .init_resource::<Start>()
                .init_resource::<PlayedWorld>()
                .init_resource::<WorldsFolder>()
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
        assert_eq!(app.world().resource::<Settings>().name.len(), MAX_LETTERS);
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
        assert_eq!(*app.world().resource::<Party>(), Party::Guest(([10, 0, 0, 3], PORT).into(), 0));
    }

    #[test]
    fn a_click_that_ends_typing_also_chooses_another_item() {
        let mut app = app();
        activate(&mut app, 0);
        write_text(&mut app, "Ann");
        click(&mut app, 4);
        assert_eq!(app.world().resource::<Settings>().name, "Ann");
        assert_eq!(**app.world().resource::<State<MenuPage>>(), MenuPage::Menu);
    }

    #[test]
    fn a_world_that_cannot_be_saved_is_hosted_or_played_after_a_question_only() {
        let guest = Party::Guest(([10, 0, 0, 3], PORT).into(), 0);
        for (before, after) in [(Party::Alone, Party::Host(PORT)), (guest, Party::Alone)] {
            let mut app = app();
            app.insert_resource(before.clone());
            click(&mut app, 1);
            assert_eq!(**app.world().resource::<State<MenuPage>>(), MenuPage::Question);
            assert!(words(&mut app).contains(&texts::nothing_saved(texts::NO_FOLDER)));
            assert_eq!(*app.world().resource::<Party>(), before);
            assert!(!app.world().resource::<Start>().is_wanted);
            click(&mut app, 1);
            assert_eq!(*app.world().resource::<Party>(), after);
            assert!(app.world().resource::<Start>().is_wanted);
        }
    }

    #[test]
    fn who_leaves_a_host_plays_a_world_that_is_saved() {
        let all = std::env::temp_dir().join(format!("digger_leave_{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&all);
        let mut app = app();
        app.insert_resource(WorldsFolder(Some(all.clone())))
            .insert_resource(Party::Guest(([10, 0, 0, 3], PORT).into(), 0));
        click(&mut app, 1);
        assert_eq!(*app.world().resource::<Party>(), Party::Alone);
        assert_eq!(app.world().resource::<PlayedWorld>().0, Some(all.join("world 1")));
        assert!(app.world().resource::<Start>().is_wanted);
        std::fs::remove_dir_all(&all).expect("removed");
    }
}
