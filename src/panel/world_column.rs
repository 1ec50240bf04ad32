//! The right column: files and buttons, terrain, rules, look, plants, settings, and diagnostics.

use bevy::prelude::Entity;
use bevy_egui::egui::{Color32, RichText, Ui, Vec2};

use super::files;
use super::open_level::Files;
use super::state::{BurrowPanel, Note, PanelAction};
use super::survey::{Counts, Survey};
use super::terrain_controls::TerrainControls;
use super::theme::{ACCENT, BAD, BLUE, BRIGHT, FAINT, GOOD, PARTS};
use super::widgets::{button, bytes, choice, count, figure, figure_in, section, share, slider, time};
use super::{look_section, plot, rules_section, texts};
use crate::backend::{Choice, EngineState, Stage};
use crate::plugin::{BurrowFigures, BurrowSettings, ShownLevels, Times};
use crate::terrain::{History, Terrain};

/// A terrain in the list.
pub struct TerrainLine<'a> {
    pub entity: Entity,
    pub name: String,
    pub terrain: &'a Terrain,
}

/// Data that the column shows and edits.
pub struct Content<'a> {
    pub terrains: &'a [TerrainLine<'a>],
    pub chosen: Option<Entity>,
    pub figures: &'a BurrowFigures,
    pub survey: &'a Survey,
    pub settings: &'a mut BurrowSettings,
    pub controls: &'a mut TerrainControls,
    #[cfg(feature = "scatter")]
    pub plants: Option<&'a crate::plants::ShownPlants>,
    pub materials: &'a [(Color32, String)],
    pub actions: &'a mut Vec<PanelAction>,
}

/// Draws what is always in sight: files, history, pictures, and the current message.
pub fn head(ui: &mut Ui, panel: &mut BurrowPanel, files: &Files, content: &mut Content) {
    let chosen = content.terrains.iter().find(|line| Some(line.entity) == content.chosen);
    if panel.shows_files {
        files::bar(ui, panel, files, content.actions, chosen.is_some());
    }
    buttons(ui, panel, content.actions, chosen);
    note(ui, panel, chosen);
}

/// Draws the column.
pub fn show(ui: &mut Ui, panel: &mut BurrowPanel, content: &mut Content) {
    let chosen = content.terrains.iter().find(|line| Some(line.entity) == content.chosen);
    section(ui, texts::TERRAIN, true, |ui| terrain(ui, panel, content.terrains, chosen));
    if let Some(line) = chosen {
        let voxel = line.terrain.voxel_size();
        rules_section::show(ui, content.controls, &mut panel.material, content.materials, voxel);
        if let Some(look) = &mut content.controls.look {
            look_section::show(ui, look);
        }
        #[cfg(feature = "scatter")]
        if let Some(rules) = &mut content.controls.plants {
            super::plants_section::show(ui, rules, content.plants);
        }
    }
    let undo_budget = chosen.is_some().then_some(&mut content.controls.undo_budget);
    section(ui, texts::SETTINGS, false, |ui| settings(ui, undo_budget, content.settings));
    section(ui, texts::DIAGNOSTICS, false, |ui| {
        live(ui, content.figures, content.survey);
        if let Some(line) = chosen {
            lod_nodes(ui, line);
        }
        if let Some(counts) = &content.survey.counts {
            memory(ui, counts, content.survey.mesh_bytes);
        }
        if let Some((state, stages, last)) = &content.survey.engine {
            engine(ui, state, *stages, last.as_ref());
        }
    });
}

fn buttons(ui: &mut Ui, panel: &BurrowPanel, actions: &mut Vec<PanelAction>, chosen: Option<&TerrainLine>) {
    let is_busy = matches!(panel.note, Some(Note::Busy(_)));
    let width = share(ui, 2);
    let history = chosen.map(|line| line.terrain.history());
    let History { undos, redos, bytes: held } = history.unwrap_or_default();
    let key = |name: &str| panel.keys.get(name).cloned().unwrap_or_default();
    ui.horizontal(|ui| {
        if button(ui, texts::UNDO, width, undos > 0).on_hover_text(key(texts::UNDO)).clicked() {
            actions.push(PanelAction::Undo);
        }
        if button(ui, texts::REDO, width, redos > 0).on_hover_text(key(texts::REDO)).clicked() {
            actions.push(PanelAction::Redo);
        }
    });
    figure(ui, texts::HISTORY_STEPS, texts::steps(undos, redos, &bytes(held)));
    ui.horizontal(|ui| {
        let seams = button(ui, texts::CHECK_SEAMS, width, chosen.is_some() && !is_busy);
        if seams.on_hover_text(texts::CHECK_SEAMS_HELP).clicked() {
            actions.push(PanelAction::CheckSeams);
        }
        if button(ui, texts::SAVE_PICTURE, width, true).on_hover_text(key(texts::SAVE_PICTURE)).clicked() {
            actions.push(PanelAction::SavePicture);
        }
    });
}

/// Shows the current message.
fn note(ui: &mut Ui, panel: &BurrowPanel, chosen: Option<&TerrainLine>) {
    let (color, text) = match &panel.note {
        None => return,
        Some(Note::Good(text)) => (GOOD, text.clone()),
        Some(Note::Bad(text)) => (BAD, text.clone()),
        Some(Note::Busy(text)) => (FAINT, text.clone()),
        Some(Note::Seams(verdict)) => {
            let about = chosen.and_then(|line| verdict.about(line.entity, line.terrain.world()));
            let Some(text) = about else { return };
            (if verdict.is_flawless { GOOD } else { BAD }, text)
        }
    };
    ui.label(RichText::new(text).color(color).size(12.0));
}

fn terrain(ui: &mut Ui, panel: &mut BurrowPanel, terrains: &[TerrainLine], chosen: Option<&TerrainLine>) {
    let Some(line) = chosen else {
        ui.label(RichText::new(texts::NO_TERRAIN).color(FAINT).size(12.0));
        return;
    };
    if terrains.len() > 1 {
        let at = terrains.iter().position(|other| other.entity == line.entity).unwrap_or_default();
        let names: Vec<&str> = terrains.iter().map(|line| line.name.as_str()).collect();
        for (row, names) in names.chunks(2).enumerate() {
            let here = at.checked_sub(row * 2).unwrap_or(usize::MAX);
            if let Some(other) = choice(ui, names, here).and_then(|at| terrains.get(row * 2 + at)) {
                panel.terrain = Some(other.entity);
            }
        }
    } else {
        ui.label(RichText::new(&line.name).color(BRIGHT).size(13.0));
    }
    let (grid, voxel) = (line.terrain.world().grid(), line.terrain.voxel_size());
    let metres = |voxels: i32| voxels as f32 * voxel;
    figure(ui, texts::SIZE, format!("{} x {} m", metres(grid.width()), metres(grid.depth())));
    figure(ui, texts::VOXEL, format!("{voxel} m"));
    figure(ui, texts::CHUNK, format!("{}{}", grid.size(), texts::VOXELS));
    figure(ui, texts::REVISION, count(line.terrain.world().revision() as usize));
}

fn lod_nodes(ui: &mut Ui, line: &TerrainLine) {
    if let Some(drawn) = line.terrain.drawn_cut() {
        let nodes = ShownLevels::of(drawn.cut(), 0).nodes;
        figure(ui, texts::LEVELS, nodes.iter().map(usize::to_string).collect::<Vec<_>>().join(" "));
    }
}

fn live(ui: &mut Ui, figures: &BurrowFigures, survey: &Survey) {
    let recent = figures.transactions.iter().map(|took| took.as_secs_f32() * 1e3);
    let recent: Vec<f32> = recent.skip(figures.transactions.len().saturating_sub(180)).collect();
    plot::line(
        ui,
        recent.into_iter(),
        1.0,
        ACCENT,
        texts::TRANSACTION,
        &time(figures.transactions.iter().last()),
    );
    figure(ui, texts::PERCENTILES, percentiles(&figures.transactions));
    let now = survey.swaps_now.to_string();
    plot::line(ui, survey.swaps.iter(), 8.0, BLUE, texts::SWAPPED, &now);
    let last = survey.frame_ms.iter().last().unwrap_or_default();
    plot::line(ui, survey.frame_ms.iter(), 16.7, GOOD, texts::FRAME, &format!("{last:.1} ms"));
    let own = time(Some(figures.main_thread));
    plot::line(ui, survey.main_thread_us.iter(), 100.0, PARTS[4], texts::MAIN_THREAD, &own);
    figure(ui, texts::QUEUE, count(survey.queued));
    figure(ui, texts::BRUSHES, count(figures.brushes as usize));
    figure(ui, texts::COMMITS, count(figures.commits as usize));
}

/// The 50th, 95th and 99th percentile.
fn percentiles(times: &Times) -> String {
    [50, 95, 99].map(|percent| time(times.percentile(percent))).join(", ")
}

fn memory(ui: &mut Ui, counts: &Counts, mesh_bytes: usize) {
    let memory = counts.memory;
    let sizes = [memory.ground, memory.samples, memory.materials, memory.meshes, memory.parts, memory.index];
    let kinds: Vec<(&str, usize)> = texts::MEMORY.into_iter().zip(sizes).collect();
    let parts: Vec<(usize, Color32)> =
        kinds.iter().zip(PARTS).map(|(&(_, size), color)| (size, color)).collect();
    plot::parts(ui, &parts);
    for pair in kinds.iter().zip(PARTS).collect::<Vec<_>>().chunks(2) {
        ui.horizontal(|ui| {
            let width = share(ui, 2);
            for ((name, size), color) in pair {
                ui.allocate_ui(Vec2::new(width, 16.0), |ui| {
                    ui.set_min_width(width);
                    figure_in(ui, name, bytes(*size), *color);
                });
            }
        });
    }
    figure(ui, texts::ALL_MEMORY, bytes(memory.total()));
    figure(ui, texts::EDITS_MEMORY, bytes(memory.edits()));
    figure(ui, texts::GPU_MESHES, bytes(mesh_bytes));
    figure(ui, texts::FIELDS, count(counts.fields));
    figure(ui, texts::CHUNKS, count(counts.chunks));
    figure(ui, texts::BRICKS, count(counts.bricks));
    figure(ui, texts::MASK_CELLS, count(counts.cells));
    figure(ui, texts::HASH, format!("{:016x}", counts.hash));
}

fn engine(ui: &mut Ui, state: &EngineState, [cpu, cuda]: [u64; 2], last: Option<&Choice>) {
    match state {
        EngineState::Cpu => figure(ui, texts::BACKEND, texts::CPU),
        EngineState::Unopened => figure(ui, texts::BACKEND, texts::CPU_UNOPENED),
        EngineState::Opening => figure(ui, texts::BACKEND, texts::CPU_OPENING),
        EngineState::Cuda(name) => figure_in(ui, texts::BACKEND, name, GOOD),
        EngineState::Lost(why) => {
            figure(ui, texts::BACKEND, texts::CPU_ONLY);
            ui.label(RichText::new(why).color(FAINT).size(11.0));
        }
    }
    for (name, stages) in texts::STAGES.into_iter().zip([cpu, cuda]) {
        figure(ui, name, count(stages as usize));
    }
    let Some(choice) = last else { return };
    let what = match choice.stage {
        Stage::Edit => texts::EDITED,
        Stage::Mesh => texts::MESHED,
    };
    figure(ui, texts::LAST, format!("{} {what} in {}", count(choice.amount), time(Some(choice.took))));
    if let Some(estimate) = choice.estimate {
        for (name, estimate) in texts::EXPECTED.into_iter().zip([estimate.cpu, estimate.cuda]) {
            figure(ui, name, time(Some(estimate)));
        }
    }
}

fn settings(ui: &mut Ui, undo_budget: Option<&mut usize>, settings: &mut BurrowSettings) {
    if let Some(bytes) = undo_budget {
        let mut mebibytes = *bytes >> 20;
        let history =
            slider(ui, texts::UNDO_MEMORY, &mut mebibytes, 0..=1024, |slider| slider.suffix(" MiB"));
        // Write only on change, as not every budget is a whole number of MiB.
        if history.on_hover_text(texts::UNDO_MEMORY_HELP).changed() {
            *bytes = mebibytes << 20;
        }
    }
    slider(ui, texts::SWAPS, &mut settings.swaps_per_frame, 1..=4096, |slider| slider.logarithmic(true))
        .on_hover_text(texts::SWAPS_HELP);
    slider(ui, texts::LOADS, &mut settings.loads_per_frame, 1..=4096, |slider| slider.logarithmic(true))
        .on_hover_text(texts::LOADS_HELP);
    let zoom = ui.ctx().zoom_factor();
    ui.label(texts::UI_SCALE).on_hover_text(texts::UI_SCALE_HELP);
    let now = texts::UI_SCALES.iter().position(|(scale, _)| (scale - zoom).abs() < 0.01);
    let clicked = choice(ui, &texts::UI_SCALES.map(|(_, name)| name), now.unwrap_or(usize::MAX));
    if let Some((scale, _)) = clicked.and_then(|at| texts::UI_SCALES.get(at)) {
        ui.ctx().set_zoom_factor(*scale);
    }
}

/// Draws the switches of the debug views.
#[cfg(feature = "debug")]
pub fn debug(ui: &mut Ui, debug: &mut crate::debug::BurrowDebug) {
    section(ui, texts::DEBUG, false, |ui| {
        for view in crate::debug::DebugView::ALL {
            super::widgets::switch(ui, view.name(), debug.switch(view));
        }
        slider(ui, texts::REACH, &mut debug.radius, 8.0..=512.0, |slider| {
            slider.logarithmic(true).suffix(" m")
        });
        slider(ui, texts::NEAR, &mut debug.near, 4.0..=64.0, |slider| slider.logarithmic(true).suffix(" m"))
            .on_hover_text(texts::NEAR_HELP);
    });
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn percentiles_stand_in_the_order_of_their_names() {
        let mut times = Times::default();
        assert_eq!(percentiles(&times), "-, -, -");
        (1..=100).for_each(|number| times.push(Duration::from_micros(10 * number)));
        assert_eq!(percentiles(&times), "500 µs, 950 µs, 990 µs");
    }
}
