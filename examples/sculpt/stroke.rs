//! Strokes by the mouse: aiming, modifiers, the preview of the brush.

#[path = "../shared/gizmos.rs"]
mod gizmos;

use std::time::Duration;

use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_burrow::brush::Blend;
use bevy_burrow::panel::{
    BrushTool, BurrowPanel, PanelAction, PanelInput, ToolOperation, ToolShape, pointer_is_free,
};
use bevy_burrow::prelude::*;

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
pub struct Strokes {
    /// Brushes that were sent.
    count: u64,
    /// The stroke that is drawn: one press of the button, and one step of undo.
    number: u64,
    /// Whether that stroke continues while the button is held.
    is_held: bool,
    rest: Timer,
    /// Where the last brush was.
    last: Option<Vec3>,
}

/// The brush's preview.
pub struct PreviewPlugin;

impl Plugin for PreviewPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Aim>()
            .init_resource::<Modifier>()
            .add_systems(Startup, gizmos::show_through_ground)
            .add_systems(Update, preview);
    }
}

/// Strokes by the mouse.
pub struct StrokePlugin;

impl Plugin for StrokePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Strokes>().add_systems(
            Update,
            (aim, read_modifier, stroke).chain().before(BurrowSystems::Collect).before(preview),
        );
    }
}

impl Strokes {
    /// The next brush of a stroke.
    fn next(&mut self, brush: Brush) -> Brush {
        self.count += 1;
        brush.with_tag(self.count).with_stroke(self.number)
    }
}

/// Finds what is under the pointer.
pub fn aim(
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

/// A stroke keeps the modifier with which it began.
fn read_modifier(
    keys: Res<ButtonInput<KeyCode>>,
    mouse: Res<ButtonInput<MouseButton>>,
    mut modifier: ResMut<Modifier>,
) {
    use KeyCode as K;
    if mouse.pressed(MouseButton::Left) && !mouse.just_pressed(MouseButton::Left) {
        return;
    }
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
        O::Merge => O::Carve,
        O::Carve => O::Merge,
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
/// stroke; undo and redo end it.
fn stroke(
    time: Res<Time>,
    mouse: Res<ButtonInput<MouseButton>>,
    input: Option<Res<PanelInput>>,
    mut actions: MessageReader<PanelAction>,
    modifier: Res<Modifier>,
    terrains: Terrains,
    aim: Res<Aim>,
    mut tool: ResMut<BrushTool>,
    mut strokes: ResMut<Strokes>,
    mut brushes: MessageWriter<Brush>,
) {
    strokes.rest.tick(time.delta());
    let is_free = pointer_is_free(input);
    let is_first = is_free && mouse.just_pressed(MouseButton::Left);
    let steps =
        actions.read().filter(|action| matches!(action, PanelAction::Undo | PanelAction::Redo)).count();
    strokes.is_held = is_first || strokes.is_held && mouse.pressed(MouseButton::Left) && steps == 0;
    if is_first {
        strokes.number += 1;
    }
    if !(strokes.is_held && is_free && (is_first || strokes.rest.is_finished())) {
        return;
    }
    let Some(hit) = &aim.0 else { return };
    if *modifier == Modifier::Pick {
        tool.material = hit.material.0;
        return;
    }
    if tool.placed.is_some() || *modifier == Modifier::Line && !is_first {
        return;
    }
    if tool.fitting_shape() == ToolShape::Path {
        if is_first {
            tool.add_point(hit);
        }
        return;
    }
    let tool = modified(&tool, *modifier);
    let from = strokes.last.filter(|_| *modifier == Modifier::Line);
    for place in line(from, hit.position, 0.5 * tool.width()) {
        let above = Ray3d::new(place + Vec3::Y * REACH, Dir3::NEG_Y);
        let on_line = if place == hit.position { Some(*hit) } else { terrains.raycast(above, 2.0 * REACH) };
        let Some(hit) = on_line else { continue };
        brushes.write(strokes.next(tool.brush_at(&hit)));
    }
    strokes.last = Some(hit.position);
    strokes.rest = Timer::new(Duration::from_secs_f32(1.0 / tool.rate.max(0.1)), TimerMode::Once);
}

/// Positions along a straight line, at most `apart` from each other, up to its end. Without a start, only the end.
fn line(from: Option<Vec3>, to: Vec3, apart: f32) -> impl Iterator<Item = Vec3> {
    let steps = from.map_or(0, |from| (from.distance(to) / apart.max(0.25)).ceil().min(400.0) as u32);
    let start = from.unwrap_or(to);
    (1..steps).map(move |step| start.lerp(to, step as f32 / steps as f32)).chain([to])
}

/// Shows the shape, and on the ground its outline and where the falloff ends; of a stamp, its image. The panel shows the
/// shape of a placed brush.
fn preview(
    aim: Res<Aim>,
    tool: Res<BrushTool>,
    modifier: Res<Modifier>,
    terrains: Terrains,
    mut gizmos: Gizmos,
) {
    let Some(hit) = tool.placed.or(aim.0) else { return };
    let hit = &hit;
    let modifier = if tool.placed.is_some() { Modifier::None } else { *modifier };
    let (shown, tool) = (&tool, modified(&tool, modifier));
    let color = match modifier {
        Modifier::Invert if tool.operation != shown.operation => Color::srgb(1.0, 0.45, 0.35),
        Modifier::Smooth => Color::srgb(0.45, 0.75, 1.0),
        _ => Color::srgb(1.0, 0.80, 0.30),
    };
    if tool.placed.is_none() {
        tool.shape_at(hit).draw(&mut gizmos, color.with_alpha(0.5));
    }
    if tool.fitting_shape() == ToolShape::Path {
        let ends = tool.points.iter().chain([&hit.position]).map(|&point| (point, tool.radius));
        let points: Vec<(Vec3, f32)> = ends.collect();
        let draw = |tube: Shape| tube.draw(&mut gizmos, color.with_alpha(0.5));
        if tool.is_smooth {
            Shape::along_spline(&points).for_each(draw);
        } else {
            Shape::along_polyline(&points).for_each(draw);
        }
    }
    let turn = tool.rotation(hit);
    let axis = turn * Vec3::Y;
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

    #[test]
    fn a_held_button_is_one_stroke() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, BurrowPlugins))
            .init_resource::<ButtonInput<MouseButton>>()
            .init_resource::<Modifier>()
            .init_resource::<BrushTool>()
            .init_resource::<Strokes>()
            .add_message::<PanelAction>()
            .init_resource::<PanelInput>()
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
        // A press in the sky begins a stroke too, and one over the panel none.
        let aim = app.world_mut().resource_mut::<Aim>().0.take();
        let input = |has_pointer: bool| PanelInput { has_pointer, has_keyboard: false };
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().press(MouseButton::Left);
        app.update();
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().clear();
        app.insert_resource(Aim(aim));
        app.update();
        let third = std::mem::take(&mut app.world_mut().resource_mut::<Sent>().0);
        assert!(third.len() == 1 && third[0] != second[0], "{third:?}");
        // Undo ends it.
        app.world_mut().write_message(PanelAction::Undo);
        (0..3).for_each(|_| app.update());
        assert!(app.world().resource::<Sent>().0.is_empty());
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().release(MouseButton::Left);
        app.update();
        app.insert_resource(input(true));
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().press(MouseButton::Left);
        app.update();
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().clear();
        app.insert_resource(input(false));
        (0..3).for_each(|_| app.update());
        assert!(app.world().resource::<Sent>().0.is_empty());
        app.world_mut().resource_mut::<ButtonInput<MouseButton>>().release(MouseButton::Left);
        app.update();
        // A brush that was placed stays where it is.
        let aim = app.world().resource::<Aim>().0;
        app.world_mut().resource_mut::<BrushTool>().placed = aim;
        assert!(press(&mut app, 5).is_empty());
        app.world_mut().resource_mut::<BrushTool>().placed = None;
        // Picking a material changes no ground.
        app.insert_resource(Modifier::Pick);
        assert!(press(&mut app, 2).is_empty());
        assert_eq!(app.world().resource::<BrushTool>().material, 4);
    }

    #[derive(Resource, Default)]
    struct Sent(Vec<Option<u64>>);
}
