//! The pages of the menu: title, worlds, playing together, pause, settings, controls, help, and questions.

mod controls;
mod fields;
mod help;
mod pause;
mod question;
mod settings_page;
mod title;
mod together;
mod worlds;

use bevy::prelude::*;

#[cfg(test)]
use crate::player::game_state::GameState;
use crate::player::game_state::MenuPage;
use crate::ui::texts;
use crate::ui::widgets::{self, Activated, GOLD};

/// All pages.
pub struct MenuPlugin;

impl Plugin for MenuPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins((
            title::TitlePlugin,
            pause::PausePlugin,
            settings_page::SettingsPagePlugin,
            controls::ControlsPlugin,
            help::HelpPlugin,
            fields::FieldsPlugin,
            question::QuestionPlugin,
            worlds::WorldsPlugin,
            together::TogetherPagePlugin,
        ))
        .add_systems(PreUpdate, show_pages);
    }
}

/// A page that was just opened. It is shown in the next frame: this one's picture may become a world's.
#[derive(Component)]
struct NewPage;

fn show_pages(mut commands: Commands, mut pages: Query<(Entity, &mut Visibility), With<NewPage>>) {
    for (page, mut visibility) in &mut pages {
        *visibility = Visibility::Inherited;
        commands.entity(page).remove::<NewPage>();
    }
}

/// Spawns a page in the middle of the window, with a headline and what `fill` spawns. It is despawned when the page
/// changes.
fn spawn_page(
    commands: &mut Commands,
    page: MenuPage,
    headline: &str,
    width: f32,
    fill: impl FnOnce(&mut ChildSpawnerCommands),
) {
    let column = Node { width: px(width), padding: UiRect::axes(px(26), px(22)), ..widgets::column(px(4)) };
    let shade = BackgroundColor(Color::srgba(0.0, 0.0, 0.02, 0.42));
    let page = (DespawnOnExit(page), NewPage, Visibility::Hidden, widgets::centered(), shade);
    commands.spawn(page).with_children(|middle| {
        middle.spawn(widgets::panel(column)).with_children(|column| {
            let below = Node { margin: UiRect::bottom(px(12)), ..default() };
            column.spawn((widgets::text(headline, 30.0, GOLD), below));
            fill(column);
        });
    });
}

/// Spawns the buttons that lead to other pages, and "Quit". The menus of title and pause have them in common.
fn spawn_common_buttons(column: &mut ChildSpawnerCommands, first: usize, width: f32) {
    for (at, (words, page)) in [
        (texts::SETTINGS, MenuPage::Settings),
        (texts::CONTROLS, MenuPage::Controls),
        (texts::HELP, MenuPage::Help),
    ]
    .into_iter()
    .enumerate()
    {
        column.spawn(widgets::button(first + at, words, width)).observe(go_to(page));
    }
}

/// The item that leads back from a page to the one before it.
fn spawn_back(column: &mut ChildSpawnerCommands, position: usize, width: f32, page: MenuPage) {
    let to = page.parent().unwrap_or_default();
    column.spawn(widgets::button(position, texts::BACK, width)).observe(go_to(to));
}

/// An observer for an item that leads to another page.
fn go_to(page: MenuPage) -> impl FnMut(On<Activated>, ResMut<NextState<MenuPage>>) {
    move |_, mut next| next.set(page)
}

fn quit(_: On<Activated>, mut exit: MessageWriter<AppExit>) {
    exit.write(AppExit::Success);
}

/// An app with an open page, for tests. Its frames are long, so that a click is never the second one of two.
#[cfg(test)]
fn app_with(plugin: impl Plugin, page: MenuPage) -> App {
    let mut app = crate::test_support::app_with_input();
    let frame = bevy::time::TimeUpdateStrategy::ManualDuration(std::time::Duration::from_millis(500));
    app.insert_resource(frame)
        .init_state::<MenuPage>()
        .init_state::<GameState>()
        .init_resource::<crate::ui::settings::DefaultSettings>()
        .init_resource::<UiScale>()
        .add_plugins((widgets::UiPlugin, fields::FieldsPlugin, question::QuestionPlugin, plugin));
    crate::test_support::go_to(&mut app, page);
    app
}

/// The menu item at a position, for tests.
#[cfg(test)]
fn item_at(app: &mut App, position: usize) -> Entity {
    let mut items = app.world_mut().query::<(Entity, &widgets::MenuItem)>();
    items.iter(app.world()).find(|(_, item)| item.0 == position).map(|(entity, _)| entity).expect("an item")
}

/// Clicks an item as Bevy sees it, for tests: it is pressed in the frame in which the button goes down.
#[cfg(test)]
fn click(app: &mut App, position: usize) {
    use bevy::input::ButtonState;

    use crate::test_support::send_button;
    let item = item_at(app, position);
    send_button(app, MouseButton::Left, ButtonState::Pressed);
    app.world_mut().entity_mut(item).insert(Interaction::Pressed);
    app.update();
    send_button(app, MouseButton::Left, ButtonState::Released);
    if let Ok(mut item) = app.world_mut().get_entity_mut(item) {
        item.insert(Interaction::Hovered);
    }
    app.update();
    app.update();
}

/// The items and texts of the open page, for tests.
#[cfg(test)]
fn words(app: &mut App) -> Vec<String> {
    let mut texts = app.world_mut().query::<&Text>();
    texts.iter(app.world()).map(|text| text.0.clone()).collect()
}
