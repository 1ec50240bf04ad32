//! The app without a window.

use std::time::Duration;

use bevy::prelude::*;
use bevy::render::settings::RenderResources;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::prelude::*;

use crate::offscreen;
use crate::ui::settings::SettingsFile;

/// The script's time from frame to frame.
const FRAME: Duration = Duration::from_nanos(1_000_000_000 / 60);

/// The game's app, ready for its first frame: `update` runs one frame of a sixtieth of a second.
pub fn build_app(renderer: Option<RenderResources>, engine: BurrowEngine) -> App {
    offscreen::build(renderer, |app| {
        app.insert_resource(TimeUpdateStrategy::ManualDuration(FRAME));
        crate::game(app, engine, SettingsFile::default());
    })
}
