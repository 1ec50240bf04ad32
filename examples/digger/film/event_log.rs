//! Logs events to standard output, one per line, for programs that play the game with a real mouse and keyboard.

#[path = "../../shared/tell.rs"]
mod frame_log;

use bevy::prelude::*;
use bevy::ui::UiGlobalTransform;
use bevy_burrow::plugin::HistoryMoved;
use bevy_burrow::prelude::*;
use bevy_burrow::view::GroundLoading;

use crate::party::players::PlayerInfo;
use crate::player::Player;
use crate::player::camera::PlayerCamera;
use crate::player::game_state::{GameState, MenuPage};
use crate::player::headlamp::HeadlampSwitch;
use crate::tools::Hand;
use crate::tools::lamps::SavedLamps;
use crate::ui::hud::Hint;
use crate::ui::widgets::{FocusedItem, MenuItem};

/// Logs events. `tools/drive.py` reads them.
pub struct EventLogPlugin;

impl Plugin for EventLogPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(
            Last,
            (
                (log_page, log_ready, log_textures, log_tool, log_aim, log_edits, log_history, log_camera),
                (log_items, log_texts, log_hints, log_game, log_ground),
                frame_log::tell_frame,
            )
                .chain(),
        );
        frame_log::tell_pipelines(app);
    }
}

fn log_page(state: Res<State<GameState>>, page: Res<State<MenuPage>>) {
    if state.is_changed() || page.is_changed() {
        println!("page {:?} {:?}", state.get(), page.get());
    }
}

/// Logs the menu's items, the selected one first, as JSON.
fn log_items(
    focus: Res<FocusedItem>,
    items: Query<(Entity, &MenuItem)>,
    children: Query<&Children>,
    texts: Query<&Text>,
    mut last: Local<String>,
) {
    let mut all: Vec<(usize, &str)> = Vec::new();
    for (entity, item) in &items {
        let text = children.iter_descendants(entity).find_map(|child| texts.get(child).ok());
        all.extend(text.map(|text| (item.0, text.0.as_str())));
    }
    all.sort_unstable();
    let names: Vec<&str> = all.into_iter().map(|(_, name)| name).collect();
    log_change(format!("items {} {}", focus.0, serde_json::json!(names)), &mut last);
}

/// Logs the places of all visible texts whenever a page has opened, and of what is behind them: left, top, right,
/// bottom.
fn log_texts(
    state: Res<State<MenuPage>>,
    texts: Query<(Entity, &Text, &InheritedVisibility)>,
    nodes: Query<(&ComputedNode, &UiGlobalTransform)>,
    fills: Query<AnyOf<(&BackgroundColor, &BackgroundGradient)>>,
    parents: Query<&ChildOf>,
    mut frames: Local<u32>,
) {
    *frames = if state.is_changed() { 0 } else { *frames + 1 };
    if *frames != 4 {
        return;
    }
    let is_dark = |node: &Entity| {
        let fill = fills.get(*node);
        fill.is_ok_and(|(color, gradient)| {
            gradient.is_some() || color.is_some_and(|fill| fill.0.alpha() > 0.7)
        })
    };
    let place = |node: Entity| {
        let (node, place) = nodes.get(node).ok()?;
        let (middle, half) = (place.translation, node.size() / 2.0);
        let (from, to) = (middle - half, middle + half);
        Some(format!("{:.0} {:.0} {:.0} {:.0}", from.x, from.y, to.x, to.y))
    };
    for (entity, text, _) in texts.iter().filter(|(_, text, shown)| shown.get() && !text.0.is_empty()) {
        let behind = parents.iter_ancestors(entity).find(is_dark).and_then(place);
        let (words, place) = (serde_json::json!(text.0), place(entity).unwrap_or_default());
        println!("text {words} {place} {}", behind.unwrap_or_else(|| "0 0 0 0".into()));
    }
    println!("texts end");
}

fn log_hints(mut hints: MessageReader<Hint>) {
    for Hint(text) in hints.read() {
        println!("hint {text}");
    }
}

/// Logs what a saved game has to bring back, rounded.
fn log_game(
    players: Query<(&Player, &Transform)>,
    headlamp: Res<HeadlampSwitch>,
    lamps: SavedLamps,
    worlds: Query<&SavedWorld>,
    others: Query<&PlayerInfo>,
    mut last: Local<String>,
) {
    let place = players.iter().next().map(|(_, place)| place.translation.round());
    let (lamps, players) = (lamps.all().len(), others.iter().count());
    let world = worlds.iter().next().and_then(|world| world.path.file_name());
    let world = world.map_or_else(|| "none".into(), |name| name.to_string_lossy());
    let place = place.map_or_else(|| "none".into(), |place| format!("{} {} {}", place.x, place.y, place.z));
    let line =
        format!("game headlamp={} lamps={lamps} players={players} place={place} world={world}", headlamp.0);
    log_change(line, &mut last);
}

/// Logs the ground's hash, which is equal for all players of a world.
fn log_ground(terrains: Query<&Terrain, Changed<Terrain>>, mut last: Local<String>) {
    for terrain in &terrains {
        log_change(format!("ground {:016x}", terrain.world().hash()), &mut last);
    }
}

fn log_ready(players: Query<(), Added<Player>>) {
    if !players.is_empty() {
        println!("ready");
    }
}

fn log_textures(textures: Res<GroundLoading>, mut is_logged: Local<bool>) {
    if !*is_logged && textures.is_ready() {
        *is_logged = true;
        println!("painted");
    }
}

/// Logs a line if it differs from the last one.
fn log_change(line: String, last: &mut String) {
    if *last != line {
        println!("{line}");
        *last = line;
    }
}

fn log_tool(hand: Res<Hand>, mut last: Local<String>) {
    log_change(format!("tool {} radius={:.2}", hand.tool.label(), hand.radius(hand.tool)), &mut last);
}

/// Logs the distance of the aim, rounded to decimetres.
fn log_aim(hand: Res<Hand>, camera: Single<&Transform, With<PlayerCamera>>, mut last: Local<String>) {
    let distance = hand.aim.map(|aim| format!("{:.1}", aim.point.distance(camera.translation)));
    log_change(format!("aim {}", distance.unwrap_or("none".into())), &mut last);
}

/// Logs whether the camera is in the air or in the ground.
fn log_camera(
    camera: Single<&Transform, With<PlayerCamera>>,
    loaded: Query<(), With<Terrain>>,
    terrains: Terrains,
    mut last: Local<String>,
) {
    if loaded.is_empty() {
        return;
    }
    let medium = if terrains.is_solid(camera.translation) { "ground" } else { "air" };
    log_change(format!("eyes in {medium}"), &mut last);
}

fn log_edits(mut receipts: MessageReader<BrushApplied>) {
    for BrushApplied { receipt, .. } in receipts.read() {
        if let Ok(applied) = &receipt.outcome {
            let (removed, added) = (applied.removed.total(), applied.added.total());
            println!("edit tag={} removed={removed} added={added}", receipt.tag);
        }
    }
}

fn log_history(mut steps: MessageReader<HistoryMoved>) {
    for HistoryMoved { receipt, .. } in steps.read() {
        match &receipt.outcome {
            Ok(restored) => println!(
                "history {:?} removed={} added={}",
                receipt.kind,
                restored.removed.total(),
                restored.added.total()
            ),
            Err(nothing) => println!("history {nothing}"),
        }
    }
}
