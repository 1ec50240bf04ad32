//! Settings of an engine: which GPU, and how much of its memory.

use super::Backend;

/// Selects the CUDA GPU that an engine opens.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum GpuChoice {
    /// The [suggested](super::Engine::suggest_gpu) GPU, such as the renderer's, if CUDA lists it; otherwise
    /// the first.
    #[default]
    Default,
    /// By CUDA's device ordinal, from 0; `CUDA_VISIBLE_DEVICES` applies.
    Ordinal(u32),
    /// By its UUID, as `nvidia-smi -L` lists them, or as Vulkan has it in `VkPhysicalDeviceIDProperties::deviceUUID`.
    Uuid([u8; 16]),
    /// By its address on the PCI bus, `domain:bus:device.function` in hexadecimal, such as `0000:01:00.0`;
    /// wgpu has it in `AdapterInfo::device_pci_bus_id`, on Vulkan and DirectX 12.
    PciBusId(String),
}

/// What an [`Engine`](super::Engine) may run on.
///
/// ```
/// use bevy_burrow::backend::{GpuChoice, Engine, EngineSettings};
///
/// let settings = EngineSettings { gpu: GpuChoice::Ordinal(1), ..EngineSettings::default() };
/// let engine = Engine::with_settings(&settings);
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct EngineSettings {
    /// CPU, GPU, or the faster of the two.
    pub backend: Backend,
    /// Selects the GPU. One that does not exist is treated like one that fails.
    pub gpu: GpuChoice,
    /// The maximum number of bytes of GPU memory. Up to half may hold bricks and ground, which stay there between
    /// transactions. `None`: a quarter of the memory that is free when the GPU is opened, at most 2 GiB.
    pub device_memory: Option<usize>,
    /// The maximum number of bytes of pinned host memory, through which all data passes to the GPU and back. A
    /// transaction that needs more of either runs on the CPU. 1 GiB by default.
    pub pinned_memory: usize,
}

impl Default for EngineSettings {
    fn default() -> Self {
        Self { backend: Backend::Auto, gpu: GpuChoice::Default, device_memory: None, pinned_memory: 1 << 30 }
    }
}
