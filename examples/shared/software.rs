//! Is there a graphics card? Examples ask it in common; each takes it in by its path.

use bevy::render::renderer::RenderAdapterInfo;

/// Does the processor draw? Then all that is dear is left out. (Bevy does not re-export the type that tells.)
pub fn draws_in_software(adapter: Option<&RenderAdapterInfo>) -> bool {
    adapter.is_some_and(|adapter| format!("{:?}", adapter.device_type) == "Cpu")
}
