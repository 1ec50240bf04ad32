//! Meshes of random worlds.

use bytemuck::Zeroable;
use fastrand::Rng;
use glam::{IVec3, Vec3};

use super::super::layout::*;
use super::{Device, Slots, seeds, worlds};
use crate::brush::{Brush, Roughness, Shape};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{BrickPos, Column, LatticeBox, SNAP};
use crate::surface::block::{Block, Mesher, Parts};
use crate::surface::mesh::Vertex;
use crate::surface::vertex::WorldView;
use crate::surface::{MaterialMix, pristine};
use crate::terrain::{Terrain, TerrainSettings};

/// Every block that could have a surface, and some more.
fn blocks_around(view: &WorldView, world: &crate::terrain::World) -> Vec<Block> {
    let mut bricks: Vec<BrickPos> = world
        .bricks()
        .flat_map(|(pos, _)| LatticeBox::point(pos.0).grown(1).points())
        .map(BrickPos)
        .collect();
    for ((x, z), cells) in world.mask().words() {
        let rows = pristine::sheet_rows(world.ground(), Column::new(x * 8, z * 8), cells);
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

/// A launch of `mesh`, and its output.
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
            // Ordered by y, then z, then x.
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
            strata: device.strata(view.samples.ground()),
        };
        device.launch(jobs.len(), params);
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

    /// A vertex in the coordinates of its chunk.
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

    /// Asserts that blocks equal those of the CPU; returns how many were written.
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

/// Meshes a world on both sides, first with enough room and then without; returns the number of blocks.
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
        // The roughest brushes possible: many samples change sign, so bricks have as many vertices as possible.
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
        // Between columns 32 or more voxels apart, crossings lie halfway between two steps and are rounded up.
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
