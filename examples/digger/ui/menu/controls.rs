//! The controls page: every action with its bindings, which can be changed.

use bevy::prelude::*;

use super::{question, spawn_back};
use crate::player::bindings::Binding;
use crate::player::game_state::MenuPage;
use crate::player::input::{Action, Actions, WheelSteps};
use crate::ui::labels::Labels;
use crate::ui::settings::Settings;
use crate::ui::texts;
use crate::ui::widgets::{
    self, Activated, GOLD, GREY, MenuInputDisabled, MenuItem, MenuPointerSystems, WHITE, text,
};

/// The controls page.
pub struct ControlsPlugin;

impl Plugin for ControlsPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(MenuPage::Controls), open)
            .add_systems(
                Update,
                (bind.after(MenuPointerSystems), show_bindings).chain().run_if(in_state(MenuPage::Controls)),
            )
            .add_systems(OnExit(MenuPage::Controls), stop_waiting);
    }
}

/// The action that waits for its new binding.
#[derive(Resource, Clone, Copy)]
struct Waiting(Action);

/// The row of an action.
#[derive(Component, Clone, Copy, PartialEq, Eq)]
struct Row(Action);

/// The text with an action's bindings.
#[derive(Component)]
struct BindingsText(Action);

/// Says what the latest change did.
#[derive(Component)]
struct Note;

fn open(mut commands: Commands) {
    super::spawn_page(&mut commands, MenuPage::Controls, texts::CONTROLS, 1010.0, |column| {
        let columns = Node { column_gap: px(16), justify_content: JustifyContent::SpaceBetween, ..default() };
        column.spawn(columns).with_children(|columns| {
            let half = Action::ALL.len().div_ceil(2);
            for (part, actions) in Action::ALL.chunks(half).enumerate() {
                let rows = Node { width: px(470), ..widgets::column(px(0)) };
                columns.spawn(rows).with_children(|rows| {
                    for (at, &(action, _)) in actions.iter().enumerate() {
                        rows.spawn(row(part * half + at, action)).observe(
                            move |_: On<Activated>, mut commands: Commands| {
                                commands.insert_resource(Waiting(action));
                                commands.insert_resource(MenuInputDisabled);
                            },
                        );
                    }
                });
            }
        });
        let line = Node { height: px(20), margin: UiRect::axes(px(14), px(8)), ..default() };
        column.spawn((Note, text(texts::CHOOSE_ACTION, 15.0, GREY), line));
        let count = Action::ALL.len();
        column.spawn(widgets::button(count, texts::RESET, 950.0)).observe(ask_to_reset);
        spawn_back(column, count + 1, 950.0, MenuPage::Controls);
    });
}

fn ask_to_reset(_: On<Activated>, mut commands: Commands) {
    let reset = |commands: &mut Commands| {
        commands.queue(|world: &mut World| world.resource_mut::<Settings>().bindings = default());
    };
    question::ask(&mut commands, MenuPage::Controls, texts::RESET_CONTROLS, texts::RESET, reset);
}

fn row(position: usize, action: Action) -> impl Bundle {
    let node = Node {
        padding: UiRect::axes(px(12), px(3)),
        justify_content: JustifyContent::SpaceBetween,
        ..default()
    };
    let texts = children![text(action.label(), 16.0, WHITE), (BindingsText(action), text("", 16.0, GOLD))];
    (Row(action), widgets::item(position, node), texts)
}

/// Binds the first key, button or turn of the wheel after an action was chosen. Escape cancels, unless the action is
/// the pause. A click on another item of the page cancels too, and activates that item.
fn bind(
    mut commands: Commands,
    waiting: Option<Res<Waiting>>,
    mut settings: ResMut<Settings>,
    labels: Res<Labels>,
    keys: Res<ButtonInput<KeyCode>>,
    mouse: Res<ButtonInput<MouseButton>>,
    wheel: Res<WheelSteps>,
    pads: Query<&Gamepad>,
    items: Query<(Entity, &Interaction, Option<&Row>), With<MenuItem>>,
    mut actions: ResMut<Actions>,
    mut notes: Query<&mut Text, With<Note>>,
) {
    // The press that chose the action is not its binding.
    let Some(waiting) = waiting.filter(|waiting| !waiting.is_added()) else { return };
    let action = waiting.0;
    let key = keys.get_just_pressed().next().map(|&key| Binding::Key(key));
    let button = mouse.get_just_pressed().next().map(|&button| Binding::Mouse(button));
    let pad = pads.iter().find_map(|pad| pad.get_just_pressed().next().map(|&button| Binding::Pad(button)));
    let Some(binding) = key.or(button).or(pad).or(wheel.binding()) else { return };
    let is_click = binding == Binding::Mouse(MouseButton::Left);
    let other_item = items.iter().find(|(_, interaction, row)| {
        is_click && **interaction == Interaction::Pressed && *row != Some(&Row(action))
    });
    let is_cancelled = binding == Binding::Key(KeyCode::Escape) && action != Action::Pause;
    let note = if other_item.is_some() || is_cancelled {
        texts::keeps_keys(action.label())
    } else if !binding.can_be_saved() {
        texts::key_without_name(action.label())
    } else {
        let name = labels.of(binding);
        match settings.bindings.rebind(action, binding) {
            Some(loser) => texts::key_moved(&name, loser.label(), action.label()),
            None => texts::key_bound(&name, action.label()),
        }
    };
    for mut text in &mut notes {
        text.0.clone_from(&note);
    }
    commands.run_system_cached(stop_waiting);
    actions.release_all();
    if let Some((entity, ..)) = other_item {
        commands.trigger(Activated { entity });
    }
}

fn show_bindings(
    waiting: Option<Res<Waiting>>,
    settings: Res<Settings>,
    labels: Res<Labels>,
    mut texts: Query<(&BindingsText, &mut Text, &mut TextColor)>,
) {
    for (&BindingsText(action), mut text, mut color) in &mut texts {
        let (words, new_color) = if waiting.as_ref().is_some_and(|waiting| waiting.0 == action) {
            (texts::PRESS_KEY.into(), WHITE)
        } else {
            // Where gamepads do nothing, their buttons would only be taken for keys.
            let works = |binding: &&Binding| cfg!(feature = "gamepad") || !matches!(binding, Binding::Pad(_));
            let bindings = settings.bindings.of(action).iter().filter(works);
            (bindings.map(|&binding| labels.of(binding)).collect::<Vec<_>>().join("  "), GOLD)
        };
        text.set_if_neq(Text::new(words));
        color.set_if_neq(TextColor(new_color));
    }
}

fn stop_waiting(mut commands: Commands) {
    commands.remove_resource::<Waiting>();
    commands.remove_resource::<MenuInputDisabled>();
}

#[cfg(test)]
#[path = "controls_tests.rs"]
mod tests;
