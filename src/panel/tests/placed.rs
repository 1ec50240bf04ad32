//! Tests of a placed brush and its handles, in an app with a camera but without a window.

use std::time::Duration;

use super::*;
use crate::brush::Edit;
use crate::panel::handle_geometry::{Axis, Handle, test_camera};
use crate::plugins::BurrowPlugins;

/// An editor with flat ground, at which the middle of the view is.
struct Stage {
    app: App,
    context: egui::Context,
    terrain: Entity,
    frames: f64,
}

impl Stage {
    fn new() -> Self {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, BurrowPlugins))
            .init_resource::<BrushTool>()
            .init_resource::<BurrowPanel>()
            .init_resource::<PanelInput>()
            .init_resource::<PanelPlaces>()
            .init_resource::<Files>()
            .init_resource::<Handles>()
            .init_resource::<Survey>()
            .init_resource::<EguiUserTextures>()
            .add_message::<PanelAction>()
            .add_systems(PreUpdate, (input::read_input, handles::hold_pointer).chain())
            .add_systems(Update, (level::finish, handles::act, perform_actions, note_rejection).chain())
            .add_systems(Last, (handles::show, draw).chain());
        app.finish();
        let terrain = app.world_mut().spawn((flat(1.0), Transform::default())).id();
        let eye = Transform::from_xyz(26.0, 34.0, 66.0).looking_at(Vec3::new(32.0, 8.0, 32.0), Vec3::Y);
        let camera = test_camera(Mat4::perspective_infinite_reverse_rh(0.8, 16.0 / 9.0, 0.1));
        let camera = app.world_mut().spawn((camera, eye, PrimaryEguiContext)).id();
        let mut camera = app.world_mut().entity_mut(camera);
        let context = camera.get_mut::<EguiContext>().expect("required").get_mut().clone();
        let mut stage = Self { app, context, terrain, frames: 0.0 };
        // Its tiles appear.
        (0..20).for_each(|_| stage.frame(Vec::new()));
        stage
    }

    fn frame(&mut self, events: Vec<Event>) {
        self.frames += 1.0;
        let screen_rect = Some(Rect::from_min_size(Pos2::ZERO, Vec2::new(1280.0, 720.0)));
        let input = RawInput { screen_rect, time: Some(self.frames / 60.0), events, ..RawInput::default() };
        let app = &mut self.app;
        let _ = self.context.run_ui(input, |_| app.update());
    }

    fn until(&mut self, is_so: impl Fn(&App) -> bool) {
        for _ in 0..10_000 {
            self.frame(Vec::new());
            if is_so(&self.app) {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("it never happens");
    }

    fn act(&mut self, action: PanelAction) {
        self.app.world_mut().write_message(action);
        (0..2).for_each(|_| self.frame(Vec::new()));
    }

    fn tool(&self) -> BrushTool {
        self.app.world().resource::<BrushTool>().clone()
    }

    fn change(&mut self, change: impl FnOnce(&mut BrushTool)) {
        change(&mut self.app.world_mut().resource_mut::<BrushTool>());
        self.frame(Vec::new());
    }

    fn placed(&self) -> Vec3 {
        self.tool().placed.expect("it is placed").position
    }

    fn hash(&self) -> u64 {
        self.app.world().get::<Terrain>(self.terrain).expect("it is there").world().hash()
    }

    fn is_held(&self) -> bool {
        self.app.world().resource::<PanelInput>().has_pointer
    }

    fn place_of(&self, name: &str) -> Option<Pos2> {
        let place = self.app.world().resource::<PanelPlaces>().0.get(name)?.center();
        Some(Pos2::new(place.x, place.y))
    }

    fn middle(&self, name: &str) -> Pos2 {
        self.place_of(name).unwrap_or_else(|| panic!("{name} is not seen"))
    }

    /// Presses the button at a handle.
    fn grab(&mut self, name: &str) -> Pos2 {
        let at = self.middle(name);
        self.frame(vec![Event::PointerMoved(at)]);
        self.frame(vec![Screen::button(at, true)]);
        at
    }

    /// Drags a handle over this part of the screen.
    fn drag(&mut self, name: &str, by: Vec2) {
        let to = self.grab(name) + by;
        self.frame(vec![Event::PointerMoved(to)]);
        assert!(self.is_held(), "{name}");
        self.frame(vec![Screen::button(to, false)]);
        self.frame(vec![Event::PointerMoved(Pos2::new(640.0, 700.0))]);
        self.frame(Vec::new());
        assert!(!self.is_held(), "{name}");
    }

    fn click(&mut self, name: &str) {
        let at = self.middle(name);
        for events in
            [vec![Event::PointerMoved(at)], vec![Screen::button(at, true)], vec![Screen::button(at, false)]]
        {
            self.frame(events);
        }
        (0..2).for_each(|_| self.frame(Vec::new()));
    }

    /// Applies the placed brush, and waits for its receipt.
    fn apply(&mut self) {
        let before = self.app.world().resource::<BurrowFigures>().brushes;
        self.app.world_mut().write_message(PanelAction::ApplyBrush);
        self.until(|app| app.world().resource::<BurrowFigures>().brushes > before);
    }
}

fn placed_box(tool: &mut BrushTool) {
    (tool.operation, tool.shape, tool.half) = (ToolOperation::Add, ToolShape::Box, Vec3::splat(3.0));
    tool.material = 5;
}

#[test]
fn a_placed_brush_is_dragged_applied_and_undone() {
    let mut stage = Stage::new();
    stage.change(placed_box);
    let pristine = stage.hash();
    stage.act(PanelAction::PlaceBrush);
    let first = stage.placed();
    assert!(first.distance(Vec3::new(32.0, 8.0, 32.0)) < 0.1, "the middle of the view: {first}");
    stage.frame(vec![Event::PointerMoved(Pos2::new(640.0, 700.0))]);
    assert_eq!(stage.placed(), first, "it does not follow the pointer");

    stage.drag("Move along x", Vec2::new(60.0, 0.0));
    let moved = stage.placed() - first;
    assert!(moved.x > 1.0 && moved.y == 0.0 && moved.z == 0.0, "{moved}");
    stage.drag("Move along y", Vec2::new(0.0, -40.0));
    assert!(stage.placed().y > first.y + 1.0 && stage.placed().z == first.z, "{}", stage.placed());
    stage.drag("Turn about y", Vec2::new(30.0, 0.0));
    let turned = stage.tool();
    assert!(
        turned.turn != 0.0 && turned.turn % 5.0 == 0.0 && turned.align == ToolAlign::Upright,
        "{}",
        turned.turn
    );
    stage.drag("Turn about x", Vec2::new(20.0, 20.0));
    let tilted = stage.tool();
    assert_eq!(tilted.align, ToolAlign::Surface);
    assert!(
        tilted
            .rotation(&tilted.placed.expect("placed"))
            .angle_between(turned.rotation(&turned.placed.expect("placed")))
            > 0.05
    );
    stage.drag("Scale along y", Vec2::new(0.0, -20.0));
    let scaled = stage.tool();
    assert!(scaled.half.y > 3.0 && scaled.half.x == 3.0 && scaled.half.z == 3.0, "{}", scaled.half);
    (0..20).for_each(|_| stage.frame(Vec::new()));
    assert_eq!(stage.hash(), pristine, "nothing is built while handles are dragged");

    stage.apply();
    let world = |stage: &Stage| stage.app.world().get::<Terrain>(stage.terrain).expect("there").history();
    assert!(stage.hash() != pristine && stage.placed() == scaled.placed.expect("placed").position);
    assert_eq!(world(&stage).undos, 1);
    stage.act(PanelAction::Undo);
    let terrain = stage.terrain;
    stage.until(move |app| {
        app.world().get::<Terrain>(terrain).is_some_and(|own| own.world().hash() == pristine)
    });
    stage.act(PanelAction::ReleaseBrush);
    assert!(stage.tool().placed.is_none() && stage.place_of("Move along x").is_none());
}

#[test]
fn a_placed_brush_is_moved_to_the_ground_and_over_it() {
    let mut stage = Stage::new();
    stage.act(PanelAction::PlaceBrush);
    let first = stage.placed();
    stage.drag("Move along y", Vec2::new(0.0, -60.0));
    assert!(stage.placed().y > 10.0);
    stage.act(PanelAction::SnapBrush);
    assert_eq!(stage.placed(), Vec3 { y: 8.0, ..first });
    stage.drag("Move over the ground", Vec2::new(80.0, 50.0));
    let moved = stage.placed() - first;
    assert!(moved.x > 2.0 && moved.z > 2.0 && moved.y.abs() < 0.01, "{moved}");
    // Without ground there, it stays.
    stage.drag("Move over the ground", Vec2::new(0.0, -600.0));
    assert!((stage.placed().y - 8.0).abs() < 0.01);
}

#[test]
fn a_placed_brush_has_the_handles_of_its_shape() {
    let mut stage = Stage::new();
    stage.act(PanelAction::PlaceBrush);
    let shown = |stage: &Stage| {
        let names = ["Turn about x", "Turn about y", "Scale along x", "Scale along y", "Scale along z"];
        names.map(|name| stage.place_of(name).is_some())
    };
    for (operation, shape, expected) in [
        (ToolOperation::Dig, ToolShape::Sphere, [false, false, true, false, false]),
        (ToolOperation::Dig, ToolShape::Box, [true, true, true, true, true]),
        (ToolOperation::Dig, ToolShape::Cylinder, [true, false, true, true, false]),
        (ToolOperation::Dig, ToolShape::Torus, [true, false, true, true, false]),
        (ToolOperation::Dig, ToolShape::Model, [true, true, true, false, false]),
        (ToolOperation::Paste, ToolShape::Sphere, [true, true, false, true, false]),
        (ToolOperation::Stamp, ToolShape::Sphere, [true, true, true, false, false]),
    ] {
        stage.change(|tool| (tool.operation, tool.shape) = (operation, shape));
        assert_eq!(shown(&stage), expected, "{operation:?} {shape:?}");
    }
    // A road can't be placed.
    stage.change(|tool| tool.operation = ToolOperation::Road);
    assert!(stage.tool().placed.is_none());
    stage.act(PanelAction::PlaceBrush);
    assert!(stage.tool().placed.is_none());
}

#[test]
fn a_setting_that_is_changed_during_a_drag_stays() {
    let mut stage = Stage::new();
    stage.change(placed_box);
    stage.act(PanelAction::PlaceBrush);
    let at = stage.grab("Move along x");
    stage.frame(vec![Event::PointerMoved(at + Vec2::new(30.0, 0.0))]);
    let halfway = stage.placed();
    stage.change(|tool| (tool.operation, tool.half.z) = (ToolOperation::Dig, 7.0));
    stage.frame(vec![Event::PointerMoved(at + Vec2::new(60.0, 0.0))]);
    let tool = stage.tool();
    assert_eq!((tool.operation, tool.half.z), (ToolOperation::Dig, 7.0));
    assert!(stage.placed().x > halfway.x + 0.5);
    // The handle may be gone.
    stage.frame(vec![Screen::button(at, false)]);
    stage.grab("Turn about y");
    stage.change(|tool| tool.shape = ToolShape::Sphere);
    let before = stage.tool();
    stage.frame(vec![Event::PointerMoved(at)]);
    assert_eq!(stage.tool(), before);
}

#[test]
fn the_terrain_may_be_gone_while_a_brush_is_placed() {
    let mut stage = Stage::new();
    stage.act(PanelAction::PlaceBrush);
    let (first, at) = (stage.placed(), stage.grab("Move along x"));
    stage.app.world_mut().despawn(stage.terrain);
    stage.frame(vec![Event::PointerMoved(at + Vec2::new(50.0, 0.0))]);
    stage.frame(vec![Screen::button(at, false)]);
    let moved = stage.placed();
    assert!(moved.x > first.x);
    stage.act(PanelAction::SnapBrush);
    stage.act(PanelAction::ApplyBrush);
    let panel = |stage: &Stage| stage.app.world().resource::<BurrowPanel>().clone();
    assert!(panel(&stage).rejection.is_some());
    stage.act(PanelAction::PlaceBrush);
    assert_eq!(panel(&stage).note, Some(Note::Bad(texts::NO_GROUND.into())));
    assert_eq!(stage.placed(), moved);
    for name in ["Place", "Apply"] {
        stage.click(name);
    }
    assert_eq!(stage.placed(), moved, "without a terrain, these buttons do nothing");
    stage.click("Release");
    assert!(stage.tool().placed.is_none());
}

#[test]
fn the_pointer_is_free_when_the_camera_is_gone() {
    let mut stage = Stage::new();
    stage.act(PanelAction::PlaceBrush);
    stage.grab("Move along x");
    stage.frame(Vec::new());
    assert!(stage.is_held());
    let world = stage.app.world_mut();
    let camera =
        world.query_filtered::<Entity, With<PrimaryEguiContext>>().single(world).expect("one camera");
    world.despawn(camera);
    // Bevy's egui shows nothing without a camera, so what ran there no longer does.
    for _ in 0..2 {
        stage.app.world_mut().run_system_cached(input::read_input).expect("it runs");
        stage.app.world_mut().run_system_cached(handles::hold_pointer).expect("it runs");
    }
    assert!(!stage.is_held());
}

#[test]
fn a_question_comes_before_a_placed_brush() {
    let mut stage = Stage::new();
    stage.app.add_systems(Update, files::track_changes.before(handles::act));
    stage.app.add_systems(Update, files::answer.before(handles::act));
    stage.change(placed_box);
    stage.act(PanelAction::PlaceBrush);
    stage.apply();
    let (built, placed) = (stage.hash(), stage.placed());
    let is_asked = |stage: &Stage| stage.app.world().resource::<Files>().is_asking();
    (0..3).for_each(|_| stage.frame(Vec::new()));
    stage.act(PanelAction::Quit);
    assert!(is_asked(&stage));
    stage.change(|tool| tool.material = 7);
    stage.act(PanelAction::ApplyBrush);
    (0..5).for_each(|_| stage.frame(Vec::new()));
    assert_eq!(stage.hash(), built);
    // Neither keys nor clicks are meant for the game. Escape takes the question back, and nothing else.
    let input = *stage.app.world().resource::<PanelInput>();
    assert_eq!(input, PanelInput { has_pointer: true, has_keyboard: true });
    stage.act(PanelAction::ReleaseBrush);
    let (key, modifiers) = (egui::Key::Escape, Modifiers::NONE);
    stage.frame(vec![Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers }]);
    stage.frame(Vec::new());
    assert_eq!((is_asked(&stage), stage.placed()), (false, placed));
    stage.frame(Vec::new());
    assert!(!stage.app.world().resource::<PanelInput>().has_keyboard);
    stage.act(PanelAction::ReleaseBrush);
    assert!(stage.tool().placed.is_none());
}

#[test]
fn the_points_of_a_path_are_applied_or_dropped_by_the_same_buttons() {
    let mut stage = Stage::new();
    let points = |tool: &mut BrushTool| {
        tool.shape = ToolShape::Path;
        tool.points = vec![Vec3::new(20.0, 8.0, 20.0), Vec3::new(40.0, 8.0, 40.0)];
    };
    let pristine = stage.hash();
    stage.act(PanelAction::ApplyBrush);
    stage.change(points);
    stage.click("Release");
    assert_eq!((stage.tool().points.len(), stage.hash()), (0, pristine));
    stage.change(points);
    stage.apply();
    assert_eq!(stage.tool().points.len(), 0);
    assert_ne!(stage.hash(), pristine);
    // Points that another shape has forgotten are not applied.
    let dug = stage.hash();
    stage.change(points);
    stage.change(|tool| tool.shape = ToolShape::Box);
    stage.act(PanelAction::ApplyBrush);
    (0..5).for_each(|_| stage.frame(Vec::new()));
    assert_eq!(stage.hash(), dug);
}

#[test]
fn a_placed_brush_snaps_to_the_terrain_it_was_placed_on() {
    let mut stage = Stage::new();
    stage.act(PanelAction::PlaceBrush);
    let first = stage.placed();
    stage.app.world_mut().spawn((flat(1.0), Transform::from_xyz(0.0, 90.0, 0.0)));
    (0..20).for_each(|_| stage.frame(Vec::new()));
    stage.drag("Move along y", Vec2::new(0.0, -60.0));
    stage.act(PanelAction::SnapBrush);
    assert_eq!(stage.placed(), first, "not to the island above it");
}

#[test]
fn a_placed_brush_stays_when_another_level_is_there() {
    let mut stage = Stage::new();
    stage.change(placed_box);
    let pristine = stage.hash();
    stage.click("Place");
    let place = stage.placed();
    stage.apply();
    let built = stage.hash();
    stage.act(PanelAction::NewLevel);
    let terrain = stage.terrain;
    stage.until(move |app| {
        app.world().get::<Terrain>(terrain).is_some_and(|own| own.world().hash() == pristine)
    });
    (0..5).for_each(|_| stage.frame(Vec::new()));
    assert_eq!(stage.placed(), place);
    stage.apply();
    assert_eq!(stage.hash(), built);
}

#[test]
fn buttons_of_a_placed_brush_act_only_where_they_can() {
    let names = ["Place", "Apply", "Snap", "Release"];
    let place = PanelAction::PlaceBrush;
    let all = [place, PanelAction::ApplyBrush, PanelAction::SnapBrush, PanelAction::ReleaseBrush];
    for (terrains, is_placed, operation, expected) in [
        (0, false, ToolOperation::Dig, &all[..0]),
        (0, true, ToolOperation::Dig, &all[3..]),
        (1, false, ToolOperation::Dig, &all[..1]),
        (1, false, ToolOperation::Road, &all[..0]),
        (1, true, ToolOperation::Dig, &all[..]),
    ] {
        let mut screen = Screen::new(1280.0, 720.0, terrains);
        screen.tool.operation = operation;
        screen.tool.placed = is_placed.then(hit);
        names.iter().for_each(|name| screen.choose(name));
        assert_eq!(screen.actions, expected, "{terrains} {is_placed} {operation:?}");
    }
}

#[test]
fn turns_about_any_axes_add_up() {
    let mut rng = fastrand::Rng::with_seed(3);
    for align in [ToolAlign::Upright, ToolAlign::Surface] {
        for _ in 0..200 {
            let normal = Vec3::new(rng.f32() - 0.5, 1.0, rng.f32() - 0.5).normalize();
            let placed = Some(TerrainHit { normal, ..hit() });
            let mut tool = BrushTool { shape: ToolShape::Box, turn: 35.0, align, placed, ..default() };
            let rotation = |tool: &BrushTool| tool.rotation(&tool.placed.expect("it is placed"));
            let mut expected = rotation(&tool);
            for _ in 0..20 {
                let axis = Axis::ALL[rng.usize(0..3)];
                let angle = 5.0 * (rng.f32() * 70.0 - 35.0).round();
                tool = tool.dragged(Handle::Turn(axis), 1.0, 1.0 + angle.to_radians(), 1.0);
                expected = Quat::from_axis_angle(axis.unit(), angle.to_radians()) * expected;
                let found = rotation(&tool);
                assert!(found.dot(expected).abs() > 0.999_9, "{found} {expected} {tool:?}");
                assert!((-180.0..=180.0).contains(&tool.turn), "{}", tool.turn);
            }
        }
    }
}

#[test]
fn whatever_is_dragged_makes_a_valid_brush() {
    for (operation, shape) in
        ToolOperation::all().flat_map(|operation| ToolShape::ALL.map(|shape| (operation, shape)))
    {
        for voxel in [0.125, 1.0, 4.0] {
            let mut tool = BrushTool { operation, shape, placed: Some(hit()), ..default() };
            if !tool.can_be_placed() {
                continue;
            }
            let handles: Vec<Handle> = tool.handles(&hit()).collect();
            for (from, to) in [(1.0, 1e9), (1.0, -3.0), (0.1, 0.101), (1.0, 0.4)] {
                for handle in handles.iter().filter(|handle| !matches!(handle, Handle::Move(_))) {
                    tool = tool.dragged(*handle, from, to, voxel);
                    let Some(placed) = tool.placed else { panic!("it stays placed") };
                    let brush = tool.brush_at(&placed);
                    let brush = brush.transformed(Quat::IDENTITY, Vec3::ZERO, voxel.recip());
                    let edit = Edit::quantize(&brush);
                    assert!(edit.is_ok(), "{handle:?} {from} {to} with voxels of {voxel}: {edit:?} {tool:?}");
                }
            }
        }
    }
}

#[test]
fn a_copy_that_is_turned_by_quarters_and_scaled_back_is_exact() {
    let mut tool = BrushTool { operation: ToolOperation::Paste, placed: Some(hit()), ..default() };
    let own = tool.brush_at(&hit());
    for _ in 0..18 {
        for (from, to) in [(1.0, 1.09), (1.0, 1.08)] {
            tool = tool.dragged(Handle::Turn(Axis::Y), from, to, 1.0);
        }
    }
    assert_eq!(tool.turn, 180.0 - 360.0, "36 times 5 degrees");
    tool = tool.dragged(Handle::Scale(Axis::Y), 1.0, 2.4, 1.0);
    assert_eq!(tool.prefab.voxel_size, 2.375);
    tool = tool.dragged(Handle::Scale(Axis::Y), 2.4, 1.0, 1.0);
    assert_eq!(tool.prefab.voxel_size, 1.0);
    tool.turn = 0.0;
    assert_eq!(tool.brush_at(&hit()), own);
}
