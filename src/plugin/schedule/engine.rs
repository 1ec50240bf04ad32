//! Maintenance of the engines that terrains run on.

use std::time::Duration;

use bevy::platform::time::Instant;
use bevy::prelude::*;

use crate::backend::{Engine, EngineState};
use crate::plugin::BurrowEngine;
use crate::terrain::Terrain;
use crate::threads::Threads;

/// How often engines free memory that they have not used lately.
const TRIMMED_EVERY: Duration = Duration::from_secs(30);

/// Whether it is time to trim engines again: a run condition.
pub(in crate::plugin) fn is_time_to_trim(mut last: Local<Option<Instant>>) -> bool {
    let is_time = last.get_or_insert_with(Instant::now).elapsed() >= TRIMMED_EVERY;
    if is_time {
        *last = Some(Instant::now());
    }
    is_time
}

/// Engines free memory at each transaction; this covers the time in which there are none.
pub(in crate::plugin) fn trim_engines(engine: Res<BurrowEngine>, terrains: Query<&Terrain>) {
    let own = terrains.iter().filter_map(Terrain::engine);
    let opened = own.chain([&engine.0]).filter(|engine| matches!(engine.state(), EngineState::Cuda(_)));
    let opened: Vec<Engine> = opened.cloned().collect();
    if !opened.is_empty() {
        Threads::Background.spawn(move || opened.iter().for_each(Engine::trim));
    }
}

/// Suggests the GPU that renders, if there are several.
#[cfg(feature = "render")]
pub(in crate::plugin) fn suggest_renderers_gpu(world: &World) {
    use bevy::render::renderer::RenderAdapterInfo;

    use crate::backend::GpuChoice;

    let place = world.get_resource::<RenderAdapterInfo>().map(|info| info.device_pci_bus_id.clone());
    let place = place.filter(|place| !place.is_empty());
    if let (Some(place), Some(engine)) = (place, world.get_resource::<BurrowEngine>()) {
        engine.suggest_gpu(GpuChoice::PciBusId(place));
    }
}
