//! The panel: a brush to choose, settings, live figures, in two columns over the game (feature `egui`).
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_burrow::panel::{BrushTool, BurrowPanelPlugin, pointer_is_free};
//! # use bevy_burrow::prelude::*;
//! # fn dig() {}
//! App::new()
//!     .add_plugins((DefaultPlugins, BurrowPlugins, BurrowPanelPlugin))
//!     .add_systems(Update, dig.before(BurrowSystems::Collect).run_if(pointer_is_free));
//! ```
//!
//! | resource | what it is |
//! | --- | --- |
//! | [`BrushTool`] | the brush in hand: [`brush_at`](BrushTool::brush_at) makes the [`Brush`](crate::brush::Brush) |
//! | [`BurrowPanel`] | what is shown, names of materials, where pictures go |
//! | [`PanelPlaces`] | where its widgets are on the screen: for tutorials that point at one, and for tests |
//! | [`PanelInput`] | who has the pointer and the keyboard; run conditions [`pointer_is_free`], [`keyboard_is_free`] |
//!
//! [`PanelAction`] messages are its buttons, for keys of the game. It is drawn by the camera that has egui's primary
//! context: the first one, unless the game says otherwise; a camera that draws into an image is as good as one with a
//! window. With no terrain the panel says so; with several it shows one of them at a time.

mod brush_column;
mod customs;
mod look_section;
mod operations;
mod picture;
mod plot;
mod rules_section;
mod state;
mod survey;
mod theme;
mod tool;
mod widgets;
mod world_column;

pub use operations::ToolOperation;
pub use state::{BurrowPanel, PanelAction, PanelInput, PanelPlaces, keyboard_is_free, pointer_is_free};
pub use tool::{BrushTool, StampImage, ToolAlign, ToolShape};

use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy_egui::egui::{self, Align2, Color32, Id, Order, RichText, ScrollArea, Ui, Vec2};
use bevy_egui::{EguiContexts, EguiPlugin, EguiPreUpdateSet, EguiPrimaryContextPass, PrimaryEguiContext};

use crate::plugin::{BurrowFigures, BurrowSettings, BurrowSystems, LooseGround, MaterialColors, Redo, Undo};
use crate::terrain::Terrain;
use crate::view::GroundLook;
use customs::Customs;
use survey::Survey;
use world_column::{Content, TerrainLine};

/// The least and the greatest radius that the panel offers, in metres.
const RADII: (f32, f32) = (0.5, 32.0);
/// The least and the greatest length.
const LENGTHS: (f32, f32) = (1.0, 64.0);

/// Adds the panel to a game that has `BurrowPlugins`, and egui if it is not there. A game that adds egui by itself does so
/// before.
pub struct BurrowPanelPlugin;

impl Plugin for BurrowPanelPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<EguiPlugin>() {
            app.add_plugins(EguiPlugin::default());
        }
        app.init_resource::<BrushTool>()
            .init_resource::<BurrowPanel>()
            .init_resource::<PanelInput>()
            .init_resource::<PanelPlaces>()
            .init_resource::<Survey>()
            .init_resource::<picture::Saving>()
            .add_message::<PanelAction>()
            .add_systems(PreUpdate, state::read_input.after(EguiPreUpdateSet::BeginPass))
            .add_systems(
                Update,
                (
                    survey::follow_frames,
                    survey::count_terrain,
                    survey::finish_seam_check,
                    picture::finish,
                    act,
                    set_undo_budget,
                )
                    .chain()
                    .after(BurrowSystems::Begin),
            )
            .add_systems(EguiPrimaryContextPass, draw);
    }
}

/// Does what the buttons say.
fn act(
    mut commands: Commands,
    mut actions: MessageReader<PanelAction>,
    mut panel: ResMut<BurrowPanel>,
    check: Option<Res<survey::SeamCheck>>,
    terrains: Query<(Entity, &Terrain)>,
    cameras: Query<&RenderTarget, With<PrimaryEguiContext>>,
    mut undos: MessageWriter<Undo>,
    mut redos: MessageWriter<Redo>,
) {
    for action in actions.read() {
        let chosen = survey::chosen(&panel, &terrains);
        match action {
            PanelAction::Undo => drop(chosen.map(|terrain| undos.write(Undo { terrain: Some(terrain) }))),
            PanelAction::Redo => drop(chosen.map(|terrain| redos.write(Redo { terrain: Some(terrain) }))),
            PanelAction::CheckSeams => {
                let terrain = chosen.and_then(|entity| terrains.get(entity).ok());
                if let (Some((_, terrain)), None) = (terrain, &check) {
                    survey::start_seam_check(&mut commands, &mut panel, terrain);
                }
            }
            PanelAction::SavePicture => picture::save(&mut commands, &mut panel, cameras.iter().next()),
        }
    }
}

/// Hands a new budget of undo on to the terrains.
fn set_undo_budget(
    panel: Res<BurrowPanel>,
    mut terrains: Query<&mut Terrain>,
    mut last: Local<Option<usize>>,
) {
    let budget = panel.undo_mebibytes;
    if last.replace(budget).is_some_and(|last| last != budget) {
        terrains.iter_mut().for_each(|mut terrain| terrain.set_undo_budget(budget << 20));
    }
}

/// Draws both columns.
fn draw(
    mut contexts: EguiContexts,
    mut tool: ResMut<BrushTool>,
    mut panel: ResMut<BurrowPanel>,
    mut settings: ResMut<BurrowSettings>,
    figures: Res<BurrowFigures>,
    survey: Res<Survey>,
    terrains: Query<(Entity, &Terrain)>,
    parts: Query<(Option<&Name>, &MaterialColors, Option<&LooseGround>, Option<&GroundLook>)>,
    mut places: ResMut<PanelPlaces>,
    #[cfg(feature = "debug")] mut debug: Option<ResMut<crate::debug::BurrowDebug>>,
    mut actions: MessageWriter<PanelAction>,
    mut commands: Commands,
) {
    let Ok(context) = contexts.ctx_mut() else { return };
    if !panel.is_open {
        return;
    }
    let chosen = survey::chosen(&panel, &terrains);
    let part = chosen.and_then(|entity| parts.get(entity).ok());
    let materials = materials(&panel, &part.map(|(_, colors, ..)| colors.clone()).unwrap_or_default());
    let customs =
        chosen.and_then(|entity| terrains.get(entity).ok()).map_or_else(Customs::default, |(_, terrain)| {
            Customs::of(terrain, part.and_then(|part| part.2), part.and_then(|part| part.3))
        });
    let mut lines: Vec<TerrainLine> = terrains
        .iter()
        .map(|(entity, terrain)| {
            let name = parts.get(entity).ok().and_then(|(name, ..)| name);
            let name = name.map_or_else(|| format!("Terrain {entity}"), |name| name.to_string());
            TerrainLine { entity, name, terrain }
        })
        .collect();
    lines.sort_unstable_by_key(|line| line.entity);

    let (mut new_tool, mut new_panel, mut new_settings) = (tool.clone(), panel.clone(), settings.clone());
    let mut new_customs = customs.clone();
    let mut pressed = Vec::new();
    if panel.shows_brush {
        column(context, "burrow brush", Align2::LEFT_TOP, "Brush", |ui| {
            brush_column::show(ui, &mut new_tool, &materials);
        });
    }
    if panel.shows_world {
        column(context, "burrow world", Align2::RIGHT_TOP, "World", |ui| {
            let mut content = Content {
                terrains: &lines,
                chosen,
                figures: &figures,
                survey: &survey,
                settings: &mut new_settings,
                customs: &mut new_customs,
                materials: &materials,
                actions: &mut pressed,
            };
            world_column::show(ui, &mut new_panel, &mut content);
            #[cfg(feature = "debug")]
            if let Some(debug) = &mut debug {
                let mut new = (**debug).clone();
                world_column::debug(ui, &mut new);
                debug.set_if_neq(new);
            }
        });
    }
    // Whoever watches them for changes is told of real ones only.
    tool.set_if_neq(new_tool);
    panel.set_if_neq(new_panel);
    settings.set_if_neq(new_settings);
    places.set_if_neq(widgets::places(context));
    if let Some(entity) = chosen {
        new_customs.enact(&customs, entity, &mut commands);
    }
    actions.write_batch(pressed);
}

/// Colours and names by id, as many as there are of both.
fn materials(panel: &BurrowPanel, colors: &MaterialColors) -> Vec<(Color32, String)> {
    let color = |at: usize| match colors.0.get(at) {
        Some(color) => {
            let [r, g, b, _] = Srgba::from(*color).to_u8_array();
            Color32::from_rgb(r, g, b)
        }
        None => theme::MORE_MATERIALS[at % theme::MORE_MATERIALS.len()],
    };
    panel.materials.iter().enumerate().map(|(at, name)| (color(at), name.clone())).collect()
}

/// A card along one side of the window, as high as its content or the window.
fn column(
    context: &egui::Context,
    id: &'static str,
    side: Align2,
    title: &str,
    content: impl FnOnce(&mut Ui),
) {
    let height = context.viewport_rect().height() - 2.0 * theme::GAP;
    let offset = Vec2::new(if side == Align2::LEFT_TOP { theme::GAP } else { -theme::GAP }, theme::GAP);
    egui::Area::new(Id::new(id)).order(Order::Middle).anchor(side, offset).show(context, |ui| {
        ui.set_style(theme::style());
        ui.set_max_height(height);
        let card = theme::card();
        let inside = theme::COLUMN - card.inner_margin.sum().x;
        card.show(ui, |ui| {
            // Before anything is placed: later it would move what follows up to the top.
            ui.set_max_height(height - card.inner_margin.sum().y);
            ui.set_width(inside);
            ui.label(RichText::new(title).heading().color(theme::BRIGHT));
            let rest = (height - card.inner_margin.sum().y - 30.0).max(80.0);
            ScrollArea::vertical().max_height(rest).auto_shrink([false, true]).show(ui, |ui| {
                ui.set_width(inside);
                content(ui);
            });
        });
    });
}

#[cfg(test)]
mod tests {
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
        for (at, is_over) in [(over, true), (Pos2::new(640.0, 400.0), false), (Pos2::new(1200.0, 60.0), true)]
        {
            screen.frame(vec![Event::PointerMoved(at)]);
            screen.frame(Vec::new());
            assert_eq!(screen.context.is_pointer_over_egui(), is_over, "{at:?}");
        }
    }
}
