//! An app without a window, whose frames all take the same time. Shared by examples, which include this file by path.

#[path = "offscreen.rs"]
mod offscreen;
#[path = "photo.rs"]
pub mod photo;

use std::path::Path;
use std::time::Duration;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use photo::Photographer;

/// Time from frame to frame.
pub const FRAME: Duration = Duration::from_micros(15_625);

/// Bevy's plugins and what `add` adds, after the first frame; and a photographer with its camera, if there is a graphics
/// adapter.
pub fn build(size: (u32, u32), add: impl FnOnce(&mut App)) -> Result<(App, Option<Photographer>)> {
    let renderer = offscreen::find_renderer();
    let renders = renderer.is_some();
    if !renders {
        println!("no graphics adapter: there will be no pictures");
    }
    let mut app = offscreen::build(renderer, add);
    app.update();
    let world = app.world_mut();
    let camera = world.query_filtered::<Entity, With<Camera3d>>().single(world)?;
    let photographer = renders.then(|| Photographer::new(&mut app, camera, size));
    Ok((app, photographer))
}

/// Takes a picture. Time stands still meanwhile.
pub fn shoot(app: &mut App, photographer: &Photographer, path: &Path) -> Result {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    let shot = photographer.shoot(app, path);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(FRAME));
    shot
}

/// Prints a report, and saves it in a folder.
pub fn save_report(report: &serde_json::Value, folder: &Path) -> Result {
    let text = serde_json::to_string_pretty(report)?;
    println!("{text}");
    let path = folder.join("report.json");
    std::fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(())
}
