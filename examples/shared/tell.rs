//! What any example tells a program that plays it, on standard output. Each takes this in by its path.

use bevy::prelude::*;
use bevy::render::render_resource::PipelineCache;
use bevy::render::{Render, RenderApp, RenderSystems};

/// Tells how many pipelines are still being compiled: until there are none, something is missing in the picture.
pub fn tell_pipelines(app: &mut App) {
    if let Some(renderer) = app.get_sub_app_mut(RenderApp) {
        renderer.add_systems(Render, count_pipelines.in_set(RenderSystems::Cleanup));
    }
}

fn count_pipelines(pipelines: Res<PipelineCache>, mut last: Local<Option<usize>>) {
    let now = pipelines.waiting_pipelines().count();
    if last.replace(now) != Some(now) {
        println!("pipelines {now}");
    }
}

/// The last line of a frame.
pub fn tell_frame() {
    println!("frame");
}
