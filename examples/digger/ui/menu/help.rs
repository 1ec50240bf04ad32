//! The page of help: what there is to do, with the keys as they are bound.

use bevy::prelude::*;

use super::go_to;
use crate::player::bindings::Bindings;
use crate::player::game_state::Page;
use crate::player::input::Action;
use crate::tools::Tool;
use crate::ui::art::Art;
use crate::ui::labels::Labels;
use crate::ui::settings::Settings;
use crate::ui::widgets;

/// Pixels for the keys of an action: none of those that it has at first is broken.
const KEYS: f32 = 200.0;

/// The page of help.
pub struct HelpPlugin;

impl Plugin for HelpPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(Page::Help), open);
    }
}

/// What there is to do, and its keys.
fn lines(bindings: &Bindings, labels: &Labels) -> [(String, &'static str); 14] {
    use Action as A;
    let key = |action: Action| bindings.first(action, labels);
    let keys = |actions: [Action; 2]| actions.map(key).join(", ");
    [
        ([A::Forward, A::Left, A::Back, A::Right].map(key).join(" "), "walk"),
        (key(A::Run), "run"),
        (key(A::Jump), "jump"),
        (key(A::Use), "use the tool in hand; hold to go on"),
        (key(A::Build), "build with the chosen material"),
        (keys([A::Grow, A::Shrink]), "size of the brush"),
        (keys([A::PreviousMaterial, A::NextMaterial]), "choose a material"),
        (key(A::Form), "form of what is built"),
        (key(A::NextTool), "next tool"),
        (key(A::PreviousTool), "previous tool"),
        (key(A::Headlamp), "headlamp"),
        (keys([A::Undo, A::Redo]), "undo, redo"),
        (keys([A::Figures, A::Panel]), "frame times, panel"),
        (key(A::Pause), "pause"),
    ]
}

fn open(mut commands: Commands, settings: Res<Settings>, labels: Res<Labels>, art: Option<Res<Art>>) {
    let Some(art) = art else { return };
    let bindings = &settings.bindings;
    super::open(&mut commands, Page::Help, "Help", 1110.0, |column| {
        let below = Node { margin: UiRect::bottom(px(14)), ..default() };
        let words = "Every hill here can be dug, and what was dug can be built with.";
        column.spawn((widgets::text(words, 17.0, widgets::WHITE), below));
        let columns = Node { column_gap: px(28), ..default() };
        column.spawn(columns).with_children(|columns| {
            let rows =
                Node { flex_direction: FlexDirection::Column, row_gap: px(7), width: px(514), ..default() };
            columns.spawn(rows.clone()).with_children(|rows| {
                for (keys, what) in lines(bindings, &labels) {
                    rows.spawn(Node { column_gap: px(14), ..default() }).with_children(|row| {
                        let first = Node { width: px(KEYS), flex_shrink: 0.0, ..default() };
                        row.spawn((first, children![widgets::text(keys, 16.0, widgets::GOLD)]));
                        row.spawn(widgets::text(what, 16.0, widgets::WHITE));
                    });
                }
            });
            columns.spawn(rows).with_children(|rows| {
                for tool in Tool::ALL {
                    spawn_tool(rows, tool, bindings.first(tool.slot(), &labels), &art);
                }
            });
        });
        if cfg!(feature = "gamepad") {
            let above = Node { margin: UiRect::top(px(14)), ..default() };
            let words = "A gamepad's left stick walks, and goes through menus; its right one looks around.";
            column.spawn((widgets::text(words, 15.0, widgets::WHITE), above));
        }
        column.spawn(Node { height: px(14), ..default() });
        column.spawn(widgets::button(0, "Back", 1050.0)).observe(go_to(Page::Menu));
    });
}

/// The row of a tool: its picture, the key that takes it, its name, and what it is for.
fn spawn_tool(rows: &mut ChildSpawnerCommands, tool: Tool, key: String, art: &Art) {
    let row = Node { column_gap: px(14), align_items: AlignItems::Center, ..default() };
    rows.spawn(row).with_children(|row| {
        let icon = Node { width: px(32), height: px(32), flex_shrink: 0.0, ..default() };
        row.spawn((ImageNode::new(art.tools[tool as usize].clone()), icon));
        // A long name moves the others aside.
        let first = Node { min_width: px(12), flex_shrink: 0.0, ..default() };
        row.spawn((first, children![widgets::text(key, 16.0, widgets::GOLD)]));
        let second = Node { width: px(74), flex_shrink: 0.0, ..default() };
        row.spawn((second, children![widgets::text(tool.label(), 16.0, widgets::WHITE)]));
        row.spawn(widgets::text(tool.purpose(), 15.0, widgets::GREY));
    });
}

#[cfg(test)]
mod tests {
    use bevy::state::app::StatesPlugin;

    use super::*;
    use crate::player::bindings::Binding;

    /// All that is written on the page.
    fn words(bindings: &Bindings) -> Vec<String> {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, StatesPlugin, HelpPlugin))
            .init_state::<Page>()
            .insert_resource(Settings { bindings: bindings.clone(), ..default() })
            .init_resource::<Labels>()
            .init_resource::<Assets<Image>>()
            .init_resource::<Art>();
        app.world_mut().resource_mut::<NextState<Page>>().set(Page::Help);
        app.update();
        let mut texts = app.world_mut().query::<&Text>();
        texts.iter(app.world()).map(|text| text.0.clone()).collect()
    }

    #[test]
    fn every_tool_and_its_key_are_on_the_page() {
        let mut bindings = Bindings::default();
        bindings.rebind(Tool::Bomb.slot(), Binding::Key(KeyCode::KeyG));
        let words = words(&bindings);
        let is_there = |what: &str| words.iter().any(|word| word == what);
        for tool in Tool::ALL {
            assert!(
                is_there(tool.label()) && is_there(&bindings.first(tool.slot(), &Labels::default())),
                "{tool:?}: {words:?}"
            );
        }
        assert!(is_there("next tool") && is_there("previous tool"), "{words:?}");
    }

    #[test]
    fn no_keys_are_broken_as_they_are_at_first() {
        // Letters of the default font are all 0.6 times as wide as they are high.
        for (keys, what) in lines(&Bindings::default(), &Labels::default()) {
            assert!(keys.len() as f32 * 0.6 * 16.0 <= KEYS, "{what}: {keys}");
        }
    }
}
