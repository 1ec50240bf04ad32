//! Tests of the panel on a simulated screen, mostly without an app.

mod brush_settings;
mod layout;
mod level_files;
mod messages;
mod placed;
mod pointer_and_keys;
mod terrain_settings;
mod tool;

use bevy_egui::egui::{Event, Modifiers, PointerButton, Pos2, RawInput, Rect};
use bevy_egui::{EguiContext, EguiUserTextures};

use super::*;
use crate::brush::{Brush, Shape};
use crate::ground::{Ground, MaterialId};
use crate::plugin::TerrainHit;
use crate::terrain::TerrainSettings;

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
