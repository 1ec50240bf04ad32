//! A device with its caches: bricks, ground stacks, staging buffers.

use std::time::Duration;

use rustc_hash::FxHashMap;
use web_time::Instant;

use super::cache::{RecordCache, reference};
use super::device::{Device, Fault, Launch};
use super::edit::output::EditOutput;
use super::layout::{self, BRICK_BYTES, EditJob, RECORD_BYTES, ScatterJob, ScatterParams, StackRecord};
use super::lists::{cut, fill, for_each_parallel};
use super::mesh::output::MeshOutput;
use super::staging::{DeviceBuffer, InputBuffer, Section, StagingLayout};
use super::windows::{KeptSlabs, Windows};
use crate::edits::PreparedEdits;
use crate::ground::Ground;
use crate::lattice::BrickPos;
use crate::surface::block::Block;
use crate::surface::vertex::WorldView;
use crate::volume::{Brick, SampleView};

/// A device and its caches.
pub(super) struct Session {
    pub(super) device: Box<dyn Device>,
    /// Device time of the last launch: uploads and kernels, and the kernel alone.
    pub(super) times: [Duration; 2],
    pub(super) bricks: RecordCache,
    pub(super) stacks: Stacks,
    pub(super) input: InputBuffer,
    pub(super) meshes: MeshOutput,
    pub(super) edits: EditOutput,
    /// Distances to the surface during fills and carves.
    pub(super) surface: DeviceBuffer,
    /// Memory reused for the jobs and windows of the next launch.
    pub(super) edit_jobs: Vec<EditJob>,
    pub(super) kept: KeptSlabs,
    /// Address of the table of marching cubes cases.
    pub(super) table: u64,
    /// When memory was last trimmed, and whether anything was launched since.
    trimmed: Instant,
    is_used: bool,
    /// Time for which unused memory is kept.
    pub(super) keep: Duration,
}

/// Cached stacks of the ground. They never change.
pub(super) struct Stacks {
    slots: RecordCache,
    /// Tags of the stacks, in pages by ground and position.
    pages: FxHashMap<(u64, i32, i32), Box<[u64; PAGE * PAGE]>>,
}

/// Side of a page, in stacks.
const PAGE: usize = 64;

/// Maximum number of pages. Beyond it, all are dropped.
const MOST_PAGES: usize = 1 << 12;

/// The page of a stack, and its index within the page.
fn page(ground: &Ground, (x, z): (i32, i32)) -> ((u64, i32, i32), usize) {
    let side = PAGE as i32;
    let number = z.rem_euclid(side) * side + x.rem_euclid(side);
    ((ground.hash(), x.div_euclid(side), z.div_euclid(side)), number as usize)
}

impl Stacks {
    fn new(budget: usize) -> Self {
        Self { slots: RecordCache::new(size_of::<StackRecord>(), budget), pages: FxHashMap::default() }
    }

    /// Device address of the first slot.
    pub fn base(&self) -> u64 {
        self.slots.base()
    }

    /// The slot of a cached stack.
    pub fn find(&self, ground: &Ground, place: (i32, i32)) -> Option<u32> {
        let (page, number) = page(ground, place);
        self.slots.find(self.pages.get(&page)?[number])
    }

    /// Takes a slot for a stack that is not cached.
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

/// Data of a launch that is not on the device yet. Slots are reserved for it and must be given back if the launch
/// is abandoned.
pub(super) struct Uploads<'a> {
    ground: &'a Ground,
    bricks: Vec<Upload<'a>>,
    /// Total bytes of the brick records.
    bytes: usize,
    stacks: Vec<((i32, i32), u32)>,
    jobs: Section,
    brick_list: Section,
    stack_list: Section,
}

/// A brick to upload, and its slot.
struct Upload<'a> {
    brick: &'a Brick,
    slot: u32,
    /// Offset and length of its record within the section of brick records.
    first: usize,
    bytes: usize,
}

impl<'a> Uploads<'a> {
    pub fn new(ground: &'a Ground) -> Self {
        let [jobs, brick_list, stack_list] = [Section::default(); 3];
        Self { ground, bricks: Vec::new(), bytes: 0, stacks: Vec::new(), jobs, brick_list, stack_list }
    }

    /// Number of bricks and stacks.
    pub fn len(&self) -> usize {
        self.bricks.len() + self.stacks.len()
    }

    /// Adds a brick.
    fn push(&mut self, brick: &'a Brick, slot: u32) {
        let bytes = if brick.material_bytes() > 0 { BRICK_BYTES } else { RECORD_BYTES };
        self.bricks.push(Upload { brick, slot, first: self.bytes, bytes });
        self.bytes += bytes;
    }

    /// Reserves staging sections for the uploads.
    pub fn plan(&mut self, plan: &mut StagingLayout) {
        self.jobs = plan.section::<ScatterJob>(self.len());
        self.brick_list = plan.section::<u8>(self.bytes);
        self.stack_list = plan.section::<StackRecord>(self.stacks.len());
    }

    /// Writes the records of bricks and stacks.
    fn write(&self, input: &mut InputBuffer) {
        let groups = self.bricks.chunks(GROUP);
        let lengths = groups.clone().map(|group| group.iter().map(|upload| upload.bytes).sum::<usize>());
        let places = cut(input.entries::<u8>(self.brick_list), lengths);
        for_each_parallel(groups.zip(places).collect(), |(group, place)| {
            let before = group.first().map_or(0, |upload| upload.first);
            for Upload { brick, first, bytes, .. } in group {
                layout::brick_record(brick, &mut place[first - before..][..*bytes]);
            }
        });
        let record = |_, &(place, _): &((i32, i32), u32)| layout::stack_record(self.ground, place);
        fill(&self.stacks, input.entries::<StackRecord>(self.stack_list), MANY_STACKS, record);
    }
}

/// Bricks whose records a thread writes at a time.
const GROUP: usize = 256;

/// Windows around these bricks, which are sorted by stack, extending `up_and_down` bricks vertically. Bricks
/// without a slot are still to be [completed](Session::complete).
pub(super) fn windows<'a, T: Sync>(
    slots: &RecordCache,
    view: SampleView<'a>,
    bricks: &[T],
    pos: impl Fn(&T) -> BrickPos + Send + Sync,
    up_and_down: i32,
    kept: &mut KeptSlabs,
) -> Windows<'a> {
    let find = |brick: &Brick| slots.find(brick.tag.get()).map(|slot| reference(slot, brick));
    Windows::around(view, bricks, pos, up_and_down, find, kept)
}

/// From this many stacks on, their records are written in parallel. Each reads 121 columns.
const MANY_STACKS: usize = 64;

/// Number of bricks that are sampled to estimate how many are missing.
const LOOKS: usize = 128;

/// Time for which unused memory is kept. Players pause, and reallocating costs time.
const KEEP: Duration = Duration::from_secs(30);

/// Fraction of the budget for stacks, as a divisor.
const STACKS_SHARE: usize = 8;

impl Session {
    /// A session that may keep `budget` bytes of bricks and ground on the device.
    pub fn new(mut device: Box<dyn Device>, budget: usize) -> Result<Self, Fault> {
        let mut input = InputBuffer::new(&mut *device)?;
        let meshes = MeshOutput::new(&mut *device)?;
        let edits = EditOutput::new(&mut *device)?;
        let table = layout::table();
        let mut plan = StagingLayout::default();
        let section = plan.section::<[u16; 16]>(table.len());
        input.open(&mut *device, &plan)?;
        input.put(section, &table);
        input.send(&mut *device, &plan)?;
        let address = device.alloc(size_of_val(&table))?;
        // SAFETY: the section and the new allocation are as long as the table.
        unsafe { device.copy(input.address(section), address, size_of_val(&table)) }?;
        device.wait()?;
        let (stacks, bricks) = (budget / STACKS_SHARE, budget - budget / STACKS_SHARE);
        Ok(Self {
            device,
            times: [Duration::ZERO; 2],
            bricks: RecordCache::new(BRICK_BYTES, bricks),
            stacks: Stacks::new(stacks),
            input,
            meshes,
            edits,
            surface: DeviceBuffer::default(),
            edit_jobs: Vec::new(),
            kept: KeptSlabs::default(),
            table: address,
            trimmed: Instant::now(),
            is_used: true,
            keep: KEEP,
        })
    }

    /// Empties both caches.
    pub fn forget(&mut self) {
        self.bricks.clear();
        self.stacks.slots.clear();
        self.stacks.pages.clear();
    }

    /// Frees memory that was unused for some time: lists shrink to the size last used, and the caches are
    /// released if nothing was launched.
    pub fn trim(&mut self, now: Instant) -> Result<(), Fault> {
        if now.saturating_duration_since(self.trimmed) < self.keep {
            return Ok(());
        }
        self.trimmed = now;
        // After a fault, work may still be in flight.
        self.device.wait()?;
        let device = &mut *self.device;
        self.surface.trim(device);
        let trimmed = self
            .input
            .trim(device)
            .and_then(|()| self.meshes.lists_mut().into_iter().try_for_each(|list| list.trim(device)))
            .and_then(|()| self.edits.lists_mut().into_iter().try_for_each(|list| list.trim(device)));
        if !std::mem::take(&mut self.is_used) {
            self.bricks.release(device);
            self.stacks.slots.release(device);
            self.stacks.pages = FxHashMap::default();
        }
        // Without memory for shorter lists, the long ones stay.
        trimmed.or_else(|fault| if fault.is_passing() { Ok(()) } else { Err(fault) })
    }

    /// Device time of the last launch: uploads and kernels, and the kernel alone.
    pub fn times(&self) -> [Duration; 2] {
        self.times
    }

    /// The name of the device.
    pub fn name(&self) -> String {
        self.device.name()
    }

    /// Estimated number of bricks and stacks of these edits that are not on the device.
    pub fn missing_edits(&self, work: &PreparedEdits) -> usize {
        let jobs = work.jobs();
        self.missing(work.base, jobs.len(), |at| jobs[at].pos())
    }

    /// Estimated number of bricks and stacks of these blocks that are not on the device.
    pub fn missing_blocks(&self, view: &WorldView, blocks: &[Block]) -> usize {
        self.missing(view.samples, blocks.len(), |at| blocks[at].brick)
    }

    /// Estimates from a sample how many of `count` bricks, sorted by stack, and of their stacks are not on the
    /// device. A brick or stack that occurs several times in a row counts once.
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

    /// Begins a launch. Slots found or taken from now on are not evicted before the next launch.
    pub(super) fn begin(&mut self) {
        self.is_used = true;
        self.bricks.begin();
        self.stacks.slots.begin();
    }

    /// The reference of a brick. Queues an upload if it is not on the device.
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
        uploads.push(brick, slot);
        Ok(reference(slot, brick))
    }

    /// Fills in the references of window entries without one, and queues their uploads.
    pub(super) fn complete<'a>(
        &mut self,
        uploads: &mut Uploads<'a>,
        windows: &mut Windows<'a>,
    ) -> Result<(), Fault> {
        windows.complete(|brick| self.need_brick(uploads, brick))
    }

    /// The slot of a stack. Queues an upload if it is not on the device.
    pub(super) fn need_stack(&mut self, uploads: &mut Uploads, place: (i32, i32)) -> Result<u32, Fault> {
        if let Some(slot) = self.stacks.find(uploads.ground, place) {
            return Ok(slot);
        }
        let slot = self.stacks.take(&mut *self.device, uploads.ground, place)?;
        uploads.stacks.push((place, slot));
        Ok(slot)
    }

    /// Sends the planned input, and moves uploads into their slots.
    pub(super) fn send(&mut self, plan: &StagingLayout, uploads: &Uploads) -> Result<(), Fault> {
        if uploads.len() > 0 {
            uploads.write(&mut self.input);
            self.direct(uploads);
        }
        self.input.send(&mut *self.device, plan)?;
        let params = ScatterParams { jobs: self.input.address(uploads.jobs) };
        // SAFETY: jobs copy from sections of the input to slots that were taken for them.
        unsafe { self.device.launch(Launch::new(uploads.len() as u32, &params)) }
    }

    /// Writes the scatter jobs of uploads.
    fn direct(&mut self, uploads: &Uploads) {
        let Self { input, bricks, stacks, .. } = self;
        let (brick_list, stack_list) = (input.address(uploads.brick_list), input.address(uploads.stack_list));
        let job = |to: u64, from: u64, bytes: usize| ScatterJob { to, from, bytes: bytes as u32, pad: 0 };
        let jobs = input.entries::<ScatterJob>(uploads.jobs);
        let (of_bricks, of_stacks) = jobs.split_at_mut(uploads.bricks.len());
        for (place, upload) in of_bricks.iter_mut().zip(&uploads.bricks) {
            *place = job(bricks.address(upload.slot), brick_list + upload.first as u64, upload.bytes);
        }
        for ((number, &(_, slot)), place) in (0..).zip(&uploads.stacks).zip(of_stacks) {
            let bytes = size_of::<StackRecord>();
            *place = job(stacks.slots.address(slot), stack_list + number * bytes as u64, bytes);
        }
    }

    /// Releases the slots of uploads that were never sent.
    pub(super) fn give_up(&mut self, uploads: &Uploads) {
        uploads.bricks.iter().for_each(|upload| self.bricks.release_slot(upload.slot));
        uploads.stacks.iter().for_each(|&(_, slot)| self.stacks.slots.release_slot(slot));
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::device;
    use super::*;
    use crate::ground::MaterialId;

    /// Reads bytes of the device.
    fn read(session: &mut Session, address: u64, bytes: usize) -> Vec<u8> {
        let mut host = session.device.alloc_host(bytes).expect("memory of the host");
        // SAFETY: tests read slots that exist, after the wait.
        unsafe { session.device.download(address, &mut *host, 0..bytes) }.expect("a download");
        session.device.wait().expect("a download");
        host.bytes()[..bytes].to_vec()
    }

    fn brick(number: i32) -> Brick {
        let mut brick = Brick::of_edited(&std::array::from_fn(|at| (at as i32 * 7 + number) as i16));
        if number % 3 == 1 {
            brick.set_material(5, MaterialId(number as u8 | 1));
        }
        brick
    }

    #[test]
    fn what_is_uploaded_is_in_its_slot() {
        let ground = Ground::from_fn(200, 200, |x, z| f64::from(x * z % 31)).expect("finite heights");
        // One number that a single thread handles, and one that needs several.
        for count in [3, 2 * GROUP as i32 + 5] {
            let Some(device) = device() else { return };
            let mut session = Session::new(device, 8 << 20).expect("a session");
            let bricks: Vec<Brick> = (0..count).map(brick).collect();
            let stacks: Vec<(i32, i32)> = (0..count / 3).map(|number| (number % 13, number / 13)).collect();
            session.begin();
            let mut uploads = Uploads::new(&ground);
            for brick in &bricks {
                session.need_brick(&mut uploads, brick).expect("room for all");
            }
            for &stack in &stacks {
                session.need_stack(&mut uploads, stack).expect("room for all");
            }
            let mut plan = StagingLayout::default();
            uploads.plan(&mut plan);
            session.input.open(&mut *session.device, &plan).expect("room for all");
            session.send(&plan, &uploads).expect("the device works");
            session.device.wait().expect("the device works");
            for brick in &bricks {
                let slot = session.bricks.find(brick.tag.get()).expect("it is there");
                let mut record = vec![0; if brick.material_bytes() > 0 { BRICK_BYTES } else { RECORD_BYTES }];
                layout::brick_record(brick, &mut record);
                let address = session.bricks.address(slot);
                assert!(read(&mut session, address, record.len()) == record);
            }
            for &stack in &stacks {
                let slot = session.stacks.find(&ground, stack).expect("it is there");
                let record = layout::stack_record(&ground, stack);
                let address = session.stacks.slots.address(slot);
                assert!(read(&mut session, address, size_of_val(&record)) == bytemuck::bytes_of(&record));
            }
        }
    }
}
