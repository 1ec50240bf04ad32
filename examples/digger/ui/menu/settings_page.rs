//! The settings page: a row for each setting, with its value between two arrows.

use bevy::prelude::*;

use super::go_to;
use crate::player::game_state::MenuPage;
use crate::ui::settings::{DefaultSettings, Quality, Settings};
use crate::ui::widgets::{self, Activated, Adjusted, Arrow, GOLD, GREY, WHITE, text};

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

const ROWS: [Row; 9] = [
    (
        "Mouse and stick speed",
        |settings| format!("{:.1}", settings.sensitivity),
        |settings, by| step(&mut settings.sensitivity, by, 0.1, 0.1, 5.0),
    ),
    (
        "Invert up and down",
        |settings| yes_or_no(settings.invert_y),
        |settings, _| settings.invert_y = !settings.invert_y,
    ),
    (
        "Field of view",
        |settings| format!("{:.0} degrees", settings.field_of_view),
        |settings, by| step(&mut settings.field_of_view, by, 5.0, 40.0, 110.0),
    ),
    (
        "View distance",
        |settings| format!("{:.0} m", settings.view_distance),
        |settings, by| step(&mut settings.view_distance, by, 200.0, 200.0, 8000.0),
    ),
    (
        "Quality",
        |settings| format!("{:?}", settings.quality).to_lowercase(),
        |settings, by| {
            let all = [Quality::Low, Quality::Medium, Quality::High];
            settings.quality = all[(settings.quality as i32 + by).rem_euclid(3) as usize];
        },
    ),
    (
        "Length of a day",
        |settings| match settings.day_minutes {
            0.0 => "the sun stands still".into(),
            minutes => format!("{minutes:.0} min"),
        },
        |settings, by| step(&mut settings.day_minutes, by, 5.0, 0.0, 120.0),
    ),
    (
        "Brush radius",
        |settings| format!("{:.1} m", settings.radius),
        |settings, by| step(&mut settings.radius, by, 0.5, 1.0, 12.0),
    ),
    (
        "Shape of what is built",
        |settings| settings.shape.label().into(),
        |settings, by| {
            let next = settings.shape.next();
            settings.shape = if by < 0 { next.next() } else { next };
        },
    ),
    (
        "Build only with what was dug",
        |settings| yes_or_no(settings.survival),
        |settings, _| settings.survival = !settings.survival,
    ),
];

/// What the labels do not say.
const NOTES: &str = "View distance: what is farther fades into the sky. Far ground is drawn coarsely, so a long view costs \
                     little.\nQuality: of shadows, textures and far ground.";

fn yes_or_no(value: bool) -> String {
    if value { "yes" } else { "no" }.into()
}

/// Steps to a multiple of `width`, whatever number the file had.
fn step(number: &mut f32, by: i32, width: f32, low: f32, high: f32) {
    *number = (((*number / width).round() + by as f32) * width).clamp(low, high);
}

/// The value of a row.
#[derive(Component)]
struct Value(usize);

fn open(mut commands: Commands) {
    super::spawn_page(&mut commands, MenuPage::Settings, "Settings", 600.0, |column| {
        for (at, (label, _, adjust)) in ROWS.into_iter().enumerate() {
            let row = Node {
                padding: UiRect::axes(px(14), px(6)),
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
        let around = Node { margin: UiRect::axes(px(14), px(8)), ..default() };
        column.spawn((text(NOTES, 13.0, GREY), around));
        column.spawn(widgets::button(ROWS.len(), "Reset", 540.0)).observe(reset);
        column.spawn(widgets::button(ROWS.len() + 1, "Back", 540.0)).observe(go_to(MenuPage::Menu));
    });
}

fn arrow(sign: &str, by: i32) -> impl Bundle {
    let node =
        Node { padding: UiRect::axes(px(10), px(2)), border_radius: BorderRadius::all(px(4)), ..default() };
    (Arrow(by), node, BackgroundColor(Color::srgba(1.0, 1.0, 1.0, 0.08)), children![text(sign, 18.0, WHITE)])
}

/// Resets everything but what has a page of its own.
fn reset(_: On<Activated>, defaults: Res<DefaultSettings>, mut settings: ResMut<Settings>) {
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
            ("Invert up and down", ["yes", "no", "yes"]),
            ("Build only with what was dug", ["no", "yes", "no"]),
            ("Quality", ["high", "low", "medium"]),
            ("Shape of what is built", ["cube", "beam", "sphere"]),
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
        let entity = item_at(&mut app, ROWS.len());
        for quality in [Quality::Low, Quality::Medium] {
            app.world_mut().resource_mut::<DefaultSettings>().0.quality = quality;
            let mut settings = app.world_mut().resource_mut::<Settings>();
            (settings.quality, settings.sensitivity) = (Quality::High, 3.0);
            app.world_mut().trigger(Activated { entity });
            let settings = app.world().resource::<Settings>();
            assert_eq!((settings.quality, settings.sensitivity), (quality, 1.0));
        }
    }

    #[test]
    fn rows_react_to_enter_and_to_clicks() {
        let mut app = app();
        let is_inverted = |app: &App| app.world().resource::<Settings>().invert_y;
        let at = position("Invert up and down");
        app.world_mut().resource_mut::<FocusedItem>().0 = at;
        tap_key(&mut app, KeyCode::Enter);
        assert!(is_inverted(&app));
        let row = item_at(&mut app, at);
        app.world_mut().entity_mut(row).insert(Interaction::Pressed);
        app.update();
        assert!(!is_inverted(&app));
    }
}
