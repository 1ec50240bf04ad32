//! The page of saved worlds: each continues where it was left.

use std::time::SystemTime;

use bevy::prelude::*;

use super::spawn_page;
use super::title::Start;
use crate::party::connection::Party;
use crate::player::game_state::{GameState, MenuPage};
use crate::ui::widgets::{self, Activated, GREY, WHITE};
use crate::world::landscape::NewGame;
use crate::world::saves::{self, FoundWorld, PlayedWorld};
use crate::world::thumbnails;

/// Width of the buttons.
const WIDTH: f32 = 420.0;
/// Size of the pictures.
const PICTURE: Vec2 = Vec2::new(96.0, 54.0);

/// The page of saved worlds.
pub struct WorldsPlugin;

impl Plugin for WorldsPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(MenuPage::Worlds), open);
    }
}

fn open(mut commands: Commands, played: Res<PlayedWorld>, mut images: ResMut<Assets<Image>>) {
    let worlds = saves::worlds();
    let played = played.0.clone();
    spawn_page(&mut commands, MenuPage::Worlds, "Worlds", WIDTH + 54.0, |column| {
        let count = worlds.len();
        for (at, world) in worlds.into_iter().enumerate() {
            let is_played = played.as_ref() == Some(&world.folder);
            let picture = thumbnails::read(&world.folder).map(|picture| images.add(picture));
            let button = slot(at, &world, is_played, picture);
            let folder = world.folder;
            column.spawn(button).observe(
                move |_: On<Activated>, mut commands: Commands, mut start: ResMut<Start>| {
                    commands.insert_resource(PlayedWorld(Some(folder.clone())));
                    commands.insert_resource(Party::Alone);
                    begin(&mut commands, &mut start);
                },
            );
        }
        if count == 0 {
            column.spawn(widgets::text("nothing has been saved yet", 15.0, GREY));
        }
        column.spawn(widgets::button(count, "Back", WIDTH)).observe(super::go_to(MenuPage::Menu));
    });
}

/// A button with a world's picture, its name, and when it was saved.
fn slot(at: usize, world: &FoundWorld, is_played: bool, picture: Option<Handle<Image>>) -> impl Bundle {
    let node = Node {
        width: px(WIDTH),
        padding: UiRect::axes(px(12), px(4)),
        column_gap: px(16),
        align_items: AlignItems::Center,
        ..default()
    };
    let frame = Node { width: px(PICTURE.x), height: px(PICTURE.y), ..default() };
    let picture = picture.map_or(ImageNode::solid_color(Color::BLACK), ImageNode::new);
    let mark = if is_played { " *" } else { "" };
    let words = (
        widgets::column(px(2)),
        children![
            widgets::text(format!("{}{mark}", world.name()), 20.0, WHITE),
            widgets::text(ago(world.saved), 14.0, GREY)
        ],
    );
    (widgets::item(at, node), children![(picture, frame), words])
}

/// Plays the world that is set now, with the party that is set.
pub fn begin(commands: &mut Commands, start: &mut Start) {
    commands.trigger(NewGame);
    start.is_wanted = true;
    commands.set_state(GameState::Title);
    commands.set_state(MenuPage::Menu);
}

/// How long ago something was.
fn ago(time: SystemTime) -> String {
    let minutes = time.elapsed().map_or(0, |passed| passed.as_secs() / 60);
    match minutes {
        0 => "just now".into(),
        1..60 => format!("{minutes} min ago"),
        60..2880 => format!("{} h ago", minutes / 60),
        _ => format!("{} days ago", minutes / 1440),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn times_are_told_in_words() {
        for (minutes, words) in [(0, "just now"), (59, "59 min ago"), (180, "3 h ago"), (5000, "3 days ago")]
        {
            assert_eq!(ago(SystemTime::now() - Duration::from_secs(minutes * 60)), words);
        }
    }
}
