//! The panel on a screen of its own, without an app.

use bevy_egui::egui::{Event, Modifiers, PointerButton, Pos2, RawInput, Rect};

use super::*;
use crate::ground::Ground;
use crate::terrain::TerrainSettings;

/// The panel on a screen of its own, without an app.
struct Screen {
    context: egui::Context,
    size: Vec2,
    tool: BrushTool,
    panel: BurrowPanel,
    settings: BurrowSettings,
    customs: Customs,
    terrains: Vec<Terrain>,
    actions: Vec<PanelAction>,
    places: PanelPlaces,
    frames: f64,
}

impl Screen {
    fn new(width: f32, height: f32, terrains: usize) -> Self {
        let terrain = |_| {
            let ground = Ground::flat(64, 64, 8.0).expect("valid");
            Terrain::new(ground, &TerrainSettings::default()).expect("valid")
        };
        let mut screen = Self {
            context: egui::Context::default(),
            size: Vec2::new(width, height),
            tool: BrushTool::default(),
            panel: BurrowPanel::default(),
            settings: BurrowSettings::default(),
            customs: Customs::default(),
            terrains: (0..terrains).map(terrain).collect(),
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
        let mut actions = Vec::new();
        let _ = self.context.run_ui(input, |ui| {
            let context = ui.ctx().clone();
            column(&context, "burrow brush", Align2::LEFT_TOP, "Brush", |ui| {
                brush_column::show(ui, &mut self.tool, &materials);
            });
            column(&context, "burrow world", Align2::RIGHT_TOP, "World", |ui| {
                let mut content = Content {
                    terrains: &lines,
                    chosen: self.panel.terrain.or(lines.first().map(|line| line.entity)),
                    figures: &figures,
                    survey: &survey,
                    settings: &mut self.settings,
                    customs: &mut self.customs,
                    materials: &materials,
                    actions: &mut actions,
                };
                world_column::show(ui, &mut self.panel, &mut content);
            });
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
    }
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
        let at = screen.middle(operation.name());
        screen.click(at);
        assert_eq!(screen.tool.operation, operation);
    }
    for shape in ToolShape::ALL {
        let at = screen.middle(shape.name());
        screen.click(at);
        assert_eq!(screen.tool.shape, shape);
    }
    let at = screen.middle("Sphere");
    screen.click(at);
    screen.frame(Vec::new());
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
fn rules_and_loose_pieces_are_set_where_they_are_shown() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    let click = |screen: &mut Screen, name: &str| {
        let at = screen.middle(name);
        screen.click(at);
        screen.frame(Vec::new());
    };
    for section in ["Digging rules", "Loose pieces"] {
        click(&mut screen, section);
    }
    assert_eq!(screen.customs, Customs::default());
    for name in ["Bedrock", "Rule of Clay", "Hardness", "Unbreakable", "Found after digs", "are found"] {
        click(&mut screen, name);
    }
    let Customs { rules, loose, .. } = screen.customs.clone();
    let clay = crate::ground::MaterialId(4);
    assert_eq!((rules.bedrock, rules.unbreakable.first()), (Some(0), Some(&clay)));
    assert!((100..160).contains(&rules.hardness[&clay]), "{rules:?}");
    let default = LooseGround::default();
    let largest = loose.expect("switched on").largest;
    assert_eq!(loose, Some(LooseGround { largest, ..default }));
    assert!((100..1000).contains(&largest), "the middle of a logarithmic slider: {largest}");
    for name in ["Bedrock", "Unbreakable", "Found after digs"] {
        click(&mut screen, name);
    }
    assert_eq!((screen.customs.rules.bedrock, screen.customs.loose), (None, None));
    assert!(screen.customs.rules.unbreakable.is_empty());
}

#[test]
fn looks_are_set_where_there_is_one() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    assert!(!screen.places.0.contains_key("Look"));
    screen.customs.look = Some(GroundLook::default());
    screen.frame(Vec::new());
    for name in ["Look", "Plain", "Variety", "Beds"] {
        let at = screen.middle(name);
        screen.click(at);
        screen.frame(Vec::new());
    }
    let GroundLook { quality, variety, strata, .. } = screen.customs.look.expect("it is there");
    assert_eq!(quality, crate::view::GroundQuality::Low);
    assert!((0.4..0.6).contains(&variety) && (4.0..8.0).contains(&strata.height), "{variety} {strata:?}");
}

#[test]
fn buttons_act_only_where_they_can() {
    let mut screen = Screen::new(1280.0, 720.0, 0);
    for name in ["Undo", "Redo", "Check seams"] {
        let at = screen.middle(name);
        screen.click(at);
    }
    assert_eq!(screen.actions, []);
    let mut screen = Screen::new(1280.0, 720.0, 1);
    let shape = crate::brush::Shape::sphere(Vec3::splat(32.0).with_y(8.0), 4.0);
    screen.terrains[0].apply([crate::brush::Brush::dig(shape)]);
    screen.frame(Vec::new());
    for name in ["Undo", "Redo", "Check seams", "Save picture"] {
        let at = screen.middle(name);
        screen.click(at);
    }
    assert_eq!(screen.actions, [PanelAction::Undo, PanelAction::CheckSeams, PanelAction::SavePicture]);
}

#[test]
fn one_of_several_terrains_is_chosen() {
    let mut screen = Screen::new(1280.0, 720.0, 3);
    let at = screen.middle("Hills 2");
    screen.click(at);
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
