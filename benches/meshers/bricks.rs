//! The block mesher of bevy_burrow, which terrain edits use: the same samples in bricks, with their signs as bits. It
//! produces more than the others do: positions on a lattice of 1/4096 voxel, and a mix of materials for each vertex.

use std::sync::Arc;

use bevy_burrow::ground::Ground;
use bevy_burrow::lattice::{BrickPos, ChunkGrid, ChunkPos, LatticeBox};
use bevy_burrow::surface::block::{Block, Mesher, Parts};
use bevy_burrow::surface::vertex::WorldView;
use bevy_burrow::surface::{Mask, MaskView};
use bevy_burrow::terrain::{Terrain, TerrainSettings};
use bevy_burrow::volume::{Brick, Bricks, SampleView};
use glam::IVec3;

use crate::contender::{Class, Contender, Mesh, Part, Shading, Sharing};
use crate::fields::Grid;
use crate::timing::CHUNK_CELLS;

/// One chunk, cut into bricks.
pub struct Bricked {
    ground: Ground,
    grid: ChunkGrid,
    mask: Mask,
    bricks: Bricks,
    blocks: Vec<Block>,
    mesher: Mesher,
    parts: Parts,
}

impl Default for Bricked {
    fn default() -> Self {
        let cells = CHUNK_CELLS as u32;
        // Far below: no sample of the chunk is pristine.
        let ground = || Ground::flat(cells, cells, -1000.0).expect("a small world");
        let settings = TerrainSettings { chunk_size: cells, ..Default::default() };
        let grid = Terrain::new(ground(), &settings).expect("a chunk size").world().grid();
        let last = CHUNK_CELLS as i32 - 1;
        let cells = LatticeBox { min: IVec3::ZERO, max: IVec3::splat(last) };
        let mut bricks: Vec<BrickPos> = BrickPos::covering(cells).collect();
        bricks.sort_unstable_by_key(|brick| (brick.0.x, brick.0.z, brick.0.y));
        let chunk = ChunkPos { x: 0, y: 0, z: 0 };
        Self {
            ground: ground(),
            grid,
            mask: Mask::default(),
            bricks: Bricks::default(),
            blocks: bricks.into_iter().map(|brick| Block { brick, chunk }).collect(),
            mesher: Mesher::default(),
            parts: Parts::default(),
        }
    }
}

impl Contender for Bricked {
    fn name(&self) -> &'static str {
        "burrow bricks i16"
    }

    fn class(&self) -> Class {
        Class { shading: Shading::Unit, sharing: Sharing::Partly, dual: false }
    }

    /// Copies bricks from one before the chunk to one after it; samples beyond the apron are air.
    fn load(&mut self, grid: &Grid) {
        let sides = grid.sides().map(|side| side as i32);
        let last = CHUNK_CELLS as i32 + 1;
        self.bricks = BrickPos::covering(LatticeBox { min: IVec3::splat(-1), max: IVec3::splat(last) })
            .map(|pos| {
                let mut samples = [i16::MAX; 512];
                for point in pos.samples().points() {
                    let at = point + 1;
                    let is_inside = (0..3).all(|axis| (0..sides[axis]).contains(&at[axis]));
                    if is_inside {
                        let index = at.x + sides[0] * (at.y + sides[1] * at.z);
                        samples[BrickPos::index(point)] = grid.fixed[index as usize];
                    }
                }
                (pos, Arc::new(Brick::of_edited(&samples)))
            })
            .collect();
    }

    fn mesh(&mut self, _: &Grid, _: Part) {
        let view = WorldView {
            samples: SampleView::new(&self.ground, &self.bricks),
            mask: MaskView::new(&self.mask),
            grid: self.grid,
        };
        self.parts.clear();
        self.mesher.mesh(&view, &self.blocks, &mut self.parts);
    }

    fn triangles(&self) -> usize {
        self.parts.indices.len() / 3
    }

    fn result(&self) -> Mesh {
        let vertices = self.parts.vertices.iter();
        let (mut indices, mut base) = (Vec::new(), 0);
        for (_, vertices, part) in self.parts.iter() {
            indices.extend(part.iter().map(|&index| base + u32::from(index)));
            base += vertices.len() as u32;
        }
        Mesh {
            positions: vertices.clone().map(|vertex| vertex.position_f32().map(|v| v + 1.0)).collect(),
            normals: vertices.map(|vertex| vertex.normal.to_array()).collect(),
            indices,
        }
    }
}
