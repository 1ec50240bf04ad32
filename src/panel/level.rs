//! Saves and loads levels in tasks.

use std::path::PathBuf;

use bevy::prelude::*;

use super::open_level::Files;
use super::state::{BurrowPanel, Note, PanelAction};
use super::texts;
use crate::format::Level;
use crate::store::{StoreError, load_level, save_level};
use crate::terrain::{Terrain, TerrainError, TerrainSettings};
use crate::threads::{ThreadTask, Threads};
use crate::volume::DiggingRules;

/// A level on its way.
#[derive(Resource)]
pub(super) enum LevelTask {
    /// The state that is saved, and where.
    Save(ThreadTask<Result<(), StoreError>>, PathBuf, (Entity, u64, DiggingRules)),
    /// The terrain whose place the level takes, and where it is from.
    Load(ThreadTask<Result<Terrain, StoreError>>, Entity, PathBuf),
    New(ThreadTask<Result<Terrain, TerrainError>>, Entity),
}

/// Starts to save a terrain as a level.
pub(super) fn save(
    commands: &mut Commands,
    panel: &mut BurrowPanel,
    (entity, terrain): (Entity, &Terrain),
    folder: PathBuf,
) {
    let (level, path) = (Level::of(terrain), folder.clone());
    let state = (entity, terrain.world().hash(), terrain.rules().cloned().unwrap_or_default());
    panel.note = Some(Note::Busy(texts::SAVING.into()));
    let task = ThreadTask::start(Threads::Background, move || save_level(&path, &level).map(drop));
    commands.insert_resource(LevelTask::Save(task, folder, state));
}

/// Starts to load a level over the ground of a terrain.
pub(super) fn load(commands: &mut Commands, panel: &mut BurrowPanel, (entity, terrain): (Entity, &Terrain)) {
    let (ground, folder) = (terrain.world().shared_ground(), panel.level.clone());
    let path = folder.clone();
    panel.note = Some(Note::Busy(texts::OPENING.into()));
    let load = move || Ok(load_level(&path, &ground)?.terrain(ground)?);
    commands.insert_resource(LevelTask::Load(ThreadTask::start(Threads::Background, load), entity, folder));
}

/// Starts again from the ground of a terrain, with its rules.
pub(super) fn renew(commands: &mut Commands, panel: &mut BurrowPanel, (entity, terrain): (Entity, &Terrain)) {
    let ground = terrain.world().shared_ground();
    let chunk_size = terrain.world().grid().size().unsigned_abs();
    let settings = TerrainSettings { voxel_size: terrain.voxel_size(), chunk_size };
    let rules = terrain.rules().cloned().unwrap_or_default();
    panel.note = Some(Note::Busy(texts::OPENING.into()));
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
        LevelTask::Save(task, folder, (entity, hash, rules)) => {
            let Some(outcome) = task.finish() else { return };
            outcome.map_err(|why| why.to_string()).map(|()| {
                files.note_saved(folder.clone(), *entity, *hash, rules.clone());
                // What waited for it is asked about again if the terrain changed meanwhile.
                files.is_unsaved = false;
                actions.write_batch(files.take_next());
                texts::saved(folder.display())
            })
        }
        LevelTask::Load(task, entity, folder) => {
            let Some(outcome) = task.finish() else { return };
            outcome.map_err(|why| why.to_string()).map(|terrain| {
                commands.entity(*entity).try_insert(terrain);
                files.note_opened(Some(folder.clone()));
                texts::opened(folder.display())
            })
        }
        LevelTask::New(task, entity) => {
            let Some(outcome) = task.finish() else { return };
            outcome.map_err(|why| why.to_string()).map(|terrain| {
                commands.entity(*entity).try_insert(terrain);
                files.note_opened(None);
                texts::STARTED_ANEW.into()
            })
        }
    };
    commands.remove_resource::<LevelTask>();
    if note.is_err() {
        files.forget_next();
    }
    panel.note = Some(note.map_or_else(Note::Bad, Note::Good));
}
