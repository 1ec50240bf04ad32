//! The page of settings: a row for each, with its value between two arrows. What has names goes round; numbers end.

use bevy::prelude::*;

use super::go_to;
use crate::player::game_state::Page;
use crate::ui::settings::{AsMade, Quality, Settings};
use crate::ui::widgets::{self, Arrow, Chosen, Item, Turned};

/// The page of settings.
pub struct KnobsPlugin;

impl Plugin for KnobsPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(Page::Settings), open)
            .add_systems(Update, show_values.run_if(in_state(Page::Settings)));
    }
}

/// One row: what it is called, what it says, and what turning it does.
#[derive(Clone, Copy)]
struct Knob {
    label: &'static str,
    value: fn(&Settings) -> String,
    turn: fn(&mut Settings, i32),
}

const KNOBS: [Knob; 9] = [
    Knob {
        label: "Mouse and stick speed",
        value: |settings| format!("{:.1}", settings.sensitivity),
        turn: |settings, by| step(&mut settings.sensitivity, by, 0.1, 0.1, 5.0),
    },
    Knob {
        label: "Invert up and down",
        value: |settings| yes(settings.invert_y),
        turn: |settings, _| settings.invert_y = !settings.invert_y,
    },
    Knob {
        label: "Field of view",
        value: |settings| format!("{:.0} degrees", settings.field_of_view),
        turn: |settings, by| step(&mut settings.field_of_view, by, 5.0, 40.0, 110.0),
    },
    Knob {
        label: "View distance",
        value: |settings| format!("{:.0} m", settings.view_distance),
        turn: |settings, by| step(&mut settings.view_distance, by, 200.0, 200.0, 6000.0),
    },
    Knob {
        label: "Quality",
        value: |settings| format!("{:?}", settings.quality).to_lowercase(),
        turn: |settings, by| {
            let all = [Quality::Low, Quality::Medium, Quality::High];
            settings.quality = all[(settings.quality as i32 + by).rem_euclid(3) as usize];
        },
    },
    Knob {
        label: "Length of a day",
        value: |settings| match settings.day_minutes {
            0.0 => "the sun stands still".into(),
            minutes => format!("{minutes:.0} min"),
        },
        turn: |settings, by| step(&mut settings.day_minutes, by, 5.0, 0.0, 120.0),
    },
    Knob {
        label: "Size of the brush",
        value: |settings| format!("{:.1} m", settings.radius),
        turn: |settings, by| step(&mut settings.radius, by, 0.5, 1.0, 12.0),
    },
    Knob {
        label: "Form of what is built",
        value: |settings| settings.form.label().into(),
        turn: |settings, by| {
            settings.form = if by < 0 { settings.form.next().next() } else { settings.form.next() }
        },
    },
    Knob {
        label: "Use only what was dug",
        value: |settings| yes(settings.survival),
        turn: |settings, _| settings.survival = !settings.survival,
    },
];

fn yes(is: bool) -> String {
    if is { "yes" } else { "no" }.into()
}

fn step(number: &mut f32, by: i32, width: f32, low: f32, high: f32) {
    // From mark to mark, whatever stood in the file.
    *number = (((*number / width).round() + by as f32) * width).clamp(low, high);
}

/// The text that shows a knob's value.
#[derive(Component)]
struct Value(usize);

fn open(mut commands: Commands) {
    super::open(&mut commands, Page::Settings, "Settings", 600.0, |column| {
        for (at, knob) in KNOBS.into_iter().enumerate() {
            let row = Node {
                padding: UiRect::axes(px(14), px(6)),
                border: UiRect::left(px(4)),
                border_radius: BorderRadius::all(px(4)),
                justify_content: JustifyContent::SpaceBetween,
                align_items: AlignItems::Center,
                ..default()
            };
            let item = (Item(at), row, BackgroundColor::DEFAULT, BorderColor::all(Color::NONE));
            column
                .spawn(item)
                .with_children(|row| {
                    row.spawn(widgets::text(knob.label, 18.0, widgets::WHITE));
                    let side = Node { align_items: AlignItems::Center, column_gap: px(4), ..default() };
                    row.spawn(side).with_children(|side| {
                        side.spawn(arrow("<", -1));
                        let middle =
                            Node { width: px(190), justify_content: JustifyContent::Center, ..default() };
                        side.spawn((middle, children![(Value(at), widgets::text("", 18.0, widgets::GOLD))]));
                        side.spawn(arrow(">", 1));
                    });
                })
                .observe(move |turned: On<Turned>, mut settings: ResMut<Settings>| {
                    (knob.turn)(&mut settings, turned.by);
                })
                // It can be clicked, so a click does something: what the right arrow does.
                .observe(move |_: On<Chosen>, mut settings: ResMut<Settings>| {
                    (knob.turn)(&mut settings, 1);
                });
        }
        let gap = Node { height: px(10), ..default() };
        column.spawn(gap);
        column.spawn(widgets::button(KNOBS.len(), "As it was made", 540.0)).observe(reset);
        column.spawn(widgets::button(KNOBS.len() + 1, "Back", 540.0)).observe(go_to(Page::Menu));
    });
}

fn arrow(sign: &str, by: i32) -> impl Bundle {
    let node =
        Node { padding: UiRect::axes(px(10), px(2)), border_radius: BorderRadius::all(px(4)), ..default() };
    (
        Arrow(by),
        node,
        BackgroundColor(Color::srgba(1.0, 1.0, 1.0, 0.08)),
        children![widgets::text(sign, 18.0, widgets::WHITE)],
    )
}

/// All but the keys, which have a page of their own.
fn reset(_: On<Chosen>, made: Res<AsMade>, mut settings: ResMut<Settings>) {
    *settings = Settings { bindings: settings.bindings.clone(), ..made.0.clone() };
}

fn show_values(settings: Res<Settings>, mut values: Query<(&Value, &mut Text)>) {
    for (value, mut text) in &mut values {
        text.set_if_neq(Text::new((KNOBS[value.0].value)(&settings)));
    }
}

#[cfg(test)]
mod tests {
    use bevy::input::ButtonState;
    use bevy::input::keyboard::{Key, KeyboardInput};

    use super::*;
    use crate::ui::widgets::Focus;

    /// The page of settings.
    fn app() -> App {
        crate::ui::menu::app_with(KnobsPlugin, Page::Settings)
    }

    /// The row of a setting, and where it stands.
    fn row(app: &mut App, label: &str) -> (Entity, usize) {
        let at = KNOBS.iter().position(|knob| knob.label == label).expect("a knob");
        let mut rows = app.world_mut().query::<(Entity, &Item)>();
        let found = rows.iter(app.world()).find(|(_, item)| item.0 == at);
        (found.expect("a row").0, at)
    }

    #[test]
    fn what_has_names_goes_round_and_numbers_end() {
        let mut app = app();
        for (label, expected) in [
            ("Invert up and down", ["yes", "no", "yes"]),
            ("Use only what was dug", ["no", "yes", "no"]),
            ("Quality", ["high", "low", "medium"]),
            ("Form of what is built", ["cube", "beam", "sphere"]),
            ("Field of view", ["105 degrees", "110 degrees", "110 degrees"]),
        ] {
            app.world_mut().resource_mut::<Settings>().field_of_view = 100.0;
            let (entity, at) = row(&mut app, label);
            let values = expected.map(|_| {
                app.world_mut().trigger(Chosen { entity });
                (KNOBS[at].value)(app.world().resource::<Settings>())
            });
            assert_eq!(values, expected, "{label}");
        }
    }

    #[test]
    fn as_it_was_made_is_as_this_machine_was_given_it() {
        let mut app = app();
        let mut items = app.world_mut().query::<(Entity, &Item)>();
        let found = items.iter(app.world()).find(|(_, item)| item.0 == KNOBS.len());
        let entity = found.expect("a button below the knobs").0;
        for given in [Quality::Low, Quality::Medium] {
            app.world_mut().resource_mut::<AsMade>().0.quality = given;
            let mut settings = app.world_mut().resource_mut::<Settings>();
            (settings.quality, settings.sensitivity) = (Quality::High, 3.0);
            app.world_mut().trigger(Chosen { entity });
            let settings = app.world().resource::<Settings>();
            assert_eq!((settings.quality, settings.sensitivity), (given, 1.0));
        }
    }

    #[test]
    fn rows_answer_to_enter_and_to_a_click() {
        let mut app = app();
        let is_inverted = |app: &App| app.world().resource::<Settings>().invert_y;
        let (entity, at) = row(&mut app, "Invert up and down");
        app.world_mut().resource_mut::<Focus>().0 = at;
        app.world_mut().write_message(KeyboardInput {
            key_code: KeyCode::Enter,
            logical_key: Key::Enter,
            state: ButtonState::Pressed,
            text: None,
            repeat: false,
            window: Entity::PLACEHOLDER,
        });
        app.update();
        assert!(is_inverted(&app));
        app.world_mut().entity_mut(entity).insert(Interaction::Pressed);
        app.update();
        assert!(!is_inverted(&app));
    }
}
