//! What is written over the game: crosshair, tools, materials, the hour, and what was just dug.

use std::collections::VecDeque;

use bevy::prelude::*;
use bevy_burrow::panel::BurrowPanel;
use bevy_burrow::prelude::*;

use crate::player::Drone;
use crate::player::game_state::Phase;
use crate::player::input::Action;
use crate::tools::inventory::{Inventory, StockChanged};
use crate::tools::{Hand, Tool};
use crate::ui::art::Art;
use crate::ui::labels::Labels;
use crate::ui::settings::Settings;
use crate::ui::widgets;
use crate::world::day::Clock;
use crate::world::landscape::{self, MATERIALS};
use crate::world::light::{Eyes, LampSwitch};

/// Seconds that a hint or a find stays, the player's own: a new game begins without those of the old one.
const STAY: f32 = 2.6;
/// Finds that are seen at once.
const FINDS: usize = 4;

/// Something to tell the player.
#[derive(Message, Clone, Debug)]
pub struct Hint(String);

impl Hint {
    pub fn new(words: impl Into<String>) -> Self {
        Self(words.into())
    }

    #[cfg(test)]
    pub fn words(&self) -> &str {
        &self.0
    }
}

/// Is anything written at all? Not on pictures of the landscape.
#[derive(Resource)]
pub struct ShowHud(pub bool);

/// Writes over the game.
pub struct HudPlugin;

impl Plugin for HudPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(ShowHud(true)).add_message::<Hint>().add_systems(Startup, write_all).add_systems(
            Update,
            (show, mark_tool, count_materials, aim, tell_hour, tell_hints, tell_finds, tell_keys)
                .after(BurrowSystems::Propagate),
        );
    }
}

#[derive(Component)]
struct Hud;

#[derive(Component)]
struct Crosshair;

#[derive(Component)]
struct Slot(Tool);

/// The key that takes the tool of a slot.
#[derive(Component)]
struct SlotKey(Action);

#[derive(Component)]
struct ToolName;

/// A material's row, and its count.
#[derive(Component)]
struct Row(MaterialId);

#[derive(Component)]
struct Count(MaterialId);

#[derive(Component)]
struct Hour;

#[derive(Component)]
struct Hints;

#[derive(Component)]
struct Find(usize);

#[derive(Component)]
struct KeyLine;

fn write_all(mut commands: Commands, art: Res<Art>) {
    commands.spawn((Hud, widgets::full(), Visibility::Hidden)).with_children(|hud| {
        spawn_crosshair(hud);
        spawn_slots(hud, &art);
        spawn_materials(hud, &art);
        let corner = Node { position_type: PositionType::Absolute, right: px(16), top: px(12), ..default() };
        hud.spawn((corner, children![(Hour, widgets::text("", 17.0, widgets::WHITE))]));
        let top = Node {
            position_type: PositionType::Absolute,
            width: percent(100),
            top: px(92),
            justify_content: JustifyContent::Center,
            ..default()
        };
        hud.spawn((top, children![(Hints, widgets::text("", 19.0, widgets::GOLD))]));
        let keys = Node {
            position_type: PositionType::Absolute,
            left: px(14),
            bottom: px(12),
            padding: UiRect::axes(px(9), px(6)),
            ..default()
        };
        hud.spawn((widgets::panel(keys), children![(KeyLine, widgets::text("", 13.0, widgets::GREY))]));
    });
}

fn spawn_crosshair(hud: &mut ChildSpawnerCommands) {
    let centre =
        Node { align_items: AlignItems::Center, justify_content: JustifyContent::Center, ..widgets::full() };
    let dot = Node {
        width: px(6),
        height: px(6),
        border: UiRect::all(px(1)),
        border_radius: BorderRadius::all(px(3)),
        ..default()
    };
    let colors = (BackgroundColor(widgets::WHITE), BorderColor::all(Color::srgba(0.0, 0.0, 0.0, 0.6)));
    hud.spawn((centre, children![(Crosshair, dot, colors)]));
}

/// The tools along the lower edge, with the name of the chosen one above.
fn spawn_slots(hud: &mut ChildSpawnerCommands, art: &Art) {
    let bottom = Node {
        position_type: PositionType::Absolute,
        width: percent(100),
        bottom: px(12),
        flex_direction: FlexDirection::Column,
        align_items: AlignItems::Center,
        row_gap: px(6),
        ..default()
    };
    hud.spawn(bottom).with_children(|bottom| {
        let sign = Node { padding: UiRect::axes(px(11), px(3)), ..default() };
        bottom.spawn((widgets::panel(sign), children![(ToolName, widgets::text("", 15.0, widgets::WHITE))]));
        bottom.spawn(Node { column_gap: px(5), ..default() }).with_children(|bar| {
            for (at, tool) in Tool::ALL.into_iter().enumerate() {
                let slot = Node {
                    width: px(52),
                    height: px(52),
                    border: UiRect::all(px(2)),
                    border_radius: BorderRadius::all(px(6)),
                    align_items: AlignItems::Center,
                    justify_content: JustifyContent::Center,
                    ..default()
                };
                let icon = Node { width: px(36), height: px(36), ..default() };
                let number =
                    Node { position_type: PositionType::Absolute, left: px(4), top: px(1), ..default() };
                bar.spawn((
                    Slot(tool),
                    slot,
                    BackgroundColor(widgets::SHADE),
                    BorderColor::all(widgets::EDGE),
                    children![
                        (ImageNode::new(art.tools[at].clone()), icon),
                        (number, SlotKey(tool.slot()), widgets::text("", 11.0, widgets::GREY)),
                    ],
                ));
            }
        });
    });
}

/// What was dug, at the right, with the latest finds above.
fn spawn_materials(hud: &mut ChildSpawnerCommands, art: &Art) {
    let right = Node {
        position_type: PositionType::Absolute,
        right: px(14),
        bottom: px(12),
        flex_direction: FlexDirection::Column,
        align_items: AlignItems::End,
        row_gap: px(3),
        ..default()
    };
    hud.spawn(right).with_children(|right| {
        for at in (0..FINDS).rev() {
            right.spawn((Find(at), widgets::text("", 15.0, widgets::WHITE)));
        }
        let list = Node {
            width: px(158),
            padding: UiRect::all(px(5)),
            margin: UiRect::top(px(4)),
            flex_direction: FlexDirection::Column,
            row_gap: px(1),
            ..default()
        };
        right.spawn(widgets::panel(list)).with_children(|list| {
            for (material, name) in MATERIALS {
                let row = Node {
                    height: px(22),
                    padding: UiRect::horizontal(px(5)),
                    border_radius: BorderRadius::all(px(4)),
                    align_items: AlignItems::Center,
                    column_gap: px(8),
                    ..default()
                };
                let swatch = Node { width: px(14), height: px(14), ..default() };
                // A light edge, without which coal could not be told from the list's own ground.
                let frame = Node { padding: UiRect::all(px(1)), ..default() };
                let color = Color::from(landscape::colour(material));
                list.spawn((Row(material), row, BackgroundColor::DEFAULT)).with_children(|row| {
                    let edge = BackgroundColor(Color::srgba(1.0, 1.0, 1.0, 0.45));
                    let picture = ImageNode::new(art.swatch.clone()).with_color(brighter(color));
                    row.spawn((frame, edge, children![(picture, swatch)]));
                    let grow = Node { flex_grow: 1.0, ..default() };
                    row.spawn((widgets::text(name, 13.0, widgets::WHITE), grow));
                    row.spawn((Count(material), widgets::text("", 13.0, widgets::GREY)));
                });
            }
        });
    });
}

/// Ground is lit by the sun, swatches by nothing.
fn brighter(color: Color) -> Color {
    let lit = |channel: f32| (1.9 * channel + 0.035).min(1.0);
    let color = color.to_linear();
    Color::linear_rgb(lit(color.red), lit(color.green), lit(color.blue))
}

fn show(
    shown: Res<ShowHud>,
    phase: Res<State<Phase>>,
    eyes: Single<Has<Drone>, With<Eyes>>,
    panel: Res<BurrowPanel>,
    mut hud: Single<&mut Visibility, With<Hud>>,
) {
    // The panel is read without anything shining through it.
    let is_shown = shown.0 && *phase.get() == Phase::Playing && !*eyes && !panel.is_open;
    hud.set_if_neq(if is_shown { Visibility::Inherited } else { Visibility::Hidden });
}

fn mark_tool(
    hand: Res<Hand>,
    mut slots: Query<(&Slot, &mut BorderColor, &mut BackgroundColor)>,
    mut name: Single<&mut Text, With<ToolName>>,
) {
    for (slot, mut edge, mut ground) in &mut slots {
        let chosen = slot.0 == hand.tool;
        edge.set_if_neq(BorderColor::all(if chosen { widgets::GOLD } else { widgets::EDGE }));
        let lit = Color::srgba(0.24, 0.20, 0.10, 0.82);
        ground.set_if_neq(BackgroundColor(if chosen { lit } else { widgets::SHADE }));
    }
    let radius = hand.radius(hand.tool);
    let words = match hand.tool {
        Tool::Builder => {
            format!("builder  {} of {}  {radius:.2} m", hand.form.label(), landscape::name(hand.material))
        }
        Tool::Painter => format!("painter  {}  {radius:.2} m", landscape::name(hand.material)),
        Tool::Bomb | Tool::Lamp | Tool::Ball => hand.tool.label().into(),
        tool => format!("{}  {radius:.2} m", tool.label()),
    };
    name.set_if_neq(Text::new(words));
}

fn count_materials(
    hand: Res<Hand>,
    inventory: Res<Inventory>,
    mut rows: Query<(&Row, &mut BackgroundColor)>,
    mut counts: Query<(&Count, &mut Text, &mut TextColor)>,
) {
    for (row, mut ground) in &mut rows {
        let chosen = row.0 == hand.material;
        let lit = Color::srgba(1.0, 0.80, 0.32, 0.22);
        ground.set_if_neq(BackgroundColor(if chosen { lit } else { Color::NONE }));
    }
    for (count, mut text, mut color) in &mut counts {
        let stock = inventory.stock(count.0);
        text.set_if_neq(Text::new(stock.to_string()));
        color.set_if_neq(TextColor(match stock {
            1.. => widgets::WHITE,
            0 => widgets::GREY,
            // Owed.
            _ => widgets::RED,
        }));
    }
}

/// The crosshair fades where the tool does not reach.
fn aim(hand: Res<Hand>, mut dot: Single<&mut BackgroundColor, With<Crosshair>>) {
    let reaches = hand.aim.is_some() || matches!(hand.tool, Tool::Bomb | Tool::Ball);
    dot.set_if_neq(BackgroundColor(widgets::WHITE.with_alpha(if reaches { 0.95 } else { 0.30 })));
}

fn tell_hour(clock: Res<Clock>, lamp: Res<LampSwitch>, mut hour: Single<&mut Text, With<Hour>>) {
    let lamp = if lamp.0 { "lamp on   " } else { "" };
    hour.set_if_neq(Text::new(format!("{lamp}{}", clock.face())));
}

fn tell_hints(
    time: Res<Time<Real>>,
    mut hints: MessageReader<Hint>,
    mut line: Single<(&mut Text, &mut TextColor), With<Hints>>,
    mut left: Local<f32>,
) {
    let (text, color) = &mut *line;
    if let Some(hint) = hints.read().last() {
        text.set_if_neq(Text::new(hint.0.clone()));
        *left = STAY;
    }
    *left -= time.delta_secs();
    color.set_if_neq(TextColor(widgets::GOLD.with_alpha((2.0 * *left).clamp(0.0, 1.0))));
}

/// What was dug lately, the same materials added up while they keep coming.
fn tell_finds(
    time: Res<Time<Real>>,
    mut changes: MessageReader<StockChanged>,
    mut lines: Query<(&Find, &mut Text, &mut TextColor)>,
    mut finds: Local<VecDeque<(MaterialId, i64, f32)>>,
) {
    for change in changes.read().filter(|change| change.by != 0) {
        let same = finds.iter_mut().find(|find| find.0 == change.material && (find.1 > 0) == (change.by > 0));
        match same {
            Some(find) => (find.1, find.2) = (find.1 + change.by, STAY),
            None => finds.push_front((change.material, change.by, STAY)),
        }
    }
    for find in finds.iter_mut() {
        find.2 -= time.delta_secs();
    }
    finds.retain(|find| find.2 > 0.0);
    finds.truncate(FINDS);
    for (line, mut text, mut color) in &mut lines {
        let (words, alpha) = finds.get(line.0).map_or((String::new(), 0.0), |&(material, by, left)| {
            (format!("{by:+} {}", landscape::name(material)), (2.0 * left).clamp(0.0, 1.0))
        });
        text.set_if_neq(Text::new(words));
        color.set_if_neq(TextColor(widgets::WHITE.with_alpha(alpha)));
    }
}

fn tell_keys(
    settings: Res<Settings>,
    labels: Res<Labels>,
    mut line: Single<&mut Text, (With<KeyLine>, Without<SlotKey>)>,
    mut slots: Query<(&SlotKey, &mut Text)>,
) {
    if !settings.is_changed() && !labels.is_changed() {
        return;
    }
    let lines = [Action::Help, Action::Headlamp, Action::Undo, Action::Pause]
        .map(|action| format!("{}  {}", settings.bindings.first(action, &labels), action.label()));
    line.0 = lines.join("\n");
    for (slot, mut text) in &mut slots {
        // There is no room for more than a short name.
        let key = settings.bindings.first(slot.0, &labels);
        text.0 = if key.len() <= 5 { key } else { String::new() };
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use bevy::time::TimeUpdateStrategy;

    use super::*;

    #[test]
    fn hints_go_even_while_the_game_stands_still() {
        let mut app = App::new();
        app.add_plugins(MinimalPlugins)
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(500)))
            .add_message::<Hint>()
            .add_systems(Update, tell_hints);
        let line = app.world_mut().spawn((Hints, Text::default(), TextColor::default())).id();
        let alpha = |app: &App| app.world().get::<TextColor>(line).expect("a line").0.alpha();
        app.world_mut().resource_mut::<Time<Virtual>>().pause();
        app.world_mut().write_message(Hint::new("look there"));
        app.update();
        assert_eq!(alpha(&app), 1.0);
        for _ in 0..6 {
            app.update();
        }
        assert_eq!(alpha(&app), 0.0);
    }
}
