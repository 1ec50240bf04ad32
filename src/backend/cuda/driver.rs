//! A GPU, accessed through the CUDA driver.
//!
//! Outside of tests, all unsafe code of the crate is in this module and its siblings that copy and launch.
//! Addresses come from the driver and are passed only to it. Kernels stay within the capacities in their
//! parameters.

use std::ffi::{CString, c_void};
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use cudarc::driver::sys::{self, CUfunction};
use cudarc::driver::{CudaContext, CudaEvent, CudaStream, DriverError, result};

use rustc_hash::FxHashSet;
use web_time::Instant;

use super::device::{Device, DeviceResult, Fault, HostMemory, Kernel, Launch, Mark};
use super::layout::THREADS;
use crate::backend::GpuChoice;

/// The kernels as PTX, compiled in advance.
const PTX: &str = include_str!("kernels.ptx");

/// Launches with at least this many blocks are timed. For smaller ones, timing costs more than it is worth.
const TIMED: u32 = 64;

/// A GPU with the kernels loaded.
pub(super) struct Gpu {
    context: Arc<CudaContext>,
    stream: Arc<CudaStream>,
    /// Recorded at the end of the work to wait for.
    done: CudaEvent,
    /// Recorded before the first upload and before a long launch.
    marks: [CudaEvent; 2],
    is_begun: bool,
    /// Whether the last launch was timed.
    is_timed: bool,
    module: sys::CUmodule,
    kernels: [CUfunction; Kernel::ALL.len()],
    /// Device memory that is not freed yet. The context may outlive this struct, as it is shared by the whole
    /// process.
    allocated: FxHashSet<u64>,
}

// SAFETY: the module and its functions belong to the context, which any thread may use once it is bound there.
// Every method binds it first.
unsafe impl Send for Gpu {}

/// Converts a driver error. Call only when the driver is known to be loaded.
fn failed(error: DriverError) -> Fault {
    let name = error.error_name().map_or("unknown error".into(), |name| name.to_string_lossy().into_owned());
    Fault::Failed(name)
}

/// Converts an error of an allocation of this size.
fn no_memory(bytes: usize) -> impl Fn(DriverError) -> Fault {
    move |error| match error.0 {
        sys::CUresult::CUDA_ERROR_OUT_OF_MEMORY => Fault::Memory(bytes),
        _ => failed(error),
    }
}

/// Converts an error of the search for a device.
fn no_device(error: DriverError) -> Fault {
    match failed(error) {
        Fault::Failed(name) => Fault::NoDevice(name),
        fault => fault,
    }
}

/// The device ordinal of a GPU, or `None` if CUDA does not list it. Call only when the driver is known to be
/// loaded.
fn number_of(gpu: &GpuChoice) -> Result<Option<usize>, Fault> {
    // Report missing devices before anything else.
    let count = CudaContext::device_count().map_err(no_device)?;
    let find = |is: &dyn Fn(sys::CUdevice) -> Result<bool, Fault>| {
        for number in 0..count {
            if is(result::device::get(number).map_err(no_device)?)? {
                return Ok(Some(number as usize));
            }
        }
        Ok(None)
    };
    match gpu {
        GpuChoice::Default => Ok((count > 0).then_some(0)),
        GpuChoice::Ordinal(number) => Ok((i64::from(*number) < i64::from(count)).then_some(*number as usize)),
        GpuChoice::Uuid(uuid) => find(&|device| {
            let own = result::device::get_uuid(device).map_err(no_device)?;
            Ok(own.bytes.map(|byte| byte as u8) == *uuid)
        }),
        GpuChoice::PciBusId(id) => {
            let Ok(id) = CString::new(id.as_str()) else { return Ok(None) };
            let mut wanted = 0;
            // SAFETY: the text is null-terminated, and the call writes at most `wanted`.
            match unsafe { sys::cuDeviceGetByPCIBusId(&mut wanted, id.as_ptr()) }.result() {
                Ok(()) => find(&|device| Ok(device == wanted)),
                Err(DriverError(
                    sys::CUresult::CUDA_ERROR_INVALID_DEVICE | sys::CUresult::CUDA_ERROR_INVALID_VALUE,
                )) => Ok(None),
                Err(error) => Err(no_device(error)),
            }
        }
    }
}

impl Gpu {
    /// Opens a GPU: the suggested one if the settings leave the choice open and CUDA has it.
    pub fn open(gpu: &GpuChoice, suggested: Option<&GpuChoice>) -> Result<Self, Fault> {
        Self::open_with(gpu, suggested, PTX)
    }

    /// Opens a GPU with other kernels.
    pub fn open_with(gpu: &GpuChoice, suggested: Option<&GpuChoice>, ptx: &str) -> Result<Self, Fault> {
        // SAFETY: only loads the driver's library, as every later call does.
        if !unsafe { sys::is_culib_present() } {
            return Err(Fault::NoDriver);
        }
        let suggested = suggested.filter(|_| *gpu == GpuChoice::Default);
        let number = match suggested.map(number_of).transpose()?.flatten() {
            Some(number) => Some(number),
            None => number_of(gpu)?,
        };
        let number = number.ok_or_else(|| Fault::NoDevice(format!("{gpu:?} is not one of CUDA's")))?;
        Self::open_number(number, ptx)
    }

    /// Opens the device with this ordinal. Call only when the driver is known to be loaded.
    fn open_number(number: usize, ptx: &str) -> Result<Self, Fault> {
        let context = CudaContext::new(number).map_err(no_device)?;
        let (major, minor) = context.compute_capability().map_err(failed)?;
        if (major, minor) < (7, 5) {
            return Err(Fault::OldDevice(major, minor));
        }
        let image = CString::new(ptx).map_err(|error| Fault::Refused(error.to_string()))?;
        let refused = |error: DriverError| match failed(error) {
            Fault::Failed(name) => Fault::Refused(name),
            fault => fault,
        };
        // SAFETY: the image is null-terminated PTX.
        let module = unsafe { result::module::load_data(image.as_ptr().cast()) }.map_err(refused)?;
        let mut kernels = [std::ptr::null_mut(); Kernel::ALL.len()];
        for (function, kernel) in kernels.iter_mut().zip(Kernel::ALL) {
            let name = CString::new(kernel.name()).map_err(|error| Fault::Refused(error.to_string()))?;
            // SAFETY: the module was just loaded.
            *function = unsafe { result::module::get_function(module, name) }.map_err(refused)?;
        }
        let stream = context.new_stream().map_err(failed)?;
        let (done, marks) = (event(&context)?, [event(&context)?, event(&context)?]);
        Ok(Self {
            context,
            stream,
            done,
            marks,
            is_begun: false,
            is_timed: false,
            module,
            kernels,
            allocated: FxHashSet::default(),
        })
    }

    fn bind(&self) -> Result<(), Fault> {
        self.context.bind_to_thread().map_err(failed)
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        if self.bind().is_ok() {
            // Running work may use the module and the memory freed next. If this fails, the device is lost anyway.
            let _ = self.context.synchronize();
            for address in self.allocated.drain() {
                // SAFETY: nothing is running, and the address came from `alloc` and is not freed yet.
                let _ = unsafe { result::free_sync(address) };
            }
            // SAFETY: nothing is running, and the module has no other owner.
            let _ = unsafe { result::module::unload(self.module) };
        }
    }
}

/// Pinned memory, mapped to a device address.
struct Pinned {
    context: Arc<CudaContext>,
    start: *mut u8,
    len: usize,
    address: u64,
}

// SAFETY: the memory is only reached through this owner, and any thread may free it once the context is bound.
unsafe impl Send for Pinned {}
// SAFETY: shared references only read.
unsafe impl Sync for Pinned {}

impl Pinned {
    /// Start of a range of its bytes, if it is within bounds.
    fn within(&self, range: &Range<usize>) -> Option<*mut u8> {
        let is_within = range.start <= range.end && range.end <= self.len;
        // SAFETY: `start` has `len` bytes, and the range is within them.
        is_within.then(|| unsafe { self.start.add(range.start) })
    }
}

impl HostMemory for Pinned {
    fn bytes(&self) -> &[u8] {
        // SAFETY: `start` has `len` initialised bytes. The device does not write to them now: the caller that
        // started a copy waits for it before reading.
        unsafe { std::slice::from_raw_parts(self.start, self.len) }
    }

    fn bytes_of(&self, range: Range<usize>) -> Option<&[u8]> {
        let start = self.within(&range)?;
        // SAFETY: `start` has this many initialised bytes, and the caller that started a copy to them has
        // waited for it. Copies to other ranges may be in flight.
        Some(unsafe { std::slice::from_raw_parts(start, range.len()) })
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        // SAFETY: as in `bytes`, and the reference is unique.
        unsafe { std::slice::from_raw_parts_mut(self.start, self.len) }
    }

    fn bytes_of_mut(&mut self, range: Range<usize>) -> Option<&mut [u8]> {
        let start = self.within(&range)?;
        // SAFETY: as in `bytes_of`, and the reference is unique.
        Some(unsafe { std::slice::from_raw_parts_mut(start, range.len()) })
    }

    fn address(&self) -> Option<u64> {
        Some(self.address)
    }
}

impl Drop for Pinned {
    fn drop(&mut self) {
        if self.context.bind_to_thread().is_ok() {
            // After an error, copies may still be in flight.
            let _ = self.context.synchronize();
            // SAFETY: this is the only owner, and no copy uses the memory any more.
            let _ = unsafe { result::free_host(self.start.cast()) };
        }
    }
}

/// A [`Mark`]: an event recorded in the stream.
struct Passed {
    context: Arc<CudaContext>,
    event: CudaEvent,
}

impl Mark for Passed {
    fn wait(&self) -> Result<(), Fault> {
        self.context.bind_to_thread().map_err(failed)?;
        wait_for(&self.event)
    }
}

/// Creates an event whose waiters sleep. Without the flag, the driver makes them spin.
fn event(context: &Arc<CudaContext>) -> Result<CudaEvent, Fault> {
    context.new_event(Some(sys::CUevent_flags::CU_EVENT_BLOCKING_SYNC)).map_err(failed)
}

/// How long a thread polls before it sleeps: about as long as the kernels take for 512 bricks. Small transactions
/// finish within it; in large ones the wake-up latency is negligible.
const SPIN: Duration = Duration::from_micros(400);

/// Waits for an event.
fn wait_for(event: &CudaEvent) -> Result<(), Fault> {
    let start = Instant::now();
    while !event.try_is_complete().map_err(failed)? {
        if start.elapsed() > SPIN {
            return event.synchronize().map_err(failed);
        }
        std::hint::spin_loop();
    }
    Ok(())
}

impl Device for Gpu {
    fn name(&self) -> String {
        self.context.name().unwrap_or_else(|_| "CUDA device".into())
    }

    fn free_memory(&mut self) -> usize {
        self.bind().and_then(|()| result::mem_get_info().map_err(failed)).map_or(0, |(free, _)| free)
    }

    fn alloc(&mut self, bytes: usize) -> Result<u64, Fault> {
        self.bind()?;
        // SAFETY: a plain allocation.
        let address = unsafe { result::malloc_sync(bytes.max(1)) }.map_err(no_memory(bytes))?;
        self.allocated.insert(address);
        Ok(address)
    }

    fn free(&mut self, address: u64) {
        if self.allocated.remove(&address) && self.bind().is_ok() {
            // SAFETY: the address came from `alloc` and is not freed yet. Freeing waits for work that uses it.
            let _ = unsafe { result::free_sync(address) };
        }
    }

    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault> {
        self.bind()?;
        let len = bytes.max(1);
        let flags = sys::CU_MEMHOSTALLOC_PORTABLE | sys::CU_MEMHOSTALLOC_DEVICEMAP;
        // SAFETY: a plain allocation, zeroed before anyone reads it.
        let start = unsafe { result::malloc_host(len, flags) }.map_err(no_memory(bytes))?.cast::<u8>();
        // SAFETY: `start` has `len` bytes.
        unsafe { start.write_bytes(0, len) };
        let mut pinned = Pinned { context: Arc::clone(&self.context), start, len, address: 0 };
        // SAFETY: the pointer came from `malloc_host`, with a device mapping.
        let mapped = unsafe { sys::cuMemHostGetDevicePointer_v2(&mut pinned.address, start.cast(), 0) };
        mapped.result().map_err(failed)?;
        Ok(Box::new(pinned))
    }

    unsafe fn upload(&mut self, from: &dyn HostMemory, bytes: Range<usize>, to: u64) -> DeviceResult {
        self.bind()?;
        let Some(bytes) = from.bytes().get(bytes) else {
            return Err(Fault::Failed("copy out of range".into()));
        };
        if !std::mem::replace(&mut self.is_begun, true) {
            self.marks[0].record(&self.stream).map_err(failed)?;
        }
        // SAFETY: callers keep the memory until they have waited, and `to` has room for these bytes.
        unsafe { result::memcpy_htod_async(to, bytes, self.stream.cu_stream()) }.map_err(failed)
    }

    unsafe fn download(&mut self, from: u64, to: &mut dyn HostMemory, bytes: Range<usize>) -> DeviceResult {
        self.bind()?;
        let Some(bytes) = to.bytes_of_mut(bytes) else {
            return Err(Fault::Failed("copy out of range".into()));
        };
        // SAFETY: callers keep the memory and do not access it until they have waited, and `from` has these bytes.
        unsafe { result::memcpy_dtoh_async(bytes, from, self.stream.cu_stream()) }.map_err(failed)
    }

    unsafe fn copy(&mut self, from: u64, to: u64, bytes: usize) -> Result<(), Fault> {
        self.bind()?;
        // SAFETY: both addresses came from `alloc` with at least this size, and the ranges do not overlap.
        unsafe { result::memcpy_dtod_async(to, from, bytes, self.stream.cu_stream()) }.map_err(failed)
    }

    unsafe fn launch(&mut self, launch: Launch<'_>) -> Result<(), Fault> {
        let (blocks, params) = (launch.blocks(), launch.params());
        if blocks == 0 {
            return Ok(());
        }
        self.bind()?;
        self.is_timed = blocks >= TIMED && self.is_begun;
        if self.is_timed {
            self.marks[1].record(&self.stream).map_err(failed)?;
        }
        // The driver copies the parameter struct during the call. It needs an alignment of 8 bytes.
        let mut words = vec![0u64; params.len().div_ceil(8)];
        bytemuck::cast_slice_mut(&mut words)[..params.len()].copy_from_slice(params);
        let mut list = [words.as_mut_ptr().cast::<c_void>()];
        let (function, stream) = (self.kernels[launch.kernel() as usize], self.stream.cu_stream());
        // SAFETY: `Launch` holds the kernel's own parameter struct, with the layout of `layout.cuh`. Its addresses
        // came from `alloc` or are mapped host memory, have as many entries as the struct says, and stay valid
        // until the next `wait`.
        unsafe { result::launch_kernel(function, (blocks, 1, 1), (THREADS, 1, 1), 0, stream, &mut list) }
            .map_err(failed)
    }

    fn mark(&mut self) -> Result<Box<dyn Mark>, Fault> {
        self.bind()?;
        let event = event(&self.context)?;
        event.record(&self.stream).map_err(failed)?;
        Ok(Box::new(Passed { context: Arc::clone(&self.context), event }))
    }

    fn times(&mut self) -> [Duration; 2] {
        if !self.is_timed {
            return [Duration::ZERO; 2];
        }
        self.marks.each_ref().map(|start| {
            let millis = start.elapsed_ms(&self.done).unwrap_or_default();
            Duration::try_from_secs_f32(millis / 1e3).unwrap_or_default()
        })
    }

    fn wait(&mut self) -> Result<(), Fault> {
        self.bind()?;
        self.is_begun = false;
        self.done.record(&self.stream).map_err(failed)?;
        wait_for(&self.done)
    }
}
