//! The page of help: what there is to do, with the keys as they are bound.

use bevy::prelude::*;

use super::go_to;
use crate::art::Art;
use crate::input::Action;
use crate::phase::Page;
use crate::settings::Settings;
use crate::tools::Tool;
use crate::ui;

/// The page of help.
pub struct HelpPlugin;

impl Plugin for HelpPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(Page::Help), open);
    }
}

fn open(mut commands: Commands, settings: Res<Settings>, art: Option<Res<Art>>) {
    let Some(art) = art else { return };
    let key = |action: Action| settings.bindings.first(action);
    let lines = [
        (
            format!(
                "{} {} {} {}",
                key(Action::Forward),
                key(Action::Left),
                key(Action::Back),
                key(Action::Right)
            ),
            "walk",
        ),
        (key(Action::Run), "run"),
        (key(Action::Jump), "jump"),
        (key(Action::Use), "use the tool in hand; hold to go on"),
        (key(Action::Build), "build with the chosen material"),
        (format!("{}, {}", key(Action::Grow), key(Action::Shrink)), "size of the brush"),
        (format!("{}, {}", key(Action::PreviousMaterial), key(Action::NextMaterial)), "choose a material"),
        (key(Action::Form), "form of what is built"),
        (key(Action::Headlamp), "headlamp"),
        (format!("{}, {}", key(Action::Undo), key(Action::Redo)), "undo, redo"),
        (format!("{}, {}", key(Action::Figures), key(Action::Panel)), "frame times, panel"),
        (key(Action::Pause), "pause"),
    ];
    super::open(&mut commands, Page::Help, "Help", 1010.0, |column| {
        let below = Node { margin: UiRect::bottom(px(14)), ..default() };
        let words = "Every hill here can be dug, and what was dug can be built with.";
        column.spawn((ui::text(words, 17.0, ui::WHITE), below));
        let columns = Node { column_gap: px(28), ..default() };
        column.spawn(columns).with_children(|columns| {
            let rows =
                Node { flex_direction: FlexDirection::Column, row_gap: px(7), width: px(465), ..default() };
            columns.spawn(rows.clone()).with_children(|rows| {
                for (keys, what) in lines {
                    rows.spawn(Node { column_gap: px(14), ..default() }).with_children(|row| {
                        let first = Node { width: px(150), flex_shrink: 0.0, ..default() };
                        row.spawn((first, children![ui::text(keys, 16.0, ui::GOLD)]));
                        row.spawn(ui::text(what, 16.0, ui::WHITE));
                    });
                }
            });
            columns.spawn(rows).with_children(|rows| {
                for (slot, tool) in Tool::ALL.into_iter().enumerate() {
                    let row = Node { column_gap: px(14), align_items: AlignItems::Center, ..default() };
                    rows.spawn(row).with_children(|row| {
                        let icon = Node { width: px(32), height: px(32), flex_shrink: 0.0, ..default() };
                        row.spawn((ImageNode::new(art.tools[slot].clone()), icon));
                        let first = Node { width: px(90), flex_shrink: 0.0, ..default() };
                        row.spawn((first, children![ui::text(tool.label(), 16.0, ui::GOLD)]));
                        row.spawn(ui::text(tool.purpose(), 15.0, ui::WHITE));
                    });
                }
            });
        });
        column.spawn(Node { height: px(14), ..default() });
        column.spawn(ui::button(0, "Back", 950.0)).observe(go_to(Page::Menu));
    });
}
