//! The help page: what the player can do, with the current bindings.

use bevy::prelude::*;

use super::spawn_back;
use crate::player::bindings::Bindings;
use crate::player::game_state::MenuPage;
use crate::player::input::Action;
use crate::tools::Tool;
use crate::ui::images::Images;
use crate::ui::labels::Labels;
use crate::ui::settings::Settings;
use crate::ui::texts;
use crate::ui::widgets::{self, GOLD, GREY, WHITE, text};

/// Width of the column with the keys, in pixels. The default bindings fit into it.
const KEYS: f32 = 200.0;

/// The help page.
pub struct HelpPlugin;

impl Plugin for HelpPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(MenuPage::Help), open);
    }
}

/// Keys, and what they do. An action without a key is left out.
fn lines(bindings: &Bindings, labels: &Labels) -> Vec<(String, &'static str)> {
    use Action as A;
    let keys = |actions: &[Action], separator: &str| {
        let keys = actions.iter().map(|action| bindings.first(*action, labels));
        keys.collect::<Vec<_>>().join(separator)
    };
    let all = [
        keys(&[A::Forward, A::Left, A::Back, A::Right], " "),
        keys(&[A::Run], ""),
        keys(&[A::Jump], ""),
        keys(&[A::Use], ""),
        keys(&[A::Build], ""),
        keys(&[A::Grow, A::Shrink], ", "),
        keys(&[A::PreviousMaterial, A::NextMaterial], ", "),
        keys(&[A::BuildShape], ""),
        keys(&[A::NextTool], ""),
        keys(&[A::PreviousTool], ""),
        keys(&[A::Headlamp], ""),
        keys(&[A::Undo, A::Redo], ", "),
        keys(&[A::Panel], ""),
        keys(&[A::Pause], ""),
    ];
    all.into_iter().zip(texts::HELP_KEYS).filter(|(keys, _)| keys != "-").collect()
}

fn open(mut commands: Commands, settings: Res<Settings>, labels: Res<Labels>, images: Option<Res<Images>>) {
    let Some(images) = images else { return };
    let bindings = &settings.bindings;
    super::spawn_page(&mut commands, MenuPage::Help, texts::HELP, 1110.0, |column| {
        let below = Node { margin: UiRect::bottom(px(14)), ..default() };
        column.spawn((text(texts::HELP_SUMMARY, 17.0, WHITE), below));
        column.spawn(Node { column_gap: px(28), ..default() }).with_children(|columns| {
            let rows = Node { width: px(514), ..widgets::column(px(7)) };
            columns.spawn(rows.clone()).with_children(|rows| {
                for (keys, what) in lines(bindings, &labels) {
                    let row = Node { column_gap: px(14), ..default() };
                    let first = Node { width: px(KEYS), flex_shrink: 0.0, ..default() };
                    let keys = (first, children![text(keys, 16.0, GOLD)]);
                    rows.spawn((row, children![keys, text(what, 16.0, WHITE)]));
                }
            });
            columns.spawn(rows).with_children(|rows| {
                for tool in Tool::ALL {
                    let row = Node { column_gap: px(14), align_items: AlignItems::Center, ..default() };
                    let icon = Node { width: px(32), height: px(32), flex_shrink: 0.0, ..default() };
                    // A long key label moves the other columns.
                    let first = Node { min_width: px(12), flex_shrink: 0.0, ..default() };
                    let second = Node { width: px(74), flex_shrink: 0.0, ..default() };
                    rows.spawn((
                        row,
                        children![
                            (images.icon(tool), icon),
                            (first, children![text(bindings.first(tool.slot(), &labels), 16.0, GOLD)]),
                            (second, children![text(tool.label(), 16.0, WHITE)]),
                            text(tool.purpose(), 15.0, GREY),
                        ],
                    ));
                }
            });
        });
        if cfg!(feature = "gamepad") {
            let above = Node { margin: UiRect::top(px(14)), ..default() };
            column.spawn((text(texts::HELP_GAMEPAD, 15.0, WHITE), above));
        }
        column.spawn(Node { height: px(14), ..default() });
        spawn_back(column, 0, 1050.0, MenuPage::Help);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::player::bindings::Binding;

    #[test]
    fn every_tool_and_its_key_are_on_the_page() {
        let mut app = crate::test_support::app_with_input();
        app.add_plugins(HelpPlugin)
            .init_state::<MenuPage>()
            .init_resource::<Assets<Image>>()
            .init_resource::<Images>();
        let bindings = &mut app.world_mut().resource_mut::<Settings>().bindings;
        bindings.rebind(Tool::Bomb.slot(), Binding::Key(KeyCode::KeyG));
        let bindings = bindings.clone();
        crate::test_support::go_to(&mut app, MenuPage::Help);
        let mut texts = app.world_mut().query::<&Text>();
        let words: Vec<String> = texts.iter(app.world()).map(|text| text.0.clone()).collect();
        for tool in Tool::ALL {
            let key = bindings.first(tool.slot(), &Labels::default());
            assert!(words.contains(&tool.label().into()) && words.contains(&key), "{tool:?}: {words:?}");
        }
    }

    #[test]
    fn the_default_keys_fit_into_their_column() {
        // Letters of the default font are 0.6 times as wide as they are high.
        for (keys, what) in lines(&Bindings::default(), &Labels::default()) {
            assert!(keys.len() as f32 * 0.6 * 16.0 <= KEYS, "{what}: {keys}");
        }
    }
}
