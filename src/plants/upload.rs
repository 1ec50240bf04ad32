//! Writes what changed in the buffers of plants to the GPU: some hundred bytes for a dig, some thousand for a patch.

use bevy::asset::AssetId;
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::renderer::RenderQueue;
use bevy::render::storage::{GpuShaderBuffer, ShaderBuffer};
use bevy::render::{ExtractSchedule, MainWorld, Render, RenderApp, RenderSystems};

use super::draw::PlantBuffers;
use super::slots::Bytes;

/// Changes are written to buffers in place. Without a renderer, nothing is written.
pub(super) fn build(app: &mut App) {
    if let Some(render) = app.get_sub_app_mut(RenderApp) {
        render
            .init_resource::<PendingWrites>()
            .add_systems(ExtractSchedule, extract)
            .add_systems(Render, write.in_set(RenderSystems::PrepareResources));
    }
}

/// Bytes that a buffer lacks.
struct PendingWrite {
    buffer: AssetId<ShaderBuffer>,
    /// The size of the buffer that lacks them. One of another size was made later, with all bytes that there were then.
    size: u64,
    bytes: Bytes,
}

#[derive(Resource, Default)]
struct PendingWrites(Vec<PendingWrite>);

fn extract(mut main: ResMut<MainWorld>, mut pending: ResMut<PendingWrites>) {
    let Some(mut buffers) = main.get_resource_mut::<PlantBuffers>() else { return };
    let buffers = buffers.bypass_change_detection();
    let [records, gone] = [buffers.records.id(), buffers.gone.id()];
    let sizes = buffers.slots.sizes();
    let changes = buffers.slots.take_changes();
    for ((buffer, size), changes) in [records, gone].into_iter().zip(sizes).zip(changes) {
        pending.0.retain(|write| write.buffer != buffer || write.size == size);
        pending.0.extend(changes.into_iter().map(|bytes| PendingWrite { buffer, size, bytes }));
    }
}

fn write(
    mut pending: ResMut<PendingWrites>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    queue: Res<RenderQueue>,
) {
    pending.0.retain(|write| {
        let Some(gpu) = buffers.get(write.buffer) else { return true };
        let is_there = gpu.buffer.size() == write.size;
        if is_there {
            queue.write_buffer(&gpu.buffer, write.bytes.offset, &write.bytes.bytes);
        }
        !is_there
    });
}
