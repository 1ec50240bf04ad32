//! Compares incrementally updated meshes with meshes made from scratch.

use std::collections::{BTreeMap, BTreeSet};

use bevy_burrow::lattice::{BrickPos, ChunkPos, LatticeBox};
use bevy_burrow::surface::block::{Block, Parts};
use bevy_burrow::surface::mask::cell_sheet;
use bevy_burrow::surface::{Indices, SurfaceMesh, Vertex, plain};
use bevy_burrow::terrain::{MeshUpdates, World};
use glam::IVec3;

use crate::bits::{mesh_bits, sorted};
use crate::checked_terrain::CheckedTerrain;

impl CheckedTerrain {
    /// Meshes that are only ever updated by commits equal those of the world.
    pub fn check_updates(&mut self, meshes: &MeshUpdates, what: &str) {
        let world = self.terrain.world();
        for (tile, update) in &meshes.tiles {
            self.tiles.insert(*tile, mesh_bits(&update.mesh()));
        }
        for (chunk, surface) in &meshes.chunks {
            let new = mesh_bits(surface.mesh());
            let old = if surface.is_empty() {
                self.chunks.remove(chunk)
            } else {
                self.chunks.insert(*chunk, new.clone())
            };
            assert!(old.is_none_or(|old| old != new), "{what}: {chunk:?} is sent without a change");
        }
        assert_eq!(self.tiles.len(), world.grid().tiles().count(), "{what}");
        for (&tile, mesh) in &self.tiles {
            assert!(*mesh == mesh_bits(&world.tile_mesh(tile)), "{what}: {tile:?} is not up to date");
        }
        let drawn: BTreeSet<ChunkPos> = world.drawn_chunks().collect();
        assert_eq!(self.chunks.keys().copied().collect::<BTreeSet<_>>(), drawn, "{what}: drawn chunks");
        for (&chunk, mesh) in &self.chunks {
            assert!(*mesh == mesh_bits(&world.chunk_mesh(chunk)), "{what}: {chunk:?} is not up to date");
        }
    }

    /// Chunks equal all of their blocks meshed now, and blocks equal the reference mesher's.
    pub fn check_meshes(&mut self, what: &str) {
        let world = self.terrain.world();
        let (view, grid) = (world.view(), world.grid());
        let blocks = blocks(world);
        let mut parts = Parts::default();
        self.mesher.mesh(&view, &blocks, &mut parts);
        let mut fresh: BTreeMap<ChunkPos, Vec<([i32; 3], &[Vertex], &[u16])>> = BTreeMap::new();
        for (block, vertices, indices) in parts.iter() {
            let cells = block.brick.samples().intersection(grid.chunk_cells(block.chunk)).expect("cells");
            let book = plain::mesh(&view, block.brick, cells, grid.origin(block.chunk));
            let ours = sorted(vertices, indices.iter().map(|&index| usize::from(index)));
            let theirs = sorted(&book.vertices, book.indices.iter().map(|index| index as usize));
            assert!(ours == theirs, "{what}: {block:?} differs from the reference mesher");
            assert_eq!(vertices.len(), book.vertices.len(), "{what}: {block:?}");
            if !indices.is_empty() {
                let key = [block.brick.0.y, block.brick.0.z, block.brick.0.x];
                fresh.entry(block.chunk).or_default().push((key, vertices, indices));
            }
        }
        assert_eq!(fresh.keys().copied().collect::<Vec<_>>(), {
            let mut drawn: Vec<ChunkPos> = world.drawn_chunks().collect();
            drawn.sort_unstable();
            drawn
        });
        for (chunk, mut parts) in fresh {
            parts.sort_unstable_by_key(|part| part.0);
            let (mut vertices, mut list) = (Vec::new(), Vec::new());
            for (_, own, indices) in parts {
                list.extend(indices.iter().map(|&index| vertices.len() as u32 + u32::from(index)));
                vertices.extend_from_slice(own);
            }
            let mesh = SurfaceMesh { indices: Indices::new(vertices.len(), list), vertices };
            let (ours, kept) = (mesh_bits(&mesh), mesh_bits(&world.chunk_mesh(chunk)));
            let differs = ours.0.iter().zip(&kept.0).find(|(a, b)| a != b);
            assert!(ours == kept, "{what}: {chunk:?} was not redrawn: {differs:?}");
        }
    }
}

/// Every block that could draw something: all stored bricks and their neighbours, and all sheets of the mask.
fn blocks(world: &World) -> Vec<Block> {
    let (grid, mut bricks) = (world.grid(), BTreeSet::new());
    let end = IVec3::new(grid.width() - 1, i32::MAX, grid.depth() - 1);
    let inside = LatticeBox { min: IVec3::new(0, i32::MIN, 0), max: end };
    for (brick, _) in world.bricks() {
        bricks.extend((0..27).map(|i| (brick.0 + IVec3::new(i % 3, i / 3 % 3, i / 9) - 1).to_array()));
    }
    for cell in world.mask().iter() {
        let sheet = cell_sheet(world.ground(), cell);
        bricks.extend((sheet.start >> 3..=(sheet.end - 1) >> 3).map(|y| [cell.x >> 3, y, cell.z >> 3]));
    }
    let mut bricks: Vec<[i32; 3]> = bricks.into_iter().collect();
    bricks.sort_unstable_by_key(|&[x, y, z]| (x, z, y));
    let of = |brick: [i32; 3]| {
        let brick = BrickPos(brick.into());
        let cells = brick.samples().intersection(inside);
        cells.into_iter().flat_map(move |c| grid.chunks_of(c).map(move |chunk| Block { brick, chunk }))
    };
    bricks.into_iter().flat_map(of).collect()
}
