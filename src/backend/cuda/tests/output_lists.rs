//! Capacities of output lists, on a device with little memory.

use std::ops::Range;

use super::super::device::{Device, Fault, HostMemory, Launch, Mark};
use super::super::staging::OutputList;

/// A device with little memory, whose kernels access host memory.
pub(super) struct SmallDevice {
    left: usize,
    host_left: usize,
    /// All allocation requests, and the live allocations.
    asked: Vec<usize>,
    held: Vec<(u64, usize)>,
}

impl SmallDevice {
    pub fn new(left: usize, host_left: usize) -> Self {
        Self { left, host_left, asked: Vec::new(), held: Vec::new() }
    }

    fn held(&self) -> Vec<usize> {
        self.held.iter().map(|(_, bytes)| *bytes).collect()
    }
}

struct Reached(Vec<u128>);

impl HostMemory for Reached {
    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
    fn bytes_of(&self, range: Range<usize>) -> Option<&[u8]> {
        self.bytes().get(range)
    }
    fn bytes_mut(&mut self) -> &mut [u8] {
        bytemuck::cast_slice_mut(&mut self.0)
    }
    fn bytes_of_mut(&mut self, range: Range<usize>) -> Option<&mut [u8]> {
        self.bytes_mut().get_mut(range)
    }
    fn address(&self) -> Option<u64> {
        Some(1)
    }
}

/// Takes bytes from those that are left.
fn take(left: &mut usize, bytes: usize) -> Result<(), Fault> {
    *left = left.checked_sub(bytes).ok_or(Fault::Memory(bytes))?;
    Ok(())
}

impl Device for SmallDevice {
    fn name(&self) -> String {
        "tight".into()
    }
    fn free_memory(&mut self) -> usize {
        self.left
    }
    fn alloc(&mut self, bytes: usize) -> Result<u64, Fault> {
        self.asked.push(bytes);
        take(&mut self.left, bytes)?;
        let address = 1000 + self.asked.len() as u64;
        self.held.push((address, bytes));
        Ok(address)
    }
    fn free(&mut self, address: u64) {
        let at = self.held.iter().position(|held| held.0 == address).expect("nothing is freed twice");
        self.left += self.held.remove(at).1;
    }
    fn alloc_host(&mut self, bytes: usize) -> Result<Box<dyn HostMemory>, Fault> {
        take(&mut self.host_left, bytes)?;
        Ok(Box::new(Reached(vec![0; bytes.div_ceil(16)])))
    }
    unsafe fn upload(&mut self, _: &dyn HostMemory, _: Range<usize>, _: u64) -> Result<(), Fault> {
        Ok(())
    }
    unsafe fn download(&mut self, _: u64, _: &mut dyn HostMemory, _: Range<usize>) -> Result<(), Fault> {
        Ok(())
    }
    unsafe fn copy(&mut self, _: u64, _: u64, _: usize) -> Result<(), Fault> {
        Ok(())
    }
    unsafe fn launch(&mut self, _: Launch<'_>) -> Result<(), Fault> {
        Ok(())
    }
    fn mark(&mut self) -> Result<Box<dyn Mark>, Fault> {
        Err(Fault::Failed("nobody marks anything".into()))
    }
    fn wait(&mut self) -> Result<(), Fault> {
        Ok(())
    }
}

#[test]
fn a_list_on_the_device_is_as_long_as_it_has_to_be_whatever_the_host_has_room_for() {
    let mut device = SmallDevice::new(10_000, 1 << 20);
    let mut list = OutputList::new(&mut device, 4, 16).expect("room for 16");
    assert_eq!(list.reserve(&mut device, 100_000, false), Ok(true));
    assert_eq!((list.capacity(), list.is_mapped(), device.asked.len()), (125_000, true, 0));
    // Device memory is not sized by the host's capacity of 125 000.
    assert_eq!(list.reserve(&mut device, 0, true), Ok(false));
    assert_eq!((list.capacity(), list.is_mapped(), device.held()), (16, false, vec![64]));
    assert_eq!(list.reserve(&mut device, 1000, true), Ok(true));
    assert_eq!((list.capacity(), device.held()), (1250, vec![5000]));
    // The short list is still in host memory.
    assert_eq!(list.reserve(&mut device, 125_000, false), Ok(false));
    assert_eq!((list.capacity(), list.address()), (125_000, 1));
}

#[test]
fn a_list_makes_room_for_itself_and_one_that_can_not_grow_does_not_ask_for_the_same_again() {
    let mut device = SmallDevice::new(10_000, 1 << 20);
    let mut list = OutputList::new(&mut device, 4, 16).expect("room for 16");
    assert_eq!(list.reserve(&mut device, 1000, true), Ok(true));
    // The old and the new list do not fit together.
    assert_eq!(list.reserve(&mut device, 2000, true), Ok(true));
    assert_eq!((list.capacity(), device.held()), (2500, vec![10_000]));
    assert_eq!(list.reserve(&mut device, 4000, true), Err(Fault::Memory(20_000)));
    assert_eq!((list.capacity(), device.held()), (0, vec![]));
    // The list still works with its previous size.
    assert_eq!(list.reserve(&mut device, 1000, true), Ok(true));
    assert_eq!((list.capacity(), device.held()), (1250, vec![5000]));
    assert_eq!(list.fetch(&mut device, 1250), Ok(true));
    assert_eq!(list.entries::<u32>(1250).len(), 1250);
}

#[test]
fn a_list_is_not_longer_on_the_device_than_on_the_host() {
    let mut device = SmallDevice::new(1 << 20, 1000);
    let mut list = OutputList::new(&mut device, 4, 16).expect("room for 16");
    assert_eq!(list.reserve(&mut device, 1000, true), Err(Fault::Memory(5000)));
    assert_eq!((list.capacity(), device.held()), (0, vec![]));
    assert_eq!(list.reserve(&mut device, 10, true), Ok(true));
    assert_eq!((list.capacity(), device.held()), (16, vec![64]));
}
