//! The state of an engine: the device that it runs on, and why.

/// The device that an engine runs on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EngineState {
    /// The CPU.
    Cpu,
    /// The CPU; no transaction was large enough for a GPU yet.
    Unopened,
    /// The CPU, while a GPU is being opened.
    Opening,
    /// The GPU of this name, and the CPU.
    Cuda(String),
    /// The CPU, because the GPU can't be used, for this reason.
    Lost(String),
}
