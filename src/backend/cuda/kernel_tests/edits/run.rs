//! Launches edits, and checks the output.

use std::collections::{BTreeMap, HashMap};

use fastrand::Rng;
use glam::IVec3;

use super::super::super::edit::surface::{greatest_horizon, steps, surface_jobs};
use super::super::super::layout::{self, *};
use super::super::{Device, Slots, assert_same};
use crate::edits::{EditDelta, PreparedEdit, PreparedEdits};
use crate::ground::GreyImage;
use crate::lattice::{BrickPos, ChunkPos, LatticeBox};
use crate::volume::{Brick, SampleView, UniformKind};

/// Capacities of the output lists.
#[derive(Clone, Copy, Debug)]
pub(super) struct EditRoom {
    pub records: usize,
    pub materials: usize,
    pub parts: usize,
    pub counts: usize,
}

/// A launch of `edit`, and its output.
pub(super) struct EditRun {
    jobs: Vec<EditJob>,
    pub results: Vec<EditResult>,
    records: Vec<BrickRecord>,
    materials: Vec<[u8; MATERIAL_BYTES]>,
    parts: Vec<EditPart>,
    counts: Vec<EditCount>,
    pub counters: Vec<u32>,
    /// Content of all slots before and after.
    before: Vec<u8>,
    after: Vec<u8>,
}

/// The bricks around jobs, for stencil edits.
struct Stencil {
    look: i32,
    refs: Vec<u32>,
}

impl Stencil {
    /// The window entry of a brick, and its strides. Each brick has its own window.
    fn around(&mut self, slots: &mut Slots, samples: SampleView, pos: BrickPos) -> (u32, u32) {
        let first = self.refs.len() as u32;
        for (x, z) in (-1..=1).flat_map(|x| (-1..=1).map(move |z| (x, z))) {
            let column = (-self.look..=self.look).map(|y| BrickPos(pos.0 + IVec3::new(x, y, z)));
            self.refs.extend(column.map(|pos| slots.reference(samples, pos)));
        }
        let height = 2 * self.look as u32 + 1;
        (first + 4 * height + self.look as u32, (height * 3) | (height << 16))
    }
}

/// The bricks whose distances to the surface jobs need, and the references of the bricks around them.
fn surface_jobs_with_windows(
    work: &PreparedEdits,
    slots: &mut Slots,
    jobs: &mut [EditJob],
) -> (Vec<SurfaceJob>, Vec<u32>) {
    let (mut own, mut windows) = (surface_jobs(work, jobs), Stencil { look: 1, refs: Vec::new() });
    for job in &mut own {
        let pos = job.pos();
        (job.window, job.strides) = windows.around(slots, work.base, pos);
        job.stack = slots.stack(work.base.ground(), (pos.0.x, pos.0.z));
    }
    (own, windows.refs)
}

/// Computes distances to the surface, and returns their address; 0 if none are needed.
fn launch_surface(
    device: &mut Device,
    work: &PreparedEdits,
    [bricks, stacks]: [Address; 2],
    (own, windows): &(Vec<SurfaceJob>, Vec<u32>),
) -> Address {
    let horizon = greatest_horizon(work);
    if horizon == 0 {
        return 0;
    }
    let (jobs, last) = (device.upload(own), [work.grid.width(), work.grid.depth()]);
    let mut places = [0, 1].map(|_| device.output::<[i16; 512]>(own.len()));
    let (windows, distances) = (device.upload(windows), places[0].address);
    device.launch(
        own.len(),
        SurfaceStartParams { bricks, stacks, windows, jobs, distances, horizon, last, pad: 0 },
    );
    for _ in 0..steps(horizon) {
        let [from, to] = places.each_ref().map(|place| place.address);
        device.launch(own.len(), SurfaceSpreadParams { jobs, from, to });
        places.reverse();
    }
    places.iter().for_each(|place| drop(device.read_checked(place)));
    places[0].address
}

impl EditRun {
    pub fn new(device: &mut Device, work: &PreparedEdits, rng: &mut Rng, room: EditRoom, look: i32) -> Self {
        let (mut slots, mut jobs, mut list) = (Slots::default(), Vec::new(), Vec::new());
        let mut windows = Stencil { look, refs: Vec::new() };
        for of_brick in work.bricks() {
            let Some(pos) = of_brick.first().map(|job| job.pos()) else { continue };
            let base = slots.reference(work.base, pos);
            // The target is the same slot or another one. Stencil edits need another one.
            let is_in_place = base != NONE && !work.looks_around() && rng.bool();
            let target = if is_in_place { base >> 1 } else { slots.brick(None) };
            let (window, strides) =
                if work.looks_around() { windows.around(&mut slots, work.base, pos) } else { (0, 0) };
            let stack = slots.stack(work.base.ground(), (pos.0.x, pos.0.z));
            let (first, count) = (list.len() as u32, of_brick.len() as u32);
            list.extend(of_brick.iter().map(|job| job.edit));
            let cuts = cuts(work.grid, pos);
            jobs.push(EditJob {
                brick: pos.0.to_array(),
                base,
                target,
                stack,
                first,
                count,
                cuts,
                window,
                strides,
                surface: NONE,
            });
        }
        let surface_jobs = surface_jobs_with_windows(work, &mut slots, &mut jobs);
        let (mut images, mut grids) = (vec![7u16; 3], Vec::new());
        let mut image = |image: &GreyImage| {
            images.extend_from_slice(image.samples());
            (images.len() - image.samples().len()) as u32
        };
        let mut record = |record: &PreparedEdit| {
            let grid = record.evaluator.grid().map_or(NONE, |grid| {
                grids.push(GridRecord::new(&grid, image(grid.image)));
                grids.len() as u32 - 1
            });
            layout::record(record.reach, record.operation, &record.evaluator, grid)
        };
        let edit_records: Vec<EditRecord> = work.edits.iter().map(&mut record).collect();
        let sculpt = |record: &PreparedEdit| layout::sculpt(record, &mut image);
        let sculpt_params: Vec<SculptParams> = work.edits.iter().map(sculpt).collect();

        let bricks = device.upload(&slots.bricks);
        let results = device.output::<EditResult>(jobs.len());
        let records = device.output::<BrickRecord>(room.records);
        let materials = device.output::<[u8; MATERIAL_BYTES]>(room.materials);
        let parts = device.output::<EditPart>(room.parts);
        let counts = device.output::<EditCount>(room.counts);
        let counters = device.counters(4);
        let stacks = device.upload(&slots.stacks);
        let surface = launch_surface(device, work, [bricks, stacks], &surface_jobs);
        let params = EditParams {
            bricks,
            stacks,
            jobs: device.upload(&jobs),
            list: device.upload(&list),
            edit_records: device.upload(&edit_records),
            results: results.address,
            records: records.address,
            materials: materials.address,
            parts: parts.address,
            counts: counts.address,
            counters: counters.address,
            record_capacity: room.records as u32,
            material_capacity: room.materials as u32,
            part_capacity: room.parts as u32,
            count_capacity: room.counts as u32,
            strata: device.strata(work.base.ground()),
            grids: device.upload(&grids),
            images: device.upload(&images),
        };
        if work.looks_around() {
            let rules = work.rules.as_ref().map_or(0, |rules| {
                let (rules, boxes) = layout::rules(rules);
                device.place(&[bytemuck::bytes_of(&rules), bytemuck::cast_slice(&boxes)].concat())
            });
            let params = StencilEditParams {
                edit: params,
                windows: device.upload(&windows.refs),
                sculpt_params: device.upload(&sculpt_params),
                surface,
                rules,
                look,
                last: [work.grid.width(), work.grid.depth()],
                pad: 0,
            };
            device.launch(jobs.len(), params);
        } else {
            device.launch(jobs.len(), params);
        }
        let run = Self {
            jobs,
            results: device.read_checked(&results),
            records: device.read_checked(&records),
            materials: device.read_checked(&materials),
            parts: device.read_checked(&parts),
            counts: device.read_checked(&counts),
            counters: device.read(&counters),
            after: device.read_at(bricks, slots.bricks.len()),
            before: slots.bricks,
        };
        device.clear();
        run
    }

    /// The brick stored in the output entries of a result.
    fn brick_in_entries(&self, result: &EditResult) -> Option<Brick> {
        let record = self.records.get(result.record as usize)?;
        let materials = match result.flags & EditResult::HAS_MATERIALS {
            0 => None,
            _ => Some(self.materials.get(result.material as usize)?),
        };
        Some(brick_of(record, materials))
    }

    fn slot<'a>(&self, slots: &'a [u8], job: &EditJob) -> &'a [u8] {
        &slots[job.target as usize * BRICK_BYTES..][..BRICK_BYTES]
    }

    /// Asserts that bricks, results and hash equal those of the CPU. Without enough room, some entries may be
    /// missing.
    pub fn check_bricks(&self, delta: &EditDelta, is_room: bool) {
        let mut expected: HashMap<BrickPos, _> =
            delta.bricks.iter().map(|brick| (brick.pos, brick)).collect();
        let (mut hash, mut records, mut materials) = (0u64, 0, 0);
        for (job, result) in self.jobs.iter().zip(&self.results) {
            let pos = BrickPos(IVec3::from_array(job.brick));
            let Some(drafted) = expected.remove(&pos) else {
                assert_eq!(result.flags, 0, "{pos:?} did not change");
                assert_eq!(self.slot(&self.after, job), self.slot(&self.before, job), "{pos:?}");
                continue;
            };
            let has = |flag: u32| result.flags & flag != 0;
            let brick = &*drafted.brick;
            assert!(has(EditResult::CHANGED), "{pos:?}");
            assert_eq!(has(EditResult::EXTENDED), drafted.is_extended, "{pos:?}");
            assert_eq!(has(EditResult::UNIFORM), brick.uniform().is_some(), "{pos:?}");
            assert_eq!(has(EditResult::HAS_MATERIALS), brick.materials().is_some(), "{pos:?}");
            assert_eq!(unpack_box(result.bounds, pos.origin()), drafted.changed, "{pos:?}");
            hash = hash.wrapping_add(result.hash);

            let slot = self.slot(&self.after, job);
            let (record, stored) = slot.split_at(RECORD_BYTES);
            let stored = stored.first_chunk().filter(|_| has(EditResult::HAS_MATERIALS));
            assert_same(&brick_of(&bytemuck::pod_read_unaligned(record), stored), brick, pos);
            if let Some(UniformKind { sample, material }) = brick.uniform() {
                let sample = sample.distance().unwrap_or_default() as u16;
                assert_eq!(result.uniform, u32::from(sample) | u32::from(material.0) << 16);
                assert_eq!((result.record, result.material), (NONE, NONE));
                continue;
            }
            records += 1;
            materials += u32::from(brick.materials().is_some());
            match self.brick_in_entries(result) {
                Some(found) => assert_same(&found, brick, pos),
                None => assert!(!is_room, "{pos:?} has no entry"),
            }
        }
        assert!(expected.is_empty(), "bricks without a job");
        assert_eq!(hash, delta.hash, "hash");
        assert_eq!(self.counters[..2], [records, materials]);
    }

    /// Asserts that parts and counts equal those of the CPU.
    pub fn check_effects(&self, delta: &EditDelta, work: &PreparedEdits) {
        type Part = (usize, [i32; 3], ChunkPos, [i32; 6]);
        let ends = |of: LatticeBox| {
            let ([a, b, c], [d, e, f]) = (of.min.to_array(), of.max.to_array());
            [a, b, c, d, e, f]
        };
        let mut expected: Vec<Part> = delta
            .parts
            .iter()
            .map(|part| {
                (part.edit, BrickPos::of(part.bounds.min).0.to_array(), part.chunk, ends(part.bounds))
            })
            .collect();
        let mut found: Vec<Part> = self
            .parts
            .iter()
            .map(|part| {
                let brick = self.jobs[part.job as usize].brick;
                let pos = BrickPos(IVec3::from_array(brick));
                let bounds = ends(unpack_box(part.bounds, pos.origin()));
                (part.edit as usize, brick, part_chunk(work.grid, pos, part.part), bounds)
            })
            .collect();
        expected.sort_unstable();
        found.sort_unstable();
        assert_eq!(found, expected);

        let (mut expected, mut found) = (BTreeMap::new(), BTreeMap::new());
        for count in &delta.counts {
            *expected.entry((count.edit, count.outcome as u32, count.material.0)).or_insert(0) +=
                count.voxels;
        }
        for count in &self.counts {
            let key = (count.edit as usize, count.outcome & 0xff, (count.outcome >> 8) as u8);
            *found.entry(key).or_insert(0) += u64::from(count.voxels);
        }
        assert_eq!(found, expected);
    }
}
