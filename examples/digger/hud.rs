//! What is written on the window: crosshair, figures, help, and a word while the landscape loads.

use bevy::diagnostic::{DiagnosticsStore, FrameTimeDiagnosticsPlugin};
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::landscape::MATERIALS;
use crate::player::{Player, mouse_is_captured};
use crate::tools::Tools;

const HELP: &str = "\
click: take the mouse    Esc: let go    Q: quit
W A S D: walk    Shift: run    Space: jump
left: dig    right: build    middle or G: paint
wheel: radius    1..8: material    C: form
F: headlamp    H: this help";

/// Writes on the window.
pub struct HudPlugin;

impl Plugin for HudPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(FrameTimeDiagnosticsPlugin::default())
            .add_systems(Startup, write_all)
            .add_systems(Update, (write_figures, toggle_help, wipe_loading, tools_follow_mouse));
    }
}

#[derive(Component)]
struct Figures;

#[derive(Component)]
struct Help;

/// There until the player arrives.
#[derive(Component)]
struct LoadingWord;

#[derive(Component)]
struct Crosshair;

fn write_all(mut commands: Commands) {
    let shade = BackgroundColor(Color::srgba(0.0, 0.0, 0.0, 0.45));
    let font = |size: f32| TextFont { font_size: FontSize::Px(size), ..default() };
    let corner = Node {
        position_type: PositionType::Absolute,
        left: px(10),
        padding: UiRect::all(px(8)),
        border_radius: BorderRadius::all(px(6)),
        ..default()
    };
    let top = Node { top: px(10), ..corner.clone() };
    let bottom = Node { bottom: px(10), ..corner };
    commands.spawn((Figures, Text::new(""), font(15.0), top, shade));
    commands.spawn((Help, Text::new(HELP), font(14.0), bottom, shade));
    let centre = Node {
        width: percent(100),
        height: percent(100),
        position_type: PositionType::Absolute,
        align_items: AlignItems::Center,
        justify_content: JustifyContent::Center,
        ..default()
    };
    let dot = Node { width: px(5), height: px(5), border_radius: BorderRadius::all(px(3)), ..default() };
    let white = BackgroundColor(Color::srgba(1.0, 1.0, 1.0, 0.85));
    commands.spawn((Crosshair, centre.clone(), Visibility::Hidden, children![(dot, white)]));
    commands.spawn((LoadingWord, centre, children![(Text::new("loading the landscape ..."), font(28.0))]));
}

fn wipe_loading(
    mut commands: Commands,
    arrived: Query<(), Added<Player>>,
    words: Query<Entity, With<LoadingWord>>,
    mut crosshairs: Query<&mut Visibility, With<Crosshair>>,
) {
    if !arrived.is_empty() {
        for word in &words {
            commands.entity(word).despawn();
        }
        for mut crosshair in &mut crosshairs {
            *crosshair = Visibility::Inherited;
        }
    }
}

/// Who has not taken the mouse does not dig, and needs no preview.
fn tools_follow_mouse(
    mut tools: ResMut<Tools>,
    cursors: Query<&bevy::window::CursorOptions, With<bevy::window::PrimaryWindow>>,
) {
    tools.preview = mouse_is_captured(cursors);
}

fn write_figures(
    diagnostics: Res<DiagnosticsStore>,
    tools: Res<Tools>,
    burrow: Res<BurrowFigures>,
    fields: Query<(), With<Field>>,
    chunks: Query<(), With<Chunk>>,
    mut text: Single<&mut Text, With<Figures>>,
) {
    let fps = diagnostics.get(&FrameTimeDiagnosticsPlugin::FPS).and_then(|fps| fps.smoothed()).unwrap_or(0.0);
    let material = MATERIALS.iter().find(|(id, _)| *id == tools.material).map_or("?", |(_, name)| name);
    text.0 = format!(
        "{fps:.0} fps\n{:?}, radius {:.1}, {material}\n{} edits, {} fields, {} chunks\nlast transaction {:.1} ms",
        tools.form,
        tools.radius,
        burrow.brushes,
        fields.iter().count(),
        chunks.iter().count(),
        burrow.last_transaction.as_secs_f64() * 1e3,
    );
}

fn toggle_help(keys: Res<ButtonInput<KeyCode>>, mut help: Query<&mut Visibility, With<Help>>) {
    if keys.just_pressed(KeyCode::KeyH) {
        for mut visibility in &mut help {
            visibility.toggle_inherited_hidden();
        }
    }
}
