//! The panel: the current brush, settings and live statistics in two columns over the game (feature `egui`).
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
//! | resource | content |
//! | --- | --- |
//! | [`BrushTool`] | the current brush; [`brush_at`](BrushTool::brush_at) makes the [`Brush`](crate::brush::Brush) |
//! | [`BurrowPanel`] | what is shown, names of materials, the folder for pictures |
//! | [`PanelPlaces`] | the widgets' positions on the screen, for tutorials and tests |
//! | [`PanelInput`] | whether the panel uses the pointer or the keyboard; run conditions [`pointer_is_free`], [`keyboard_is_free`] |
//!
//! [`PanelAction`] messages trigger its buttons, for key bindings. A brush that was [placed](BrushTool::placed) has
//! handles, which the panel draws over the view even while it is closed. The panel is drawn by the camera with egui's
//! primary context: the first one, unless the game chooses another. That camera may render to an image. When it is
//! despawned, another camera with a window gets the context, if bevy_egui may create it
//! (`EguiGlobalSettings::auto_create_primary_context`). With several terrains, the panel shows one at a time.

mod brush_column;
mod context;
mod files;
mod handle_geometry;
mod handles;
mod input;
mod lengths;
mod level;
mod look_section;
mod open_level;
mod operations;
mod picture;
#[cfg(feature = "scatter")]
mod plants_section;
mod plot;
mod rules_section;
mod state;
mod survey;
mod terrain_controls;
#[allow(dead_code, reason = "which of them are shown depends on the features")]
mod texts;
mod theme;
pub mod tool;
mod tool_brush;
mod tool_content;
mod tool_geometry;
mod tool_operation;
mod tool_placed;
mod widgets;
mod world_column;

pub use input::{PanelInput, keyboard_is_free, pointer_is_free};
pub use state::{BurrowPanel, PanelAction, PanelPlaces};
#[doc(hidden)]
pub use tool::{BrushTool, PATH_POINTS, StampImage, ToolAlign, ToolModel, ToolPrefab, ToolShape};
pub use tool_operation::ToolOperation;

use std::path::PathBuf;

use bevy::camera::RenderTarget;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy_egui::egui::{self, Align2, Color32, Id, LayerId, Order, ScrollArea, Ui, Vec2};
use bevy_egui::{EguiContexts, EguiPlugin, EguiPreUpdateSet, EguiPrimaryContextPass, PrimaryEguiContext};

use crate::plugin::{
    BrushApplied, BurrowFigures, BurrowSettings, BurrowSystems, CommitSameFrame, MaterialColors, Redo, Undo,
};
use crate::terrain::{LooseSettings, Terrain};
use crate::view::GroundLook;
use handles::Handles;
use open_level::Files;
use state::Note;
use survey::Survey;
use terrain_controls::TerrainControls;
use world_column::{Content, TerrainLine};

/// Egui ids of the columns.
const BRUSH: &str = "burrow brush";
const WORLD: &str = "burrow world";

/// Adds the panel. Requires `BurrowPlugins`. Adds `EguiPlugin` if necessary.
#[derive(Default)]
pub struct BurrowPanelPlugin;

impl Plugin for BurrowPanelPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<EguiPlugin>() {
            app.add_plugins(EguiPlugin::default());
        }
        context::add_reassignment(app);
        app.init_resource::<BrushTool>()
            .init_resource::<BurrowPanel>()
            .init_resource::<PanelInput>()
            .init_resource::<PanelPlaces>()
            .init_resource::<Survey>()
            .init_resource::<Files>()
            .init_resource::<Handles>()
            .init_resource::<picture::Saving>()
            .add_message::<PanelAction>()
            .add_systems(
                PreUpdate,
                (input::read_input, handles::hold_pointer).chain().after(EguiPreUpdateSet::BeginPass),
            )
            .add_systems(
                Update,
                (
                    survey::count_terrain,
                    survey::finish_seam_check,
                    picture::finish,
                    level::finish,
                    picture::give_up,
                    // Before anything that would lose changes.
                    files::track_changes,
                    files::answer,
                    // Both read the same actions, whether a question is open or not.
                    handles::act,
                    perform_actions,
                    note_rejection,
                    forget_note,
                )
                    .chain()
                    .after(BurrowSystems::Begin),
            )
            // After the last of the plugin's work in a frame.
            .add_systems(PostUpdate, survey::follow_frames.after(CommitSameFrame))
            .add_systems(EguiPrimaryContextPass, (handles::show, draw).chain());
    }
}

/// Performs the buttons' actions.
fn perform_actions(
    mut commands: Commands,
    mut actions: MessageReader<PanelAction>,
    mut panel: ResMut<BurrowPanel>,
    mut files: ResMut<Files>,
    check: Option<Res<survey::SeamCheck>>,
    terrains: Query<(Entity, &Terrain)>,
    cameras: Query<&RenderTarget, With<PrimaryEguiContext>>,
    mut undos: MessageWriter<Undo>,
    mut redos: MessageWriter<Redo>,
    mut exit: MessageWriter<AppExit>,
) {
    for action in actions.read() {
        let chosen = survey::chosen(&panel, &terrains);
        let terrain = chosen.and_then(|entity| terrains.get(entity).ok());
        match files.admit(*action, &panel) {
            None => {}
            Some(PanelAction::Undo) => {
                undos.write_batch(chosen.map(|terrain| Undo { terrain: Some(terrain) }));
            }
            Some(PanelAction::Redo) => {
                redos.write_batch(chosen.map(|terrain| Redo { terrain: Some(terrain) }));
            }
            Some(PanelAction::CheckSeams) => {
                if let (Some((entity, terrain)), None) = (terrain, &check) {
                    survey::start_seam_check(&mut commands, &mut panel, entity, terrain);
                }
            }
            Some(PanelAction::SavePicture) => picture::save(&mut commands, &mut panel, cameras.iter().next()),
            Some(action @ (PanelAction::SaveLevel | PanelAction::SaveLevelAs)) => {
                let target = match action {
                    PanelAction::SaveLevel => files.target(&panel),
                    _ => panel.level.clone(),
                };
                save_level(&mut commands, &mut panel, &mut files, terrain, target);
            }
            Some(PanelAction::LoadLevel) if panel.level.as_os_str().is_empty() => {
                panel.report(Err(texts::NO_FOLDER.into()));
            }
            Some(PanelAction::LoadLevel) => {
                terrain
                    .into_iter()
                    .for_each(|own| level::load(&mut commands, (&mut *panel, &mut *files), own));
            }
            Some(PanelAction::NewLevel) => {
                terrain
                    .into_iter()
                    .for_each(|own| level::renew(&mut commands, (&mut *panel, &mut *files), own));
            }
            Some(PanelAction::Quit) => drop(exit.write(AppExit::Success)),
            // See `handles::act`.
            Some(
                PanelAction::PlaceBrush
                | PanelAction::ApplyBrush
                | PanelAction::SnapBrush
                | PanelAction::ReleaseBrush,
            ) => {}
        }
    }
}

/// Saves the level of a terrain in a folder. An empty path and a packed file are refused.
fn save_level(
    commands: &mut Commands,
    panel: &mut ResMut<BurrowPanel>,
    files: &mut ResMut<Files>,
    terrain: Option<(Entity, &Terrain)>,
    target: PathBuf,
) {
    if terrain.is_none() {
        files.forget_next();
    }
    let why = match &target {
        target if target.as_os_str().is_empty() => Some(texts::NO_FOLDER),
        target if target.is_file() => Some(texts::PACKED_FILE),
        _ => None,
    };
    if let Some(why) = why {
        files.forget_next();
        panel.report(Err(why.into()));
    } else if let Some(terrain) = terrain {
        level::save(commands, (&mut **panel, &mut **files), terrain, target);
    }
}

/// Stores why the chosen terrain rejected the last brush, until it accepts one or another terrain is chosen.
fn note_rejection(
    mut receipts: MessageReader<BrushApplied>,
    mut panel: ResMut<BurrowPanel>,
    terrains: Query<(Entity, &Terrain)>,
    mut last: Local<Option<Entity>>,
) {
    let chosen = survey::chosen(&panel, &terrains);
    let is_another = std::mem::replace(&mut *last, chosen) != chosen;
    let is_own = |terrain: Entity| chosen.is_none_or(|chosen| chosen == terrain);
    let own = receipts.read().filter(|answer| answer.terrain.is_none_or(is_own)).last();
    if own.is_none() && !is_another {
        return;
    }
    let rejection = own.and_then(|answer| answer.receipt.outcome.as_ref().err()).map(ToString::to_string);
    if panel.rejection != rejection {
        panel.rejection = rejection;
    }
}

/// Seconds after which a message about something that went well is gone.
const NOTE_SHOWN: f32 = 12.0;

/// Removes old messages, except for errors and running work.
fn forget_note(
    time: Option<Res<Time<Real>>>,
    mut panel: ResMut<BurrowPanel>,
    mut last: Local<(Option<Note>, f32)>,
) {
    if last.0 != panel.note {
        *last = (panel.note.clone(), 0.0);
    }
    last.1 += time.map_or(0.0, |time| time.delta_secs());
    let is_good = match &last.0 {
        Some(Note::Good(_)) => true,
        Some(Note::Seams(verdict)) => verdict.is_flawless,
        _ => false,
    };
    if is_good && last.1 > NOTE_SHOWN {
        panel.note = None;
    }
}

/// The terrains, and what the panel shows of them.
#[derive(SystemParam)]
struct PanelTerrains<'w, 's> {
    terrains: Query<'w, 's, (Entity, &'static Terrain)>,
    parts: Query<
        'w,
        's,
        (
            Option<&'static Name>,
            Option<&'static MaterialColors>,
            Option<&'static LooseSettings>,
            Option<&'static GroundLook>,
        ),
    >,
    #[cfg(feature = "scatter")]
    plants: Query<'w, 's, (&'static crate::plants::Plants, &'static crate::plants::ShownPlants)>,
}

impl PanelTerrains<'_, '_> {
    /// A line for each terrain, by entity.
    fn lines(&self) -> Vec<TerrainLine<'_>> {
        let line = |(entity, terrain)| {
            let name = self.parts.get(entity).ok().and_then(|(name, ..)| name);
            let name = name.map_or_else(|| format!("Terrain {entity}"), |name| name.to_string());
            TerrainLine { entity, name, terrain }
        };
        let mut lines: Vec<TerrainLine> = self.terrains.iter().map(line).collect();
        lines.sort_unstable_by_key(|line| line.entity);
        lines
    }

    /// The material colours of the chosen terrain.
    fn colors(&self, chosen: Option<Entity>) -> MaterialColors {
        let part = chosen.and_then(|entity| self.parts.get(entity).ok());
        part.and_then(|(_, colors, ..)| colors.cloned()).unwrap_or_default()
    }

    /// The settings of the chosen terrain.
    fn controls(&self, chosen: Option<Entity>) -> TerrainControls {
        let part = chosen.and_then(|entity| self.parts.get(entity).ok());
        let (loose, look) = part.map_or((None, None), |(_, _, loose, look)| (loose, look));
        let terrain = chosen.and_then(|entity| self.terrains.get(entity).ok());
        let controls = terrain.map(|(_, terrain)| TerrainControls::of(terrain, loose, look));
        TerrainControls {
            #[cfg(feature = "scatter")]
            plants: self.plants(chosen).map(|(crate::plants::Plants(rules), _)| rules.clone()),
            ..controls.unwrap_or_default()
        }
    }

    /// The plants of the chosen terrain: their rules, and those that are shown.
    #[cfg(feature = "scatter")]
    fn plants(
        &self,
        chosen: Option<Entity>,
    ) -> Option<(&crate::plants::Plants, &crate::plants::ShownPlants)> {
        chosen.and_then(|entity| self.plants.get(entity).ok())
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
    mut files: ResMut<Files>,
    terrains: PanelTerrains,
    mut places: ResMut<PanelPlaces>,
    #[cfg(feature = "debug")] mut debug: Option<ResMut<crate::debug::BurrowDebug>>,
    mut actions: MessageWriter<PanelAction>,
    mut commands: Commands,
) {
    let Ok(context) = contexts.ctx_mut() else { return };
    // A question is asked even while the panel is closed.
    files::ask(context, files.bypass_change_detection());
    if show_elsewhere(context, &panel) {
        panel.note = None;
    }
    if !panel.is_open {
        places.set_if_neq(widgets::places(context));
        return;
    }
    let was_typing = context.text_edit_focused();
    let chosen = survey::chosen(&panel, &terrains.terrains);
    let materials = materials(&panel, &terrains.colors(chosen));
    let controls = terrains.controls(chosen);
    let lines = terrains.lines();
    let voxel = voxel_size(&lines, chosen);

    let (mut new_tool, mut new_panel, mut new_settings) = (tool.clone(), panel.clone(), settings.clone());
    let mut new_controls = controls.clone();
    let mut pressed = Vec::new();
    let mut content = Content {
        terrains: &lines,
        chosen,
        figures: &figures,
        survey: &survey,
        settings: &mut new_settings,
        controls: &mut new_controls,
        #[cfg(feature = "scatter")]
        plants: terrains.plants(chosen).map(|(_, shown)| shown),
        materials: &materials,
        actions: &mut pressed,
    };
    fold_one(context, panel.shows_brush && panel.shows_world);
    if panel.shows_brush {
        draw_brush(context, &panel, (&tool, &mut new_tool), voxel, &mut content);
    }
    if panel.shows_world {
        let mut both = (&mut new_panel, &mut content);
        let head = |ui: &mut Ui, (panel, content): &mut (&mut BurrowPanel, &mut Content)| {
            world_column::head(ui, panel, &files, content);
        };
        column(context, WORLD, Align2::RIGHT_TOP, texts::WORLD, &mut both, head, |ui, (panel, content)| {
            world_column::show(ui, panel, content);
            #[cfg(feature = "debug")]
            if let Some(debug) = &mut debug {
                let mut new = (**debug).clone();
                world_column::debug(ui, &mut new);
                debug.set_if_neq(new);
            }
        });
    }
    free_keyboard(context, was_typing);
    // Only real changes may trigger change detection.
    tool.set_if_neq(new_tool);
    panel.set_if_neq(new_panel);
    settings.set_if_neq(new_settings);
    places.set_if_neq(widgets::places(context));
    if let Some(entity) = chosen {
        new_controls.apply(&controls, entity, &mut commands);
    }
    actions.write_batch(pressed);
}

/// Draws the column of the brush.
fn draw_brush(
    context: &egui::Context,
    panel: &BurrowPanel,
    (tool, new_tool): (&BrushTool, &mut BrushTool),
    voxel: f32,
    content: &mut Content,
) {
    let head = |ui: &mut Ui, content: &mut Content| {
        brush_column::head(ui, panel, tool, content.chosen.is_some(), content.actions);
    };
    column(context, BRUSH, Align2::LEFT_TOP, texts::BRUSH, content, head, |ui, content| {
        brush_column::show(ui, new_tool, content.materials, voxel, panel);
    });
}

/// Shows a failure or running work where the column that has the message is not in sight; returns whether it was
/// clicked away.
fn show_elsewhere(context: &egui::Context, panel: &BurrowPanel) -> bool {
    let is_seen = panel.is_open && panel.shows_world && is_unfolded(context, WORLD);
    !is_seen && files::alert(context, panel.note.as_ref())
}

/// The voxel size of the chosen terrain.
fn voxel_size(lines: &[TerrainLine], chosen: Option<Entity>) -> f32 {
    lines.iter().find(|line| Some(line.entity) == chosen).map_or(1.0, |line| line.terrain.voxel_size())
}

/// Takes the keyboard focus from the panel's widgets unless text is being typed. Egui moves the focus on `Tab`, but
/// keys belong to the game.
fn free_keyboard(context: &egui::Context, was_typing: bool) {
    let Some(focused) = context.memory(|memory| memory.focused()) else { return };
    let columns = [BRUSH, WORLD].map(|id| LayerId::new(Order::Middle, Id::new(id)));
    let is_own = context.read_response(focused).is_some_and(|widget| columns.contains(&widget.layer_id));
    let is_typing = context.text_edit_focused()
        && (was_typing || !context.input(|input| input.key_pressed(egui::Key::Tab)));
    if is_own && !is_typing {
        context.memory_mut(|memory| memory.surrender_focus(focused));
    }
}

/// The name and colour of each material, by id.
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

/// Whether a column is unfolded.
fn is_unfolded(context: &egui::Context, id: &'static str) -> bool {
    context.data(|data| data.get_temp(Id::new((id, "open")))).unwrap_or(true)
}

fn unfold(context: &egui::Context, id: &'static str, is_open: bool) {
    context.data_mut(|data| data.insert_temp(Id::new((id, "open")), is_open));
}

/// In a narrow window, only one of two columns is unfolded: the one that was unfolded last.
fn fold_one(context: &egui::Context, are_two: bool) {
    let is_narrow = context.viewport_rect().width() < 2.0 * theme::COLUMN + theme::LEAST_VIEW;
    let last = Id::new("burrow unfolded last");
    let now = [BRUSH, WORLD].map(|id| is_unfolded(context, id));
    let newest: &'static str = context.data(|data| data.get_temp(last)).unwrap_or(BRUSH);
    if are_two && is_narrow && now == [true, true] {
        unfold(context, if newest == BRUSH { WORLD } else { BRUSH }, false);
    }
}

/// A framed column along one side of the window, at most as high as the window. A click on its title folds it. The head
/// stays in sight, and the content scrolls below it.
fn column<T>(
    context: &egui::Context,
    id: &'static str,
    side: Align2,
    title: &str,
    data: &mut T,
    head: impl FnOnce(&mut Ui, &mut T),
    content: impl FnOnce(&mut Ui, &mut T),
) {
    let height = context.viewport_rect().height() - 2.0 * theme::GAP;
    let offset = Vec2::new(if side == Align2::LEFT_TOP { theme::GAP } else { -theme::GAP }, theme::GAP);
    let is_open = is_unfolded(context, id);
    egui::Area::new(Id::new(id)).order(Order::Middle).anchor(side, offset).show(context, |ui| {
        ui.set_style(theme::style());
        ui.set_max_height(height);
        let card = theme::card();
        let inside = if is_open { theme::COLUMN - card.inner_margin.sum().x } else { theme::FOLDED };
        card.show(ui, |ui| {
            // Must precede all widgets: later it would move the following ones to the top.
            ui.set_max_height(height - card.inner_margin.sum().y);
            ui.set_width(inside);
            if widgets::title(ui, title, is_open) {
                unfold(context, id, !is_open);
                context.data_mut(|data| data.insert_temp(Id::new("burrow unfolded last"), id));
            }
            if !is_open {
                return;
            }
            let top = ui.cursor().top();
            head(ui, data);
            let used = 30.0 + ui.cursor().top() - top;
            let rest = (height - card.inner_margin.sum().y - used).max(60.0);
            ScrollArea::vertical().max_height(rest).auto_shrink([false, true]).show(ui, |ui| {
                // The scroll bar floats over the margin at the right.
                ui.set_width(inside - theme::SCROLL_BAR);
                content(ui, data);
            });
        });
    });
}

#[cfg(test)]
mod tests;
