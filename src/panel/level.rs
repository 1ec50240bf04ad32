//! Saves and loads levels in tasks.

use std::path::PathBuf;

use bevy::prelude::*;

use super::state::{BurrowPanel, Note};
use crate::plugin::{ThreadTask, Threads};
use crate::store::{Level, StoreError, load_level, save_level};
use crate::terrain::Terrain;

/// A level on its way, and the terrain whose place it takes, if it is loaded.
#[derive(Resource)]
pub(super) struct LevelTask(ThreadTask<Result<Option<Terrain>, StoreError>>, Option<Entity>, PathBuf);

/// Starts to save a terrain as a level.
pub(super) fn save(commands: &mut Commands, panel: &mut BurrowPanel, terrain: &Terrain) {
    let (level, folder) = (Level::of(terrain), panel.level.clone());
    panel.note = Some(Note::Busy("saving the level ...".into()));
    let path = folder.clone();
    let save = move || save_level(&path, &level).map(|()| None);
    commands.insert_resource(LevelTask(ThreadTask::start(Threads::Background, save), None, folder));
}

/// Starts to load a level over the ground of a terrain.
pub(super) fn load(commands: &mut Commands, panel: &mut BurrowPanel, (entity, terrain): (Entity, &Terrain)) {
    let (ground, folder) = (terrain.world().shared_ground(), panel.level.clone());
    panel.note = Some(Note::Busy("loading the level ...".into()));
    let path = folder.clone();
    let load = move || Ok(Some(load_level(&path, &ground)?.terrain(ground)?));
    commands.insert_resource(LevelTask(ThreadTask::start(Threads::Background, load), Some(entity), folder));
}

/// Puts a level that was loaded in place, and tells what came of it.
pub(super) fn finish(
    mut commands: Commands,
    task: Option<ResMut<LevelTask>>,
    mut panel: ResMut<BurrowPanel>,
) {
    let Some(mut task) = task else { return };
    let Some(outcome) = task.0.finish() else { return };
    commands.remove_resource::<LevelTask>();
    let folder = task.2.display();
    panel.note = Some(match outcome {
        Ok(None) => Note::Good(format!("the level is saved in {folder}")),
        Ok(Some(terrain)) => {
            if let Some(entity) = task.1 {
                commands.entity(entity).try_insert(terrain);
            }
            Note::Good(format!("the level of {folder} is loaded"))
        }
        Err(why) => Note::Bad(why.to_string()),
    });
}
