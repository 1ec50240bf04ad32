//! An app for unit tests of what follows commits.

use std::time::{Duration, Instant};

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;

use crate::brush::Brush;
use crate::plugin::BurrowSettings;
use crate::terrain::{Terrain, World};

/// An app with meshes and without anything that draws them, to which the plugins under test are added.
pub(crate) fn meshes_only() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin));
    app
}

/// Runs frames until this is so.
pub(crate) fn run_until(app: &mut App, is_so: impl Fn(&App) -> bool) {
    let start = Instant::now();
    while !is_so(app) {
        assert!(start.elapsed() < Duration::from_secs(60), "it never came");
        app.update();
        std::thread::sleep(Duration::from_millis(1));
    }
}

pub(crate) fn model(app: &App, terrain: Entity) -> &World {
    app.world().get::<Terrain>(terrain).expect("it is there").world()
}

/// Sends two brushes to a pristine terrain so that both are committed in the same frame: the first in the frame after
/// its own, in which the second begins and ends.
pub(crate) fn commit_two_in_a_frame(app: &mut App, terrain: Entity, brushes: [Brush; 2]) {
    for (brush, seconds) in brushes.into_iter().zip([0, 60]) {
        app.world_mut().resource_mut::<BurrowSettings>().same_frame = Duration::from_secs(seconds);
        app.world_mut().write_message(brush).expect("the plugin added it");
        app.update();
    }
    run_until(app, |app| model(app, terrain).revision() > 0);
    assert_eq!(model(app, terrain).revision(), 2, "both are committed in one frame");
}
