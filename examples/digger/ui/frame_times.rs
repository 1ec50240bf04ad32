//! Frame times as text: percentiles of the latest frames, the plugin's share of the main thread, and levels of detail.

use std::time::Duration;

use bevy::prelude::*;
use bevy_burrow::plugin::Times;
use bevy_burrow::prelude::*;

use crate::player::PlayerControlSystems;
use crate::player::game_state::GameState;
use crate::player::input::{Action, Actions};
use crate::ui::widgets;

/// Shows frame times on demand.
pub struct FrameTimesPlugin;

impl Plugin for FrameTimesPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<FrameTimes>()
            .add_systems(Update, toggle.in_set(PlayerControlSystems).run_if(in_state(GameState::Playing)))
            .add_systems(Last, (measure, show).chain());
    }
}

/// The latest frames, and what the plugin took of them on the main thread.
#[derive(Resource, Default)]
struct FrameTimes {
    frames: Times,
    plugin: Times,
}

#[derive(Component)]
struct FrameTimesPanel;

#[derive(Component)]
struct FrameTimesText;

/// The panel, for the heads-up display.
pub fn panel(node: Node) -> impl Bundle {
    let node = Node { display: Display::None, ..node };
    let text = (FrameTimesText, widgets::text("", 13.0, widgets::WHITE));
    (FrameTimesPanel, widgets::panel(node), children![text])
}

fn toggle(actions: Res<Actions>, mut panel: Single<&mut Node, With<FrameTimesPanel>>) {
    if actions.just_pressed(Action::FrameTimes) {
        panel.display = if panel.display == Display::None { Display::Flex } else { Display::None };
    }
}

fn measure(time: Res<Time<Real>>, figures: Res<BurrowFigures>, mut times: ResMut<FrameTimes>) {
    times.frames.push(time.delta());
    times.plugin.push(figures.main_thread);
}

fn show(
    times: Res<FrameTimes>,
    figures: Res<BurrowFigures>,
    chunks: Query<(), With<Chunk>>,
    levels: Query<&ShownLevels>,
    panel: Single<&Node, With<FrameTimesPanel>>,
    mut text: Single<&mut Text, With<FrameTimesText>>,
) {
    if panel.display == Display::None {
        return;
    }
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    let line = |name: &str, times: &Times| {
        let [p50, p99] = [50, 99].map(|percent| ms(times.percentile(percent).unwrap_or_default()));
        format!("{name}  p50 {p50:.2}  p99 {p99:.2} ms\n")
    };
    text.0 = line("frame ", &times.frames) + &line("plugin", &times.plugin);
    text.0 += &format!(
        "{} edits, {} chunks, last transaction {:.1} ms",
        figures.brushes,
        chunks.iter().count(),
        ms(figures.last_transaction),
    );
    for ShownLevels { nodes, waiting } in &levels {
        let counts: Vec<String> = nodes.iter().map(usize::to_string).collect();
        text.0 += &format!("\nsquares by level, finest first: {}; {waiting} waiting", counts.join(" "));
    }
}
