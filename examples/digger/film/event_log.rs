//! Logs events to standard output, one per line, for programs that play the game with a real mouse and keyboard.

#[path = "../../shared/tell.rs"]
mod frame_log;

use bevy::prelude::*;
use bevy_burrow::plugin::HistoryMoved;
use bevy_burrow::prelude::*;
use bevy_burrow::view::GroundLoading;

use crate::player::Player;
use crate::player::camera::PlayerCamera;
use crate::player::game_state::{GameState, MenuPage};
use crate::tools::Hand;

/// Logs events. `tools/drive.py` reads them.
pub struct EventLogPlugin;

impl Plugin for EventLogPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(
            Last,
            (
                (log_page, log_ready, log_textures, log_tool, log_aim, log_edits, log_history, log_camera),
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
                receipt.step,
                restored.removed.total(),
                restored.added.total()
            ),
            Err(nothing) => println!("history {nothing}"),
        }
    }
}
