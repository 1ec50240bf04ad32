//! Kernels equal the CPU bit for bit, on random worlds. Tests use a GPU if there is one, else the emulator.
//!
//! `BURROW_WORLDS` sets the number of worlds.

mod edits;
mod meshes;

use std::collections::HashMap;

use bytemuck::Pod;
use fastrand::Rng;

use super::device::{self, KernelParams, Launch};
use super::layout::*;
use super::tests::{self, worlds};
use crate::ground::Ground;
use crate::lattice::BrickPos;
use crate::volume::{Brick, SampleView};

/// A device and its allocations.
struct Device {
    own: Box<dyn device::Device>,
    allocated: Vec<Address>,
}

/// Guard bytes behind every output, which no kernel may write.
const MARGIN: usize = 64;
/// Fill value of guard bytes and unused slots.
const RUBBISH: u8 = 0xa5;

impl Device {
    /// `None` skips the test.
    fn start() -> Option<Self> {
        Some(Self { own: tests::device()?, allocated: Vec::new() })
    }

    /// Copies bytes to new device memory.
    fn place(&mut self, bytes: &[u8]) -> Address {
        let address = self.own.alloc(bytes.len()).expect("memory of the device");
        self.allocated.push(address);
        let mut host = self.own.alloc_host(bytes.len()).expect("memory of the host");
        host.bytes_mut()[..bytes.len()].copy_from_slice(bytes);
        // SAFETY: the memory was just allocated, and `host` is kept until the wait.
        unsafe { self.own.upload(&*host, 0..bytes.len(), address) }.expect("upload");
        self.own.wait().expect("upload");
        address
    }

    /// Copies the strata of a ground to the device; 0 without any.
    fn strata(&mut self, ground: &Ground) -> Address {
        strata_table(ground).map_or(0, |table| self.upload(&[table]))
    }

    /// Copies values to the device.
    fn upload<T: Pod>(&mut self, values: &[T]) -> Address {
        self.place(bytemuck::cast_slice(values))
    }

    /// Allocates an output of `len` values.
    fn output<T: Pod>(&mut self, len: usize) -> Output<T> {
        let bytes = (len * size_of::<T>()).next_multiple_of(16) + MARGIN;
        let address = self.place(&vec![RUBBISH; bytes]);
        Output { address, len, of: std::marker::PhantomData }
    }

    /// Allocates counters, initially zero.
    fn counters(&mut self, len: usize) -> Output<u32> {
        let address = self.upload(&vec![0u32; len.max(4)]);
        Output { address, len, of: std::marker::PhantomData }
    }

    fn read<T: Pod>(&mut self, output: &Output<T>) -> Vec<T> {
        self.read_at(output.address, output.len)
    }

    fn read_at<T: Pod>(&mut self, address: Address, len: usize) -> Vec<T> {
        let mut values = vec![T::zeroed(); len];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut values);
        let mut host = self.own.alloc_host(bytes.len()).expect("memory of the host");
        // SAFETY: tests read no more than they uploaded, after the wait.
        unsafe { self.own.download(address, &mut *host, 0..bytes.len()) }.expect("download");
        self.own.wait().expect("download");
        bytes.copy_from_slice(&host.bytes()[..bytes.len()]);
        values
    }

    /// Reads an output, and asserts that nothing was written past its end.
    fn read_checked<T: Pod>(&mut self, output: &Output<T>) -> Vec<T> {
        let bytes = output.len * size_of::<T>();
        let behind = bytes.next_multiple_of(16) + MARGIN - bytes;
        let margin: Vec<u8> = self.read_at(output.address + bytes as u64, behind);
        assert!(margin.iter().all(|&byte| byte == RUBBISH), "something was written past the end");
        self.read(output)
    }

    fn launch<P: KernelParams>(&mut self, blocks: usize, params: P) {
        // SAFETY: tests upload everything that the parameters refer to.
        unsafe { self.own.launch(Launch::new(blocks as u32, &params)) }.expect("the launch succeeds");
        self.own.wait().expect("the kernel succeeds");
    }

    /// Frees everything.
    fn clear(&mut self) {
        self.allocated.drain(..).for_each(|address| self.own.free(address));
    }
}

struct Output<T> {
    address: Address,
    len: usize,
    of: std::marker::PhantomData<T>,
}

/// Bricks and stacks on the device.
#[derive(Default)]
struct Slots {
    bricks: Vec<u8>,
    stacks: Vec<StackRecord>,
    stack_slots: HashMap<(i32, i32), u32>,
    brick_refs: HashMap<BrickPos, u32>,
}

impl Slots {
    /// Adds a slot for a brick; `None` leaves it filled with guard bytes.
    fn brick(&mut self, brick: Option<&Brick>) -> u32 {
        let slot = self.bricks.len() / BRICK_BYTES;
        self.bricks.resize(self.bricks.len() + BRICK_BYTES, RUBBISH);
        if let Some(brick) = brick {
            let with = if brick.materials().is_some() { BRICK_BYTES } else { RECORD_BYTES };
            brick_record(brick, &mut self.bricks[slot * BRICK_BYTES..][..with]);
        }
        slot as u32
    }

    /// The reference of the brick at a position.
    fn reference(&mut self, samples: SampleView, pos: BrickPos) -> u32 {
        if let Some(&found) = self.brick_refs.get(&pos) {
            return found;
        }
        let reference = samples
            .brick(pos)
            .map_or(NONE, |brick| self.brick(Some(brick)) << 1 | u32::from(brick.materials().is_some()));
        self.brick_refs.insert(pos, reference);
        reference
    }

    fn stack(&mut self, ground: &Ground, stack: (i32, i32)) -> u32 {
        *self.stack_slots.entry(stack).or_insert_with(|| {
            self.stacks.push(stack_record(ground, stack));
            self.stacks.len() as u32 - 1
        })
    }
}

/// Asserts that bricks are equal, including materials.
fn assert_same(found: &Brick, expected: &Brick, what: impl std::fmt::Debug) {
    assert_eq!(found.samples(), expected.samples(), "samples of {what:?}");
    assert_eq!(found.solid(), expected.solid(), "solid bits of {what:?}");
    assert_eq!(found.edited(), expected.edited(), "edited bits of {what:?}");
    assert_eq!(found.materials(), expected.materials(), "materials of {what:?}");
}

fn seeds(default: u64) -> impl Iterator<Item = (u64, Rng)> {
    (0..worlds::world_count(default)).map(|seed| (seed, Rng::with_seed(seed)))
}
#[test]
fn bytes_are_scattered() {
    let Some(mut device) = Device::start() else { return };
    let mut rng = Rng::with_seed(1);
    let source: Vec<u64> = (0..4096).map(|_| rng.u64(..)).collect();
    let from = device.upload(&source);
    let to = device.output::<u64>(8192);
    let (mut at, mut jobs, mut expected) = (0, Vec::new(), vec![0xa5a5_a5a5_a5a5_a5a5; 8192]);
    for pieces in [1, 2, 7, 72, 104, 128, 129, 300] {
        let (words, first) = (pieces * 2, rng.usize(0..1500) * 2);
        expected[at..at + words].copy_from_slice(&source[first..first + words]);
        let (to, from) = (to.address + at as u64 * 8, from + first as u64 * 8);
        jobs.push(ScatterJob { to, from, bytes: words as u32 * 8, pad: 0 });
        at += words + rng.usize(0..4) * 2;
    }
    let params = ScatterParams { jobs: device.upload(&jobs) };
    device.launch(jobs.len(), params);
    assert!(device.read_checked(&to) == expected);
}
