//! Detects pending shaders, whose meshes are not drawn. Shared by examples and tests, which include this file by path.

use bevy::app::App;
use bevy::render::RenderApp;
use bevy::render::render_resource::PipelineCache;

/// Whether a picture would be incomplete, because a shader is still being compiled.
pub fn are_missing(app: &App) -> bool {
    let render = app.get_sub_app(RenderApp);
    let pipelines = render.and_then(|render| render.world().get_resource::<PipelineCache>());
    pipelines.is_some_and(|pipelines| pipelines.waiting_pipelines().next().is_some())
}
