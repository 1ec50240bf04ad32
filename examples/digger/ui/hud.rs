//! The heads-up display: crosshair, tools, materials, time of day, hints, what was just dug, and what lies below.

use std::collections::VecDeque;

use bevy::prelude::*;
use bevy_burrow::panel::BurrowPanel;
use bevy_burrow::prelude::*;

use crate::party::players::PlayerInfo;
use crate::player::Player;
use crate::player::body::Body;
use crate::player::camera::{DetachedCamera, PlayerCamera};
use crate::player::game_state::GameState;
use crate::player::headlamp::HeadlampSwitch;
use crate::player::input::{Action, Actions};
use crate::tools::hardness;
use crate::tools::inventory::{AmountChanged, Inventory};
use crate::tools::{Hand, Tool};
use crate::ui::images::Images;
use crate::ui::labels::Labels;
use crate::ui::settings::Settings;
use crate::ui::texts;
use crate::ui::widgets::{self, EDGE, GOLD, GREY, RED, SHADE, WHITE, column, text};
use crate::world::day::Clock;
use crate::world::landscape::{self, BEDROCK, MATERIALS};

/// Seconds that a hint or a find is shown, in real time: also while the game is paused.
const SHOWN: f32 = 2.6;
/// Seconds after which a hint says that the world is not on the disk yet.
const SLOW_SAVE: f32 = 5.0;
/// Finds that are shown at the same time.
const MAX_FINDS: usize = 4;

/// A short text for the player.
#[derive(Message, Clone, Debug)]
pub struct Hint(pub String);

/// Whether the display is shown. Scripts hide it for pictures of the landscape.
#[derive(Resource)]
pub struct ShowHud(pub bool);

/// Shows the display.
pub struct HudPlugin;

impl Plugin for HudPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(ShowHud(true)).add_message::<Hint>().add_systems(Startup, spawn_hud).add_systems(
            Update,
            (
                show_hud,
                show_tool,
                show_materials,
                fade_crosshair,
                show_time,
                show_whereabouts,
                show_hints,
                show_finds,
                show_core_sample,
                show_keys.run_if(resource_changed::<Settings>.or_else(resource_changed::<Labels>)),
            )
                .after(BurrowSystems::Propagate),
        );
    }
}

#[derive(Component)]
struct Hud;

/// What lies below the crosshair, by depth.
#[derive(Component)]
struct CoreSample;

#[derive(Component)]
struct Crosshair;

#[derive(Component)]
struct Slot(Tool);

/// The label of the key that selects a tool.
#[derive(Component)]
struct SlotKey(Action);

#[derive(Component)]
struct ToolName;

/// The row of a material.
#[derive(Component)]
struct Row(MaterialId);

/// The amount of a material.
#[derive(Component)]
struct Amount(MaterialId);

#[derive(Component)]
struct TimeOfDay;

/// Direction of view, height and depth.
#[derive(Component)]
struct Whereabouts;

#[derive(Component)]
struct HintBox;

#[derive(Component)]
struct Hints;

#[derive(Component)]
struct Find(usize);

/// Important actions with their keys.
#[derive(Component)]
struct KeyList;

fn spawn_hud(mut commands: Commands, images: Res<Images>) {
    let place = |node: Node| Node { position_type: PositionType::Absolute, ..node };
    let padded = || Node { padding: UiRect::axes(px(9), px(6)), ..column(px(0)) };
    commands.spawn((Hud, widgets::full(), Visibility::Hidden)).with_children(|hud| {
        let side = px(6);
        let dot = Node {
            width: side,
            height: side,
            border: UiRect::all(px(1)),
            border_radius: BorderRadius::all(px(3)),
            ..default()
        };
        let colors = (BackgroundColor(WHITE), BorderColor::all(Color::srgba(0.0, 0.0, 0.0, 0.6)));
        hud.spawn((widgets::centered(), children![(Crosshair, dot, colors)]));
        let upper_left = place(Node { left: px(14), top: px(12), ..padded() });
        hud.spawn((widgets::panel(upper_left), children![(CoreSample, text("", 14.0, WHITE))]));
        let upper_right =
            place(Node { right: px(14), top: px(12), align_items: AlignItems::End, ..padded() });
        let lines = children![(TimeOfDay, text("", 16.0, WHITE)), (Whereabouts, text("", 14.0, GREY))];
        hud.spawn((widgets::panel(upper_right), lines));
        let top =
            Node { width: percent(100), top: px(92), justify_content: JustifyContent::Center, ..default() };
        let hint = Node { max_width: percent(46), ..padded() };
        let hint = (HintBox, widgets::panel(hint), Visibility::Hidden);
        hud.spawn((place(top), children![(hint, children![(Hints, widgets::paragraph("", 18.0, GOLD))])]));
        let lower_left = place(Node { left: px(8), bottom: px(12), ..padded() });
        hud.spawn((widgets::panel(lower_left), children![(KeyList, text("", 13.0, GREY))]));
        let bottom =
            Node { width: percent(100), bottom: px(12), align_items: AlignItems::Center, ..column(px(6)) };
        hud.spawn(place(bottom)).with_children(|bottom| spawn_slots(bottom, &images));
        let lower_right =
            Node { right: px(14), bottom: px(12), align_items: AlignItems::End, ..column(px(3)) };
        hud.spawn(place(lower_right)).with_children(spawn_materials);
    });
}

/// The tools, with the name of the selected one above.
fn spawn_slots(parent: &mut ChildSpawnerCommands, images: &Images) {
    let sign = Node { padding: UiRect::axes(px(11), px(3)), ..default() };
    parent.spawn((widgets::panel(sign), children![(ToolName, text("", 15.0, WHITE))]));
    parent.spawn(Node { column_gap: px(5), ..default() }).with_children(|bar| {
        for tool in Tool::ALL {
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
            let key = Node { position_type: PositionType::Absolute, left: px(4), top: px(1), ..default() };
            bar.spawn((
                Slot(tool),
                slot,
                BackgroundColor(SHADE),
                BorderColor::all(EDGE),
                children![(images.icon(tool), icon), (key, SlotKey(tool.slot()), text("", 11.0, WHITE))],
            ));
        }
    });
}

/// The inventory, with the latest finds above.
fn spawn_materials(parent: &mut ChildSpawnerCommands) {
    for at in (0..MAX_FINDS).rev() {
        let node = Node { padding: UiRect::axes(px(8), px(1)), ..default() };
        parent.spawn((Find(at), widgets::panel(node), Visibility::Hidden, children![text("", 15.0, WHITE)]));
    }
    let list =
        Node { width: px(158), padding: UiRect::all(px(5)), margin: UiRect::top(px(4)), ..column(px(1)) };
    parent.spawn(widgets::panel(list)).with_children(|list| {
        for material in MATERIALS {
            let row = Node {
                height: px(22),
                padding: UiRect::horizontal(px(5)),
                border_radius: BorderRadius::all(px(4)),
                align_items: AlignItems::Center,
                column_gap: px(8),
                ..default()
            };
            // With a light border, because coal is as dark as the list.
            let swatch = Node { width: px(16), height: px(16), border: UiRect::all(px(1)), ..default() };
            let grow = Node { flex_grow: 1.0, ..default() };
            list.spawn((
                Row(material),
                row,
                BackgroundColor::DEFAULT,
                children![
                    (
                        swatch,
                        BackgroundColor(swatch_color(material)),
                        BorderColor::all(WHITE.with_alpha(0.45))
                    ),
                    (text(landscape::name(material), 13.0, WHITE), grow),
                    (Amount(material), text("", 13.0, GREY)),
                ],
            ));
        }
    });
}

/// The colour of a material, brightened: the ground is lit by the sun, but a swatch is not.
fn swatch_color(material: MaterialId) -> Color {
    let color = landscape::colour(material);
    let brighten = |channel: f32| (1.5 * channel + 0.03).min(1.0);
    Color::linear_rgb(brighten(color.red), brighten(color.green), brighten(color.blue))
}

fn show_hud(
    shown: Res<ShowHud>,
    state: Res<State<GameState>>,
    is_detached: Single<Has<DetachedCamera>, With<PlayerCamera>>,
    panel: Res<BurrowPanel>,
    mut hud: Single<&mut Visibility, With<Hud>>,
) {
    // The display would shine through the plugin's panel.
    let is_shown = shown.0 && *state.get() == GameState::Playing && !*is_detached && !panel.is_open;
    hud.set_if_neq(if is_shown { Visibility::Inherited } else { Visibility::Hidden });
}

/// Metres down to which the core sample reaches.
const CORE_DEPTH: i32 = 24;

/// Names what lies straight below the crosshair, from the surface down.
fn show_core_sample(
    hand: Res<Hand>,
    terrains: Query<(&Terrain, &GlobalTransform)>,
    mut core: Single<(&mut Text, &ChildOf), With<CoreSample>>,
    mut boxes: Query<&mut Visibility>,
) {
    let lines = hand.aim.zip(terrains.iter().next()).map(|(aim, (terrain, place))| {
        let world = terrain.world();
        let top = place.affine().inverse().transform_point3(aim.point).floor().as_ivec3();
        core_sample(|depth| {
            let voxel = top - IVec3::Y * depth;
            let is_solid = world.samples().is_solid(voxel);
            is_solid
                .then(|| if voxel.y < hardness::BEDROCK { BEDROCK } else { world.samples().material(voxel) })
        })
    });
    let lines = lines.unwrap_or_default();
    if let Ok(mut shown) = boxes.get_mut(core.1.parent()) {
        shown.set_if_neq(if lines.is_empty() { Visibility::Hidden } else { Visibility::Inherited });
    }
    core.0.set_if_neq(Text::new(format!("{}\n{lines}", texts::CORE_SAMPLE)));
}

/// The materials by depth. Where nothing can be dug, that is what counts.
fn core_sample(material_at: impl Fn(i32) -> Option<MaterialId>) -> String {
    let mut layers: Vec<(i32, MaterialId)> =
        (0..CORE_DEPTH).filter_map(|depth| Some((depth, material_at(depth)?))).collect();
    layers.dedup_by_key(|layer| layer.1);
    let lines =
        layers.iter().map(|(depth, material)| format!("{depth:>3} m  {}", landscape::name(*material)));
    lines.collect::<Vec<_>>().join("\n")
}

fn show_tool(
    hand: Res<Hand>,
    mut slots: Query<(&Slot, &mut BorderColor, &mut BackgroundColor)>,
    mut name: Single<&mut Text, With<ToolName>>,
) {
    for (slot, mut border, mut background) in &mut slots {
        let is_selected = slot.0 == hand.tool;
        border.set_if_neq(BorderColor::all(if is_selected { GOLD } else { EDGE }));
        let fill = if is_selected { Color::srgba(0.24, 0.20, 0.10, 0.82) } else { SHADE };
        background.set_if_neq(BackgroundColor(fill));
    }
    let (label, radius) = (hand.tool.label(), hand.radius(hand.tool));
    let material = landscape::name(hand.material);
    let words = match hand.tool {
        Tool::Builder => format!("{label}  {} of {material}  {radius:.2} m", hand.shape.label()),
        Tool::Painter => format!("{label}  {material}  {radius:.2} m"),
        Tool::Bomb | Tool::Lamp | Tool::Ball => label.into(),
        _ => format!("{label}  {radius:.2} m"),
    };
    name.set_if_neq(Text::new(words));
}

fn show_materials(
    hand: Res<Hand>,
    inventory: Res<Inventory>,
    mut rows: Query<(&Row, &mut BackgroundColor)>,
    mut amounts: Query<(&Amount, &mut Text, &mut TextColor)>,
) {
    for (row, mut background) in &mut rows {
        let fill = if row.0 == hand.material { GOLD.with_alpha(0.22) } else { Color::NONE };
        background.set_if_neq(BackgroundColor(fill));
    }
    for (material, mut text, mut color) in &mut amounts {
        let amount = inventory.amount(material.0);
        text.set_if_neq(Text::new(amount.to_string()));
        color.set_if_neq(TextColor(match amount {
            1.. => WHITE,
            0 => GREY,
            // In debt.
            _ => RED,
        }));
    }
}

/// The crosshair is faint where the tool does not reach, and red while it is used there.
fn fade_crosshair(
    hand: Res<Hand>,
    actions: Res<Actions>,
    mut dot: Single<&mut BackgroundColor, With<Crosshair>>,
) {
    let color = match hand.aim.is_some() || matches!(hand.tool, Tool::Bomb | Tool::Ball) {
        true => WHITE.with_alpha(0.95),
        false if actions.pressed(Action::Use) => RED,
        false => WHITE.with_alpha(0.30),
    };
    dot.set_if_neq(BackgroundColor(color));
}

fn show_time(
    clock: Res<Clock>,
    lamp: Res<HeadlampSwitch>,
    worlds: Query<(&Terrain, &WorldStore)>,
    others: Query<&PlayerInfo>,
    clock_time: Res<Time<Real>>,
    mut time: Single<&mut Text, With<TimeOfDay>>,
    mut behind: Local<f32>,
) {
    let is_behind = |(terrain, world): (&Terrain, &WorldStore)| world.durable() < terrain.world().revision();
    // While the player drills, something always is on its way to the disk.
    *behind = if worlds.iter().any(is_behind) { *behind + clock_time.delta_secs() } else { 0.0 };
    let players = others.iter().count();
    let mut words: Vec<String> = Vec::new();
    words.extend((players > 1).then(|| texts::players(players)));
    words.extend(lamp.0.then(|| texts::HEADLAMP_ON.into()));
    words.extend((*behind > SLOW_SAVE).then(|| texts::SAVING.into()));
    words.push(clock.text());
    time.set_if_neq(Text::new(words.join("   ")));
}

/// Shows where the player looks, how high it is, and how deep below the ground.
fn show_whereabouts(
    players: Query<(&Player, Body)>,
    terrains: Terrains,
    mut line: Single<&mut Text, With<Whereabouts>>,
) {
    let Some((player, body)) = players.iter().next() else { return };
    let feet = body.feet();
    let depth = terrains.height(feet.x, feet.z).map_or(0.0, |top| top - feet.y);
    line.set_if_neq(Text::new(texts::place(compass(player.yaw), feet.y, depth)));
}

/// The direction of the compass for a yaw, which grows to the left from north, -z.
fn compass(yaw: f32) -> &'static str {
    let eighths = (-yaw / std::f32::consts::FRAC_PI_4).round() as i64;
    texts::COMPASS[eighths.rem_euclid(8) as usize]
}

/// A hint and its box are shown for a while, and then both are gone.
fn show_hints(
    time: Res<Time<Real>>,
    mut hints: MessageReader<Hint>,
    mut text: Single<&mut Text, With<Hints>>,
    mut shown: Single<&mut Visibility, With<HintBox>>,
    mut left: Local<f32>,
) {
    if let Some(hint) = hints.read().last() {
        text.set_if_neq(Text::new(hint.0.clone()));
        *left = SHOWN + 0.04 * hint.0.len() as f32;
    }
    shown.set_if_neq(if *left > 0.0 { Visibility::Inherited } else { Visibility::Hidden });
    *left -= time.delta_secs();
}

/// Shows what was gained and used lately. Changes of the same material are added up.
fn show_finds(
    time: Res<Time<Real>>,
    mut changes: MessageReader<AmountChanged>,
    mut lines: Query<(&Find, &mut Visibility, &Children)>,
    mut texts: Query<&mut Text>,
    mut finds: Local<VecDeque<(MaterialId, i64, f32)>>,
) {
    for change in changes.read() {
        let same = finds.iter_mut().find(|find| find.0 == change.material && (find.1 > 0) == (change.by > 0));
        match same {
            Some(find) => (find.1, find.2) = (find.1 + change.by, SHOWN),
            None => finds.push_front((change.material, change.by, SHOWN)),
        }
    }
    for find in finds.iter_mut() {
        find.2 -= time.delta_secs();
    }
    finds.retain(|find| find.2 > 0.0);
    finds.truncate(MAX_FINDS);
    for (line, mut shown, children) in &mut lines {
        let find = finds.get(line.0);
        shown.set_if_neq(if find.is_some() { Visibility::Inherited } else { Visibility::Hidden });
        if let (Some(&(material, by, _)), Ok(mut text)) = (find, texts.get_mut(children[0])) {
            text.set_if_neq(Text::new(format!("{by:+} {}", landscape::name(material))));
        }
    }
}

fn show_keys(
    settings: Res<Settings>,
    labels: Res<Labels>,
    mut list: Single<&mut Text, (With<KeyList>, Without<SlotKey>)>,
    mut slots: Query<(&SlotKey, &mut Text)>,
) {
    use Action as A;
    let lines =
        [A::Use, A::Build, A::Grow, A::NextMaterial, A::Help, A::Headlamp, A::Undo, A::Pause].map(|action| {
            let what = if action == A::Grow { texts::BRUSH_SIZE } else { action.label() };
            format!("{}  {what}", settings.bindings.first(action, &labels))
        });
    list.0 = lines.join("\n");
    for (slot, mut text) in &mut slots {
        // A slot has room for a short label only.
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
    fn a_hint_disappears_with_its_box_even_while_the_game_is_paused() {
        let mut app = App::new();
        app.add_plugins(MinimalPlugins)
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(500)))
            .add_message::<Hint>()
            .add_systems(Update, show_hints);
        app.world_mut().spawn((Hints, Text::default()));
        let shown = app.world_mut().spawn((HintBox, Visibility::Hidden)).id();
        let is_shown = |app: &App| app.world().get(shown) == Some(&Visibility::Inherited);
        app.world_mut().resource_mut::<Time<Virtual>>().pause();
        app.update();
        assert!(!is_shown(&app), "there was none yet");
        app.world_mut().write_message(Hint("look there".into()));
        app.update();
        assert!(is_shown(&app));
        for _ in 0..7 {
            app.update();
        }
        assert!(!is_shown(&app));
    }

    #[test]
    fn every_text_of_the_display_has_a_backing() {
        let mut app = App::new();
        app.init_resource::<Assets<Image>>().init_resource::<Images>().add_systems(Startup, spawn_hud);
        app.update();
        let world = app.world_mut();
        let mut texts = world.query_filtered::<Entity, With<Text>>();
        for text in texts.iter(world).collect::<Vec<_>>() {
            let above =
                std::iter::successors(Some(text), |at| world.get::<ChildOf>(*at).map(ChildOf::parent));
            let fills: Vec<f32> = above
                .filter_map(|node| world.get::<BackgroundColor>(node))
                .map(|fill| fill.0.alpha())
                .collect();
            assert!(fills.iter().any(|alpha| *alpha > 0.7), "{text}: {fills:?}");
        }
    }

    #[test]
    fn the_core_sample_names_bedrock() {
        let rock =
            |bedrock: i32| move |depth: i32| Some(if depth < bedrock { landscape::ROCK } else { BEDROCK });
        assert_eq!(core_sample(rock(2)), "  0 m  rock\n  2 m  bedrock");
        assert_eq!(core_sample(|_| None), "");
    }

    #[test]
    fn the_compass_turns_with_the_player() {
        let yaws = [0.0, -0.8, -1.5, 3.1, 1.5, 6.3, 0.3];
        assert_eq!(yaws.map(compass), ["N", "NE", "E", "S", "W", "N", "N"]);
        // The sun rises where the game says that the east is.
        let sunrise = Clock { hour: 6.0, runs: true }.sun();
        assert_eq!(compass(Player::looking(Vec3::ZERO, sunrise).yaw), "E");
    }
}
