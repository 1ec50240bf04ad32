//! An app without a window. Shared by examples, benchmarks and tests, which include this file by path.

use std::any::Any;
use std::panic;
use std::sync::atomic::{AtomicBool, Ordering};

use bevy::app::PluginsState;
use bevy::log::{Level, LogPlugin};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::renderer::initialize_renderer;
use bevy::render::settings::{RenderCreation, RenderResources, WgpuSettings};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;

/// A renderer without a window, if there is an adapter, possibly in software. Otherwise it prints the reason.
pub fn find_renderer() -> Option<RenderResources> {
    let settings = WgpuSettings::default();
    let backends = settings.backends?;
    // Without an adapter Bevy panics and prints a message; here that is an expected outcome.
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let found = panic::catch_unwind(|| bevy::tasks::block_on(initialize_renderer(backends, None, &settings)));
    panic::set_hook(hook);
    found.inspect_err(|panic| eprintln!("no renderer: {}", reason(&**panic))).ok()
}

/// The message of a panic.
fn reason(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no reason was given")
}

/// Bevy's plugins and what `add` adds, ready for the first frame. Without a renderer, the app runs but draws nothing.
pub fn build(renderer: Option<RenderResources>, add: impl FnOnce(&mut App)) -> App {
    let (render_creation, filter) = match renderer {
        Some(renderer) => (RenderCreation::Manual(renderer), ""),
        // A missing renderer is reported once by `find_renderer`, not by every plugin that needs it.
        None => {
            let settings = WgpuSettings { backends: None, ..default() };
            (settings.into(), "bevy_render=off,bevy_gizmos_render=off,bevy_gltf=off")
        }
    };
    let mut plugins = DefaultPlugins
        .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
        .set(RenderPlugin { render_creation, synchronous_pipeline_compilation: true, ..default() })
        .set(LogPlugin { level: Level::WARN, filter: filter.into(), ..default() })
        .disable::<WinitPlugin>()
        .disable::<PipelinedRenderingPlugin>();
    // A process has a single logger, which the first of its apps installs.
    static LOGS: AtomicBool = AtomicBool::new(false);
    if LOGS.swap(true, Ordering::Relaxed) {
        plugins = plugins.disable::<LogPlugin>();
    }
    let mut app = App::new();
    app.add_plugins(plugins);
    add(&mut app);
    while app.plugins_state() == PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
    app
}
