//! Strokes: aiming, the preview of the brush, and mouse and key bindings.

#[path = "../shared/gizmos.rs"]
mod gizmos;

use std::time::Duration;

use bevy::camera_controller::free_camera::{FreeCamera, FreeCameraState};
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy::window::{PrimaryWindow, WindowCloseRequested};
use bevy_burrow::brush::Blend;
use bevy_burrow::debug::draw_shape;
use bevy_burrow::panel::{
    BrushTool, BurrowPanel, PanelAction, PanelInput, ToolAlign, ToolOperation, ToolShape, keyboard_is_free,
    pointer_is_free,
};
use bevy_burrow::prelude::*;

use crate::stamps;

/// The reach of the brush in metres.
const REACH: f32 = 400.0;

/// Parts of a ring, and lines along a side of the preview of a stamp.
const RING: u32 = 48;
const STAMP_LINES: i32 = 16;

/// Where the pointer hits the ground, if it does.
#[derive(Resource, Default)]
pub struct Aim(pub Option<TerrainHit>);

/// What the modifier keys make of a stroke.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Modifier {
    #[default]
    None,
    /// Shift: the opposite operation.
    Invert,
    /// Control.
    Smooth,
    /// Alt: a click takes the material of the ground, and changes nothing.
    Pick,
    /// L: a click draws a straight line from where the last stroke ended.
    Line,
}

/// The strokes that were made.
#[derive(Resource, Default)]
struct Strokes {
    /// Brushes that were sent.
    count: u64,
    /// The stroke that is drawn: one press of the button, and one step of undo.
    number: u64,
    rest: Timer,
    /// Where the last brush was.
    last: Option<Vec3>,
}

/// The brush's preview.
pub struct StrokePlugin;

impl Plugin for StrokePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Aim>()
            .init_resource::<Modifier>()
            .add_systems(Startup, gizmos::show_through_ground)
            .add_systems(Update, preview);
    }
}

/// Strokes by mouse and keys.
pub struct MousePlugin;

impl Plugin for MousePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Strokes>()
            .add_systems(Startup, name_keys)
            .add_systems(PreUpdate, hold_camera.after(bevy::input::InputSystems))
            .add_systems(
                Update,
                (
                    (aim, read_modifier, stroke.run_if(pointer_is_free))
                        .chain()
                        .before(BurrowSystems::Collect)
                        .before(preview),
                    turn_wheel.run_if(pointer_is_free),
                    keys.run_if(keyboard_is_free),
                    path_keys.run_if(keyboard_is_free).before(BurrowSystems::Collect),
                    command,
                    copy.after(aim),
                    ask_to_close,
                ),
            );
    }
}

/// The keys of the operations, in the panel's order.
const OPERATION_KEYS: [(KeyCode, &str); 14] = [
    (KeyCode::Digit1, "1"),
    (KeyCode::Digit2, "2"),
    (KeyCode::Digit3, "3"),
    (KeyCode::Digit4, "4"),
    (KeyCode::Digit5, "5"),
    (KeyCode::Digit6, "6"),
    (KeyCode::Digit7, "7"),
    (KeyCode::Digit8, "8"),
    (KeyCode::Digit9, "9"),
    (KeyCode::Digit0, "0"),
    (KeyCode::Minus, "-"),
    (KeyCode::Equal, "="),
    (KeyCode::KeyP, "P"),
    (KeyCode::KeyR, "R"),
];

/// Keys of the panel's buttons.
const BUTTON_KEYS: [(&str, &str); 7] = [
    ("New", "Ctrl+N"),
    ("Open", "Ctrl+O"),
    ("Save", "Ctrl+S"),
    ("Save as", "Ctrl+Shift+S"),
    ("Undo", "Ctrl+Z"),
    ("Redo", "Ctrl+Y"),
    ("Save picture", "F12"),
];

/// Tells the panel the keys that it shows.
fn name_keys(mut panel: ResMut<BurrowPanel>) {
    let operations =
        ToolOperation::all().zip(OPERATION_KEYS).map(|(operation, (_, key))| (operation.name(), key));
    panel.keys = operations.chain(BUTTON_KEYS).map(|(name, key)| (name.into(), key.into())).collect();
}

fn aim(
    window: Single<&Window, With<PrimaryWindow>>,
    camera: Single<(&Camera, &GlobalTransform), With<Camera3d>>,
    terrains: Terrains,
    input: Option<Res<PanelInput>>,
    mut aim: ResMut<Aim>,
    mut panel: ResMut<BurrowPanel>,
) {
    let (camera, place) = *camera;
    let cursor = window.cursor_position().filter(|_| pointer_is_free(input));
    let ray = cursor.and_then(|cursor| camera.viewport_to_world(place, cursor).ok());
    aim.0 = ray.and_then(|ray| terrains.raycast(ray, REACH));
    let pointer = aim.0.map(|hit| hit.position).or(panel.pointer);
    if panel.pointer != pointer {
        panel.pointer = pointer;
    }
}

fn read_modifier(keys: Res<ButtonInput<KeyCode>>, mut modifier: ResMut<Modifier>) {
    use KeyCode as K;
    *modifier = if keys.any_pressed([K::AltLeft, K::AltRight]) {
        Modifier::Pick
    } else if keys.pressed(K::KeyL) {
        Modifier::Line
    } else if keys.any_pressed([K::ControlLeft, K::ControlRight]) {
        Modifier::Smooth
    } else if keys.any_pressed([K::ShiftLeft, K::ShiftRight]) {
        Modifier::Invert
    } else {
        Modifier::None
    };
}

/// The opposite of an operation, or itself where there is none.
fn inverse(operation: ToolOperation) -> ToolOperation {
    use ToolOperation as O;
    match operation {
        O::Dig => O::Add,
        O::Add => O::Dig,
        O::Raise => O::Lower,
        O::Lower => O::Raise,
        O::Smooth => O::Sharpen,
        O::Sharpen => O::Smooth,
        other => other,
    }
}

/// The tool that a modifier makes of another.
fn modified(tool: &BrushTool, modifier: Modifier) -> BrushTool {
    let operation = match modifier {
        Modifier::Invert => inverse(tool.operation),
        Modifier::Smooth => ToolOperation::Smooth,
        Modifier::None | Modifier::Pick | Modifier::Line => tool.operation,
    };
    BrushTool { operation, ..tool.clone() }
}

/// Applies a brush at the first press, then at the tool's rate. All brushes until the button is released are one
/// stroke.
fn stroke(
    time: Res<Time>,
    mouse: Res<ButtonInput<MouseButton>>,
    modifier: Res<Modifier>,
    terrains: Terrains,
    aim: Res<Aim>,
    mut tool: ResMut<BrushTool>,
    mut strokes: ResMut<Strokes>,
    mut brushes: MessageWriter<Brush>,
) {
    strokes.rest.tick(time.delta());
    let is_first = mouse.just_pressed(MouseButton::Left);
    if !(is_first || mouse.pressed(MouseButton::Left) && strokes.rest.is_finished()) {
        return;
    }
    let Some(hit) = &aim.0 else { return };
    if *modifier == Modifier::Pick {
        tool.material = hit.material.0;
        return;
    }
    if *modifier == Modifier::Line && !is_first {
        return;
    }
    if tool.fitting_shape() == ToolShape::Path && *modifier == Modifier::None {
        if is_first {
            tool.add_point(hit);
        }
        return;
    }
    if is_first {
        strokes.number += 1;
    }
    let tool = modified(&tool, *modifier);
    let from = strokes.last.filter(|_| *modifier == Modifier::Line);
    for place in line(from, hit.position, 0.5 * tool.width()) {
        let above = Ray3d::new(place + Vec3::Y * REACH, Dir3::NEG_Y);
        let on_line = if place == hit.position { Some(*hit) } else { terrains.raycast(above, 2.0 * REACH) };
        let Some(hit) = on_line else { continue };
        strokes.count += 1;
        brushes.write(tool.brush_at(&hit).with_tag(strokes.count).with_stroke(strokes.number));
    }
    strokes.last = Some(hit.position);
    strokes.rest = Timer::new(Duration::from_secs_f32(1.0 / tool.rate.max(0.1)), TimerMode::Once);
}

/// Enter makes an edit of the path's points, Backspace takes the last one back.
fn path_keys(
    keys: Res<ButtonInput<KeyCode>>,
    mut tool: ResMut<BrushTool>,
    mut strokes: ResMut<Strokes>,
    mut brushes: MessageWriter<Brush>,
) {
    if tool.points.is_empty() || tool.fitting_shape() != ToolShape::Path {
        return;
    }
    if keys.just_pressed(KeyCode::Backspace) {
        tool.points.pop();
    }
    if keys.any_just_pressed([KeyCode::Enter, KeyCode::NumpadEnter])
        && let Some(brush) = tool.finish_path()
    {
        strokes.count += 1;
        strokes.number += 1;
        brushes.write(brush.with_tag(strokes.count).with_stroke(strokes.number));
    }
}

/// Positions along a straight line, at most `apart` from each other, up to its end. Without a start, only the end.
fn line(from: Option<Vec3>, to: Vec3, apart: f32) -> impl Iterator<Item = Vec3> {
    let steps = from.map_or(0, |from| (from.distance(to) / apart.max(0.25)).ceil().min(400.0) as u32);
    let start = from.unwrap_or(to);
    (1..steps).map(move |step| start.lerp(to, step as f32 / steps as f32)).chain([to])
}

/// The wheel changes the size of the brush, or, while the right button is held, how fast the camera flies.
fn turn_wheel(
    wheel: Res<AccumulatedMouseScroll>,
    mouse: Res<ButtonInput<MouseButton>>,
    mut tool: ResMut<BrushTool>,
    terrain: Option<Single<&Terrain>>,
    mut cameras: Query<&mut FreeCamera>,
) {
    let lines = match wheel.unit {
        MouseScrollUnit::Line => wheel.delta.y,
        MouseScrollUnit::Pixel => wheel.delta.y / MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
    };
    if lines == 0.0 {
        return;
    }
    if mouse.pressed(MouseButton::Right) {
        for mut camera in &mut cameras {
            let factor = 1.2f32.powf(lines);
            camera.walk_speed = (camera.walk_speed * factor).clamp(2.0, 200.0);
            camera.run_speed = (camera.run_speed * factor).clamp(6.0, 600.0);
        }
    } else if let Some(terrain) = terrain {
        tool.grow(1.1f32.powf(lines), terrain.voxel_size());
    }
}

fn keys(
    keys: Res<ButtonInput<KeyCode>>,
    aim: Res<Aim>,
    terrain: Option<Single<&Terrain>>,
    mut camera: Single<&mut Transform, With<FreeCamera>>,
    mut tool: ResMut<BrushTool>,
    mut panel: ResMut<BurrowPanel>,
    mut actions: MessageWriter<PanelAction>,
) {
    for (key, factor) in [(KeyCode::BracketRight, 1.25), (KeyCode::BracketLeft, 0.8)] {
        if let (true, Some(terrain)) = (keys.just_pressed(key), &terrain) {
            tool.grow(factor, terrain.voxel_size());
        }
    }
    for (operation, (key, _)) in ToolOperation::all().zip(OPERATION_KEYS) {
        if keys.just_pressed(key) {
            tool.operation = operation;
        }
    }
    if keys.just_pressed(KeyCode::Tab) {
        let all: Vec<ToolOperation> = ToolOperation::all().collect();
        let next = all.iter().position(|&operation| operation == tool.operation).map_or(0, |at| at + 1);
        tool.operation = all.get(next).copied().unwrap_or_default();
    }
    if let (true, Some(hit)) = (keys.just_pressed(KeyCode::KeyH), &aim.0) {
        tool.level = hit.position.y;
    }
    if let (true, Some(hit)) = (keys.just_pressed(KeyCode::KeyF), &aim.0) {
        camera.translation = hit.position - camera.forward() * (15.0 + 3.0 * tool.width());
    }
    if keys.just_pressed(KeyCode::F1) {
        panel.is_open = !panel.is_open;
    }
    if keys.just_pressed(KeyCode::F12) {
        actions.write(PanelAction::SavePicture);
    }
    if keys.just_pressed(KeyCode::Escape) {
        actions.write(PanelAction::Quit);
    }
}

/// The window's close button asks as Escape does.
fn ask_to_close(mut requests: MessageReader<WindowCloseRequested>, mut actions: MessageWriter<PanelAction>) {
    if requests.read().next().is_some() {
        actions.write(PanelAction::Quit);
    }
}

/// Undo, redo and files. Reads keyboard messages, because `ButtonInput<Key>` never releases a `Z` that comes up as `z`
/// after Shift was released.
fn command(
    mut presses: MessageReader<KeyboardInput>,
    keys: Res<ButtonInput<KeyCode>>,
    panel: Option<Res<PanelInput>>,
    mut actions: MessageWriter<PanelAction>,
) {
    let is_shift = keys.any_pressed([KeyCode::ShiftLeft, KeyCode::ShiftRight]);
    let is_due = keyboard_is_free(panel) && keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
    for press in presses.read().filter(|press| is_due && press.state.is_pressed() && !press.repeat) {
        let action = match letter(press) {
            Some('z') if !is_shift => PanelAction::Undo,
            Some('z' | 'y') => PanelAction::Redo,
            Some('s') if is_shift => PanelAction::SaveLevelAs,
            Some('s') => PanelAction::SaveLevel,
            Some('o') => PanelAction::LoadLevel,
            Some('n') => PanelAction::NewLevel,
            _ => continue,
        };
        actions.write(action);
    }
}

/// `Ctrl+C` copies what lies in the brush; with Shift, into a file too.
fn copy(
    mut presses: MessageReader<KeyboardInput>,
    keys: Res<ButtonInput<KeyCode>>,
    input: Option<Res<PanelInput>>,
    aim: Res<Aim>,
    terrains: Query<(&Terrain, &GlobalTransform)>,
    mut tool: ResMut<BrushTool>,
    mut panel: ResMut<BurrowPanel>,
) {
    let is_due = keyboard_is_free(input) && keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
    let is_pressed =
        |press: &KeyboardInput| press.state.is_pressed() && !press.repeat && letter(press) == Some('c');
    if !presses.read().any(is_pressed) || !is_due {
        return;
    }
    let Some(hit) = aim.0 else { return };
    let Ok((terrain, place)) = terrains.get(hit.terrain) else { return };
    let copied = tool.copy(terrain, place, &hit).map_err(|why| why.to_string());
    let is_kept = keys.any_pressed([KeyCode::ShiftLeft, KeyCode::ShiftRight]);
    panel
        .report(copied.and_then(|()| if is_kept { stamps::keep(&tool.prefab) } else { Ok("Copied".into()) }));
}

/// The letter on a key, by the keyboard layout: QWERTZ and AZERTY have Z elsewhere than QWERTY. For layouts without
/// Latin letters, the key's position on QWERTY counts.
fn letter(press: &KeyboardInput) -> Option<char> {
    match (&press.logical_key, press.key_code) {
        (Key::Character(text), _) if text.bytes().all(|byte| byte.is_ascii_graphic()) => {
            text.chars().next().map(|letter| letter.to_ascii_lowercase())
        }
        (_, KeyCode::KeyZ) => Some('z'),
        (_, KeyCode::KeyY) => Some('y'),
        (_, KeyCode::KeyS) => Some('s'),
        (_, KeyCode::KeyO) => Some('o'),
        (_, KeyCode::KeyN) => Some('n'),
        (_, KeyCode::KeyC) => Some('c'),
        _ => None,
    }
}

/// The camera stands still while the panel uses pointer or keyboard, and while Control turns its keys into commands.
fn hold_camera(
    input: Res<PanelInput>,
    keys: Res<ButtonInput<KeyCode>>,
    mouse: Res<ButtonInput<MouseButton>>,
    mut cameras: Query<&mut FreeCameraState>,
) {
    for mut camera in &mut cameras {
        // A look around that began outside the panel continues over it.
        let goes_on =
            camera.enabled && mouse.pressed(MouseButton::Right) && !mouse.just_pressed(MouseButton::Right);
        let is_command = keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
        camera.enabled = goes_on || !input.has_pointer && !input.has_keyboard && !is_command;
    }
}

/// Shows the shape, and on the ground its outline and where the falloff ends; of a stamp, its image.
fn preview(
    aim: Res<Aim>,
    tool: Res<BrushTool>,
    modifier: Res<Modifier>,
    terrains: Terrains,
    mut gizmos: Gizmos,
) {
    let Some(hit) = &aim.0 else { return };
    let tool = modified(&tool, *modifier);
    let color = match *modifier {
        Modifier::Invert => Color::srgb(1.0, 0.45, 0.35),
        Modifier::Smooth => Color::srgb(0.45, 0.75, 1.0),
        _ => Color::srgb(1.0, 0.80, 0.30),
    };
    draw_shape(&mut gizmos, &tool.shape_at(hit), color.with_alpha(0.5));
    if tool.fitting_shape() == ToolShape::Path {
        gizmos.linestrip(tool.points.iter().copied().chain([hit.position]), color);
        for point in &tool.points {
            draw_shape(&mut gizmos, &Shape::sphere(*point, tool.radius), color.with_alpha(0.3));
        }
    }
    let axis = if tool.align == ToolAlign::Surface { hit.normal } else { Vec3::Y };
    let turn = Quat::from_rotation_arc(Vec3::Y, axis.normalize_or(Vec3::Y));
    let width = tool.width();
    let ring = |radius: f32| {
        (0..=RING).map(move |step| {
            let (sin, cos) = (step as f32 / RING as f32 * std::f32::consts::TAU).sin_cos();
            (turn * Vec3::new(cos * radius, 0.0, sin * radius)) + hit.position
        })
    };
    // Rings lie on the ground, wherever it is within the brush.
    let mut draw_ring = |radius: f32, color: Color| {
        let on_ground = ring(radius).map(|place| {
            let ray = Ray3d::new(place + axis * (width + 2.0), Dir3::new(-axis).unwrap_or(Dir3::NEG_Y));
            terrains.raycast(ray, 2.0 * width + 4.0).map_or(place, |ground| ground.position) + axis * 0.1
        });
        gizmos.linestrip(on_ground, color);
    };
    draw_ring(width, color);
    if tool.falloff > 0.0 && tool.brush_at(hit).blend != Blend::default() {
        draw_ring((width - tool.falloff).max(0.1 * width), color.with_alpha(0.45));
    }
    let cells = 0..=STAMP_LINES;
    let at = |cell: i32| 2.0 * cell as f32 / STAMP_LINES as f32 - 1.0;
    for row in cells.clone() {
        let place = |u: f32, v: f32| {
            let height = tool.stamp_height(u, v)?;
            Some(hit.position + turn * Vec3::new(u * width, height, v * width))
        };
        gizmos.linestrip(cells.clone().filter_map(|cell| place(at(cell), at(row))), color);
        gizmos.linestrip(cells.clone().filter_map(|cell| place(at(row), at(cell))), color);
    }
    gizmos.line(hit.position, hit.position + hit.normal * f32::max(0.5 * width, 1.0), Color::WHITE);
}

#[cfg(test)]
mod tests {
    use bevy::input::ButtonState;

    use super::*;

    #[test]
    fn modifiers_turn_an_operation_into_another() {
        for operation in ToolOperation::all() {
            let tool = BrushTool { operation, ..BrushTool::default() };
            assert_eq!(inverse(inverse(operation)), operation);
            assert_eq!(modified(&tool, Modifier::Smooth).operation, ToolOperation::Smooth);
            assert_eq!(modified(&tool, Modifier::None), tool);
        }
        let raise = BrushTool { operation: ToolOperation::Raise, ..BrushTool::default() };
        assert_eq!(modified(&raise, Modifier::Invert).operation, ToolOperation::Lower);
    }

    #[test]
    fn a_line_has_no_gaps_and_ends_where_one_clicks() {
        let (from, to) = (Vec3::ZERO, Vec3::new(10.0, 0.0, 0.0));
        let places: Vec<Vec3> = line(Some(from), to, 2.0).collect();
        assert_eq!(places.last(), Some(&to));
        let all = [&[from][..], &places].concat();
        assert!(all.windows(2).all(|pair| pair[0].distance(pair[1]) <= 2.001), "{places:?}");
        assert_eq!(line(None, to, 2.0).collect::<Vec<_>>(), [to]);
    }

    /// Sends mouse input to the strokes, and returns the stroke of each brush.
    #[test]
    fn a_held_button_is_one_stroke() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, BurrowPlugins))
            .init_resource::<ButtonInput<MouseButton>>()
            .init_resource::<Modifier>()
            .init_resource::<BrushTool>()
            .init_resource::<Strokes>()
            .insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(Duration::from_millis(200)))
            .add_systems(Update, stroke.before(BurrowSystems::Collect))
            .add_systems(Last, |mut brushes: MessageReader<Brush>, mut sent: ResMut<Sent>| {
                sent.0.extend(brushes.read().map(|brush| brush.stroke));
            })
            .init_resource::<Sent>();
        app.insert_resource(Aim(Some(TerrainHit {
            terrain: Entity::PLACEHOLDER,
            distance: 9.0,
            position: Vec3::ZERO,
            normal: Vec3::Y,
            material: MaterialId(4),
            from_inside: false,
        })));
        app.finish();
        let press = |app: &mut App, frames: usize| {
            app.world_mut().resource_mut::<ButtonInput<MouseButton>>().press(MouseButton::Left);
            for _ in 0..frames {
                app.update();
                app.world_mut().resource_mut::<ButtonInput<MouseButton>>().clear();
            }
            app.world_mut().resource_mut::<ButtonInput<MouseButton>>().release(MouseButton::Left);
            app.update();
            std::mem::take(&mut app.world_mut().resource_mut::<Sent>().0)
        };
        let first = press(&mut app, 5);
        assert!(first.len() > 3 && first.iter().all(|stroke| *stroke == first[0]), "{first:?}");
        let second = press(&mut app, 3);
        assert_ne!(first[0], second[0]);
        // Picking a material changes no ground.
        app.insert_resource(Modifier::Pick);
        assert!(press(&mut app, 2).is_empty());
        assert_eq!(app.world().resource::<BrushTool>().material, 4);
    }

    #[derive(Resource, Default)]
    struct Sent(Vec<Option<u64>>);

    #[test]
    fn undo_and_redo_follow_the_keyboard_layout() {
        let on = |key_code, text: &str| {
            let (logical_key, state, window) =
                (Key::Character(text.into()), ButtonState::Pressed, Entity::PLACEHOLDER);
            letter(&KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window })
        };
        assert_eq!((on(KeyCode::KeyZ, "z"), on(KeyCode::KeyZ, "Z")), (Some('z'), Some('z')));
        // QWERTZ and AZERTY.
        assert_eq!((on(KeyCode::KeyY, "z"), on(KeyCode::KeyZ, "y")), (Some('z'), Some('y')));
        assert_eq!((on(KeyCode::KeyW, "z"), on(KeyCode::KeyZ, "w")), (Some('z'), Some('w')));
        // Cyrillic letters.
        assert_eq!((on(KeyCode::KeyZ, "я"), on(KeyCode::KeyY, "н")), (Some('z'), Some('y')));
    }

    #[test]
    fn ctrl_shift_z_works_again_after_shift_was_released_first() {
        let mut app = App::new();
        app.add_message::<KeyboardInput>().add_message::<PanelAction>().add_systems(Update, command);
        let mut keys = ButtonInput::<KeyCode>::default();
        keys.press(KeyCode::ControlLeft);
        keys.press(KeyCode::ShiftLeft);
        app.insert_resource(keys);
        for (text, state) in [("Z", ButtonState::Pressed), ("z", ButtonState::Released)].repeat(2) {
            let (key_code, logical_key) = (KeyCode::KeyZ, Key::Character(text.into()));
            let window = Entity::PLACEHOLDER;
            let press = KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window };
            app.world_mut().write_message(press);
        }
        app.update();
        let actions = app.world().resource::<Messages<PanelAction>>();
        assert_eq!(actions.len(), 2);
    }
}
