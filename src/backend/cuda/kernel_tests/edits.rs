//! Edits of random worlds.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use fastrand::Rng;
use glam::{IVec3, Vec3};

use super::super::layout::{self, *};
use super::{Device, Kernel, Slots, assert_same, seeds, worlds};
use crate::brush::{Brush, DEPTH, Edit, Roughness, Shape};
use crate::ground::{ColumnMaterial, GreyImage, Ground, MaterialControl, MaterialId};
use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, Column, LatticeBox};
use crate::terrain::{Terrain, TerrainSettings};
use crate::volume::{Brick, Bricks, EditWork, Ledger, SampleView};

/// Edits of all kinds: those of the worlds, larger ones that leave bricks all alike, and such as give ground its look back.
fn random_edits(rng: &mut Rng, ground: &Ground, chunk_size: u32) -> Vec<Edit> {
    let sculpts = rng.bool();
    let mut brushes = Vec::new();
    for _ in 0..rng.usize(1..6) {
        let mut brush = match rng.u32(0..6) {
            0 => worlds::random_brush_at_a_face(rng, ground, chunk_size),
            1 | 2 if sculpts => worlds::random_sculpting_brush(rng, ground),
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
        brush.power = rng.u8(..) | rng.u8(..);
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

/// The bricks around jobs, as edits look at them.
struct Around {
    look: i32,
    refs: Vec<u32>,
}

impl Around {
    /// The entry of a brick, and its strides. Each has a window of its own.
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

impl EditRun {
    fn new(device: &mut Device, work: &EditWork, rng: &mut Rng, room: EditRoom, look: i32) -> Self {
        let (mut slots, mut jobs, mut list) = (Slots::default(), Vec::new(), Vec::new());
        let mut windows = Around { look, refs: Vec::new() };
        for of_brick in work.bricks() {
            let Some(pos) = of_brick.first().map(|job| job.pos()) else { continue };
            let base = slots.reference(work.base, pos);
            // In place, or to another slot; where edits look around, always to another one.
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
                pad: 0,
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
        if work.looks_around() {
            let mut images = vec![7u16; 3];
            let mut image = |image: &GreyImage| {
                images.extend_from_slice(image.samples());
                (images.len() - image.samples().len()) as u32
            };
            let chisel = |tool: &crate::volume::Tool| layout::chisel(tool, &mut image);
            let chisels: Vec<Chisel> = work.tools.iter().map(chisel).collect();
            let rules = work.rules.as_ref().map_or(0, |rules| {
                let (rules, boxes) = layout::rules(rules);
                device.place(&[bytemuck::bytes_of(&rules), bytemuck::cast_slice(&boxes)].concat())
            });
            let params = CarefulParams {
                edit: params,
                windows: device.upload(&windows.refs),
                chisels: device.upload(&chisels),
                images: device.upload(&images),
                rules,
                look,
                last: [work.grid.width(), work.grid.depth()],
                pad: 0,
            };
            device.launch(Kernel::Careful, jobs.len(), params);
        } else {
            device.launch(Kernel::Edit, jobs.len(), params);
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
fn compare_edits(
    device: &mut Device,
    (samples, grid): (SampleView, ChunkGrid),
    edits: &[Edit],
    rng: &mut Rng,
) -> usize {
    let edits: Vec<&Edit> = edits.iter().collect();
    let rules = worlds::random_rules(rng, samples.ground());
    let work = EditWork::new(samples, grid, &edits);
    let work = work.under((rng.u32(0..3) == 0).then_some(&rules));
    let ledger = ledger_of(&work);
    let most = EditRoom {
        records: ledger.bricks.len(),
        materials: ledger.bricks.iter().filter(|drafted| drafted.brick.materials().is_some()).count(),
        parts: ledger.parts.len(),
        counts: ledger.counts.len(),
    };
    let run = EditRun::new(device, &work, rng, most, FAR);
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
    let short = EditRun::new(device, &work, rng, room, FAR);
    short.check_bricks(&ledger, false);
    assert_eq!(short.counters, run.counters, "counters go on past the room");
    // Windows that end near the brick do, or it is told that they don't.
    let near = EditRun::new(device, &work, rng, most, 1);
    if near.results.iter().all(|result| result.flags & EditResult::TOO_FAR == 0) {
        near.check_bricks(&ledger, true);
        near.check_effects(&ledger, &work);
    }
    ledger.bricks.len()
}

/// How far windows have to reach up and down that are always enough.
const FAR: i32 = 8;

#[test]
fn edits_are_those_of_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    let mut bricks = 0;
    for (seed, mut rng) in seeds(40) {
        let terrain = worlds::random_world(&mut rng, seed);
        let world = terrain.world();
        let edits = random_edits(&mut rng, world.ground(), world.grid().size() as u32);
        bricks += compare_edits(&mut device, (world.samples(), world.grid()), &edits, &mut rng);
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
            let world = terrain.world();
            let edits = random_edits(&mut rng, world.ground(), settings.chunk_size);
            compare_edits(&mut device, (world.samples(), world.grid()), &edits, &mut rng);
            edits.iter().for_each(|edit| terrain.submit_edit(edit));
            terrain.apply(std::iter::empty::<Brush>());
        }
    }
}

/// A brick that no brush would leave behind: any density beside any other, many of them cut off.
fn noise_brick(rng: &mut Rng) -> Brick {
    let mut sample = || match rng.u32(0..6) {
        0 => DEPTH as i16,
        1 => -DEPTH as i16,
        2 => rng.i16(..),
        _ => rng.i16(-300..300),
    };
    let mut brick = Brick::of_edited(&std::array::from_fn(|_| sample()));
    if rng.bool() {
        (0..512).for_each(|index| brick.set_material(index, MaterialId(rng.u8(0..4))));
    }
    brick
}

#[test]
fn noise_is_sculpted_like_on_the_cpu() {
    let Some(mut device) = Device::start() else { return };
    for (seed, mut rng) in seeds(24) {
        let ground = worlds::random_ground(&mut rng, seed).0;
        let grid =
            ChunkGrid::new(worlds::CHUNK_SIZES[seed as usize % 4] as i32, ground.width(), ground.depth());
        let near = LatticeBox::point(IVec3::ONE).grown(1).points();
        let mut bricks = Bricks::default();
        for pos in near.map(BrickPos).filter(|_| rng.u32(0..6) > 0).collect::<Vec<_>>() {
            bricks.insert(pos, Arc::new(noise_brick(&mut rng)));
        }
        let brush = |rng: &mut Rng| {
            let place = Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 16.0 + 4.0;
            let shape = Shape::sphere(place, 2.0 + rng.f32() * 5.0);
            worlds::sculpting_brush(rng, shape, place)
        };
        let edits: Vec<Edit> = (0..3).filter_map(|_| Edit::quantize(&brush(&mut rng)).ok()).collect();
        compare_edits(&mut device, (SampleView::new(&ground, &bricks), grid), &edits, &mut rng);
    }
}
