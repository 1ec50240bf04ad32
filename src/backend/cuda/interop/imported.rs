//! CUDA's side of a shared buffer: memory that another API allocated, mapped into the card's context.

use std::os::fd::{AsRawFd, IntoRawFd, OwnedFd};
use std::sync::Arc;

use cudarc::driver::sys::{CUdeviceptr, CUexternalMemory};
use cudarc::driver::{CudaContext, DriverError, result};

use super::InteropError;

/// Imported memory and where kernels see it.
pub(super) struct Imported {
    context: Arc<CudaContext>,
    memory: CUexternalMemory,
    address: CUdeviceptr,
    bytes: u64,
}

// SAFETY: the handle and the address belong to the context, which any thread may use once it is bound there; every method
// binds it first.
unsafe impl Send for Imported {}
// SAFETY: shared references only read the handle and the address; the driver may be called from several threads.
unsafe impl Sync for Imported {}

fn failed(error: DriverError) -> InteropError {
    let name = error.error_name().map_or("unknown error".into(), |name| name.to_string_lossy().into_owned());
    InteropError::Cuda(name)
}

impl Imported {
    /// Imports memory of `allocated` bytes and maps the first `bytes` of it.
    pub fn new(
        context: &Arc<CudaContext>,
        descriptor: OwnedFd,
        allocated: u64,
        bytes: u64,
    ) -> Result<Self, InteropError> {
        context.bind_to_thread().map_err(failed)?;
        let import = result::external_memory::import_external_memory_opaque_fd;
        // SAFETY: the descriptor is an exported allocation of so many bytes.
        let memory = unsafe { import(descriptor.as_raw_fd(), allocated) }.map_err(failed)?;
        // The driver's own from now on; closing it here as well would close someone else's.
        let _ = descriptor.into_raw_fd();
        // SAFETY: the memory has just been imported and has at least so many bytes.
        match unsafe { result::external_memory::get_mapped_buffer(memory, 0, bytes) } {
            Ok(address) => Ok(Self { context: Arc::clone(context), memory, address, bytes }),
            Err(error) => {
                // SAFETY: nothing is mapped, and nobody else has the handle.
                let _ = unsafe { result::external_memory::destroy_external_memory(memory) };
                Err(failed(error))
            }
        }
    }

    /// Is it mapped in the context of this card?
    pub fn is_of(&self, context: &CudaContext) -> bool {
        self.context.cu_ctx() == context.cu_ctx()
    }

    /// Where kernels see it.
    pub fn address(&self) -> u64 {
        self.address
    }

    /// Writes zeros everywhere, and waits for that.
    pub fn clear(&self) -> Result<(), InteropError> {
        self.context.bind_to_thread().map_err(failed)?;
        // SAFETY: so many bytes are mapped, and nobody else has the memory yet.
        unsafe { result::memset_d8_sync(self.address, 0, self.bytes as usize) }.map_err(failed)?;
        // What fills memory may return before it has.
        self.context.synchronize().map_err(failed)
    }
}

impl Drop for Imported {
    fn drop(&mut self) {
        if self.context.bind_to_thread().is_ok() {
            // After an error copies may be under way.
            let _ = self.context.synchronize();
            // SAFETY: nothing runs any more, and the mapping is this owner's.
            let _ = unsafe { result::memory_free(self.address) };
            // SAFETY: nothing is mapped any more, and nobody else has the handle.
            let _ = unsafe { result::external_memory::destroy_external_memory(self.memory) };
        }
    }
}
