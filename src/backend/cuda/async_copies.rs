//! The async-copy check: a device whose copies stay in flight until they are waited for. It panics if their memory
//! is accessed before. The emulator alone copies synchronously and would hide such errors.

use std::ops::Range;
use std::sync::{Arc, Mutex, Weak};

use super::device::{Device, DeviceResult, Fault, HostMemory, Launch, Mark, forward};
use super::lock;

/// A copy in flight.
struct Copy {
    /// Range of the host memory.
    bytes: Range<usize>,
    /// Whether it writes the range, or reads it.
    writes: bool,
    /// Number of marks placed before it.
    marks: usize,
}

/// Copies in flight from or to a piece of host memory.
type Copies = Mutex<Vec<Copy>>;

/// Host memory that checks accesses against its copies in flight.
struct Watched {
    own: Box<dyn HostMemory>,
    copies: Arc<Copies>,
}

impl Watched {
    fn assert_none(&self, bytes: &Range<usize>, what: &str, is_meant: impl Fn(&Copy) -> bool) {
        let is_there = |copy: &Copy| copy.bytes.start < bytes.end && bytes.start < copy.bytes.end;
        let copies = lock(&self.copies);
        assert!(!copies.iter().any(|copy| is_there(copy) && is_meant(copy)), "{what}");
    }
}

impl HostMemory for Watched {
    fn bytes(&self) -> &[u8] {
        let bytes = self.own.bytes();
        self.assert_none(&(0..bytes.len()), "memory is looked at while a copy writes it", |copy| copy.writes);
        bytes
    }

    fn bytes_of(&self, range: Range<usize>) -> Option<&[u8]> {
        self.assert_none(&range, "memory is looked at while a copy writes it", |copy| copy.writes);
        self.own.bytes_of(range)
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        let all = 0..self.own.bytes().len();
        self.assert_none(&all, "memory is written while a copy reads or writes it", |_| true);
        self.own.bytes_mut()
    }

    fn bytes_of_mut(&mut self, range: Range<usize>) -> Option<&mut [u8]> {
        self.assert_none(&range, "memory is written while a copy reads or writes it", |_| true);
        self.own.bytes_of_mut(range)
    }

    fn address(&self) -> Option<u64> {
        self.own.address()
    }
}

/// Live host memory by start address.
type All = Vec<(usize, Weak<Copies>)>;

/// The device.
pub(super) struct AsyncCopies {
    own: Box<dyn Device>,
    all: Arc<Mutex<All>>,
    marks: usize,
}

/// A mark of this device.
struct AsyncMark {
    own: Box<dyn Mark>,
    all: Arc<Mutex<All>>,
    number: usize,
}

/// Ends the copies that were started before mark `marks`.
fn finish(all: &Mutex<All>, marks: usize) {
    for copies in lock(all).iter().filter_map(|(_, copies)| copies.upgrade()) {
        lock(&copies).retain(|copy| copy.marks > marks);
    }
}

impl Mark for AsyncMark {
    fn wait(&self) -> Result<(), Fault> {
        self.own.wait()?;
        finish(&self.all, self.number);
        Ok(())
    }
}

impl AsyncCopies {
    pub fn new(own: Box<dyn Device>) -> Self {
        Self { own, all: Arc::default(), marks: 0 }
    }

    /// Starts to track a copy.
    fn begin(&self, start: usize, bytes: Range<usize>, writes: bool) {
        let all = lock(&self.all);
        let found = all.iter().filter(|(own, _)| *own == start).find_map(|(_, copies)| copies.upgrade());
        lock(&found.expect("memory of this device")).push(Copy { bytes, writes, marks: self.marks });
    }
}

/// Start address of host memory, without accessing its content.
fn start(memory: &dyn HostMemory) -> usize {
    memory.bytes_of(0..0).expect("a place").as_ptr() as usize
}

impl Device for AsyncCopies {
    forward!(own: name free_memory alloc free copy launch);

    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault> {
        let (own, copies) = (self.own.alloc_host(bytes)?, Arc::default());
        let mut all = lock(&self.all);
        all.retain(|(_, copies)| copies.strong_count() > 0);
        all.push((start(&*own), Arc::downgrade(&copies)));
        Ok(Box::new(Watched { own, copies }))
    }

    unsafe fn upload(&mut self, from: &dyn HostMemory, bytes: Range<usize>, to: u64) -> DeviceResult {
        // SAFETY: the caller promises the same.
        unsafe { self.own.upload(from, bytes.clone(), to) }?;
        self.begin(start(from), bytes, false);
        Ok(())
    }

    unsafe fn download(&mut self, from: u64, to: &mut dyn HostMemory, bytes: Range<usize>) -> DeviceResult {
        // SAFETY: the caller promises the same.
        unsafe { self.own.download(from, to, bytes.clone()) }?;
        self.begin(start(to), bytes, true);
        Ok(())
    }

    fn mark(&mut self) -> Result<Box<dyn Mark>, Fault> {
        let mark = AsyncMark { own: self.own.mark()?, all: Arc::clone(&self.all), number: self.marks };
        self.marks += 1;
        Ok(Box::new(mark))
    }

    fn wait(&mut self) -> Result<(), Fault> {
        self.own.wait()?;
        finish(&self.all, usize::MAX);
        Ok(())
    }
}
