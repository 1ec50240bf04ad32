//! Tests of the panel on a simulated screen, mostly without an app.

mod level_files;
mod placed;
mod tool;

use std::time::Duration;

use bevy_egui::egui::{Event, Modifiers, PointerButton, Pos2, RawInput, Rect};
use bevy_egui::{EguiContext, EguiUserTextures};

use super::state::Note;
use super::*;
use crate::brush::{Brush, BrushError, Edit, Shape};
use crate::ground::{Ground, MaterialId};
use crate::plugin::TerrainHit;
use crate::terrain::{Applied, Receipt, Rejection, TerrainSettings};

/// Flat ground of these voxels.
fn flat(voxel_size: f32) -> Terrain {
    let ground = Ground::flat(64, 64, 8.0).expect("valid");
    let settings = TerrainSettings { voxel_size, ..TerrainSettings::default() };
    Terrain::new(ground, &settings).expect("valid")
}

/// A dig at the ground's surface.
fn dig(x: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, 8.0, 32.0), 4.0))
}

/// A simulated screen with the panel, without an app.
struct Screen {
    context: egui::Context,
    size: Vec2,
    tool: BrushTool,
    panel: BurrowPanel,
    files: Files,
    settings: BurrowSettings,
    controls: TerrainControls,
    terrains: Vec<Terrain>,
    actions: Vec<PanelAction>,
    places: PanelPlaces,
    frames: f64,
}

impl Screen {
    fn new(width: f32, height: f32, terrains: usize) -> Self {
        let mut screen = Self {
            context: egui::Context::default(),
            size: Vec2::new(width, height),
            tool: BrushTool::default(),
            panel: BurrowPanel::default(),
            files: Files::default(),
            settings: BurrowSettings::default(),
            controls: TerrainControls::default(),
            terrains: (0..terrains).map(|_| flat(1.0)).collect(),
            actions: Vec::new(),
            places: PanelPlaces::default(),
            frames: 0.0,
        };
        (0..3).for_each(|_| screen.frame(Vec::new()));
        screen
    }

    fn frame(&mut self, events: Vec<Event>) {
        self.frames += 1.0;
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, self.size)),
            time: Some(self.frames / 60.0),
            events,
            ..RawInput::default()
        };
        let entity = |at: usize| Entity::from_raw_u32(at as u32 + 1).expect("small");
        let lines: Vec<TerrainLine> = self
            .terrains
            .iter()
            .enumerate()
            .map(|(at, terrain)| TerrainLine { entity: entity(at), name: format!("Hills {at}"), terrain })
            .collect();
        let materials = materials(&self.panel, &MaterialColors::default());
        let (figures, survey) = (BurrowFigures::default(), Survey::default());
        let chosen = self.panel.terrain.or(lines.first().map(|line| line.entity));
        let voxel = voxel_size(&lines, chosen);
        let mut actions = Vec::new();
        let _ = self.context.run_ui(input, |ui| {
            let context = ui.ctx().clone();
            let was_typing = context.text_edit_focused();
            files::ask(&context, &mut self.files);
            if show_elsewhere(&context, &self.panel) {
                self.panel.note = None;
            }
            fold_one(&context, true);
            let shown = self.tool.clone();
            let head = |ui: &mut Ui, panel: &mut BurrowPanel| {
                brush_column::head(ui, panel, &shown, chosen.is_some(), &mut actions);
            };
            column(&context, BRUSH, Align2::LEFT_TOP, "Brush", &mut self.panel, head, |ui, panel| {
                brush_column::show(ui, &mut self.tool, &materials, voxel, panel);
            });
            let content = Content {
                terrains: &lines,
                chosen,
                figures: &figures,
                survey: &survey,
                settings: &mut self.settings,
                controls: &mut self.controls,
                #[cfg(feature = "scatter")]
                plants: None,
                materials: &materials,
                actions: &mut actions,
            };
            let mut both = (&mut self.panel, content);
            let head = |ui: &mut Ui, (panel, content): &mut (&mut BurrowPanel, Content)| {
                world_column::head(ui, panel, &self.files, content);
            };
            column(&context, WORLD, Align2::RIGHT_TOP, "World", &mut both, head, |ui, (panel, content)| {
                world_column::show(ui, panel, content);
            });
            free_keyboard(&context, was_typing);
        });
        self.actions.append(&mut actions);
        self.places = widgets::places(&self.context);
    }

    fn middle(&self, name: &str) -> Pos2 {
        let middle = self.places.0.get(name).unwrap_or_else(|| panic!("{name} is not seen")).center();
        Pos2::new(middle.x, middle.y)
    }

    fn button(at: Pos2, is_down: bool) -> Event {
        Event::PointerButton {
            pos: at,
            button: PointerButton::Primary,
            pressed: is_down,
            modifiers: Modifiers::NONE,
        }
    }

    fn click(&mut self, at: Pos2) {
        self.frame(vec![Event::PointerMoved(at)]);
        self.frame(vec![Self::button(at, true)]);
        self.frame(vec![Self::button(at, false)]);
        // A section takes a moment to open.
        (0..8).for_each(|_| self.frame(Vec::new()));
    }

    /// Clicks on a widget, and shows one more frame.
    fn choose(&mut self, name: &str) {
        self.click(self.middle(name));
        self.frame(Vec::new());
    }

    /// Drags a slider past its lower or upper end.
    fn drag(&mut self, name: &str, is_up: bool) {
        let (from, rail) = (self.middle(name), self.places.0[name]);
        let to = Pos2::new(if is_up { rail.max.x + 30.0 } else { rail.min.x - 30.0 }, from.y);
        self.frame(vec![Event::PointerMoved(from)]);
        self.frame(vec![Self::button(from, true)]);
        self.frame(vec![Event::PointerMoved(to)]);
        self.frame(vec![Self::button(to, false)]);
    }

    fn press(&mut self, key: egui::Key, modifiers: Modifiers) {
        self.frame(vec![Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers }]);
    }
}

#[test]
fn a_failure_is_seen_wherever_the_panel_hides_its_message() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    screen.panel.report(Err("The folder can't be written".into()));
    screen.frame(vec![]);
    let is_seen = |screen: &Screen| screen.places.0.contains_key(texts::MESSAGE);
    assert!(!is_seen(&screen), "it is in the column");
    unfold(&screen.context, WORLD, false);
    (0..3).for_each(|_| screen.frame(vec![]));
    assert!(is_seen(&screen));
    screen.choose(texts::MESSAGE);
    screen.frame(vec![]);
    assert!(!is_seen(&screen) && screen.panel.note.is_none());
    screen.panel.report(Ok("Saved".into()));
    (0..2).for_each(|_| screen.frame(vec![]));
    assert!(!is_seen(&screen), "what went well can wait");
}

#[test]
fn both_columns_fit_on_common_screens() {
    for (width, height) in [(1280.0, 720.0), (1920.0, 1080.0), (800.0, 600.0)] {
        for terrains in [0, 1, 5] {
            let screen = Screen::new(width, height, terrains);
            for (name, place) in &screen.places.0 {
                assert!(place.min.x >= 0.0 && place.max.x <= width, "{name} {place:?}");
                assert!(place.width() > 4.0, "{name} {place:?}");
                let middle = place.center().x;
                assert!(middle < 0.4 * width || middle > 0.6 * width, "{name} hides the view: {place:?}");
            }
            for name in ["Dig", "Terrace", "Sphere", "Radius", "Undo", "Check seams", "Save picture"] {
                let place = screen.places.0.get(name).unwrap_or_else(|| panic!("{name} at {width}"));
                assert!(place.max.y <= height, "{name} {place:?}");
            }
        }
    }
}

#[test]
fn tiles_and_sliders_set_the_brush() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    for operation in ToolOperation::all() {
        screen.choose(operation.name());
        assert_eq!(screen.tool.operation, operation);
    }
    for shape in ToolShape::ALL {
        screen.choose(&format!("{shape:?}"));
        assert_eq!(screen.tool.shape, shape);
    }
    screen.choose("Sphere");
    let rail = screen.places.0["Radius"];
    let (from, to) =
        (Pos2::new(rail.min.x + 20.0, rail.center().y), Pos2::new(rail.max.x - 4.0, rail.center().y));
    screen.frame(vec![Event::PointerMoved(from)]);
    screen.frame(vec![Screen::button(from, true)]);
    let small = screen.tool.radius;
    screen.frame(vec![Event::PointerMoved(to)]);
    screen.frame(vec![Screen::button(to, false)]);
    assert!(screen.tool.radius > 2.0 * small, "{} {small}", screen.tool.radius);
}

#[test]
fn sculpting_makes_ground_of_a_material_where_told_so() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    assert!(!screen.places.0.contains_key("Fill"));
    for name in ["Raise", "Fill", "Fill material", "Clay"] {
        screen.choose(name);
    }
    assert!(screen.tool.is_of_material);
    assert_eq!(screen.tool.material, 4);
}

#[test]
fn rules_and_loose_pieces_are_set_where_they_are_shown() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    for section in ["Digging rules", "Loose pieces"] {
        screen.choose(section);
    }
    assert_eq!(screen.controls, TerrainControls::default());
    for name in ["Bedrock", "Rule of Clay", "Hardness", "Unbreakable", "Find after digs", "Search up to"] {
        screen.choose(name);
    }
    let TerrainControls { rules, loose, .. } = screen.controls.clone();
    let clay = crate::ground::MaterialId(4);
    assert_eq!((rules.bedrock, rules.unbreakable.first()), (Some(0), Some(&clay)));
    assert!((100..160).contains(&rules.hardness[&clay]), "{rules:?}");
    let default = LooseSettings::default();
    let largest = loose.expect("switched on").largest;
    assert_eq!(loose, Some(LooseSettings { largest, ..default }));
    assert!((100..1000).contains(&largest), "the middle of a logarithmic slider: {largest}");
    for name in ["Bedrock", "Unbreakable", "Find after digs"] {
        screen.choose(name);
    }
    assert_eq!((screen.controls.rules.bedrock, screen.controls.loose), (None, None));
    assert!(screen.controls.rules.unbreakable.is_empty());
}

#[test]
fn the_look_section_needs_a_look() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    assert!(!screen.places.0.contains_key("Look"));
    screen.controls.look = Some(GroundLook::default());
    screen.frame(Vec::new());
    for name in ["Look", "Plain", "Variety", "Scale to"] {
        screen.choose(name);
    }
    let GroundLook { quality, variety, distance, .. } = screen.controls.look.expect("it is there");
    assert_eq!(quality, crate::view::GroundQuality::Low);
    assert!((0.4..0.6).contains(&variety) && (15.0..35.0).contains(&distance.1), "{variety} {distance:?}");
}

#[test]
fn buttons_act_only_where_they_can() {
    let mut screen = Screen::new(1280.0, 720.0, 0);
    for name in ["Undo", "Redo", "Check seams"] {
        screen.choose(name);
    }
    assert_eq!(screen.actions, []);
    let mut screen = Screen::new(1280.0, 720.0, 1);
    screen.terrains[0].apply([dig(32.0)]);
    screen.frame(Vec::new());
    for name in ["Undo", "Redo", "Check seams", "Save picture"] {
        screen.choose(name);
    }
    assert_eq!(screen.actions, [PanelAction::Undo, PanelAction::CheckSeams, PanelAction::SavePicture]);
}

#[test]
fn one_of_several_terrains_is_chosen() {
    let mut screen = Screen::new(1280.0, 720.0, 3);
    screen.choose("Hills 2");
    assert_eq!(screen.panel.terrain, Entity::from_raw_u32(3));
}

#[test]
fn egui_has_the_pointer_over_a_column_only() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    let over = screen.middle("Radius");
    for (at, is_over) in [(over, true), (Pos2::new(640.0, 400.0), false), (Pos2::new(1200.0, 60.0), true)] {
        screen.frame(vec![Event::PointerMoved(at)]);
        screen.frame(Vec::new());
        assert_eq!(screen.context.is_pointer_over_egui(), is_over, "{at:?}");
    }
}

#[test]
fn tab_is_left_to_the_game() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    // The last widgets are sliders with numbers that can be typed.
    screen.choose("Settings");
    for modifiers in [Modifiers::NONE, Modifiers::NONE, Modifiers::SHIFT, Modifiers::SHIFT] {
        screen.press(egui::Key::Tab, modifiers);
        assert_eq!(screen.context.memory(|memory| memory.focused()), None, "{modifiers:?}");
        assert!(!screen.context.text_edit_focused());
    }
}

#[test]
fn numbers_are_typed_where_one_clicks_on_them() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    let rail = screen.places.0["Radius"];
    screen.click(Pos2::new(rail.max.x + 25.0, rail.center().y));
    assert!(screen.context.text_edit_focused());
    screen.frame(Vec::new());
    screen.frame(vec![Event::Text("7".into())]);
    assert!(screen.context.text_edit_focused());
    screen.press(egui::Key::Enter, Modifiers::NONE);
    screen.frame(Vec::new());
    assert_eq!(screen.tool.radius, 7.0);
    assert_eq!(screen.context.memory(|memory| memory.focused()), None);
}

/// A place on the ground.
fn hit() -> TerrainHit {
    TerrainHit {
        terrain: Entity::PLACEHOLDER,
        distance: 9.0,
        position: Vec3::new(10.0, 20.0, 30.0),
        normal: Vec3::Y,
        material: MaterialId(1),
        from_inside: false,
    }
}

#[test]
fn every_slider_value_makes_a_valid_brush() {
    let hit = hit();
    let sliders = [
        "Radius",
        "Half width",
        "Half height",
        "Half depth",
        "Tube",
        "Length",
        "Falloff",
        "Amount",
        "Height",
        "Step",
        "Bumps",
        "Width",
    ];
    for voxel_size in [0.125, 8.0] {
        let mut screen = Screen::new(1280.0, 1600.0, 0);
        screen.terrains.push(flat(voxel_size));
        screen.choose("Rough");
        let mut dragged = 0;
        let combinations = ToolOperation::all().map(|operation| (operation, ToolShape::Sphere));
        let shapes = ToolShape::ALL.map(|shape| (ToolOperation::Stamp, shape));
        for (operation, shape) in combinations.chain(shapes) {
            (screen.tool.operation, screen.tool.shape) = (operation, shape);
            for is_up in [false, true] {
                (0..2).for_each(|_| screen.frame(Vec::new()));
                let is_seen = |name: &&str| screen.places.0.contains_key(*name);
                let seen: Vec<&str> = sliders.into_iter().filter(is_seen).collect();
                seen.iter().for_each(|name| screen.drag(name, is_up));
                dragged += seen.len();
                let brush = screen.tool.brush_at(&hit);
                let brush = brush.transformed(Quat::IDENTITY, Vec3::ZERO, voxel_size.recip());
                let edit = Edit::quantize(&brush);
                assert!(edit.is_ok(), "{edit:?} at {voxel_size}: {:?}", screen.tool);
            }
        }
        assert!(dragged > 100, "{dragged}");
    }
}

#[test]
fn other_voxels_change_no_setting_by_themselves() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    (screen.tool.radius, screen.tool.operation) = (90.0, ToolOperation::Terrace);
    let before = screen.tool.clone();
    screen.terrains = vec![flat(8.0)];
    (0..3).for_each(|_| screen.frame(Vec::new()));
    assert_eq!(screen.tool, before);
    screen.drag("Step", false);
    assert_eq!(screen.tool, BrushTool { step: 8.0, ..before });
}

#[test]
fn a_rejection_is_seen_until_a_brush_is_accepted() {
    let mut app = App::new();
    app.init_resource::<BurrowPanel>().add_message::<BrushApplied>().add_systems(Update, note_rejection);
    let mut screen = Screen::new(1280.0, 720.0, 1);
    let small = BrushError::TooSmall { what: "radius", value: 0.1, least: 0.25 };
    for (outcome, is_seen) in [
        (Err(Rejection::Brush(small)), true),
        (Err(Rejection::OutsideWorld), true),
        (Ok(Applied::default()), false),
    ] {
        app.world_mut().write_message(BrushApplied { terrain: None, receipt: Receipt::of_edit(0, outcome) });
        // The message stays until there is another result.
        for _ in 0..3 {
            app.update();
            screen.panel = app.world().resource::<BurrowPanel>().clone();
            screen.frame(Vec::new());
            assert_eq!(screen.places.0.contains_key("Rejected"), is_seen);
        }
    }
}

/// Whether the panel shows a rejection after a frame in which this terrain, if any, rejects a brush.
fn is_rejected(app: &mut App, by: Option<Entity>) -> bool {
    if by.is_some() {
        let receipt = Receipt::of_edit(0, Err(Rejection::OutsideWorld));
        app.world_mut().write_message(BrushApplied { terrain: by, receipt });
    }
    app.update();
    app.world().resource::<BurrowPanel>().rejection.is_some()
}

#[test]
fn a_rejection_is_that_of_the_terrain_that_the_panel_is_about() {
    let mut app = App::new();
    app.init_resource::<BurrowPanel>().add_message::<BrushApplied>().add_systems(Update, note_rejection);
    let mut terrains = [(); 3].map(|()| app.world_mut().spawn(flat(1.0)).id());
    terrains.sort_unstable();
    let [first, second, gone] = terrains;
    app.world_mut().despawn(gone);
    app.world_mut().resource_mut::<BurrowPanel>().terrain = Some(gone);
    assert!(!is_rejected(&mut app, Some(second)), "the panel shows the first of those that are there");
    assert!(is_rejected(&mut app, Some(first)));
    assert!(is_rejected(&mut app, None), "nothing has changed");
    app.world_mut().resource_mut::<BurrowPanel>().terrain = Some(second);
    assert!(!is_rejected(&mut app, None), "another terrain has rejected nothing");
    assert!(!is_rejected(&mut app, Some(first)));
    assert!(is_rejected(&mut app, Some(second)));
    app.world_mut().despawn(second);
    assert!(!is_rejected(&mut app, None));
}

#[test]
fn history_is_that_of_the_chosen_terrain() {
    let mut screen = Screen::new(1280.0, 1600.0, 0);
    screen.frame(Vec::new());
    screen.choose("Settings");
    assert!(!screen.places.0.contains_key("History"), "there is no terrain");
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    // Not a whole number of MiB.
    let odd = (5 << 20) + 123;
    screen.controls.undo_budget = odd;
    screen.choose("Settings");
    assert_eq!(screen.controls.undo_budget, odd);
    screen.drag("History", true);
    assert_eq!(screen.controls.undo_budget, 1 << 30);
    screen.drag("History", false);
    assert_eq!(screen.controls.undo_budget, 0);
}

/// An app with the systems that draw the panel, and its egui context.
fn app_and_context() -> (App, egui::Context) {
    let mut app = App::new();
    app.init_resource::<BrushTool>()
        .init_resource::<BurrowPanel>()
        .init_resource::<BurrowSettings>()
        .init_resource::<BurrowFigures>()
        .init_resource::<Survey>()
        .init_resource::<Files>()
        .init_resource::<PanelPlaces>()
        .init_resource::<EguiUserTextures>()
        .add_message::<PanelAction>()
        .add_systems(Update, draw);
    let camera = app.world_mut().spawn(PrimaryEguiContext).id();
    let mut camera = app.world_mut().entity_mut(camera);
    let context = camera.get_mut::<EguiContext>().expect("required").get_mut().clone();
    (app, context)
}

/// Positions of the widgets after some frames.
fn places_in<'a>(app: &'a mut App, context: &egui::Context) -> &'a PanelPlaces {
    for _ in 0..3 {
        let screen = Rect::from_min_size(Pos2::ZERO, Vec2::new(1280.0, 1600.0));
        let input = RawInput { screen_rect: Some(screen), ..RawInput::default() };
        let _ = context.run_ui(input, |_| app.update());
    }
    app.world().resource()
}

#[test]
fn a_closed_panel_is_nowhere() {
    let (mut app, context) = app_and_context();
    for (is_open, is_somewhere) in [(true, true), (false, false), (true, true)] {
        app.world_mut().resource_mut::<BurrowPanel>().is_open = is_open;
        let places = places_in(&mut app, &context);
        assert_eq!(places.0.contains_key("Radius"), is_somewhere);
        assert!(is_somewhere || places.0.is_empty());
    }
}

#[test]
fn a_terrain_without_colours_is_shown_like_any_other() {
    let (mut app, context) = app_and_context();
    app.world_mut().spawn((flat(1.0), GroundLook::default())).remove::<MaterialColors>();
    assert!(places_in(&mut app, &context).0.contains_key("Look"));
}

#[test]
fn what_a_seam_check_found_is_said_of_the_ground_that_was_checked() {
    let mut app = App::new();
    app.init_resource::<BurrowPanel>()
        .init_resource::<Files>()
        .add_message::<PanelAction>()
        .add_message::<Undo>()
        .add_message::<Redo>()
        .add_message::<AppExit>()
        .add_systems(Update, (perform_actions, survey::finish_seam_check).chain());
    let [checked, other] = [(); 2].map(|()| app.world_mut().spawn(flat(1.0)).id());
    app.world_mut().resource_mut::<BurrowPanel>().terrain = Some(checked);
    app.world_mut().write_message(PanelAction::CheckSeams);
    let verdict = (0..10_000).find_map(|_| {
        app.update();
        std::thread::sleep(Duration::from_millis(1));
        match &app.world().resource::<BurrowPanel>().note {
            Some(Note::Seams(verdict)) => Some(verdict.clone()),
            _ => None,
        }
    });
    let verdict = verdict.expect("the check ends");
    let said = |app: &App, of: Entity| {
        let terrain = app.world().get::<Terrain>(of).expect("it is there");
        verdict.about(of, terrain.world())
    };
    assert!(verdict.is_flawless);
    assert_eq!(said(&app, checked), Some(verdict.text.clone()));
    assert_eq!(said(&app, other), None, "that one was not checked");
    let mut terrain = app.world_mut().get_mut::<Terrain>(checked).expect("it is there");
    terrain.apply([dig(32.0)]);
    let then = format!("Revision {}: {}", verdict.revision, verdict.text);
    assert_eq!(said(&app, checked), Some(then));
}

#[test]
fn in_a_narrow_window_one_column_is_unfolded() {
    let mut screen = Screen::new(640.0, 360.0, 1);
    for (here, there, column) in
        [("Dig", "Undo", "World"), ("Undo", "Dig", "Brush"), ("Dig", "Undo", "World")]
    {
        assert!(screen.places.0.contains_key(here) && !screen.places.0.contains_key(there), "{here}");
        for (name, place) in &screen.places.0 {
            assert!(place.min.x >= 0.0 && place.max.x <= 640.0, "{name} {place:?}");
        }
        screen.choose(column);
        (0..2).for_each(|_| screen.frame(Vec::new()));
    }
}

#[test]
fn what_does_not_apply_can_not_be_chosen() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    for (operation, shape) in [("Dig", ToolShape::Torus), ("Stamp", ToolShape::Box)] {
        for name in [operation, "Box", "Torus"] {
            screen.choose(name);
        }
        assert_eq!(screen.tool.shape, shape, "{operation}");
    }
}

#[test]
fn keys_of_the_game_and_the_pointer_are_shown() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    assert!(!screen.places.0.contains_key(texts::POINTER));
    screen.panel.pointer = Some(Vec3::ONE);
    screen.panel.keys.insert("Dig".into(), "1".into());
    (0..2).for_each(|_| screen.frame(Vec::new()));
    assert!(screen.places.0.contains_key(texts::POINTER));
}

#[test]
fn a_game_that_saves_its_worlds_itself_hides_the_files() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    for shows_files in [true, false] {
        screen.panel.shows_files = shows_files;
        (0..2).for_each(|_| screen.frame(Vec::new()));
        assert!(
            ["New", "Open", "Save"].iter().all(|name| screen.places.0.contains_key(*name) == shows_files)
        );
        assert!(screen.places.0.contains_key("Undo"));
    }
}

#[test]
fn the_panel_is_larger_or_smaller_as_one_likes() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    screen.choose("Settings");
    let place = screen.places.0["Undo"];
    screen.choose("150");
    assert_eq!(screen.context.zoom_factor(), 1.5);
    // Positions are those in the window.
    let larger = screen.places.0["Undo"];
    assert!((larger.min - 1.5 * place.min).length() < 1.0 && larger.width() > 1.4 * place.width());
    for (key, is_larger) in [(egui::Key::Minus, false), (egui::Key::Plus, true), (egui::Key::Equals, true)] {
        let before = screen.context.zoom_factor();
        screen.press(key, Modifiers::CTRL | Modifiers::COMMAND);
        screen.frame(Vec::new());
        let now = screen.context.zoom_factor();
        assert!(if is_larger { now > before } else { now < before }, "{key:?}: {before}, then {now}");
    }
}

#[test]
fn messages_of_success_expire() {
    let mut app = App::new();
    app.insert_resource(Time::<Real>::default())
        .init_resource::<BurrowPanel>()
        .add_systems(Update, forget_note);
    for (message, stays) in [(Ok("done".to_string()), false), (Err("failed".to_string()), true)] {
        app.world_mut().resource_mut::<BurrowPanel>().report(message);
        for _ in 0..30 {
            app.world_mut().resource_mut::<Time<Real>>().advance_by(Duration::from_secs(1));
            app.update();
        }
        assert_eq!(app.world().resource::<BurrowPanel>().note.is_some(), stays);
    }
}

#[test]
fn any_context_of_egui_may_have_the_pointer() {
    let mut app = App::new();
    app.init_resource::<PanelInput>().init_resource::<Files>().add_systems(Update, input::read_input);
    // The context of another camera than the panel's.
    let camera = app.world_mut().spawn(EguiContext::default()).id();
    let mut camera = app.world_mut().entity_mut(camera);
    let context = camera.get_mut::<EguiContext>().expect("it is there").get_mut().clone();
    for (at, is_over) in [(Pos2::new(30.0, 30.0), true), (Pos2::new(600.0, 400.0), false)] {
        for _ in 0..3 {
            let screen = Rect::from_min_size(Pos2::ZERO, Vec2::new(1280.0, 720.0));
            let events = vec![Event::PointerMoved(at)];
            let input = RawInput { screen_rect: Some(screen), events, ..RawInput::default() };
            let _ = context.run_ui(input, |ui| {
                let map = egui::Area::new(Id::new("map")).fixed_pos(Pos2::ZERO);
                map.show(ui.ctx(), |ui| ui.allocate_space(Vec2::splat(100.0)));
            });
        }
        app.update();
        assert_eq!(app.world().resource::<PanelInput>().has_pointer, is_over, "{at:?}");
    }
}
