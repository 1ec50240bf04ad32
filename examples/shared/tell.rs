//! Lines on standard output for a program that drives an example. Shared by examples, which include this file by path.

use bevy::prelude::*;
use bevy::render::render_resource::PipelineCache;
use bevy::render::{Render, RenderApp, RenderSystems};

/// Prints the number of pipelines that are still being compiled; until it is 0, pictures are incomplete.
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

/// Prints the last line of a frame.
pub fn tell_frame() {
    println!("frame");
}
