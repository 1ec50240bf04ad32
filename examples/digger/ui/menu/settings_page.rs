//! The settings page: a row for each setting, with its value between two arrows.

use bevy::prelude::*;

use super::{question, spawn_back};
use crate::player::game_state::MenuPage;
use crate::ui::settings::{DefaultSettings, Quality, Settings};
use crate::ui::texts;
use crate::ui::widgets::{self, Activated, Adjusted, Arrow, GOLD, GREY, WHITE, paragraph, text};

/// The settings page.
pub struct SettingsPagePlugin;

impl Plugin for SettingsPagePlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnEnter(MenuPage::Settings), open)
            .add_systems(Update, show_values.run_if(in_state(MenuPage::Settings)));
    }
}

/// A row: its label, its value as text, and how the arrows change it. Numbers stop at their limits, other values wrap
/// around.
type Row = (&'static str, fn(&Settings) -> String, fn(&mut Settings, i32));

const ROWS: &[Row] = &[
    (
        texts::SETTING[0],
        |settings| format!("{:.1}", settings.sensitivity),
        |settings, by| step(&mut settings.sensitivity, by, 0.1, 0.1, 5.0),
    ),
    (
        texts::SETTING[1],
        |settings| on_or_off(settings.invert_y),
        |settings, _| settings.invert_y = !settings.invert_y,
    ),
    (
        texts::SETTING[2],
        |settings| format!("{:.0} degrees", settings.field_of_view),
        |settings, by| step(&mut settings.field_of_view, by, 5.0, 40.0, 110.0),
    ),
    (
        texts::SETTING[3],
        |settings| format!("{:.0} m", settings.view_distance),
        |settings, by| step(&mut settings.view_distance, by, 200.0, 200.0, 8000.0),
    ),
    (
        texts::SETTING[4],
        |settings| texts::QUALITY[settings.quality as usize].into(),
        |settings, by| {
            let all = [Quality::Low, Quality::Medium, Quality::High];
            settings.quality = all[(settings.quality as i32 + by).rem_euclid(3) as usize];
        },
    ),
    (
        texts::SETTING[5],
        |settings| format!("{:.0} %", 100.0 * settings.ui_scale),
        |settings, by| step(&mut settings.ui_scale, by, 0.1, 0.5, 1.5),
    ),
    (
        texts::SETTING[6],
        |settings| match settings.day_minutes {
            0.0 => texts::OFF.into(),
            minutes => format!("{minutes:.0} min"),
        },
        |settings, by| step(&mut settings.day_minutes, by, 5.0, 0.0, 120.0),
    ),
    (
        texts::SETTING[7],
        |settings| format!("{:.1} m", settings.radius),
        |settings, by| step(&mut settings.radius, by, 0.5, 1.0, 12.0),
    ),
    (
        texts::SETTING[8],
        |settings| settings.shape.label().into(),
        |settings, by| {
            let next = settings.shape.next();
            settings.shape = if by < 0 { next.next() } else { next };
        },
    ),
    (
        texts::SETTING[9],
        |settings| on_or_off(settings.survival),
        |settings, _| settings.survival = !settings.survival,
    ),
    #[cfg(feature = "sound")]
    (
        texts::SETTING[10],
        |settings| format!("{:.0} %", 100.0 * settings.volume),
        |settings, by| step(&mut settings.volume, by, 0.1, 0.0, 1.0),
    ),
];

fn on_or_off(value: bool) -> String {
    if value { texts::ON } else { texts::OFF }.into()
}

/// Steps to a multiple of `width`, whatever number the file had.
fn step(number: &mut f32, by: i32, width: f32, low: f32, high: f32) {
    *number = (((*number / width).round() + by as f32) * width).clamp(low, high);
}

/// The value of a row.
#[derive(Component)]
struct Value(usize);

fn open(mut commands: Commands) {
    super::spawn_page(&mut commands, MenuPage::Settings, texts::SETTINGS, 600.0, |column| {
        for (at, &(label, _, adjust)) in ROWS.iter().enumerate() {
            let row = Node {
                padding: UiRect::axes(px(14), px(4)),
                justify_content: JustifyContent::SpaceBetween,
                align_items: AlignItems::Center,
                ..default()
            };
            let side = Node { align_items: AlignItems::Center, column_gap: px(4), ..default() };
            let middle = Node { width: px(190), justify_content: JustifyContent::Center, ..default() };
            let value = (middle, children![(Value(at), text("", 18.0, GOLD))]);
            column
                .spawn((
                    widgets::item(at, row),
                    children![
                        text(label, 18.0, WHITE),
                        (side, children![arrow("<", -1), value, arrow(">", 1)])
                    ],
                ))
                .observe(move |adjusted: On<Adjusted>, mut settings: ResMut<Settings>| {
                    adjust(&mut settings, adjusted.by);
                })
                // A click on the row does the same as its right arrow.
                .observe(move |_: On<Activated>, mut settings: ResMut<Settings>| adjust(&mut settings, 1));
        }
        let around = Node { width: px(516), margin: UiRect::axes(px(14), px(8)), ..default() };
        column.spawn((paragraph(texts::SETTINGS_NOTES, 13.0, GREY), around));
        column.spawn(widgets::button(ROWS.len(), texts::RESET, 540.0)).observe(ask_to_reset);
        spawn_back(column, ROWS.len() + 1, 540.0, MenuPage::Settings);
    });
}

fn arrow(sign: &str, by: i32) -> impl Bundle {
    let node =
        Node { padding: UiRect::axes(px(10), px(2)), border_radius: BorderRadius::all(px(4)), ..default() };
    (Arrow(by), node, BackgroundColor(Color::srgba(1.0, 1.0, 1.0, 0.08)), children![text(sign, 18.0, WHITE)])
}

fn ask_to_reset(_: On<Activated>, mut commands: Commands) {
    let reset = |commands: &mut Commands| commands.run_system_cached(reset);
    question::ask(&mut commands, MenuPage::Settings, texts::RESET_SETTINGS, texts::RESET, reset);
}

/// Resets everything but what has a page of its own.
fn reset(defaults: Res<DefaultSettings>, mut settings: ResMut<Settings>) {
    let Settings { name, host_address, bindings, .. } = settings.clone();
    *settings = Settings { name, host_address, bindings, ..defaults.0.clone() };
}

fn show_values(settings: Res<Settings>, mut values: Query<(&Value, &mut Text)>) {
    for (value, mut text) in &mut values {
        text.set_if_neq(Text::new((ROWS[value.0].1)(&settings)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::tap_key;
    use crate::ui::menu::item_at;
    use crate::ui::widgets::FocusedItem;

    fn app() -> App {
        crate::ui::menu::app_with(SettingsPagePlugin, MenuPage::Settings)
    }

    fn position(label: &str) -> usize {
        ROWS.iter().position(|row| row.0 == label).expect("a row")
    }

    #[test]
    fn numbers_stop_at_their_limits_and_other_values_wrap_around() {
        let mut app = app();
        for (label, expected) in [
            ("Invert look (Y axis)", ["on", "off", "on"]),
            ("Limited materials", ["off", "on", "off"]),
            ("Quality", ["high", "low", "medium"]),
            ("Build shape", ["cube", "beam", "sphere"]),
            ("Field of view", ["105 degrees", "110 degrees", "110 degrees"]),
        ] {
            app.world_mut().resource_mut::<Settings>().field_of_view = 100.0;
            let entity = item_at(&mut app, position(label));
            let values = expected.map(|_| {
                app.world_mut().trigger(Activated { entity });
                (ROWS[position(label)].1)(app.world().resource::<Settings>())
            });
            assert_eq!(values, expected, "{label}");
        }
    }

    #[test]
    fn reset_restores_the_defaults_of_this_machine() {
        let mut app = app();
        let activate = |app: &mut App, at: usize| {
            let entity = item_at(app, at);
            app.world_mut().trigger(Activated { entity });
            app.update();
            app.update();
        };
        for quality in [Quality::Low, Quality::Medium] {
            app.world_mut().resource_mut::<DefaultSettings>().0.quality = quality;
            let mut settings = app.world_mut().resource_mut::<Settings>();
            (settings.quality, settings.sensitivity) = (Quality::High, 3.0);
            activate(&mut app, ROWS.len());
            assert_eq!(app.world().resource::<Settings>().sensitivity, 3.0, "it asks first");
            activate(&mut app, 1);
            let settings = app.world().resource::<Settings>();
            assert_eq!((settings.quality, settings.sensitivity), (quality, 1.0));
        }
    }

    #[test]
    fn a_resting_mouse_moves_no_focus() {
        let mut app = app();
        let mut arrows = app.world_mut().query_filtered::<Entity, With<Arrow>>();
        let arrow = arrows.iter(app.world()).last().expect("an arrow");
        for (moves, focus) in [(false, 0), (true, ROWS.len() - 1)] {
            app.world_mut().entity_mut(arrow).insert(Interaction::Hovered);
            if moves {
                let (window, position) = (Entity::PLACEHOLDER, Vec2::ZERO);
                app.world_mut().write_message(CursorMoved { window, position, delta: None });
            }
            app.update();
            assert_eq!(app.world().resource::<FocusedItem>().0, focus);
        }
    }

    #[test]
    fn rows_react_to_enter_and_to_clicks() {
        let mut app = app();
        let is_inverted = |app: &App| app.world().resource::<Settings>().invert_y;
        let at = position("Invert look (Y axis)");
        app.world_mut().resource_mut::<FocusedItem>().0 = at;
        tap_key(&mut app, KeyCode::Enter);
        assert!(is_inverted(&app));
        let row = item_at(&mut app, at);
        app.world_mut().entity_mut(row).insert(Interaction::Pressed);
        app.update();
        assert!(!is_inverted(&app));
    }
}
