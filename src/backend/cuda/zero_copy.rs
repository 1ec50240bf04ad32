//! The emulator as a card whose kernels reach the host's memory: for the path that the emulator alone does not take.
//!
//! Memory of the host has a shadow on the device. Before a launch it is copied there, and back when the device is waited
//! for; so whoever looks too early sees nothing, and whoever writes too late is overwritten.

use std::ops::Range;
use std::sync::{Arc, Mutex};

use super::device::{Device, DeviceResult, Fault, HostMemory, Kernel, Launch, Mark, forward};
use super::lock;

/// Memory of the host, and where its shadow is.
#[derive(Clone, Copy)]
struct Piece {
    start: *mut u8,
    len: usize,
    shadow: u64,
}

// SAFETY: whoever has a piece has it from the list below, which is locked while it is used, or owns it.
unsafe impl Send for Piece {}
// SAFETY: as above.
unsafe impl Sync for Piece {}

impl HostMemory for Piece {
    fn bytes(&self) -> &[u8] {
        // SAFETY: the memory lives until its owner is dropped, who takes it from the list before.
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

/// Every piece that lives, and shadows of those that do not any more.
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
        // SAFETY: it was leaked as a box of so many words, and nobody else knows it any more.
        drop(unsafe {
            Box::from_raw(std::ptr::slice_from_raw_parts_mut(self.piece.start.cast::<u128>(), self.words))
        });
    }
}

/// A device that maps the host's memory.
pub(super) struct ZeroCopy {
    own: Box<dyn Device>,
    all: Arc<Mutex<Pieces>>,
    is_running: bool,
}

impl ZeroCopy {
    /// Another device that maps.
    pub fn new(own: Box<dyn Device>) -> Self {
        Self { own, all: Arc::default(), is_running: false }
    }

    /// What kernels wrote becomes visible.
    fn land(&mut self) -> Result<(), Fault> {
        if std::mem::take(&mut self.is_running) {
            for piece in &mut lock(&self.all).list {
                let (len, shadow) = (piece.len, piece.shadow);
                // SAFETY: the shadow is as long as the piece, and the emulator copies at once.
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
