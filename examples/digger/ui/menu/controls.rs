//! The page of controls: every action with its keys, each of which can be bound anew.

use bevy::prelude::*;

use super::go_to;
use crate::player::bindings::Binding;
use crate::player::game_state::Page;
use crate::player::input::{Action, Actions, Turns};
use crate::ui::labels::Labels;
use crate::ui::settings::Settings;
use crate::ui::widgets::{self, Chosen, Deaf, Item, Pointing};

/// The page of controls.
pub struct ControlsPlugin;

impl Plugin for ControlsPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(Page::Controls), open)
            .add_systems(Update, (bind.after(Pointing), show_keys).chain().run_if(in_state(Page::Controls)))
            .add_systems(OnExit(Page::Controls), stop_waiting);
    }
}

/// The action that waits for its new key.
#[derive(Resource, Clone, Copy)]
struct Waiting(Action);

/// The row of an action.
#[derive(Component, Clone, Copy, PartialEq, Eq)]
struct Row(Action);

/// The text with an action's keys.
#[derive(Component)]
struct Keys(Action);

/// What came of the latest change.
#[derive(Component)]
struct Note;

fn open(mut commands: Commands) {
    super::open(&mut commands, Page::Controls, "Controls", 1010.0, |column| {
        let columns = Node {
            flex_direction: FlexDirection::Row,
            column_gap: px(16),
            justify_content: JustifyContent::SpaceBetween,
            ..default()
        };
        column.spawn(columns).with_children(|columns| {
            let half = Action::ALL.len().div_ceil(2);
            for (part, actions) in Action::ALL.chunks(half).enumerate() {
                let rows = Node { flex_direction: FlexDirection::Column, width: px(470), ..default() };
                columns.spawn(rows).with_children(|rows| {
                    for (at, &(action, label)) in actions.iter().enumerate() {
                        rows.spawn(row(part * half + at, action, label)).observe(
                            move |_: On<Chosen>, mut commands: Commands| {
                                commands.insert_resource(Waiting(action));
                                commands.insert_resource(Deaf);
                            },
                        );
                    }
                });
            }
        });
        let line = Node { height: px(20), margin: UiRect::axes(px(14), px(8)), ..default() };
        column.spawn((
            Note,
            widgets::text("choose an action, then press its new key or button", 15.0, widgets::GREY),
            line,
        ));
        column.spawn(widgets::button(Action::ALL.len(), "As they were made", 950.0)).observe(reset);
        column.spawn(widgets::button(Action::ALL.len() + 1, "Back", 950.0)).observe(go_to(Page::Menu));
    });
}

fn row(order: usize, action: Action, label: &str) -> impl Bundle {
    let node = Node {
        padding: UiRect::axes(px(12), px(3)),
        border: UiRect::left(px(4)),
        border_radius: BorderRadius::all(px(4)),
        justify_content: JustifyContent::SpaceBetween,
        ..default()
    };
    let texts = children![
        widgets::text(label, 16.0, widgets::WHITE),
        (Keys(action), widgets::text("", 16.0, widgets::GOLD))
    ];
    (Row(action), Item(order), node, BackgroundColor::DEFAULT, BorderColor::all(Color::NONE), texts)
}

fn reset(_: On<Chosen>, mut settings: ResMut<Settings>) {
    settings.bindings = default();
}

/// The first key, button or turn of the wheel that comes after an action was chosen is its own. Escape leaves all as it
/// is, unless it is for the pause; so does a click on anything else of the page, which is what was meant by it then.
fn bind(
    mut commands: Commands,
    waiting: Option<Res<Waiting>>,
    mut settings: ResMut<Settings>,
    labels: Res<Labels>,
    keys: Res<ButtonInput<KeyCode>>,
    mouse: Res<ButtonInput<MouseButton>>,
    turns: Res<Turns>,
    pads: Query<&Gamepad>,
    items: Query<(Entity, &Interaction, Option<&Row>), With<Item>>,
    mut actions: ResMut<Actions>,
    mut notes: Query<&mut Text, With<Note>>,
) {
    let Some(waiting) = waiting else { return };
    // The press that chose the action is not its key.
    if waiting.is_added() {
        return;
    }
    let action = waiting.0;
    let key = keys.get_just_pressed().next().map(|&key| Binding::Key(key));
    let button = mouse.get_just_pressed().next().map(|&button| Binding::Mouse(button));
    let pad = pads.iter().find_map(|pad| pad.get_just_pressed().next().map(|&button| Binding::Pad(button)));
    let Some(binding) = key.or(button).or(pad).or(turns.binding()) else { return };
    let is_click = binding == Binding::Mouse(MouseButton::Left);
    let elsewhere = items
        .iter()
        .find(|(_, interaction, row)| {
            is_click && **interaction == Interaction::Pressed && *row != Some(&Row(action))
        })
        .map(|(entity, ..)| entity);
    let is_no_key = binding == Binding::Key(KeyCode::Escape) && action != Action::Pause;
    let note = if elsewhere.is_some() || is_no_key {
        format!("{} keeps its keys", action.label())
    } else if !binding.can_be_kept() {
        // It would be gone at the next start, and the old key with it.
        format!("that key has no name to remember it by: {} keeps its keys", action.label())
    } else {
        let name = labels.of(binding);
        match settings.bindings.rebind(action, binding) {
            Some(loser) => format!("{name} was taken from \"{}\"", loser.label()),
            None => format!("{name} is \"{}\" now", action.label()),
        }
    };
    for mut text in &mut notes {
        text.0.clone_from(&note);
    }
    commands.remove_resource::<Waiting>();
    commands.remove_resource::<Deaf>();
    actions.forget();
    if let Some(entity) = elsewhere {
        commands.trigger(Chosen { entity });
    }
}

fn show_keys(
    waiting: Option<Res<Waiting>>,
    settings: Res<Settings>,
    labels: Res<Labels>,
    mut rows: Query<(&Keys, &mut Text, &mut TextColor)>,
) {
    for (keys, mut text, mut color) in &mut rows {
        let waits = waiting.as_ref().is_some_and(|waiting| waiting.0 == keys.0);
        let names: Vec<String> =
            settings.bindings.of(keys.0).iter().map(|&binding| labels.of(binding)).collect();
        let words = if waits { "press a key ...".into() } else { names.join("  ") };
        text.set_if_neq(Text::new(words));
        color.set_if_neq(TextColor(if waits {
            widgets::RED
        } else if names.is_empty() {
            widgets::GREY
        } else {
            widgets::GOLD
        }));
    }
}

fn stop_waiting(mut commands: Commands) {
    commands.remove_resource::<Waiting>();
    commands.remove_resource::<Deaf>();
}

#[cfg(test)]
#[path = "controls_tests.rs"]
mod tests;
