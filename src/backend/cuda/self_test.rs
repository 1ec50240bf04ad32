//! Checks a device before it is used: computes ground from noise, digs, sculpts and fills it, and compares every bit
//! with the CPU.

use std::sync::Arc;

use glam::{IVec3, Quat, UVec3, Vec2, Vec3};

use super::device::Fault;
use super::session::Session;
use super::surfaces::Surfaces;
use crate::backend::{Compute, Cpu};
use crate::brush::{Brush, Edit, GridShape, Roughness, Shape, ShapeGrid, Stamp};
use crate::edits::{DraftedBrick, EditDelta, EditEffect, PreparedEdits, enter_effects, latest};
use crate::ground::{GreyImage, Ground, GroundError, MaterialId, NoiseHeights, NoiseKind};
use crate::lattice::{BrickPos, ChunkGrid, Column, LatticeBox, ONE};
use crate::surface::block::{Block, Part, Parts};
use crate::surface::meshed_blocks::MeshedBlocks;
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView, Vertex};
use crate::volume::{Brick, Bricks, DiggingRules, SampleView};

/// Side of the test ground, in cells.
const SIDE: i32 = 256;

/// Numbers of brushes and their radius, smallest first.
pub(super) type Sizes = &'static [(i32, f32)];

/// From a single brush to enough to fill the lists of all kernels.
pub(super) const FULL: Sizes = &[(1, 1.0), (1, 4.0), (4, 6.0), (16, 6.0), (64, 6.0)];

/// Compares a device with the CPU.
///
/// # Errors
/// If the device fails, or differs from the CPU in a single bit, or has too little memory for the smallest size.
pub(super) fn run(session: &mut Session, sizes: Sizes) -> Result<(), Fault> {
    compare_heights(session)?;
    let ground = ground()?;
    for (number, &(count, radius)) in sizes.iter().enumerate() {
        match compare(session, &ground, count, radius) {
            // Transactions of the smaller sizes still work.
            Err(fault) if fault.is_passing() && number > 0 => return Ok(()),
            other => other?,
        }
    }
    Ok(())
}

/// Compares the effects of `count` brushes.
fn compare(session: &mut Session, ground: &Ground, count: i32, radius: f32) -> Result<(), Fault> {
    let none = Bricks::default();
    let (samples, grid) = (SampleView::new(ground, &none), ChunkGrid::new(32, SIDE, SIDE));
    let [smooth, rough] = [false, true].map(|is_rough| edits(ground, count, radius, is_rough));
    let work = PreparedEdits::new(samples, grid, &smooth.iter().collect::<Vec<_>>());
    compare_edits(session, &work)?;

    let work = PreparedEdits::new(samples, grid, &rough.iter().collect::<Vec<_>>());
    let drafted = compare_edits(session, &work)?;
    let rules = rules();
    compare_edits(session, &work.under(Some(&rules)))?;

    let latest = latest(&drafted);
    let dug = samples.under(&latest);
    let sculpting = sculpting_edits(ground, count, radius);
    compare_edits(session, &PreparedEdits::new(dug, grid, &sculpting.iter().collect::<Vec<_>>()))?;
    let rounding = rounding_edits(ground, count, radius)?;
    let work = PreparedEdits::new(dug, grid, &rounding.iter().collect::<Vec<_>>());
    compare_edits(session, &work.under(Some(&rules)))?;

    let mask = Mask::default();
    let view = WorldView { samples: dug, mask: MaskView::new(&mask), grid };
    compare_meshes(session, &view, &dirty(grid, &drafted))
}

/// Compares ground from noise. It has more columns than one thread block, and no whole number of blocks.
fn compare_heights(session: &mut Session) -> Result<(), Fault> {
    for kind in [NoiseKind::Fractal, NoiseKind::Ridged] {
        let noise = NoiseHeights { kind, seed: 3, scale: 21.5, ..NoiseHeights::default() };
        let refused = |error: GroundError| Fault::Failed(error.to_string());
        let params = noise.params(70, 40).map_err(refused)?;
        let mut heights = vec![0; params.columns()];
        session.heights(&params, &mut heights)?;
        if params.ground(heights) != Some(Ground::from_noise(70, 40, &noise).map_err(refused)?) {
            return Err(Fault::SelfTest);
        }
    }
    Ok(())
}

/// Compares the results of edits, and returns the bricks that they change.
fn compare_edits(session: &mut Session, work: &PreparedEdits) -> Result<Vec<DraftedBrick>, Fault> {
    let (expected, found) = (ledgers_of(work), session.edit(work)?);
    let mut effects = vec![EditEffect::default(); work.edits.len()];
    enter_effects(&expected, &mut effects);
    let is_same = effects == found.effects && are_same_ledgers(&expected, &found);
    let bricks = expected.into_iter().flat_map(|delta| delta.bricks).collect();
    is_same.then_some(bricks).ok_or(Fault::SelfTest)
}

/// Compares the meshes of blocks.
fn compare_meshes(session: &mut Session, view: &WorldView, blocks: &[Block]) -> Result<(), Fault> {
    let mut expected = Parts::default();
    Cpu.mesh(view, blocks, &|| {}, &mut |fresh| expected = collected(blocks, fresh));
    let meshed = session.mesh(view, blocks, &|| {})?;
    let surfaces = Surfaces::new(&session.meshes, view, blocks, meshed);
    let found = collected(blocks, &surfaces);
    surfaces.arrival.end()?;
    same(&expected, &found).then_some(()).ok_or(Fault::SelfTest)
}

/// Collects the surfaces of blocks.
pub(super) fn collected(blocks: &[Block], fresh: &dyn MeshedBlocks) -> Parts {
    let mut parts = Parts::default();
    for (number, &block) in blocks.iter().enumerate() {
        let Some(part) = fresh.part(number) else { continue };
        part.vertices.append_to(&mut parts.vertices);
        parts.indices.extend_from_slice(part.indices);
        parts.list.push(Part { block, vertices: parts.vertices.len(), indices: parts.indices.len() });
    }
    parts
}

/// The deltas that the CPU computes.
fn ledgers_of(work: &PreparedEdits) -> Vec<EditDelta> {
    let mut deltas = Vec::new();
    Cpu.edit(work, &mut |own| deltas.extend(own.iter_mut().map(std::mem::take)));
    deltas
}

/// The blocks whose surface depends on changed samples.
fn dirty(grid: ChunkGrid, drafted: &[DraftedBrick]) -> Vec<Block> {
    let near = |drafted: &DraftedBrick| {
        let around = LatticeBox { min: drafted.changed.min - 2, max: drafted.changed.max + 1 };
        BrickPos::covering(around).map(|pos| (pos.0.x, pos.0.z, pos.0.y))
    };
    let mut bricks: Vec<_> = drafted.iter().flat_map(near).collect();
    bricks.sort_unstable();
    bricks.dedup();
    let block = |(x, z, y)| {
        let brick = BrickPos(IVec3::new(x, y, z));
        Block { brick, chunk: grid.chunk_of(brick.origin()) }
    };
    bricks.into_iter().map(block).collect()
}

/// Hills, and a slope so steep that a column has several cubes.
fn ground() -> Result<Ground, Fault> {
    let height = |x: i32, z: i32| {
        let (x, z) = (f64::from(x), f64::from(z));
        (x * 0.11).sin() * 6.0 + (z * 0.07).cos() * 9.0 + (x - z) * 0.4 * f64::from(x > 128.0)
    };
    let made = Ground::from_fn(SIDE as u32, SIDE as u32, height);
    made.map_err(|error| Fault::Failed(error.to_string()))
}

/// The centre of a brush near the surface. The centres form a grid.
fn place(ground: &Ground, i: i32, radius: f32) -> Vec3 {
    let (x, z) = (12 + i % 8 * 31, 12 + i / 8 * 29);
    let height = ground.height(Column::new(x, z)) as f32 / ONE as f32;
    Vec3::new(x as f32 - 0.3, height - 0.2 * radius, z as f32 - 0.4)
}

/// Rules of each kind.
fn rules() -> DiggingRules {
    let box_at = |x: i32| LatticeBox { min: IVec3::new(x, -99, 9), max: IVec3::new(x + 2, 99, 18) };
    DiggingRules::default()
        .with_hardness(MaterialId(0), 150)
        .with_unbreakable(MaterialId(3))
        .with_bedrock(-3)
        .with_protected(box_at(14))
        .with_protected(box_at(50))
}

/// Brushes of each sculpting kind, where others dug. None reads what another one changes.
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

/// Fills and carves, every other one of a grid with materials, where others dug. None reads what another one changes.
fn rounding_edits(ground: &Ground, count: i32, radius: f32) -> Result<Vec<Edit>, Fault> {
    let distance = |at: IVec3| (at - 4).as_vec3().length() - 3.0;
    let grid =
        ShapeGrid::from_fn(UVec3::splat(9), distance).map_err(|error| Fault::Failed(error.to_string()))?;
    let grid = grid.with_materials(|at| MaterialId([2, 255, 7][at.y as usize % 3]));
    let brush = |i: i32| {
        let center = place(ground, i, radius);
        let turn = Quat::from_xyzw(0.36, -0.48, 0.64, 0.48);
        let grid = GridShape::new(grid.clone(), center).with_rotation(turn).with_scale(radius / 4.0);
        let rounding = radius * [0.3, 0.5][(i / 4 % 2) as usize];
        match i % 4 {
            0 => Brush::fill(grid, rounding),
            1 => Brush::carve(Shape::sphere(center, radius), rounding),
            2 => Brush::fill(Shape::sphere(center, radius), rounding),
            _ => Brush::carve(grid, rounding).with_strength(0.7),
        }
    };
    Ok((0..count).filter_map(|i| Edit::quantize(&brush(i)).ok()).collect())
}

/// A grid of brushes near the surface.
fn edits(ground: &Ground, count: i32, radius: f32, is_rough: bool) -> Vec<Edit> {
    let brush = |i: i32| match (i % 7, place(ground, i, radius)) {
        (2, base) => Brush::add(Shape::cone(base, Vec3::new(1.0, radius * 1.5, 2.0), radius), MaterialId(3)),
        (3, from) => Brush::dig(Shape::capsule(from, from + Vec3::new(3.0, -radius, 4.0), radius * 0.7)),
        (4, center) => Brush::paint(Shape::sphere(center, radius), MaterialId(5)),
        (5, center) => Brush::dig(Shape::cuboid(center, Vec3::new(radius, radius * 0.6, radius * 0.8))),
        (6, base) => {
            Brush::add(Shape::cylinder(base, base + Vec3::new(2.0, radius, 1.0), radius * 0.7), MaterialId(1))
        }
        (_, center) => Brush::dig(Shape::sphere(center, radius)),
    };
    let power = |i: i32| [255, 100, 120, 20][(i / 2 % 4) as usize];
    let grain = |i: i32| Roughness::new(1.5, 4.0, i as u32);
    let brush =
        |i: i32| if is_rough { brush(i).with_roughness(grain(i)).with_power(power(i)) } else { brush(i) };
    (0..count).filter_map(|i| Edit::quantize(&brush(i)).ok()).collect()
}

/// Whether deltas hold the same bricks in total.
fn are_same_ledgers(a: &[EditDelta], b: &EditDelta) -> bool {
    let bricks = || a.iter().flat_map(|delta| &delta.bricks);
    let what = |drafted: &DraftedBrick| (drafted.pos, drafted.changed, drafted.is_extended);
    let mut pairs = bricks().zip(&b.bricks);
    a.iter().fold(0u64, |hash, delta| hash.wrapping_add(delta.hash)) == b.hash
        && bricks().count() == b.bricks.len()
        && pairs.all(|(a, b)| what(a) == what(b) && are_same_bricks(&a.brick, &b.brick))
}

/// Whether bricks are equal, including bits and whether materials are stored.
pub(super) fn are_same_bricks(a: &Brick, b: &Brick) -> bool {
    a.samples() == b.samples()
        && (a.solid(), a.edited(), a.materials()) == (b.solid(), b.edited(), b.materials())
}

/// Whether the parts are equal, bit by bit.
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
