//! Settings of an engine.

use super::Backend;

/// Which CUDA card an engine opens.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum CardChoice {
    /// The one that was [suggested](super::Engine::suggest_card), such as the renderer's own, where CUDA knows it; else the
    /// first.
    #[default]
    Default,
    /// By its number, as CUDA counts cards: from 0, and only those that `CUDA_VISIBLE_DEVICES` lets through.
    Ordinal(u32),
    /// By its UUID, as `nvidia-smi -L` lists them, or as Vulkan has it in `VkPhysicalDeviceIDProperties::deviceUUID`.
    Uuid([u8; 16]),
    /// By its place on the PCI bus, `domain:bus:device.function` in hexadecimal, such as `0000:01:00.0`; wgpu has it in
    /// `AdapterInfo::device_pci_bus_id`, on Vulkan and DirectX 12.
    PciBusId(String),
}

/// What an [`Engine`](super::Engine) may run on.
///
/// ```
/// use bevy_burrow::backend::{CardChoice, Engine, EngineSettings};
///
/// let settings = EngineSettings { card: CardChoice::Ordinal(1), ..EngineSettings::default() };
/// let engine = Engine::with_settings(&settings);
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct EngineSettings {
    /// Processor, card, or the faster of both.
    pub backend: Backend,
    /// Which card; a card that is not there is given up like one that fails.
    pub card: CardChoice,
    /// Most bytes of the card's memory. Half of it may be bricks and ground, which stay there from one transaction to the
    /// next. `None` is a quarter of what is free when the card is opened, and 2 GiB at most.
    pub device_memory: Option<usize>,
    /// Most bytes of pinned memory of the host, through which all goes to the card and back. A transaction that needs more,
    /// of either, is the processor's. 1 GiB by default.
    pub pinned_memory: usize,
}

impl Default for EngineSettings {
    fn default() -> Self {
        Self {
            backend: Backend::Auto,
            card: CardChoice::Default,
            device_memory: None,
            pinned_memory: 1 << 30,
        }
    }
}
