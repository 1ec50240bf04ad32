//! Frame times as small bars, with the plugin's own share of the main thread below.

use std::collections::VecDeque;
use std::time::Duration;

use bevy::asset::RenderAssetUsages;
use bevy::image::ImageSampler;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_burrow::plugin::Times;
use bevy_burrow::prelude::*;

use crate::player::Playing;
use crate::player::game_state::Phase;
use crate::player::input::{Action, Actions};
use crate::ui::widgets;

/// Frames that are seen, one bar each.
const BARS: u32 = 150;
const HEIGHT: u32 = 60;
/// The whole height, in milliseconds; lines stand at 60 and at 30 frames a second.
const TOP: f32 = 40.0;

/// Shows frame times when asked to.
pub struct FramesPlugin;

impl Plugin for FramesPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Frames>()
            .add_systems(Startup, hang_up)
            .add_systems(Update, toggle.in_set(Playing).run_if(in_state(Phase::Playing)))
            .add_systems(Last, (take_time, draw.run_if(is_shown)).chain());
    }
}

/// How long the latest frames took, and what the plugin took of them.
#[derive(Resource, Default)]
struct Frames(VecDeque<(Duration, Duration)>);

impl Frames {
    /// How long they took, for percentiles.
    fn times(&self) -> Times {
        let mut times = Times::default();
        self.0.iter().for_each(|frame| times.push(frame.0));
        times
    }
}

#[derive(Component)]
struct Graph(Handle<Image>);

#[derive(Component)]
struct Words;

fn hang_up(mut commands: Commands, mut images: ResMut<Assets<Image>>) {
    let size = Extent3d { width: BARS, height: HEIGHT, depth_or_array_layers: 1 };
    let mut image = Image::new_fill(
        size,
        TextureDimension::D2,
        &[0; 4],
        TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::all(),
    );
    image.sampler = ImageSampler::nearest();
    let image = images.add(image);
    let corner = Node {
        position_type: PositionType::Absolute,
        left: px(12),
        top: px(12),
        padding: UiRect::all(px(8)),
        flex_direction: FlexDirection::Column,
        row_gap: px(4),
        ..default()
    };
    let picture = Node { width: px(2 * BARS), height: px(HEIGHT), ..default() };
    commands.spawn((
        Graph(image.clone()),
        widgets::panel(corner),
        Visibility::Hidden,
        children![(ImageNode::new(image), picture), (Words, widgets::text("", 13.0, widgets::WHITE))],
    ));
}

fn is_shown(graph: Single<&Visibility, With<Graph>>) -> bool {
    **graph != Visibility::Hidden
}

fn toggle(actions: Res<Actions>, mut graph: Single<&mut Visibility, With<Graph>>) {
    if actions.just_pressed(Action::Figures) {
        graph.toggle_inherited_hidden();
    }
}

fn take_time(time: Res<Time<Real>>, figures: Res<BurrowFigures>, mut frames: ResMut<Frames>) {
    if frames.0.len() == BARS as usize {
        frames.0.pop_front();
    }
    frames.0.push_back((time.delta(), figures.main_thread));
}

fn draw(
    frames: Res<Frames>,
    figures: Res<BurrowFigures>,
    chunks: Query<(), With<Chunk>>,
    graph: Single<&Graph>,
    mut images: ResMut<Assets<Image>>,
    mut words: Single<&mut Text, With<Words>>,
) {
    let Some(mut image) = images.get_mut(&graph.0) else { return };
    let Some(texels) = image.data.as_mut() else { return };
    let rows = |time: Duration| ((time.as_secs_f32() * 1e3 / TOP * HEIGHT as f32).ceil() as u32).min(HEIGHT);
    let line = |ms: f32| HEIGHT - 1 - (ms / TOP * HEIGHT as f32) as u32;
    let lines = [line(1e3 / 60.0), line(1e3 / 30.0)];
    for (at, texel) in texels.chunks_exact_mut(4).enumerate() {
        let (x, y) = (at as u32 % BARS, at as u32 / BARS);
        let (frame, own) = frames.0.get(x as usize).copied().unwrap_or_default();
        let above = HEIGHT - y;
        let color = if above <= rows(own) && !own.is_zero() {
            [255, 120, 70, 255]
        } else if above <= rows(frame) {
            let ms = frame.as_secs_f32() * 1e3;
            if ms <= 17.5 {
                [120, 200, 110, 255]
            } else if ms <= 34.0 {
                [235, 195, 85, 255]
            } else {
                [225, 95, 75, 255]
            }
        } else if lines.contains(&y) {
            [255, 255, 255, 70]
        } else {
            [0, 0, 0, 90]
        };
        texel.copy_from_slice(&color);
    }
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    let times = frames.times();
    let [p50, p99] = [50, 99].map(|percent| ms(times.percentile(percent).unwrap_or_default()));
    let worst = frames.0.iter().map(|frame| frame.1).max().unwrap_or_default();
    words.0 = format!(
        "frame  p50 {p50:.1}  p99 {p99:.1} ms\nplugin {:.2} ms of it at most\n{} edits, {} chunks, last transaction {:.1} ms",
        ms(worst),
        figures.brushes,
        chunks.iter().count(),
        ms(figures.last_transaction),
    );
}
