//! The handles of a placed brush: drawn over the view, and dragged with the left mouse button.

use bevy::prelude::*;
use bevy_egui::egui::{
    Align2, Color32, Context, CursorIcon, FontId, LayerId, Pos2, Rect, Stroke, Vec2 as Size,
};
use bevy_egui::{EguiContext, PrimaryEguiContext};

use super::handle_geometry::{Axis, Frame, Handle, View};
use super::input::PanelInput;
use super::open_level::Files;
use super::state::{BurrowPanel, PanelAction};
use super::theme::{ACCENT, BAD, BLUE, BRIGHT, GOOD};
use super::{BrushTool, texts, widgets};
use crate::brush::Brush;
use crate::plugin::{TerrainHit, Terrains};

/// Metres from the camera within which a brush can be placed.
const REACH: f32 = 1000.0;

/// The handle at the pointer, and the one that is dragged.
#[derive(Resource, Default)]
pub(super) struct Handles {
    hovered: Option<Handle>,
    drag: Option<Drag>,
}

impl Handles {
    fn used(&self) -> Option<Handle> {
        self.drag.as_ref().map(|drag| drag.handle).or(self.hovered)
    }
}

/// A handle that is dragged.
struct Drag {
    handle: Handle,
    /// Its value and the tool when the drag began.
    from: f32,
    tool: BrushTool,
}

impl Drag {
    fn begin(handle: Handle, tool: &BrushTool, view: View, pointer: Vec2) -> Option<Self> {
        let hit = tool.placed.filter(|hit| tool.handles(hit).any(|own| own == handle))?;
        let frame = Frame::new(view, hit.position, tool.rotation(&hit))?;
        let from = frame.value(handle, pointer).filter(|from| frame.can_begin(handle, *from))?;
        Some(Self { handle, from, tool: tool.clone() })
    }

    /// The tool with the pointer here. `None` where nothing is to be dragged to.
    fn to(&self, view: View, pointer: Vec2, terrains: &Terrains) -> Option<BrushTool> {
        let hit = self.tool.placed?;
        let voxel = terrains.voxel_metres(hit.terrain).unwrap_or(1.0);
        if self.handle == Handle::Ground {
            let TerrainHit { terrain, position, .. } = terrains.raycast(view.ray(pointer)?, REACH)?;
            return Some(BrushTool {
                placed: Some(TerrainHit { terrain, position, ..hit }),
                ..self.tool.clone()
            });
        }
        let frame = Frame::new(view, hit.position, self.tool.rotation(&hit))?;
        let to = frame.value(self.handle, pointer)?;
        Some(self.tool.dragged(self.handle, self.from, to, voxel))
    }
}

/// The camera that draws the panel.
type Eye =
    (&'static mut EguiContext, &'static Camera, &'static Transform, &'static GlobalTransform, Has<ChildOf>);

/// What the panel's camera sees, and its egui context.
fn look<'a>(cameras: &'a mut Query<Eye, With<PrimaryEguiContext>>) -> Option<(Context, View<'a>)> {
    let (mut context, camera, transform, place, is_child) = cameras.single_mut().ok()?;
    let context = context.get_mut().clone();
    // A camera that moved in this frame is already drawn there, and its global transform may be older.
    let place = if is_child { *place } else { GlobalTransform::from(*transform) };
    let scale = context.viewport_rect().width() / camera.logical_viewport_rect()?.width();
    Some((context, View { camera, place, scale }))
}

/// Keeps the pointer from the game while it is at a handle. Runs after the panel's input was read.
pub(super) fn hold_pointer(
    cameras: Query<(), With<PrimaryEguiContext>>,
    mut handles: ResMut<Handles>,
    mut input: ResMut<PanelInput>,
) {
    if cameras.is_empty() {
        // Without a camera, nothing is shown that could be let go.
        *handles = Handles::default();
    }
    if handles.used().is_some() {
        input.has_pointer = true;
    }
}

/// Performs the buttons for a placed brush and for paths.
pub(super) fn act(
    mut actions: MessageReader<PanelAction>,
    mut cameras: Query<Eye, With<PrimaryEguiContext>>,
    terrains: Terrains,
    input: Res<PanelInput>,
    handles: Res<Handles>,
    files: Res<Files>,
    mut tool: ResMut<BrushTool>,
    mut panel: ResMut<BurrowPanel>,
    mut brushes: MessageWriter<Brush>,
) {
    // A question has to be answered first.
    if files.is_asking() {
        actions.clear();
    }
    for action in actions.read() {
        match (action, tool.placed) {
            (PanelAction::PlaceBrush, _) if tool.can_be_placed() => {
                let is_free = !input.has_pointer || handles.used().is_some();
                let hit = look(&mut cameras).and_then(|(context, view)| {
                    let pointer = context.input(|input| input.pointer.latest_pos()).filter(|_| is_free);
                    let Pos2 { x, y } = pointer.unwrap_or_else(|| context.viewport_rect().center());
                    terrains.raycast(view.ray(Vec2::new(x, y))?, REACH)
                });
                match hit {
                    Some(hit) => tool.placed = Some(hit),
                    None => panel.report(Err(texts::NO_GROUND.into())),
                }
            }
            (PanelAction::ApplyBrush, Some(hit)) if tool.can_be_placed() => {
                brushes.write(tool.brush_at(&hit));
            }
            (PanelAction::ApplyBrush, None) if tool.has_path() => {
                brushes.write_batch(tool.finish_path());
            }
            (PanelAction::SnapBrush, Some(mut hit)) => {
                let floors = terrains.spans_on(hit.terrain, hit.position.x, hit.position.z).into_iter();
                let floors = floors.map(|span| span.floor as f32);
                let away = |floor: f32| (floor - hit.position.y).abs();
                match floors.min_by(|a, b| away(*a).total_cmp(&away(*b))) {
                    Some(floor) => {
                        hit.position.y = floor;
                        tool.placed = Some(hit);
                    }
                    None => panel.report(Err(texts::NO_GROUND.into())),
                }
            }
            (PanelAction::ReleaseBrush, Some(_)) => tool.placed = None,
            (PanelAction::ReleaseBrush, None) if tool.has_path() => tool.points.clear(),
            _ => {}
        }
    }
}

/// Drags the handles, and draws them and the outline of the brush.
pub(super) fn show(
    mut cameras: Query<Eye, With<PrimaryEguiContext>>,
    terrains: Terrains,
    mut tool: ResMut<BrushTool>,
    mut handles: ResMut<Handles>,
) {
    if tool.placed.is_some() && !tool.can_be_placed() {
        tool.placed = None;
    }
    let (Some((context, view)), Some(hit)) = (look(&mut cameras), tool.placed) else {
        *handles = Handles::default();
        return;
    };
    let frame = Frame::new(view, hit.position, tool.rotation(&hit));
    let (pointer, is_pressed, is_down) = context.input(|input| {
        let pointer = &input.pointer;
        (pointer.latest_pos(), pointer.primary_pressed(), pointer.primary_down())
    });
    let pointer = pointer.map_or(Vec2::NAN, |Pos2 { x, y }| Vec2::new(x, y));
    if !is_down {
        handles.drag = None;
    }
    if let Some(drag) = &handles.drag {
        // Something else has changed the tool: continue from the changed tool.
        if tool.is_changed() {
            handles.drag = Drag::begin(drag.handle, &tool, view, pointer);
        }
    } else {
        let is_free = !context.is_pointer_over_egui() && !context.egui_is_using_pointer();
        let frame = frame.as_ref().filter(|_| is_free);
        handles.hovered = frame.and_then(|frame| frame.pick(tool.handles(&hit), pointer));
        let grabbed = handles.hovered.filter(|_| is_pressed);
        handles.drag = grabbed.and_then(|handle| Drag::begin(handle, &tool, view, pointer));
    }
    if let Some(dragged) = handles.drag.as_ref().and_then(|drag| drag.to(view, pointer, &terrains)) {
        tool.set_if_neq(dragged);
    }
    let frame = tool.placed.and_then(|hit| Frame::new(view, hit.position, tool.rotation(&hit)));
    if let Some(frame) = frame {
        paint(&context, view, &frame, &tool, handles.used());
    }
    if let Some(used) = handles.used() {
        let at = Pos2::new(pointer.x + 16.0, pointer.y + 16.0);
        let painter = context.layer_painter(LayerId::background());
        painter.text(at, Align2::LEFT_TOP, name(used), FontId::proportional(12.0), BRIGHT);
        context.set_cursor_icon(if handles.drag.is_some() { CursorIcon::Grabbing } else { CursorIcon::Grab });
    }
}

/// Draws below the panel, and above everything else.
fn paint(context: &Context, view: View, frame: &Frame, tool: &BrushTool, used: Option<Handle>) {
    let Some(hit) = tool.placed else { return };
    let painter = context.layer_painter(LayerId::background());
    let on_screen = |at: Vec2| Pos2::new(at.x, at.y);
    tool.shape_at(&hit).outline(|from, to| {
        if let (Some(from), Some(to)) = (view.project(from), view.project(to)) {
            painter.line_segment([from, to].map(on_screen), Stroke::new(1.0, ACCENT.gamma_multiply(0.7)));
        }
    });
    for handle in tool.handles(&hit).filter(|handle| frame.is_shown(*handle)) {
        let color = if used == Some(handle) { ACCENT } else { color(handle) };
        for ends in frame.segments(handle) {
            let [from, to] = ends.map(on_screen);
            match handle {
                Handle::Ground => {
                    painter.circle_filled(to, 6.0, color);
                }
                Handle::Scale(_) => {
                    painter.rect_filled(Rect::from_center_size(to, Size::splat(11.0)), 2.0, color);
                }
                Handle::Turn(_) => {
                    painter.line_segment([from, to], Stroke::new(2.0, color));
                }
                Handle::Move(_) => {
                    painter.line_segment([from, to], Stroke::new(2.5, color));
                    painter.arrow(from + (to - from) * 0.7, (to - from) * 0.3, Stroke::new(2.5, color));
                }
            }
        }
        if let Some(grip) = frame.grip(handle) {
            widgets::note_in(
                context,
                &name(handle),
                Rect::from_center_size(on_screen(grip), Size::splat(8.0)),
            );
        }
    }
}

fn color(handle: Handle) -> Color32 {
    match handle {
        Handle::Ground => BRIGHT,
        Handle::Move(axis) | Handle::Turn(axis) | Handle::Scale(axis) => match axis {
            Axis::X => BAD,
            Axis::Y => GOOD,
            Axis::Z => BLUE,
        },
    }
}

/// Its name among the [positions](super::PanelPlaces) of the panel's widgets.
fn name(handle: Handle) -> String {
    let of = |what: &str, axis: Axis| format!("{what} {}", texts::AXES[axis as usize]);
    match handle {
        Handle::Ground => texts::MOVE_OVER_GROUND.into(),
        Handle::Move(axis) => of(texts::MOVE, axis),
        Handle::Turn(axis) => of(texts::TURN_ABOUT, axis),
        Handle::Scale(axis) => of(texts::SCALE, axis),
    }
}
