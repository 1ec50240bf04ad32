//! Kernels give what the CPU gives, bit for bit: random worlds on a card, or on the emulator where there is none.
//!
//! `BURROW_WORLDS` says how many worlds to try.

use std::collections::{BTreeMap, HashMap};

use bytemuck::{Pod, Zeroable};
use fastrand::Rng;
use glam::{IVec3, Vec3};

use super::device::{self, Kernel};
use super::layout::{self, *};
use super::tests::{self, worlds};
use crate::brush::{Brush, Edit, Roughness, Shape};
use crate::ground::{ColumnMaterial, Ground, MaterialControl, MaterialId};
use crate::lattice::{BrickPos, ChunkPos, Column, LatticeBox, SNAP};
use crate::surface::MaterialMix;
use crate::surface::block::{self, Block, Mesher, Parts};
use crate::surface::mesh::Vertex;
use crate::surface::vertex::WorldView;
use crate::terrain::{Terrain, TerrainSettings};
use crate::volume::{Brick, EditWork, Ledger, SampleView};

/// A device, and what is allocated there.
struct Device {
    own: Box<dyn device::Device>,
    allocated: Vec<Address>,
}

/// Memory behind every output that no kernel may touch.
const MARGIN: usize = 64;
/// What it is filled with.
const RUBBISH: u8 = 0xa5;

impl Device {
    /// `None` where there is none; the test is skipped then.
    fn start() -> Option<Self> {
        Some(Self { own: tests::device()?, allocated: Vec::new() })
    }

    /// Copies bytes to memory of the device.
    fn place(&mut self, bytes: &[u8]) -> Address {
        let address = self.own.alloc(bytes.len()).expect("memory of the device");
        self.allocated.push(address);
        let mut host = self.own.alloc_host(bytes.len()).expect("memory of the host");
        host.bytes_mut()[..bytes.len()].copy_from_slice(bytes);
        self.own.upload(&*host, 0..bytes.len(), address).expect("upload");
        self.own.wait().expect("upload");
        address
    }

    /// Copies values to the device.
    fn upload<T: Pod>(&mut self, values: &[T]) -> Address {
        self.place(bytemuck::cast_slice(values))
    }

    /// Room for an output of so many values.
    fn output<T: Pod>(&mut self, len: usize) -> Output<T> {
        let bytes = (len * size_of::<T>()).next_multiple_of(16) + MARGIN;
        let address = self.place(&vec![RUBBISH; bytes]);
        Output { address, len, of: std::marker::PhantomData }
    }

    /// Counters that are zero.
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
        self.own.download(address, &mut *host, 0..bytes.len()).expect("download");
        self.own.wait().expect("download");
        bytes.copy_from_slice(&host.bytes()[..bytes.len()]);
        values
    }

    /// Reads an output, behind which nothing may have been written.
    fn read_checked<T: Pod>(&mut self, output: &Output<T>) -> Vec<T> {
        let bytes = output.len * size_of::<T>();
        let behind = bytes.next_multiple_of(16) + MARGIN - bytes;
        let margin: Vec<u8> = self.read_at(output.address + bytes as u64, behind);
        assert!(margin.iter().all(|&byte| byte == RUBBISH), "something was written past the end");
        self.read(output)
    }

    fn launch<T: Pod>(&mut self, kernel: Kernel, blocks: usize, params: T) {
        self.own.launch(kernel, blocks as u32, bytemuck::bytes_of(&params)).expect("the launch succeeds");
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
    /// A slot for a brick; `None` leaves rubbish in it.
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

/// Are both bricks the same, materials included?
fn assert_same(found: &Brick, expected: &Brick, what: impl std::fmt::Debug) {
    assert_eq!(found.samples(), expected.samples(), "samples of {what:?}");
    assert_eq!(found.solid(), expected.solid(), "solid bits of {what:?}");
    assert_eq!(found.edited(), expected.edited(), "edited bits of {what:?}");
    assert_eq!(found.materials(), expected.materials(), "materials of {what:?}");
}

fn seeds(default: u64) -> impl Iterator<Item = (u64, Rng)> {
    (0..worlds::world_count(default)).map(|seed| (seed, Rng::with_seed(seed)))
}

// ---- scatter ----

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
    device.launch(Kernel::Scatter, jobs.len(), params);
    assert!(device.read_checked(&to) == expected);
}

// ---- edit ----

/// Edits of all kinds: those of the worlds, larger ones that leave bricks all alike, and such as give ground its look back.
fn random_edits(rng: &mut Rng, ground: &Ground, chunk_size: u32) -> Vec<Edit> {
    let mut brushes = Vec::new();
    for _ in 0..rng.usize(1..6) {
        let mut brush = match rng.u32(0..6) {
            0 => worlds::random_brush_at_a_face(rng, ground, chunk_size),
            _ => worlds::random_brush(rng, ground),
        };
        match rng.u32(0..8) {
            0 => {
                let center = worlds::random_brush(rng, ground).shape;
                let at = Edit::quantize(&Brush::dig(center))
                    .map_or(IVec3::ZERO, |edit| edit.reach().min)
                    .as_vec3();
                brush.shape = Shape::cuboid(at, Vec3::new(17.0, 13.0, 15.0));
            }
            1 => {
                brush = Brush { operation: Brush::paint(brush.shape, MaterialId::GROUND).operation, ..brush }
            }
            2 => brush = Brush { operation: Brush::add(brush.shape, MaterialId::GROUND).operation, ..brush },
            3 => {
                let roughness = Roughness::new(rng.f32() * 8.0, 1.0 + rng.f32() * 30.0, rng.u32(..));
                brush = brush.with_roughness(roughness);
            }
            4 => {
                // Deeper than stored densities reach.
                let column = Column::new(rng.i32(0..ground.width()), rng.i32(0..ground.depth()));
                let y = ground.height(column) as f32 / 256.0 - 90.0 - rng.f32() * 80.0;
                let shape = Shape::sphere(Vec3::new(column.x as f32, y, column.z as f32), 4.0);
                brush = Brush::paint(shape, MaterialId(rng.u8(..)));
            }
            _ => {}
        }
        brushes.push(brush);
        if rng.u32(0..4) == 0 {
            brushes.extend(brushes.last().cloned());
        }
    }
    brushes.iter().filter_map(|brush| Edit::quantize(brush).ok()).collect()
}

/// What room there is for output.
#[derive(Clone, Copy, Debug)]
struct EditRoom {
    records: usize,
    materials: usize,
    parts: usize,
    counts: usize,
}

/// A launch of `edit`, and what came out.
struct EditRun {
    jobs: Vec<EditJob>,
    results: Vec<EditResult>,
    records: Vec<BrickRecord>,
    materials: Vec<[u8; MATERIAL_BYTES]>,
    parts: Vec<EditPart>,
    counts: Vec<EditCount>,
    counters: Vec<u32>,
    /// All slots before, and after.
    before: Vec<u8>,
    after: Vec<u8>,
}

impl EditRun {
    fn new(device: &mut Device, work: &EditWork, rng: &mut Rng, room: EditRoom) -> Self {
        let (mut slots, mut jobs, mut list) = (Slots::default(), Vec::new(), Vec::new());
        for of_brick in work.bricks() {
            let Some(pos) = of_brick.first().map(|job| job.pos()) else { continue };
            let base = slots.reference(work.base, pos);
            // In place, or to another slot.
            let target = if base != NONE && rng.bool() { base >> 1 } else { slots.brick(None) };
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
                pad: [0; 3],
            });
        }
        let tools: Vec<Tool> =
            work.tools.iter().map(|tool| layout::tool(tool.reach, tool.operation, &tool.evaluator)).collect();

        let bricks = device.upload(&slots.bricks);
        let results = device.output::<EditResult>(jobs.len());
        let records = device.output::<BrickRecord>(room.records);
        let materials = device.output::<[u8; MATERIAL_BYTES]>(room.materials);
        let parts = device.output::<EditPart>(room.parts);
        let counts = device.output::<EditCount>(room.counts);
        let counters = device.counters(4);
        let params = EditParams {
            bricks,
            stacks: device.upload(&slots.stacks),
            jobs: device.upload(&jobs),
            list: device.upload(&list),
            tools: device.upload(&tools),
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
        };
        device.launch(Kernel::Edit, jobs.len(), params);
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

    /// The brick that an entry holds.
    fn brick_in_entries(&self, result: &EditResult) -> Option<Brick> {
        let record = bytemuck::bytes_of(self.records.get(result.record as usize)?);
        let materials = match result.flags & EditResult::HAS_MATERIALS {
            0 => None,
            _ => Some(self.materials.get(result.material as usize)?.as_slice()),
        };
        brick_of(record, materials)
    }

    fn slot<'a>(&self, slots: &'a [u8], job: &EditJob) -> &'a [u8] {
        &slots[job.target as usize * BRICK_BYTES..][..BRICK_BYTES]
    }

    /// Bricks, results and hash are those of the CPU. Where room is short, some entries are missing.
    fn check_bricks(&self, ledger: &Ledger, is_room: bool) {
        let mut expected: HashMap<BrickPos, _> =
            ledger.bricks.iter().map(|brick| (brick.pos, brick)).collect();
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
            let stored = slot.get(RECORD_BYTES..).filter(|_| has(EditResult::HAS_MATERIALS));
            assert_same(&brick_of(slot, stored).expect("a slot holds a brick"), brick, pos);
            if let Some((sample, material)) = brick.uniform() {
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
        assert_eq!(hash, ledger.hash, "hash");
        assert_eq!(self.counters[..2], [records, materials]);
    }

    /// What each edit changed and counted is what the CPU says.
    fn check_effects(&self, ledger: &Ledger, work: &EditWork) {
        type Part = (usize, [i32; 3], ChunkPos, [i32; 6]);
        let ends = |of: LatticeBox| {
            let ([a, b, c], [d, e, f]) = (of.min.to_array(), of.max.to_array());
            [a, b, c, d, e, f]
        };
        let mut expected: Vec<Part> = ledger
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
        for count in &ledger.counts {
            *expected.entry((count.edit, count.fate as u32, count.material.0)).or_insert(0) += count.voxels;
        }
        for count in &self.counts {
            let key = (count.edit as usize, count.fate & 0xff, (count.fate >> 8) as u8);
            *found.entry(key).or_insert(0) += u64::from(count.voxels);
        }
        assert_eq!(found, expected);
    }
}

/// What the CPU makes of edits.
fn ledger_of(work: &EditWork) -> Ledger {
    let mut all = Ledger::default();
    work.run(|mut ledger| {
        all.bricks.append(&mut ledger.bricks);
        all.parts.append(&mut ledger.parts);
        all.counts.append(&mut ledger.counts);
        all.hash = all.hash.wrapping_add(ledger.hash);
    });
    all
}

/// Applies edits to a world on both sides, with room enough and then without; returns how many bricks changed.
fn compare_edits(device: &mut Device, world: &crate::terrain::World, edits: &[Edit], rng: &mut Rng) -> usize {
    let edits: Vec<&Edit> = edits.iter().collect();
    let work = EditWork::new(world.samples(), world.grid(), &edits);
    let ledger = ledger_of(&work);
    let most = EditRoom {
        records: ledger.bricks.len(),
        materials: ledger.bricks.iter().filter(|drafted| drafted.brick.materials().is_some()).count(),
        parts: ledger.parts.len(),
        counts: ledger.counts.len(),
    };
    let run = EditRun::new(device, &work, rng, most);
    assert_eq!(run.counters[2..], [most.parts as u32, most.counts as u32]);
    run.check_bricks(&ledger, true);
    run.check_effects(&ledger, &work);

    let mut less = |room: usize| if rng.bool() { room } else { rng.usize(0..=room) };
    let room = EditRoom {
        records: less(most.records),
        materials: less(most.materials),
        parts: less(most.parts),
        counts: less(most.counts),
    };
    let short = EditRun::new(device, &work, rng, room);
    short.check_bricks(&ledger, false);
    assert_eq!(short.counters, run.counters, "counters go on past the room");
    ledger.bricks.len()
}

#[test]
fn edits_are_those_of_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    let mut bricks = 0;
    for (seed, mut rng) in seeds(40) {
        let terrain = worlds::random_world(&mut rng, seed);
        let world = terrain.world();
        let edits = random_edits(&mut rng, world.ground(), world.grid().size() as u32);
        bricks += compare_edits(&mut device, world, &edits, &mut rng);
    }
    println!("{bricks} edited bricks are the same");
}

#[test]
fn edits_at_the_ends_of_the_lattice_are_those_of_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    for (seed, mut rng) in seeds(12) {
        let side = if rng.bool() { 1.0 } else { -1.0 };
        let height = |x: i32, z: i32| side * (32_760.0 - f64::from((x * 7 + z * 5) % 23) * 0.7);
        let ground = Ground::from_fn(30, 27, height).expect("a ground");
        let materials = ColumnMaterial { base: MaterialId(3), overlay: MaterialId(4), blend: 200 };
        let ground = ground
            .with_materials(&MaterialControl::Uniform(materials))
            .unwrap_or_else(|error| panic!("{error}"));
        let settings =
            TerrainSettings { chunk_size: worlds::CHUNK_SIZES[seed as usize % 4], ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("a terrain");
        for _ in 0..3 {
            let edits = random_edits(&mut rng, terrain.world().ground(), settings.chunk_size);
            compare_edits(&mut device, terrain.world(), &edits, &mut rng);
            edits.iter().for_each(|edit| terrain.submit_edit(edit));
            terrain.apply(std::iter::empty::<Brush>());
        }
    }
}

// ---- mesh ----

/// Every block that could draw something, and some more.
fn blocks_around(view: &WorldView, world: &crate::terrain::World) -> Vec<Block> {
    let mut bricks: Vec<BrickPos> = world
        .bricks()
        .flat_map(|(pos, _)| LatticeBox::point(pos.0).grown(1).points())
        .map(BrickPos)
        .collect();
    for ((x, z), cells) in world.mask().words() {
        let rows = block::sheet_rows(world.ground(), Column::new(x * 8, z * 8), cells);
        bricks.extend((rows.start >> 3..=rows.end >> 3).map(|y| BrickPos(IVec3::new(x, y, z))));
    }
    bricks.sort_unstable_by_key(|pos| (pos.0.x, pos.0.z, pos.0.y));
    bricks.dedup();
    let mut blocks = Vec::new();
    for brick in bricks {
        for chunk in view.grid.chunks_of(brick.samples()) {
            let cells = view.grid.chunk_cells(chunk).intersection(brick.samples());
            if cells.is_some_and(|cells| view.grid.has_cell(Column::of(cells.min))) {
                blocks.push(Block { brick, chunk });
            }
        }
    }
    blocks
}

/// A launch of `mesh`, and what came out.
struct MeshRun {
    results: Vec<MeshResult>,
    positions: Vec<[u16; 4]>,
    normals: Vec<[u32; 3]>,
    mixes: Vec<[u8; 8]>,
    indices: Vec<u16>,
    counters: Vec<u32>,
}

impl MeshRun {
    fn new(
        device: &mut Device,
        view: &WorldView,
        blocks: &[Block],
        vertices: usize,
        indices: usize,
        has_mixes: bool,
    ) -> Self {
        let (mut slots, mut windows, mut columns, mut jobs) =
            (Slots::default(), Vec::new(), Vec::<ColumnJob>::new(), Vec::new());
        for block in blocks {
            let (pos, window) = (block.brick, windows.len() as u32);
            let around = LatticeBox::point(IVec3::ZERO).grown(1);
            // Along y, then z, then x.
            let mut steps: Vec<IVec3> = around.points().collect();
            steps.sort_unstable_by_key(|step| (step.x, step.z, step.y));
            windows.extend(steps.iter().map(|&step| slots.reference(view.samples, BrickPos(pos.0 + step))));
            let stack = (pos.0.x, pos.0.z);
            if columns.last().is_none_or(|last| (last.x, last.z) != stack) {
                let slot = slots.stack(view.samples.ground(), stack);
                columns.push(column_job(view, stack, slot));
            }
            let cells =
                view.grid.chunk_cells(block.chunk).intersection(pos.samples()).expect("a block has cells");
            jobs.push(MeshJob {
                window: window + 13,
                strides: 9 | 3 << 16,
                column: columns.len() as u32 - 1,
                y: pos.0.y,
                cells: pack_box(cells, pos.origin()),
                pad: 0,
            });
        }
        let results = device.output::<MeshResult>(jobs.len());
        let positions = device.output::<[u16; 4]>(vertices);
        let normals = device.output::<[u32; 3]>(vertices);
        let mixes = has_mixes.then(|| device.output::<[u8; 8]>(vertices));
        let triangles = device.output::<u16>(indices);
        let counters = device.counters(2);
        let params = MeshParams {
            bricks: device.upload(&slots.bricks),
            stacks: device.upload(&slots.stacks),
            windows: device.upload(&windows),
            columns: device.upload(&columns),
            jobs: device.upload(&jobs),
            table: device.upload(&table()),
            results: results.address,
            positions: positions.address,
            normals: normals.address,
            mixes: mixes.as_ref().map_or(0, |mixes| mixes.address),
            indices: triangles.address,
            counters: counters.address,
            vertex_capacity: vertices as u32,
            index_capacity: indices as u32,
            width: view.grid.width(),
            depth: view.grid.depth(),
            single: single_mix(view.samples.ground()),
            pad: 0,
        };
        device.launch(Kernel::Mesh, jobs.len(), params);
        let run = Self {
            results: device.read_checked(&results),
            positions: device.read_checked(&positions),
            normals: device.read_checked(&normals),
            mixes: mixes.map_or_else(Vec::new, |mixes| device.read_checked(&mixes)),
            indices: device.read_checked(&triangles),
            counters: device.read(&counters),
        };
        device.clear();
        run
    }

    /// A vertex as its chunk has it.
    fn vertex(&self, at: usize, base: IVec3, single: Option<MaterialMix>) -> Vertex {
        let [x, y, z, rest] = self.positions[at].map(i32::from);
        assert_eq!(rest, 0);
        let of = |mix: &[u8; 8]| {
            let [a, b, c, d, e, f, g, h] = *mix;
            MaterialMix { ids: [a, b, c, d], weights: [e, f, g, h] }
        };
        Vertex {
            position: base * SNAP + IVec3::new(x, y, z),
            normal: Vec3::from_array(self.normals[at].map(f32::from_bits)),
            materials: self.mixes.get(at).map(of).or(single).unwrap_or_default(),
        }
    }

    /// Blocks are those of the CPU; returns how many were written.
    fn check(&self, view: &WorldView, parts: &Parts) -> usize {
        let single = view.samples.ground().single_material().map(MaterialMix::pure);
        let (mut written, mut vertices_in_all, mut indices_in_all) = (0, 0, 0);
        for ((block, vertices, indices), result) in parts.iter().zip(&self.results) {
            assert_eq!(result.vertices as usize, vertices.len(), "vertices of {block:?}");
            assert_eq!(result.indices as usize, indices.len(), "indices of {block:?}");
            vertices_in_all += vertices.len();
            indices_in_all += indices.len();
            if vertices.is_empty() {
                assert_eq!(*result, MeshResult::zeroed(), "{block:?}");
            }
            if result.vertex == NONE {
                continue;
            }
            written += 1;
            let base = block.brick.origin() - view.grid.origin(block.chunk);
            for (i, expected) in vertices.iter().enumerate() {
                let found = self.vertex(result.vertex as usize + i, base, single);
                assert!(found.is_same(expected), "vertex {i} of {block:?}: {found:?}, not {expected:?}");
            }
            let found = &self.indices[result.index as usize..][..indices.len()];
            assert_eq!(found, indices, "{block:?}");
        }
        assert_eq!(self.counters[..2], [vertices_in_all as u32, indices_in_all as u32]);
        written
    }
}

/// Meshes a world on both sides, with room enough and then without; returns how many blocks there are.
fn compare_meshes(device: &mut Device, world: &crate::terrain::World, rng: &mut Rng) -> usize {
    let view = world.view();
    let blocks = blocks_around(&view, world);
    let mut parts = Parts::default();
    Mesher::default().mesh(&view, &blocks, &mut parts);
    let (vertices, indices) = (parts.vertices.len(), parts.indices.len());
    let is_plain = view.samples.ground().single_material().is_some()
        && world.bricks().all(|(_, brick)| brick.materials().is_none());
    let has_mixes = !is_plain || rng.bool();
    let run = MeshRun::new(device, &view, &blocks, vertices, indices, has_mixes);
    assert_eq!(run.check(&view, &parts), blocks.len(), "all blocks have room");

    let mut less = |room: usize| if rng.bool() { room } else { rng.usize(0..=room) };
    let short = MeshRun::new(device, &view, &blocks, less(vertices), less(indices), has_mixes);
    short.check(&view, &parts);
    blocks.len()
}

#[test]
fn meshes_are_those_of_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    let mut blocks = 0;
    for (seed, mut rng) in seeds(40) {
        let terrain = worlds::random_world(&mut rng, seed);
        blocks += compare_meshes(&mut device, terrain.world(), &mut rng);
    }
    println!("{blocks} blocks are the same");
}

#[test]
fn a_brick_of_noise_is_meshed_like_on_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    for (seed, mut rng) in seeds(8) {
        // The roughest brushes there are: many samples change sides, so bricks have as many vertices as they can.
        let mut terrain =
            Terrain::new(Ground::flat(40, 40, 20.0).expect("flat"), &TerrainSettings::default())
                .expect("a terrain");
        for _ in 0..30 {
            let center = Vec3::new(rng.f32() * 40.0, rng.f32() * 40.0, rng.f32() * 40.0);
            let shape = Shape::sphere(center, 1.0 + rng.f32() * 9.0);
            let brush =
                if rng.bool() { Brush::dig(shape) } else { Brush::add(shape, MaterialId(rng.u8(0..5))) };
            terrain.apply([brush.with_roughness(Roughness::new(8.0, 1.0, rng.u32(..)))]);
        }
        let blocks = compare_meshes(&mut device, terrain.world(), &mut rng);
        assert!(blocks > 20, "seed {seed}");
    }
}

#[test]
fn cliffs_are_meshed_like_on_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    for (seed, mut rng) in seeds(6) {
        // Between columns 32 voxels apart, crossings lie in the middle of two steps, which are rounded up.
        let step = f64::from(1 << rng.u32(5..8));
        let rises: Vec<f64> = (0..41).map(|_| f64::from(rng.i32(0..512)) / 256.0).collect();
        let height = |x: i32, z: i32| rises[z as usize] + if (x + z / 3) & 1 == 0 { step } else { 0.0 };
        let ground = Ground::from_fn(30, 40, height).expect("finite heights");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("a terrain");
        for _ in 0..4 {
            let center = Vec3::new(rng.f32() * 30.0, rng.f32() * step as f32, rng.f32() * 40.0);
            terrain.apply([Brush::dig(Shape::sphere(center, 4.0))]);
        }
        assert!(compare_meshes(&mut device, terrain.world(), &mut rng) > 20, "seed {seed}");
    }
}
