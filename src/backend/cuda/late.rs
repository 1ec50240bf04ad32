//! A device whose copies last until it is waited for: whoever looks at memory, or writes to it, before that panics. The
//! emulator alone is done at once, and would not tell.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};

use super::device::{Device, Fault, HostMemory, Kernel};

/// What copies do with memory of the host until the next wait.
#[derive(Default)]
struct Copies {
    read: AtomicBool,
    write: AtomicBool,
}

/// Memory that copies may be under way from or to.
struct Watched {
    own: Box<dyn HostMemory>,
    copies: Arc<Copies>,
}

impl HostMemory for Watched {
    fn bytes(&self) -> &[u8] {
        assert!(!self.copies.write.load(Ordering::SeqCst), "memory is looked at while a copy writes it");
        self.own.bytes()
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        assert!(!self.copies.read.load(Ordering::SeqCst), "memory is written while a copy reads it");
        assert!(!self.copies.write.load(Ordering::SeqCst), "memory is written while a copy writes it");
        self.own.bytes_mut()
    }

    fn address(&self) -> Option<u64> {
        self.own.address()
    }
}

/// The device.
pub(super) struct Late {
    own: Box<dyn Device>,
    /// All memory that lives, by where it begins.
    all: Vec<(usize, Weak<Copies>)>,
}

impl Late {
    pub fn new(own: Box<dyn Device>) -> Self {
        Self { own, all: Vec::new() }
    }

    /// What copies do with this memory.
    fn copies(&self, start: usize) -> Arc<Copies> {
        let found = self.all.iter().filter(|(own, _)| *own == start).find_map(|(_, copies)| copies.upgrade());
        found.expect("memory of this device")
    }
}

/// Where memory begins.
fn start(memory: &dyn HostMemory) -> usize {
    memory.bytes().as_ptr() as usize
}

impl Device for Late {
    fn name(&self) -> String {
        self.own.name()
    }

    fn free_memory(&mut self) -> usize {
        self.own.free_memory()
    }

    fn alloc(&mut self, bytes: usize) -> Result<u64, Fault> {
        self.own.alloc(bytes)
    }

    fn free(&mut self, address: u64) {
        self.own.free(address);
    }

    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault> {
        let (own, copies) = (self.own.alloc_host(bytes)?, Arc::default());
        self.all.retain(|(_, copies)| copies.strong_count() > 0);
        self.all.push((start(&*own), Arc::downgrade(&copies)));
        Ok(Box::new(Watched { own, copies }))
    }

    fn upload(&mut self, from: &dyn HostMemory, bytes: Range<usize>, to: u64) -> Result<(), Fault> {
        self.own.upload(from, bytes, to)?;
        self.copies(start(from)).read.store(true, Ordering::SeqCst);
        Ok(())
    }

    fn download(&mut self, from: u64, to: &mut dyn HostMemory, bytes: Range<usize>) -> Result<(), Fault> {
        let copies = self.copies(start(to));
        self.own.download(from, to, bytes)?;
        copies.write.store(true, Ordering::SeqCst);
        Ok(())
    }

    fn copy(&mut self, from: u64, to: u64, bytes: usize) -> Result<(), Fault> {
        self.own.copy(from, to, bytes)
    }

    fn launch(&mut self, kernel: Kernel, blocks: u32, params: &[u8]) -> Result<(), Fault> {
        self.own.launch(kernel, blocks, params)
    }

    fn wait(&mut self) -> Result<(), Fault> {
        self.own.wait()?;
        for copies in self.all.iter().filter_map(|(_, copies)| copies.upgrade()) {
            copies.read.store(false, Ordering::SeqCst);
            copies.write.store(false, Ordering::SeqCst);
        }
        Ok(())
    }
}
