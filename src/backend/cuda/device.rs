//! The interface of a device: memory, copies, launches. One implementation drives a GPU, another one an emulator
//! process for tests.

use std::ops::Range;
use std::time::Duration;

/// A fault that makes a device unusable.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// The driver's library is not installed.
    #[error("there is no CUDA driver")]
    NoDriver,
    /// There is a driver but no device.
    #[error("there is no CUDA device: {0}")]
    NoDevice(String),
    /// The device's compute capability is too low for the kernels.
    #[error("the device is of compute capability {0}.{1}, kernels need 7.5")]
    OldDevice(i32, i32),
    /// The driver rejects the kernels.
    #[error("the driver refuses the kernels: {0}")]
    Refused(String),
    /// The device's results differ from those of the CPU.
    #[error("the device failed its self-test")]
    SelfTest,
    /// Memory ran out.
    #[error("the device cannot allocate {0} bytes of memory")]
    Memory(usize),
    /// A transaction needs more memory than the device may use.
    #[error("a transaction needs more than the allowed {0} bytes of device memory")]
    Budget(usize),
    /// A transaction is larger than one launch can be.
    #[error("a transaction of {0} jobs is too large for one launch")]
    TooLarge(usize),
    /// A driver call failed.
    #[error("the device failed: {0}")]
    Failed(String),
}

impl Fault {
    /// Whether the device is fine and only this transaction is too large for it.
    pub(super) fn is_passing(&self) -> bool {
        matches!(self, Self::Memory(_) | Self::Budget(_) | Self::TooLarge(_))
    }
}

/// The result of a device call.
pub(super) type DeviceResult<T = ()> = Result<T, Fault>;

/// The kernels, numbered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kernel {
    /// Copies uploaded data to its destinations.
    Scatter,
    /// Applies edits to bricks.
    Edit,
    /// Meshes blocks.
    Mesh,
    /// Computes heights from noise.
    Heights,
    /// Applies edits to bricks, including stencil edits.
    StencilEdit,
    /// Computes distances to the surface of the samples next to it.
    SurfaceStart,
    /// Spreads distances to the surface.
    SurfaceSpread,
}

impl Kernel {
    /// All kernels, ordered by number.
    pub const ALL: [Self; 7] = [
        Self::Scatter,
        Self::Edit,
        Self::Mesh,
        Self::Heights,
        Self::StencilEdit,
        Self::SurfaceStart,
        Self::SurfaceSpread,
    ];

    /// The kernel's name in the CUDA source.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scatter => "scatter",
            Self::Edit => "edit",
            Self::Mesh => "mesh",
            Self::Heights => "heights",
            Self::StencilEdit => "stencil_edit",
            Self::SurfaceStart => "surface_start",
            Self::SurfaceSpread => "surface_spread",
        }
    }
}

/// Parameters of a kernel, which reads exactly this struct; see `layout.cuh`.
pub(super) trait KernelParams: bytemuck::Pod {
    /// The kernel that takes these parameters.
    const KERNEL: Kernel;
}

/// A kernel with its parameters. It can only be built from [`KernelParams`], so kernel and parameters always match.
#[derive(Clone, Copy)]
pub(super) struct Launch<'a> {
    kernel: Kernel,
    blocks: u32,
    params: &'a [u8],
}

impl<'a> Launch<'a> {
    /// A launch of the kernel for these parameters, one block per job.
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

/// Host memory for copies to and from a device.
pub(super) trait HostMemory: Send + Sync {
    /// All bytes. Do not read them between the start of a copy into them and the next [`Device::wait`].
    fn bytes(&self) -> &[u8];

    /// A range of its bytes, or `None` if out of bounds. May be read once a [`Mark`] that was placed after a copy
    /// into them has passed.
    fn bytes_of(&self, range: Range<usize>) -> Option<&[u8]>;

    /// All bytes, for writing.
    fn bytes_mut(&mut self) -> &mut [u8];

    /// A range of its bytes for writing, or `None` if out of bounds. Copies to other ranges may be in flight.
    fn bytes_of_mut(&mut self, range: Range<usize>) -> Option<&mut [u8]>;

    /// Address for kernels, if they can access this memory without a copy.
    fn address(&self) -> Option<u64>;
}

/// A point in the device's queue of work.
pub(super) trait Mark: Send + Sync {
    /// Waits until all work queued before is done. May be called from any thread.
    fn wait(&self) -> Result<(), Fault>;
}

/// A device. Copies and launches are asynchronous and run in order. [`wait`](Self::wait) waits for all of them;
/// only then are all of their faults known.
pub(super) trait Device: Send {
    /// The name of the hardware.
    fn name(&self) -> String;

    /// Approximate number of bytes that could still be allocated.
    fn free_memory(&mut self) -> usize;

    /// Allocates memory on the device.
    fn alloc(&mut self, bytes: usize) -> Result<u64, Fault>;

    /// Frees memory on the device. An address that is not allocated is ignored.
    fn free(&mut self, address: u64);

    /// Allocates host memory.
    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault>;

    /// Copies a range of host memory to a device address.
    ///
    /// # Safety
    /// `to` must have room for the bytes in one allocation, and they must not be written before the next
    /// [`wait`](Self::wait).
    unsafe fn upload(&mut self, from: &dyn HostMemory, bytes: Range<usize>, to: u64) -> DeviceResult;

    /// Copies from a device address to a range of host memory.
    ///
    /// # Safety
    /// `from` must have as many bytes in one allocation. The range must be neither read nor written before the next
    /// [`wait`](Self::wait) or before a later [`Mark`] has passed.
    unsafe fn download(&mut self, from: u64, to: &mut dyn HostMemory, bytes: Range<usize>) -> DeviceResult;

    /// Copies within device memory.
    ///
    /// # Safety
    /// Both addresses must have as many bytes in one allocation, and the two ranges must not overlap.
    unsafe fn copy(&mut self, from: u64, to: u64, bytes: usize) -> Result<(), Fault>;

    /// Launches a kernel.
    ///
    /// # Safety
    /// Each address in the parameters must have as many entries as the kernel reads or, up to the capacities in the
    /// parameters, writes. Until the next [`wait`](Self::wait) it must stay allocated, and host memory must not be
    /// accessed.
    unsafe fn launch(&mut self, launch: Launch<'_>) -> Result<(), Fault>;

    /// Places a mark at the current end of the queue.
    fn mark(&mut self) -> Result<Box<dyn Mark>, Fault>;

    /// Times of the work last waited for: from the first upload, and of the last kernel alone. Zero if unknown.
    fn times(&mut self) -> [Duration; 2] {
        [Duration::ZERO; 2]
    }

    /// Waits for all queued work.
    fn wait(&mut self) -> Result<(), Fault>;
}

/// Implements methods of [`Device`] by forwarding to the device in a field, as in `forward!(own: alloc free)`.
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
