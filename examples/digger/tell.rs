//! Says on standard output what goes on, a line each: for programs that play the game with a real mouse and keys.

use bevy::prelude::*;
use bevy_burrow::plugin::HistoryMoved;
use bevy_burrow::prelude::*;

use crate::phase::{Page, Phase};
use crate::player::Player;
use crate::tools::Hand;

/// Says what goes on.
pub struct TellPlugin;

impl Plugin for TellPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Last, (tell_frame, tell_page, tell_ready, tell_brush, tell_edits, tell_history));
    }
}

fn tell_frame() {
    println!("frame");
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

fn tell_brush(hand: Res<Hand>, mut last: Local<String>) {
    let now = format!("tool {} radius={:.2}", hand.tool.label(), hand.radius(hand.tool));
    if *last != now {
        println!("{now}");
        *last = now;
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
