//! The world on disk: prints a line for each commit, and for each revision that would survive a crash.

use std::path::Path;

use bevy::prelude::*;
use bevy_burrow::plugin::BurrowSystems;
use bevy_burrow::prelude::Terrain;
use bevy_burrow::store::{Store, StoreError, StoreOptions};

use crate::Options;
use crate::noise_ground::noise_ground;
use crate::output::{complain, say};

/// The world that is saved.
#[derive(Resource)]
pub struct Saving {
    store: Store,
    /// The last revision that was said to be durable.
    durable: Option<u64>,
}

/// Opens the world in a folder, or makes one of an untouched terrain.
pub fn open(folder: &Path, options: &Options, untouched: Terrain) -> Result<(Saving, Terrain)> {
    let (store, terrain) = if Store::is_in(folder) {
        let ground = noise_ground(options.side)?;
        let (store, opened) = Store::open(folder, ground, StoreOptions::default())?;
        opened.warnings.iter().for_each(|warning| complain(format_args!("server: {warning}")));
        (store, opened.terrain)
    } else {
        let mut terrain = untouched;
        (Store::create(folder, &mut terrain, StoreOptions::default())?, terrain)
    };
    Ok((Saving { store, durable: None }, terrain))
}

/// Saves commits, and prints a line for each.
pub fn add(app: &mut App, saving: Saving) {
    app.insert_resource(saving)
        .add_systems(Update, save.after(BurrowSystems::Commit))
        .add_systems(Last, end.run_if(on_message::<AppExit>));
}

fn save(mut saving: ResMut<Saving>, mut terrains: Query<&mut Terrain>) {
    for mut terrain in &mut terrains {
        if !terrain.has_log() {
            continue;
        }
        let records = terrain.take_log();
        // Others only say what rules hold.
        for record in records.iter().filter(|record| record.is_commit()) {
            say(format_args!(r#"{{"revision":{},"hash":"{:#018x}"}}"#, record.revision, record.hash));
        }
        let saved = match saving.store.append(records) {
            // Records are missing.
            Err(StoreError::Gap { .. }) => saving.store.append_whole(&terrain),
            other => other,
        };
        if let Err(why) = saved {
            complain(format_args!("server: {why}"));
        }
    }
    tell(&mut saving);
}

/// Prints the durable revision if it changed, and any warning.
fn tell(saving: &mut Saving) {
    let durable = saving.store.durable();
    if saving.durable != Some(durable) {
        saving.durable = Some(durable);
        say(format_args!(r#"{{"durable":{durable}}}"#));
    }
    let warnings = saving.store.take_warnings();
    warnings.iter().for_each(|warning| complain(format_args!("server: {warning}")));
}

/// Makes the last commits durable.
fn end(mut saving: ResMut<Saving>) {
    if let Err(why) = saving.store.checkpoint() {
        complain(format_args!("server: {why}"));
    }
    tell(&mut saving);
}
