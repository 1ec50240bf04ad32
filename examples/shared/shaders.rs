//! What waits for its shader is not drawn. Examples and tests have this in common; each takes it in by its path.

use bevy::app::App;
use bevy::render::RenderApp;
use bevy::render::render_resource::PipelineCache;

/// Is something left out of pictures, because its shader is still on its way?
pub fn are_missing(app: &App) -> bool {
    let render = app.get_sub_app(RenderApp);
    let pipelines = render.and_then(|render| render.world().get_resource::<PipelineCache>());
    pipelines.is_some_and(|pipelines| pipelines.waiting_pipelines().next().is_some())
}
