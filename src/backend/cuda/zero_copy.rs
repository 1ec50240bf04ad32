//! Wraps the emulator as a device that maps host memory, to test the zero-copy path.
//!
//! Each piece of host memory has a shadow on the device. It is copied there before a launch, and back when the
//! device is waited for. Code that reads too early sees nothing, and what it writes too late is overwritten.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use super::device::{Device, DeviceResult, Fault, HostMemory, Kernel, Launch, Mark, forward};
use super::lock;

/// Host memory and the address of its shadow.
#[derive(Clone, Copy)]
struct Piece {
    start: *mut u8,
    len: usize,
    shadow: u64,
}

// SAFETY: a piece is only used by its owner, or through the locked list below.
unsafe impl Send for Piece {}
// SAFETY: as above.
unsafe impl Sync for Piece {}

impl HostMemory for Piece {
    fn bytes(&self) -> &[u8] {
        // SAFETY: the owner removes the piece from the list before it frees the memory.
        unsafe { std::slice::from_raw_parts(self.start, self.len) }
    }

    fn bytes_of(&self, range: Range<usize>) -> Option<&[u8]> {
        self.bytes().get(range)
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        // SAFETY: as above.
        unsafe { std::slice::from_raw_parts_mut(self.start, self.len) }
    }

    fn bytes_of_mut(&mut self, range: Range<usize>) -> Option<&mut [u8]> {
        self.bytes_mut().get_mut(range)
    }

    fn address(&self) -> Option<u64> {
        Some(self.shadow)
    }
}

/// All live pieces, and the shadows of dropped ones.
#[derive(Default)]
struct Pieces {
    list: Vec<Piece>,
    gone: Vec<u64>,
}

/// The owner of a piece.
struct Owned {
    piece: Piece,
    words: usize,
    all: Arc<Mutex<Pieces>>,
}

impl HostMemory for Owned {
    fn bytes(&self) -> &[u8] {
        self.piece.bytes()
    }

    fn bytes_of(&self, range: Range<usize>) -> Option<&[u8]> {
        self.piece.bytes_of(range)
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        self.piece.bytes_mut()
    }

    fn bytes_of_mut(&mut self, range: Range<usize>) -> Option<&mut [u8]> {
        self.piece.bytes_of_mut(range)
    }

    fn address(&self) -> Option<u64> {
        self.piece.address()
    }
}

impl Drop for Owned {
    fn drop(&mut self) {
        let mut all = lock(&self.all);
        all.list.retain(|piece| piece.shadow != self.piece.shadow);
        all.gone.push(self.piece.shadow);
        // SAFETY: the memory was leaked as a box of this many words, and nothing else refers to it any more.
        drop(unsafe {
            Box::from_raw(std::ptr::slice_from_raw_parts_mut(self.piece.start.cast::<u128>(), self.words))
        });
    }
}

/// A device that maps host memory.
pub(super) struct ZeroCopy {
    own: Box<dyn Device>,
    all: Arc<Mutex<Pieces>>,
    is_running: bool,
}

impl ZeroCopy {
    /// Wraps a device.
    pub fn new(own: Box<dyn Device>) -> Self {
        Self { own, all: Arc::default(), is_running: false }
    }

    /// Makes the kernels' writes visible to the host.
    fn land(&mut self) -> Result<(), Fault> {
        if std::mem::take(&mut self.is_running) {
            for piece in &mut lock(&self.all).list {
                let (len, shadow) = (piece.len, piece.shadow);
                // SAFETY: the shadow is as long as the piece, and the emulator copies synchronously.
                unsafe { self.own.download(shadow, piece, 0..len) }?;
            }
        }
        Ok(())
    }
}

impl Device for ZeroCopy {
    forward!(own: name free_memory alloc free upload copy mark);

    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault> {
        let shadow = self.own.alloc(bytes)?;
        let memory = Box::leak(vec![0u128; bytes.div_ceil(16)].into_boxed_slice());
        let (words, start) = (memory.len(), memory.as_mut_ptr().cast());
        let piece = Piece { start, len: bytes, shadow };
        lock(&self.all).list.push(piece);
        Ok(Box::new(Owned { piece, words, all: Arc::clone(&self.all) }))
    }

    unsafe fn download(&mut self, from: u64, to: &mut dyn HostMemory, bytes: Range<usize>) -> DeviceResult {
        self.land()?;
        // SAFETY: the caller promises the same.
        unsafe { self.own.download(from, to, bytes) }
    }

    unsafe fn launch(&mut self, launch: Launch<'_>) -> Result<(), Fault> {
        if launch.kernel() != Kernel::Scatter {
            let mut all = lock(&self.all);
            all.gone.drain(..).for_each(|shadow| self.own.free(shadow));
            for piece in &all.list {
                // SAFETY: the caller promises the same.
                unsafe { self.own.upload(piece, 0..piece.len, piece.shadow) }?;
            }
            self.is_running = true;
        }
        // SAFETY: the caller promises the same.
        unsafe { self.own.launch(launch) }
    }

    fn wait(&mut self) -> Result<(), Fault> {
        self.land()?;
        self.own.wait()
    }
}
