//! A trial before a device is trusted: ground is made of noise, and a piece of ground is dug and sculpted, on it and on the
//! processor. Every bit is compared, and the time it takes on both.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use glam::{IVec3, Vec2, Vec3};
use web_time::Instant;

use super::device::Fault;
use super::layout;
use super::session::Session;
use crate::backend::choice::Costs;
use crate::backend::{Compute, Cpu};
use crate::brush::{Brush, Edit, Roughness, Shape, Stamp};
use crate::ground::{GreyImage, Ground, GroundError, MaterialId, NoiseHeights, NoiseKind};
use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, Column, LatticeBox, ONE};
use crate::surface::block::{Block, Part, Parts};
use crate::surface::fresh::FreshParts;
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView, Vertex};
use crate::volume::{Brick, Bricks, DiggingRules, DraftedBrick, EditWork, Ledger, SampleView};

/// Cells along a side of the ground.
const SIDE: i32 = 256;

/// How often each thing is timed; the shortest time counts.
const REPEATS: usize = 3;

/// How thorough a trial is: brushes at once, and their radius, smallest first.
#[derive(Clone, Copy)]
pub(super) struct Sizes {
    /// Of these, all that comes out is compared.
    compared: &'static [(i32, f32)],
    /// The largest, which is timed only. Transactions that are larger still are judged by it.
    timed: Option<(i32, f32)>,
}

/// Enough to know how fast both are.
pub(super) const FULL: Sizes =
    Sizes { compared: &[(1, 1.0), (1, 4.0), (4, 6.0), (16, 6.0), (64, 6.0)], timed: Some((64, 12.0)) };

impl Sizes {
    /// To look whether all works.
    #[cfg(test)]
    pub const fn few(compared: &'static [(i32, f32)]) -> Self {
        Self { compared, timed: None }
    }
}

/// Tries a device out and measures it beside the processor.
///
/// # Errors
/// Where it fails, or differs from the processor in a single bit.
pub(super) fn run(session: &mut Session, sizes: Sizes) -> Result<Costs, Fault> {
    compare_heights(session)?;
    let ground = ground()?;
    let none = Bricks::default();
    let (samples, grid) = (SampleView::new(&ground, &none), ChunkGrid::new(32, SIDE, SIDE));
    let mut costs = Costs::default();
    for &(count, radius) in sizes.compared {
        let [smooth, rough] = [false, true].map(|is_rough| edits(&ground, count, radius, is_rough));
        let work = EditWork::new(samples, grid, &smooth.iter().collect::<Vec<_>>());
        let (times, ledgers) = compare_edits(session, &work)?;
        let jobs = work.jobs().len();
        costs.edit.iter_mut().zip(times).for_each(|(curve, time)| curve.push(jobs, time));

        let work = EditWork::new(samples, grid, &rough.iter().collect::<Vec<_>>());
        let (rough, _) = compare_edits(session, &work)?;
        // Under rules: not timed, as it takes about as long as sculpting.
        let rules = rules();
        let under_rules = work.under(Some(&rules));
        if summary(&ledgers_of(&under_rules)) != summary(&session.edit(&under_rules)?) {
            return Err(Fault::SelfTest);
        }
        let more = |on: usize| rough[on].saturating_sub(times[on]).as_secs_f64() / jobs as f64;
        costs.rough = [more(0), more(1)];

        let drafted: Vec<DraftedBrick> = ledgers.into_iter().flat_map(|ledger| ledger.bricks).collect();
        let bricks: Bricks =
            drafted.iter().map(|drafted| (drafted.pos, Arc::clone(&drafted.brick))).collect();
        let dug = SampleView::new(&ground, &bricks);
        let sculpting = sculpting_edits(&ground, count, radius);
        let work = EditWork::new(dug, grid, &sculpting.iter().collect::<Vec<_>>());
        let (times, _) = compare_edits(session, &work)?;
        let jobs = work.jobs().len();
        costs.careful.iter_mut().zip(times).for_each(|(curve, time)| curve.push(jobs, time));

        let mask = Mask::default();
        let view = WorldView { samples: dug, mask: MaskView::new(&mask), grid };
        let blocks = dirty(grid, &drafted);
        let times = compare_meshes(session, &view, &blocks)?;
        costs.mesh.iter_mut().zip(times).for_each(|(curve, time)| curve.push(blocks.len(), time));
        costs.upload = upload(session, &view, &blocks, &drafted, times[1])?;
    }
    if let Some((count, radius)) = sizes.timed {
        let sculpting = sculpting_edits(&ground, count, radius);
        time_many(session, &mut costs, samples, grid, &edits(&ground, count, radius, false), &sculpting)?;
    }
    Ok(costs)
}

/// Times edits, and the meshing that follows, on both.
fn time_many(
    session: &mut Session,
    costs: &mut Costs,
    samples: SampleView,
    grid: ChunkGrid,
    edits: &[Edit],
    sculpting: &[Edit],
) -> Result<(), Fault> {
    for (list, curves) in [(sculpting, &mut costs.careful), (edits, &mut costs.edit)] {
        let work = EditWork::new(samples, grid, &list.iter().collect::<Vec<_>>());
        let on_cpu = shortest(|| {
            ledgers_of(&work);
            Ok(())
        })?;
        let on_card = shortest(|| session.edit(&work).map(drop))?;
        let jobs = work.jobs().len();
        curves.iter_mut().zip([on_cpu, on_card]).for_each(|(curve, time)| curve.push(jobs, time));
    }
    let ledgers = ledgers_of(&EditWork::new(samples, grid, &edits.iter().collect::<Vec<_>>()));

    let drafted: Vec<DraftedBrick> = ledgers.into_iter().flat_map(|ledger| ledger.bricks).collect();
    let latest: Vec<_> = drafted.iter().map(|drafted| (drafted.pos, &*drafted.brick)).collect();
    let mask = Mask::default();
    let view = WorldView { samples: samples.under(&latest), mask: MaskView::new(&mask), grid };
    let blocks = dirty(grid, &drafted);
    let on_cpu = shortest(|| {
        Cpu.mesh(&view, &blocks, &|| {}, &mut |_| {});
        Ok(())
    })?;
    let on_card = shortest(|| session.mesh(&view, &blocks, &|| {}).map(drop))?;
    costs.mesh.iter_mut().zip([on_cpu, on_card]).for_each(|(curve, time)| curve.push(blocks.len(), time));
    costs.upload = upload(session, &view, &blocks, &drafted, on_card)?;
    Ok(())
}

/// The shortest time that something takes. The first time makes room for it.
fn shortest(mut work: impl FnMut() -> Result<(), Fault>) -> Result<Duration, Fault> {
    let mut best = Duration::MAX;
    for _ in 0..REPEATS {
        let start = Instant::now();
        work()?;
        best = best.min(start.elapsed());
    }
    Ok(best)
}

/// Seconds to bring a brick to the device, by how much longer meshing takes when it has none of these.
fn upload(
    session: &mut Session,
    view: &WorldView,
    blocks: &[Block],
    drafted: &[DraftedBrick],
    without: Duration,
) -> Result<f64, Fault> {
    let with = shortest(|| {
        drafted.iter().for_each(|drafted| drafted.brick.tag.set(0));
        session.mesh(view, blocks, &|| {}).map(drop)
    })?;
    Ok(with.saturating_sub(without).as_secs_f64() / drafted.len().max(1) as f64)
}

/// Ground of noise on both, larger than a block of threads and not of whole ones.
fn compare_heights(session: &mut Session) -> Result<(), Fault> {
    for kind in [NoiseKind::Fractal, NoiseKind::Ridged] {
        let noise = NoiseHeights { kind, seed: 3, scale: 21.5, ..NoiseHeights::default() };
        let refused = |error: GroundError| Fault::Failed(error.to_string());
        let terms = noise.terms(70, 40).map_err(refused)?;
        let mut heights = vec![0; terms.columns()];
        session.heights(&terms, &mut heights)?;
        if terms.ground(heights) != Some(Ground::from_noise(70, 40, &noise).map_err(refused)?) {
            return Err(Fault::SelfTest);
        }
    }
    Ok(())
}

/// Edits on both.
fn compare_edits(session: &mut Session, work: &EditWork) -> Result<([Duration; 2], Vec<Ledger>), Fault> {
    let is_same = |cpu: &Vec<Ledger>, cuda: &Vec<Ledger>| summary(cpu) == summary(cuda);
    let on_cpu = || {
        let start = Instant::now();
        (ledgers_of(work), start.elapsed())
    };
    let on_cuda = |session: &mut Session| {
        let start = Instant::now();
        Ok((session.edit(work)?, start.elapsed()))
    };
    compare(session, on_cpu, on_cuda, is_same)
}

/// Blocks meshed on both: timed until their surfaces are there, wherever that is, as an engine does.
fn compare_meshes(session: &mut Session, view: &WorldView, blocks: &[Block]) -> Result<[Duration; 2], Fault> {
    let on_cpu = || {
        let (start, mut meshed) = (Instant::now(), Default::default());
        Cpu.mesh(view, blocks, &|| {}, &mut |fresh| {
            let took = start.elapsed();
            meshed = (collected(blocks, fresh), took);
        });
        meshed
    };
    let on_cuda = |session: &mut Session| {
        let start = Instant::now();
        let meshed = session.mesh(view, blocks, &|| {})?;
        let took = start.elapsed();
        Ok((collected(blocks, &session.meshes.surfaces(view, blocks, meshed)), took))
    };
    compare(session, on_cpu, on_cuda, same).map(|(times, _)| times)
}

/// The surfaces of blocks as parts.
pub(super) fn collected(blocks: &[Block], fresh: &dyn FreshParts) -> Parts {
    let mut parts = Parts::default();
    for (number, &block) in blocks.iter().enumerate() {
        let Some(part) = fresh.part(number) else { continue };
        part.vertices.append_to(&mut parts.vertices);
        parts.indices.extend_from_slice(part.indices);
        parts.list.push(Part { block, vertices: parts.vertices.len(), indices: parts.indices.len() });
    }
    parts
}

/// What the processor makes of edits.
fn ledgers_of(work: &EditWork) -> Vec<Ledger> {
    let mut ledgers = Vec::new();
    Cpu.edit(work, &mut |ledger| ledgers.push(ledger));
    ledgers
}

/// The blocks that changed samples show in.
fn dirty(grid: ChunkGrid, drafted: &[DraftedBrick]) -> Vec<Block> {
    let near = |drafted: &DraftedBrick| {
        let around = LatticeBox { min: drafted.changed.min - 2, max: drafted.changed.max + 1 };
        BrickPos::covering(around).map(|pos| (pos.0.x, pos.0.z, pos.0.y))
    };
    let bricks: BTreeSet<_> = drafted.iter().flat_map(near).collect();
    let block = |(x, z, y)| {
        let brick = BrickPos(IVec3::new(x, y, z));
        Block { brick, chunk: grid.chunk_of(brick.origin()) }
    };
    bricks.into_iter().map(block).collect()
}

/// Does a thing on both, several times: the shortest times, and what came out on the processor.
fn compare<T>(
    session: &mut Session,
    mut cpu: impl FnMut() -> (T, Duration),
    mut cuda: impl FnMut(&mut Session) -> Result<(T, Duration), Fault>,
    is_same: impl Fn(&T, &T) -> bool,
) -> Result<([Duration; 2], T), Fault> {
    // The first time, memory grows and threads wake.
    let (expected, _) = cpu();
    if !is_same(&expected, &cuda(session)?.0) {
        return Err(Fault::SelfTest);
    }
    let mut best = [Duration::MAX; 2];
    for _ in 0..REPEATS {
        best[0] = best[0].min(cpu().1);
        best[1] = best[1].min(cuda(session)?.1);
    }
    Ok((best, expected))
}

/// Hills, and a slope steep enough for several cubes in a column.
fn ground() -> Result<Ground, Fault> {
    let height = |x: i32, z: i32| {
        let (x, z) = (f64::from(x), f64::from(z));
        (x * 0.11).sin() * 6.0 + (z * 0.07).cos() * 9.0 + (x - z) * 0.4 * f64::from(x > 128.0)
    };
    let made = Ground::from_fn(SIDE as u32, SIDE as u32, height);
    made.map_err(|error| Fault::Failed(error.to_string()))
}

/// The middle of a brush at the surface; they lie side by side. A small first one reaches as few bricks as a stroke can:
/// below the smallest amount that was measured nothing is known.
fn place(ground: &Ground, i: i32, radius: f32) -> Vec3 {
    let (x, z) = (12 + i % 8 * 31, 12 + i / 8 * 29);
    let height = ground.height(Column::new(x, z)) as f32 / ONE as f32;
    Vec3::new(x as f32 - 0.3, height - 0.2 * radius, z as f32 - 0.4)
}

/// Rules of every kind.
fn rules() -> DiggingRules {
    let box_at = |x: i32| LatticeBox { min: IVec3::new(x, -99, 9), max: IVec3::new(x + 2, 99, 18) };
    DiggingRules::default()
        .with_hardness(MaterialId(0), 150)
        .with_unbreakable(MaterialId(3))
        .with_bedrock(-3)
        .with_protected(box_at(14))
        .with_protected(box_at(50))
}

/// Brushes of every kind that sculpts, where others dug. None reads what another one changes.
fn sculpting_edits(ground: &Ground, count: i32, radius: f32) -> Vec<Edit> {
    let relief = GreyImage::from_samples(3, 2, vec![0, 40_000, 9_000, 65_535, 20_000, 1]).ok().map(Arc::new);
    let brush = |i: i32| {
        let center = place(ground, i, radius);
        let (shape, slope) = (Shape::sphere(center, radius + 1.0), Vec3::new(0.3, 1.0, -0.2));
        let brush = match (i / 3 % 6, &relief) {
            (0, _) => Brush::sharpen(shape, 1.0),
            (1, _) => Brush::flatten(shape, center, slope),
            (2, _) => Brush::level(shape, center.y),
            (3, Some(relief)) => {
                let stamp = Stamp::new(Arc::clone(relief), center, Vec2::splat(radius), 2.0);
                Brush::stamp(shape, stamp.onto(slope))
            }
            (4, _) => Brush::terrace(shape, 1.5),
            _ => Brush::lower(shape, 0.7),
        };
        match i % 3 {
            0 => Brush::smooth(brush.shape, 0.8),
            1 => Brush::raise(brush.shape, 1.3),
            _ => brush,
        }
    };
    (0..count).filter_map(|i| Edit::quantize(&brush(i)).ok()).collect()
}

/// Brushes at the surface, side by side.
fn edits(ground: &Ground, count: i32, radius: f32, is_rough: bool) -> Vec<Edit> {
    let brush = |i: i32| match (i % 4, place(ground, i, radius)) {
        (2, base) => Brush::add(Shape::cone(base, Vec3::new(1.0, radius * 1.5, 2.0), radius), MaterialId(3)),
        (3, from) => Brush::dig(Shape::capsule(from, from + Vec3::new(3.0, -radius, 4.0), radius * 0.7)),
        (_, center) => Brush::dig(Shape::sphere(center, radius)),
    };
    let power = |i: i32| [255, 100, 120, 20][(i / 2 % 4) as usize];
    let grain = |i: i32| Roughness::new(1.5, 4.0, i as u32);
    let brush =
        |i: i32| if is_rough { brush(i).with_roughness(grain(i)).with_power(power(i)) } else { brush(i) };
    (0..count).filter_map(|i| Edit::quantize(&brush(i)).ok()).collect()
}

/// What ledgers say, whoever wrote them and however much of it came to one entry.
#[derive(PartialEq)]
struct Summary {
    hash: u64,
    bricks: Vec<(String, Vec<u8>)>,
    /// Of each edit and chunk, the box around what changed.
    parts: BTreeMap<(usize, ChunkPos), Option<LatticeBox>>,
    /// Voxels of each edit, fate and material.
    counts: BTreeMap<(usize, u8, MaterialId), u64>,
}

fn summary(ledgers: &[Ledger]) -> Summary {
    let hash = ledgers.iter().fold(0u64, |hash, ledger| hash.wrapping_add(ledger.hash));
    let brick = |drafted: &DraftedBrick| {
        let what = format!("{} {:?} {}", drafted.pos.0, drafted.changed, drafted.is_extended);
        (what, contents(&drafted.brick))
    };
    let bricks = ledgers.iter().flat_map(|ledger| &ledger.bricks).map(brick).collect();
    let (mut parts, mut counts) = (BTreeMap::new(), BTreeMap::new());
    for part in ledgers.iter().flat_map(|ledger| &ledger.parts) {
        LatticeBox::include(parts.entry((part.edit, part.chunk)).or_default(), part.bounds);
    }
    for count in ledgers.iter().flat_map(|ledger| &ledger.counts) {
        *counts.entry((count.edit, count.fate as u8, count.material)).or_insert(0) += count.voxels;
    }
    Summary { hash, bricks, parts, counts }
}

/// Everything that a brick holds.
pub(super) fn contents(brick: &Brick) -> Vec<u8> {
    let mut bytes = vec![0; layout::RECORD_BYTES];
    layout::brick_record(brick, &mut bytes);
    bytes.extend((0..512).map(|index| brick.material_at(index).0));
    bytes.push(u8::from(brick.material_bytes() > 0));
    bytes
}

/// Are these the same parts, bit by bit?
fn same(a: &Parts, b: &Parts) -> bool {
    let mut others = b.iter();
    let is_next = |(block, vertices, indices): (Block, &[Vertex], &[u16])| {
        others.next().is_some_and(|(other, other_vertices, other_indices)| {
            let mut pairs = vertices.iter().zip(other_vertices);
            block == other
                && indices == other_indices
                && vertices.len() == other_vertices.len()
                && pairs.all(|(a, b)| a.is_same(b))
        })
    };
    a.iter().all(is_next) && others.next().is_none()
}
