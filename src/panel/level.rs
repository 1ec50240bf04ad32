//! Saves and loads levels in tasks.

use std::path::PathBuf;

use bevy::prelude::*;

use super::open_level::{Files, LevelState};
use super::state::{BurrowPanel, Note, PanelAction};
use super::texts;
use crate::format::Level;
use crate::store::StoreError;
use crate::terrain::{Terrain, TerrainError, TerrainSettings, WorldParts};
use crate::threads::{ThreadTask, Threads};

/// A level on its way.
#[derive(Resource)]
pub(super) enum LevelTask {
    /// The state that is saved, and where.
    Save(ThreadTask<Result<(), StoreError>>, PathBuf, Entity, LevelState),
    /// The terrain whose place the level takes, and where it is from.
    Load(ThreadTask<Result<Terrain, String>>, Entity, PathBuf),
    New(ThreadTask<Result<Terrain, TerrainError>>, Entity),
}

/// Whether a task may start: only one runs at a time.
fn begin(panel: &mut BurrowPanel, files: &mut Files, text: &str) -> bool {
    if files.is_busy {
        panel.report(Err(texts::STILL_BUSY.into()));
        return false;
    }
    files.is_busy = true;
    panel.note = Some(Note::Busy(text.into()));
    true
}

/// Starts to save a terrain as a level.
pub(super) fn save(
    commands: &mut Commands,
    (panel, files): (&mut BurrowPanel, &mut Files),
    (entity, terrain): (Entity, &Terrain),
    folder: PathBuf,
) {
    if !begin(panel, files, texts::SAVING) {
        return;
    }
    let (state, path) = (LevelState::of(terrain), folder.clone());
    let (world, edit_settings) = (terrain.snapshot(), terrain.edit_settings().clone());
    let voxel_size = terrain.voxel_size();
    let task = ThreadTask::start(Threads::Background, move || {
        let level = Level::of_parts(WorldParts::of(&world, edit_settings), voxel_size, &world);
        // While a snapshot is held, commits have to copy the world's index.
        drop(world);
        level.save(&path).map(drop)
    });
    commands.insert_resource(LevelTask::Save(task, folder, entity, state));
}

/// Starts to load a level over the ground of a terrain.
pub(super) fn load(
    commands: &mut Commands,
    (panel, files): (&mut BurrowPanel, &mut Files),
    (entity, terrain): (Entity, &Terrain),
) {
    let (ground, folder) = (terrain.world().shared_ground(), panel.level.clone());
    let path = folder.clone();
    if !begin(panel, files, texts::OPENING) {
        return;
    }
    let load = move || {
        let level = Level::load(&path, &ground).map_err(|why| why.to_string())?;
        if level.ground != ground.hash() {
            return Err(texts::OTHER_GROUND.to_owned());
        }
        level.terrain(ground).map_err(|why| why.to_string())
    };
    commands.insert_resource(LevelTask::Load(ThreadTask::start(Threads::Background, load), entity, folder));
}

/// Starts again from the ground of a terrain, with its rules.
pub(super) fn renew(
    commands: &mut Commands,
    (panel, files): (&mut BurrowPanel, &mut Files),
    (entity, terrain): (Entity, &Terrain),
) {
    let ground = terrain.world().shared_ground();
    let chunk_size = terrain.world().grid().size().unsigned_abs();
    let settings = TerrainSettings { voxel_size: terrain.voxel_size(), chunk_size };
    let rules = terrain.rules().cloned().unwrap_or_default();
    if !begin(panel, files, texts::OPENING) {
        return;
    }
    let make = move || {
        let mut terrain = Terrain::new(ground, &settings)?;
        // They were valid before.
        let _ = terrain.set_rules(rules);
        Ok(terrain)
    };
    commands.insert_resource(LevelTask::New(ThreadTask::start(Threads::Background, make), entity));
}

/// Installs a loaded level, and reports the result.
pub(super) fn finish(
    mut commands: Commands,
    task: Option<ResMut<LevelTask>>,
    mut panel: ResMut<BurrowPanel>,
    mut files: ResMut<Files>,
    mut actions: MessageWriter<PanelAction>,
) {
    let Some(mut task) = task else { return };
    let note = match &mut *task {
        LevelTask::Save(task, folder, entity, state) => {
            let Some(outcome) = task.finish() else { return };
            outcome.map_err(|why| why.to_string()).map(|()| {
                files.note_saved(folder.clone(), *entity, state.clone());
                actions.write_batch(files.take_next());
                texts::saved(folder.display())
            })
        }
        LevelTask::Load(task, entity, folder) => {
            let Some(outcome) = task.finish() else { return };
            outcome.map(|terrain| {
                commands.entity(*entity).try_insert(terrain);
                // Nothing is saved in a packed file.
                files.note_opened(*entity, Some(folder.clone()).filter(|folder| folder.is_dir()));
                texts::opened(folder.display())
            })
        }
        LevelTask::New(task, entity) => {
            let Some(outcome) = task.finish() else { return };
            outcome.map_err(|why| why.to_string()).map(|terrain| {
                commands.entity(*entity).try_insert(terrain);
                files.note_opened(*entity, None);
                texts::STARTED_ANEW.into()
            })
        }
    };
    commands.remove_resource::<LevelTask>();
    files.is_busy = false;
    if note.is_err() {
        files.forget_next();
    }
    panel.note = Some(note.map_or_else(Note::Bad, Note::Good));
}
