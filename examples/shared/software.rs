//! Detects software rendering. Shared by examples, which include this file by path.

use bevy::render::renderer::RenderAdapterInfo;

/// Whether the CPU renders. Expensive effects are then left out. (Bevy does not re-export the type of `device_type`.)
pub fn draws_in_software(adapter: Option<&RenderAdapterInfo>) -> bool {
    adapter.is_some_and(|adapter| format!("{:?}", adapter.device_type) == "Cpu")
}
