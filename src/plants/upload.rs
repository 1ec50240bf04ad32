//! The buffers of plants, and how what changed in them is written to the GPU: some hundred bytes for a dig, some
//! thousand for a patch.

use bevy::asset::{AssetId, RenderAssetUsages};
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::renderer::RenderQueue;
use bevy::render::storage::{GpuShaderBuffer, ShaderBuffer};
use bevy::render::{ExtractSchedule, MainWorld, Render, RenderApp, RenderSystems};

use super::slots::{Bytes, Slots};

/// The buffers with all plants that are drawn.
#[derive(Resource)]
pub(super) struct PlantBuffers {
    pub slots: Slots,
    pub records: Handle<ShaderBuffer>,
    pub gone: Handle<ShaderBuffer>,
    /// Slots that the buffers have room for.
    pub room: usize,
}

impl FromWorld for PlantBuffers {
    fn from_world(world: &mut World) -> Self {
        let mut buffers = world.resource_mut::<Assets<ShaderBuffer>>();
        let mut empty = || buffers.add(ShaderBuffer::new(&[0; 16], RenderAssetUsages::RENDER_WORLD));
        let (records, gone) = (empty(), empty());
        Self { slots: Slots::default(), records, gone, room: 0 }
    }
}

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
