//! Says on standard output what goes on, a line each: for programs that play the game with a real mouse and keys.

#[path = "../../shared/tell.rs"]
mod told;

use bevy::prelude::*;
use bevy_burrow::plugin::HistoryMoved;
use bevy_burrow::prelude::*;
use bevy_burrow::view::GroundLoading;

use crate::player::Player;
use crate::player::game_state::{Page, Phase};
use crate::tools::Hand;
use crate::world::light::Eyes;

/// Says what goes on.
pub struct TellPlugin;

impl Plugin for TellPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(
            Last,
            (
                (tell_page, tell_ready, tell_look, tell_brush, tell_aim, tell_edits, tell_history, tell_eyes),
                told::tell_frame,
            )
                .chain(),
        );
        told::tell_pipelines(app);
    }
}

fn tell_page(phase: Res<State<Phase>>, page: Res<State<Page>>) {
    if phase.is_changed() || page.is_changed() {
        println!("page {:?} {:?}", phase.get(), page.get());
    }
}

fn tell_ready(players: Query<(), Added<Player>>) {
    if !players.is_empty() {
        println!("ready");
    }
}

fn tell_look(painting: Res<GroundLoading>, mut is_told: Local<bool>) {
    if !*is_told && painting.is_ready() {
        *is_told = true;
        println!("painted");
    }
}

fn tell_brush(hand: Res<Hand>, mut last: Local<String>) {
    let now = format!("tool {} radius={:.2}", hand.tool.label(), hand.radius(hand.tool));
    if *last != now {
        println!("{now}");
        *last = now;
    }
}

/// How far away is what the tool would hit, in decimetres' precision?
fn tell_aim(hand: Res<Hand>, eyes: Single<&Transform, With<Eyes>>, mut last: Local<String>) {
    let now = match hand.aim {
        Some(aim) => format!("aim {:.1}", aim.place.distance(eyes.translation)),
        None => "aim none".into(),
    };
    if *last != now {
        println!("{now}");
        *last = now;
    }
}

/// Are the eyes in the air, or has ground come over them?
fn tell_eyes(
    eyes: Single<&Transform, With<Eyes>>,
    terrains: Query<&Terrain>,
    mut last: Local<Option<&'static str>>,
) {
    let Some(terrain) = terrains.iter().next() else { return };
    let place = eyes.translation / terrain.voxel_size();
    let now = if terrain.world().is_solid(place.as_dvec3()) { "ground" } else { "air" };
    if last.replace(now) != Some(now) {
        println!("eyes in {now}");
    }
}

fn tell_edits(mut receipts: MessageReader<BrushApplied>) {
    for BrushApplied { receipt, .. } in receipts.read() {
        if let Ok(applied) = &receipt.outcome {
            let (removed, added) = (applied.removed.total(), applied.added.total());
            println!("edit tag={} removed={removed} added={added}", receipt.tag);
        }
    }
}

fn tell_history(mut steps: MessageReader<HistoryMoved>) {
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
