//! The pages of the menus: title, pause, settings, controls and help.

mod controls;
mod help;
mod pause;
mod settings_page;
mod title;

use bevy::prelude::*;

use crate::player::game_state::Page;
use crate::ui::widgets::{self, Chosen};

/// All pages.
pub struct MenuPlugin;

impl Plugin for MenuPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins((
            title::TitlePlugin,
            pause::PausePlugin,
            settings_page::KnobsPlugin,
            controls::ControlsPlugin,
            help::HelpPlugin,
        ));
    }
}

/// A page in the middle of the window, with a headline and whatever `fill` puts below it; gone when the page is left.
fn open(
    commands: &mut Commands,
    page: Page,
    headline: &str,
    width: f32,
    fill: impl FnOnce(&mut ChildSpawnerCommands),
) {
    let middle =
        Node { align_items: AlignItems::Center, justify_content: JustifyContent::Center, ..widgets::full() };
    let column = Node {
        width: px(width),
        padding: UiRect::axes(px(26), px(22)),
        flex_direction: FlexDirection::Column,
        row_gap: px(4),
        ..default()
    };
    let veil = BackgroundColor(Color::srgba(0.0, 0.0, 0.02, 0.42));
    commands.spawn((DespawnOnExit(page), middle, veil)).with_children(|middle| {
        middle.spawn(widgets::panel(column)).with_children(|column| {
            let below = Node { margin: UiRect::bottom(px(12)), ..default() };
            column.spawn((widgets::text(headline, 30.0, widgets::GOLD), below));
            fill(column);
        });
    });
}

/// What an item that leads to another page does.
fn go_to(page: Page) -> impl FnMut(On<Chosen>, ResMut<NextState<Page>>) {
    move |_, mut next| next.set(page)
}

/// A page of what the player may set, as devices see it with nothing chosen: for its tests.
#[cfg(test)]
fn app_with(plugin: impl Plugin, page: Page) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, bevy::state::app::StatesPlugin, bevy::input::InputPlugin))
        .add_plugins(crate::player::input::InputPlugin)
        .init_state::<Page>()
        .init_resource::<crate::ui::settings::Settings>()
        .init_resource::<crate::ui::settings::AsMade>()
        .init_resource::<UiScale>()
        .add_plugins((widgets::UiPlugin, plugin));
    app.world_mut().resource_mut::<NextState<Page>>().set(page);
    app.update();
    app.update();
    app
}
