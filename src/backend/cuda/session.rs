//! A device with what is kept on it: bricks, stacks of the ground, buffers.

use std::time::Duration;

use rustc_hash::FxHashMap;

use super::device::{Device, Fault, Kernel};
use super::edit::EditOutput;
use super::layout::{self, BRICK_BYTES, RECORD_BYTES, ScatterJob, ScatterParams, StackRecord};
use super::mail::{Inbox, Plan, Section};
use super::mesh::MeshOutput;
use super::slots::{Slots, reference};
use super::windows::Windows;
use crate::ground::Ground;
use crate::lattice::BrickPos;
use crate::surface::block::Block;
use crate::surface::vertex::WorldView;
use crate::volume::{Brick, EditWork, SampleView};

/// A device that works for terrains.
pub(super) struct Session {
    pub(super) device: Box<dyn Device>,
    /// How long the device took for the last launch: uploads and kernels, and the kernel alone.
    pub(super) times: [Duration; 2],
    pub(super) bricks: Slots,
    pub(super) stacks: Stacks,
    pub(super) inbox: Inbox,
    pub(super) meshes: MeshOutput,
    pub(super) edits: EditOutput,
    /// Where the table of cases is.
    pub(super) table: u64,
}

/// Stacks of the ground on the device. They never change.
pub(super) struct Stacks {
    slots: Slots,
    /// Tags by place, in pages of each ground.
    pages: FxHashMap<(u64, i32, i32), Box<[u64; PAGE * PAGE]>>,
}

/// Stacks along a side of a page.
const PAGE: usize = 64;

/// Most pages that are kept; all are let go of when there are more, and found again.
const MOST_PAGES: usize = 1 << 12;

/// The page of a stack, and its number there.
fn page(ground: &Ground, (x, z): (i32, i32)) -> ((u64, i32, i32), usize) {
    let side = PAGE as i32;
    let number = z.rem_euclid(side) * side + x.rem_euclid(side);
    ((ground.hash(), x.div_euclid(side), z.div_euclid(side)), number as usize)
}

impl Stacks {
    fn new(budget: usize) -> Self {
        Self { slots: Slots::new(size_of::<StackRecord>(), budget), pages: FxHashMap::default() }
    }

    /// Where the first one is.
    pub fn base(&self) -> u64 {
        self.slots.base()
    }

    /// The slot of a stack that is there.
    pub fn find(&self, ground: &Ground, place: (i32, i32)) -> Option<u32> {
        let (page, number) = page(ground, place);
        self.slots.find(self.pages.get(&page)?[number])
    }

    /// A slot for a stack that is not there.
    fn take(&mut self, device: &mut dyn Device, ground: &Ground, place: (i32, i32)) -> Result<u32, Fault> {
        let (slot, tag) = self.slots.take(device)?;
        if self.pages.len() > MOST_PAGES {
            self.pages.clear();
        }
        let (page, number) = page(ground, place);
        self.pages.entry(page).or_insert_with(|| Box::new([0; PAGE * PAGE]))[number] = tag;
        Ok(slot)
    }
}

/// What a launch needs on the device and is not there yet. Its slots are taken; where it is given up, they have to be given
/// back.
pub(super) struct Uploads<'a> {
    ground: &'a Ground,
    bricks: Vec<(&'a Brick, u32)>,
    stacks: Vec<((i32, i32), u32)>,
    jobs: Section,
    data: Section,
}

impl<'a> Uploads<'a> {
    /// Nothing yet.
    pub fn new(ground: &'a Ground) -> Self {
        let (jobs, data) = (Section::default(), Section::default());
        Self { ground, bricks: Vec::new(), stacks: Vec::new(), jobs, data }
    }

    /// How many bricks and stacks.
    pub fn len(&self) -> usize {
        self.bricks.len() + self.stacks.len()
    }

    fn bytes(&self) -> usize {
        let bricks: usize = self.bricks.iter().map(|(brick, _)| record_bytes(brick)).sum();
        bricks + self.stacks.len() * size_of::<StackRecord>()
    }

    /// Adds what there is to upload.
    pub fn plan(&mut self, plan: &mut Plan) {
        self.jobs = plan.section::<ScatterJob>(self.len());
        self.data = plan.section::<u8>(self.bytes());
    }
}

/// Bytes of a brick's record.
fn record_bytes(brick: &Brick) -> usize {
    if brick.material_bytes() > 0 { BRICK_BYTES } else { RECORD_BYTES }
}

/// How many bricks are looked at to see how many are missing.
const LOOKS: usize = 128;

/// Of what a device may use, the part for stacks.
const STACKS_SHARE: usize = 8;

impl Session {
    /// A session that may keep so many bytes of bricks and ground on the device.
    pub fn new(mut device: Box<dyn Device>, budget: usize) -> Result<Self, Fault> {
        let mut inbox = Inbox::new(&mut *device)?;
        let meshes = MeshOutput::new(&mut *device)?;
        let edits = EditOutput::new(&mut *device)?;
        let table = layout::table();
        let mut plan = Plan::default();
        let section = plan.section::<[u16; 16]>(table.len());
        inbox.open(&mut *device, &plan)?;
        inbox.put(section, &table);
        inbox.send(&mut *device, &plan)?;
        let address = device.alloc(size_of_val(&table))?;
        device.copy(inbox.address(section), address, size_of_val(&table))?;
        device.wait()?;
        let (stacks, bricks) = (budget / STACKS_SHARE, budget - budget / STACKS_SHARE);
        Ok(Self {
            device,
            times: [Duration::ZERO; 2],
            bricks: Slots::new(BRICK_BYTES, bricks),
            stacks: Stacks::new(stacks),
            inbox,
            meshes,
            edits,
            table: address,
        })
    }

    /// Forgets all bricks and stacks: what comes now has their room.
    pub fn forget(&mut self) {
        self.bricks.clear();
        self.stacks.slots.clear();
        self.stacks.pages.clear();
    }

    /// How long the device took for what was done last: uploads and kernels, and the kernel alone.
    pub fn times(&self) -> [Duration; 2] {
        self.times
    }

    /// Who the device is.
    pub fn name(&self) -> String {
        self.device.name()
    }

    /// How much of what edits need is not here.
    pub fn missing_edits(&self, work: &EditWork) -> usize {
        let jobs = work.jobs();
        self.missing(work.base, jobs.len(), |at| jobs[at].pos())
    }

    /// How much of what blocks need is not here.
    pub fn missing_blocks(&self, view: &WorldView, blocks: &[Block]) -> usize {
        self.missing(view.samples, blocks.len(), |at| blocks[at].brick)
    }

    /// How many of so many bricks, sorted by place, are not here, with the stacks that they belong to; judged by some of
    /// them. One that is needed several times counts where it comes first.
    fn missing(&self, view: SampleView, count: usize, pos: impl Fn(usize) -> BrickPos) -> usize {
        let step = count.div_ceil(LOOKS).max(1);
        let stack = |pos: BrickPos| (pos.0.x, pos.0.z);
        let is_here = |brick: &Brick| self.bricks.find(brick.tag.get()).is_some();
        let mut missing = 0;
        for at in (0..count).step_by(step) {
            let (own, before) = (pos(at), at.checked_sub(1).map(&pos));
            if before != Some(own) {
                missing += usize::from(view.brick(own).is_some_and(|brick| !is_here(brick)));
            }
            if before.map(stack) != Some(stack(own)) {
                missing += usize::from(self.stacks.find(view.ground(), stack(own)).is_none());
            }
        }
        missing * step
    }

    /// Begins a launch: what it finds or takes stays where it is until the next one.
    pub(super) fn begin(&mut self) {
        self.bricks.begin();
        self.stacks.slots.begin();
    }

    /// The reference to a brick, which is uploaded if it has to be.
    pub(super) fn need_brick<'a>(
        &mut self,
        uploads: &mut Uploads<'a>,
        brick: &'a Brick,
    ) -> Result<u32, Fault> {
        if let Some(slot) = self.bricks.find(brick.tag.get()) {
            return Ok(reference(slot, brick));
        }
        let (slot, tag) = self.bricks.take(&mut *self.device)?;
        brick.tag.set(tag);
        uploads.bricks.push((brick, slot));
        Ok(reference(slot, brick))
    }

    /// References to the bricks of windows, which are uploaded where they have to be.
    pub(super) fn refs<'a>(
        &mut self,
        windows: &Windows<'a>,
        uploads: &mut Uploads<'a>,
    ) -> Result<Vec<u32>, Fault> {
        let slots = &self.bricks;
        let find = |brick: &Brick| slots.find(brick.tag.get()).map(|slot| reference(slot, brick));
        let (mut refs, missing) = windows.refs(find);
        for (number, brick) in missing {
            refs[number as usize] = self.need_brick(uploads, brick)?;
        }
        Ok(refs)
    }

    /// Sees to it that a stack is there; returns its slot.
    pub(super) fn need_stack(&mut self, uploads: &mut Uploads, place: (i32, i32)) -> Result<u32, Fault> {
        if let Some(slot) = self.stacks.find(uploads.ground, place) {
            return Ok(slot);
        }
        let slot = self.stacks.take(&mut *self.device, uploads.ground, place)?;
        uploads.stacks.push((place, slot));
        Ok(slot)
    }

    /// Sends everything that was planned, and puts uploads in their slots.
    pub(super) fn send(&mut self, plan: &Plan, uploads: &Uploads) -> Result<(), Fault> {
        let mut jobs = Vec::with_capacity(uploads.len());
        let mut at = 0;
        for &(brick, slot) in &uploads.bricks {
            let bytes = record_bytes(brick);
            let data = &mut self.inbox.entries::<u8>(uploads.data)[at..at + bytes];
            layout::brick_record(brick, data);
            jobs.push((self.bricks.address(slot), at, bytes));
            at += bytes;
        }
        for &(place, slot) in &uploads.stacks {
            let data = &mut self.inbox.entries::<u8>(uploads.data)[at..at + size_of::<StackRecord>()];
            data.copy_from_slice(bytemuck::bytes_of(&layout::stack_record(uploads.ground, place)));
            jobs.push((self.stacks.slots.address(slot), at, size_of::<StackRecord>()));
            at += size_of::<StackRecord>();
        }
        let from = self.inbox.address(uploads.data);
        let scatter = |(to, at, bytes): (u64, usize, usize)| ScatterJob {
            to,
            from: from + at as u64,
            bytes: bytes as u32,
            pad: 0,
        };
        for (job, entry) in self.inbox.entries::<ScatterJob>(uploads.jobs).iter_mut().zip(jobs) {
            *job = scatter(entry);
        }
        self.inbox.send(&mut *self.device, plan)?;
        let params = ScatterParams { jobs: self.inbox.address(uploads.jobs) };
        self.device.launch(Kernel::Scatter, uploads.len() as u32, bytemuck::bytes_of(&params))
    }

    /// Gives slots back whose data was never sent.
    pub(super) fn give_up(&mut self, uploads: &Uploads) {
        uploads.bricks.iter().for_each(|&(_, slot)| self.bricks.give_back(slot));
        uploads.stacks.iter().for_each(|&(_, slot)| self.stacks.slots.give_back(slot));
    }
}
