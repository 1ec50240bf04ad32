//! What the host asks of a device: memory, copies, launches. One implementation drives a card, another one a process that
//! stands for it in tests.

use std::ops::Range;
use std::time::Duration;

/// Why a device can't be used, or can't be used any longer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// The driver's library is not installed.
    #[error("there is no CUDA driver")]
    NoDriver,
    /// There is a driver and no card.
    #[error("there is no CUDA device: {0}")]
    NoDevice(String),
    /// The card is older than the kernels.
    #[error("the device is of compute capability {0}.{1}, kernels need 7.5")]
    OldDevice(i32, i32),
    /// The driver does not take the kernels.
    #[error("the driver refuses the kernels: {0}")]
    Refused(String),
    /// What the device computes is not what the processor does.
    #[error("the device failed its self-test")]
    SelfTest,
    /// Memory ran out.
    #[error("the device has no {0} bytes of memory left")]
    Memory(usize),
    /// A transaction needs more memory than the device may use.
    #[error("a transaction needs more than the {0} bytes that the device may use")]
    Budget(usize),
    /// A transaction is larger than one launch can be.
    #[error("a transaction of {0} jobs is more than one launch can do")]
    TooLarge(usize),
    /// A call failed.
    #[error("the device failed: {0}")]
    Failed(String),
}

impl Fault {
    /// Is the device fine, and only this transaction too large for it?
    pub(super) fn is_passing(&self) -> bool {
        matches!(self, Self::Memory(_) | Self::Budget(_) | Self::TooLarge(_))
    }
}

/// A kernel, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kernel {
    /// Copies pieces of memory to many places.
    Scatter,
    /// Applies edits to bricks.
    Edit,
    /// Meshes blocks.
    Mesh,
    /// Makes heights of noise.
    Heights,
    /// Applies edits to bricks, among them such as look around.
    Careful,
}

impl Kernel {
    /// All of them, in order of their numbers.
    pub const ALL: [Self; 5] = [Self::Scatter, Self::Edit, Self::Mesh, Self::Heights, Self::Careful];

    /// Its name in the source.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scatter => "scatter",
            Self::Edit => "edit",
            Self::Mesh => "mesh",
            Self::Heights => "heights",
            Self::Careful => "careful",
        }
    }
}

/// A kernel's parameters. The kernel reads exactly this struct, see `layout.cuh`.
pub(super) trait KernelParams: bytemuck::Pod {
    /// The kernel that takes them.
    const KERNEL: Kernel;
}

/// A kernel and its parameters. Only made from [`KernelParams`], so a kernel is never launched with another's.
#[derive(Clone, Copy)]
pub(super) struct Launch<'a> {
    kernel: Kernel,
    blocks: u32,
    params: &'a [u8],
}

impl<'a> Launch<'a> {
    /// Launches the kernel of these parameters, a block for each of its jobs.
    pub fn new<P: KernelParams>(blocks: u32, params: &'a P) -> Self {
        Self { kernel: P::KERNEL, blocks, params: bytemuck::bytes_of(params) }
    }

    pub const fn kernel(self) -> Kernel {
        self.kernel
    }

    pub const fn blocks(self) -> u32 {
        self.blocks
    }

    /// The bytes of the parameters.
    pub const fn params(self) -> &'a [u8] {
        self.params
    }
}

/// Memory of the host that a device copies from and to.
pub(super) trait HostMemory: Send + Sync {
    /// Its bytes. Not to be looked at between the start of a copy and the next [`Device::wait`].
    fn bytes(&self) -> &[u8];

    /// Some of its bytes. Of a copy that was asked for before a [`Mark`], they may be looked at once that is passed.
    fn bytes_of(&self, range: Range<usize>) -> Option<&[u8]>;

    /// Its bytes, to be written.
    fn bytes_mut(&mut self) -> &mut [u8];

    /// Some of its bytes, to be written while copies to others may be under way.
    fn bytes_of_mut(&mut self, range: Range<usize>) -> Option<&mut [u8]>;

    /// Where kernels find it, if they can read and write it without a copy.
    fn address(&self) -> Option<u64>;
}

/// A place in what a device was asked for.
pub(super) trait Mark: Send + Sync {
    /// Waits until all that was asked for before is done. From any thread.
    fn wait(&self) -> Result<(), Fault>;
}

/// A device. Copies and launches happen in the order in which they are asked for, and later: [`wait`](Self::wait) waits for
/// all of them, and only then their faults are certain to be known.
pub(super) trait Device: Send {
    /// Who it is.
    fn name(&self) -> String;

    /// Bytes that could still be allocated, roughly.
    fn free_memory(&mut self) -> usize;

    /// Memory on the device.
    fn alloc(&mut self, bytes: usize) -> Result<u64, Fault>;

    /// Gives memory back.
    fn free(&mut self, address: u64);

    /// Memory of the host.
    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault>;

    /// Copies some bytes of the host to an address.
    fn upload(&mut self, from: &dyn HostMemory, bytes: Range<usize>, to: u64) -> Result<(), Fault>;

    /// Copies from an address to some bytes of the host.
    fn download(&mut self, from: u64, to: &mut dyn HostMemory, bytes: Range<usize>) -> Result<(), Fault>;

    /// Copies on the device.
    fn copy(&mut self, from: u64, to: u64, bytes: usize) -> Result<(), Fault>;

    /// Runs a kernel.
    fn launch(&mut self, launch: Launch<'_>) -> Result<(), Fault>;

    /// Marks what was asked for up to now.
    fn mark(&mut self) -> Result<Box<dyn Mark>, Fault>;

    /// Of what was last waited for: how long it took from the first upload on, and the last kernel alone; zero where nobody
    /// knows.
    fn times(&mut self) -> [Duration; 2] {
        [Duration::ZERO; 2]
    }

    /// Waits until everything is done.
    fn wait(&mut self) -> Result<(), Fault>;
}
