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

/// What a call to a device gives.
pub(super) type DeviceResult<T = ()> = Result<T, Fault>;

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
    /// Applies edits to bricks, stencil edits among them.
    StencilEdit,
}

impl Kernel {
    /// All of them, in order of their numbers.
    pub const ALL: [Self; 5] = [Self::Scatter, Self::Edit, Self::Mesh, Self::Heights, Self::StencilEdit];

    /// Its name in the source.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scatter => "scatter",
            Self::Edit => "edit",
            Self::Mesh => "mesh",
            Self::Heights => "heights",
            Self::StencilEdit => "stencil_edit",
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

/// A device. Copies and launches are asynchronous and run in order; [`wait`](Self::wait) waits for all of them, and only then
/// are their faults certain to be known.
pub(super) trait Device: Send {
    /// The name of the hardware.
    fn name(&self) -> String;

    /// Bytes that could still be allocated, roughly.
    fn free_memory(&mut self) -> usize;

    /// Allocates memory on the device.
    fn alloc(&mut self, bytes: usize) -> Result<u64, Fault>;

    /// Frees memory on the device. An address that is not allocated is ignored.
    fn free(&mut self, address: u64);

    /// Allocates memory of the host.
    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault>;

    /// Copies some bytes of the host to an address.
    ///
    /// # Safety
    /// `to` must have room for them in one allocation, and they must not be written before the next [`wait`](Self::wait).
    unsafe fn upload(&mut self, from: &dyn HostMemory, bytes: Range<usize>, to: u64) -> DeviceResult;

    /// Copies from an address to some bytes of the host.
    ///
    /// # Safety
    /// `from` must be so many bytes of one allocation. The bytes must be neither read nor written before the next
    /// [`wait`](Self::wait), or before a later [`Mark`] has been waited for.
    unsafe fn download(&mut self, from: u64, to: &mut dyn HostMemory, bytes: Range<usize>) -> DeviceResult;

    /// Copies on the device.
    ///
    /// # Safety
    /// Both addresses must be so many bytes of an allocation, and the two ranges must not overlap.
    unsafe fn copy(&mut self, from: u64, to: u64, bytes: usize) -> Result<(), Fault>;

    /// Runs a kernel.
    ///
    /// # Safety
    /// Each address in the parameters must have as many entries as the kernel reads or, by the capacities in the parameters,
    /// writes; it must stay allocated, and memory of the host must not be accessed, before the next [`wait`](Self::wait).
    unsafe fn launch(&mut self, launch: Launch<'_>) -> Result<(), Fault>;

    /// Marks the current end of the queue.
    fn mark(&mut self) -> Result<Box<dyn Mark>, Fault>;

    /// The times of what was last waited for: from the first upload on, and the last kernel alone; zero if unknown.
    fn times(&mut self) -> [Duration; 2] {
        [Duration::ZERO; 2]
    }

    /// Waits until everything is done.
    fn wait(&mut self) -> Result<(), Fault>;
}

/// Methods of [`Device`] that pass their calls on to the device in a field, as in `forward!(own: alloc free)`.
macro_rules! forward {
    ($own:tt: $($method:ident)*) => { $(forward!(@$method $own);)* };
    (@name $own:tt) => { fn name(&self) -> String { self.$own.name() } };
    (@free_memory $own:tt) => { fn free_memory(&mut self) -> usize { self.$own.free_memory() } };
    (@alloc $own:tt) => { fn alloc(&mut self, bytes: usize) -> DeviceResult<u64> { self.$own.alloc(bytes) } };
    (@free $own:tt) => { fn free(&mut self, address: u64) { self.$own.free(address); } };
    (@alloc_host $own:tt) => {
        fn alloc_host(&mut self, bytes: usize) -> DeviceResult<Box<dyn HostMemory>> { self.$own.alloc_host(bytes) }
    };
    (@upload $own:tt) => {
        unsafe fn upload(&mut self, from: &dyn HostMemory, bytes: Range<usize>, to: u64) -> DeviceResult {
            // SAFETY: the caller promises the same.
            unsafe { self.$own.upload(from, bytes, to) }
        }
    };
    (@download $own:tt) => {
        unsafe fn download(&mut self, from: u64, to: &mut dyn HostMemory, bytes: Range<usize>) -> DeviceResult {
            // SAFETY: the caller promises the same.
            unsafe { self.$own.download(from, to, bytes) }
        }
    };
    (@copy $own:tt) => {
        unsafe fn copy(&mut self, from: u64, to: u64, bytes: usize) -> DeviceResult {
            // SAFETY: the caller promises the same.
            unsafe { self.$own.copy(from, to, bytes) }
        }
    };
    (@launch $own:tt) => {
        unsafe fn launch(&mut self, launch: Launch<'_>) -> DeviceResult {
            // SAFETY: the caller promises the same.
            unsafe { self.$own.launch(launch) }
        }
    };
    (@mark $own:tt) => { fn mark(&mut self) -> DeviceResult<Box<dyn Mark>> { self.$own.mark() } };
    (@times $own:tt) => { fn times(&mut self) -> [Duration; 2] { self.$own.times() } };
    (@wait $own:tt) => { fn wait(&mut self) -> DeviceResult { self.$own.wait() } };
}

pub(super) use forward;
