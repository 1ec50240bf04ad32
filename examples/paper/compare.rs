//! Compares the full fields with the hybrid: the same ground, and the same surface?

use std::collections::HashMap;

use bevy_burrow::lattice::{Column, SNAP};
use bevy_burrow::surface::{SurfaceMesh, Vertex};
use bevy_burrow::terrain::{MeshKey, World};
use glam::IVec3;

use crate::edits::{Run, Scene};
use crate::error::PaperError;
use crate::full::{DenseField, FullWorld, stored};
use crate::play;
use crate::published::CHUNK_SIZES;

/// Agreement between the dense field and a world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Ground {
    /// Lattice points that were compared.
    pub points: usize,
    /// Points that are solid in one and air in the other.
    pub otherwise_solid: usize,
    /// Points with different densities.
    pub otherwise_dense: usize,
}

impl Ground {
    /// Compares every lattice point of the cube.
    pub fn compare(field: &DenseField, world: &World) -> Self {
        let view = world.samples();
        let mut ground = Self::default();
        for (point, here) in field.points() {
            let there = stored(view.distance(point));
            ground.points += 1;
            ground.otherwise_solid += usize::from((here < 0) != (there < 0));
            ground.otherwise_dense += usize::from(here != there);
        }
        ground
    }
}

/// Agreement between the surfaces of the full field and of the hybrid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Surface {
    /// Marching-cubes triangles of the hybrid.
    pub triangles: usize,
    /// Triangles of the hybrid that are missing in the full field.
    pub missing: usize,
    /// Triangles of the full field that are missing in the hybrid, in cells that it draws with marching cubes.
    pub extra: usize,
    /// Triangle corners whose materials differ.
    pub other_materials: usize,
    /// Triangle corners whose normals differ, except at the border to the heightmap, where the hybrid uses its normals.
    pub other_normals: usize,
}

/// The three positions of a triangle in the world, the lowest first, in winding order.
type Key = [[i32; 3]; 3];

/// Triangles by their positions; the corners of each are in the same order.
fn keyed(mesh: &SurfaceMesh, origin: IVec3) -> impl Iterator<Item = (Key, [Vertex; 3])> {
    mesh.triangles().map(move |mut corners| {
        for corner in &mut corners {
            corner.position += origin * SNAP;
        }
        let place = |corner: &Vertex| corner.position.to_array();
        let first = (0..3).min_by_key(|&i| place(&corners[i])).unwrap_or(0);
        corners.rotate_left(first);
        (corners.each_ref().map(place), corners)
    })
}

impl Surface {
    /// Compares every triangle.
    pub fn compare(full: &FullWorld, world: &World) -> Self {
        let mut surface = Self::default();
        let mut others: HashMap<Key, [Vertex; 3]> = keyed(&full.mesh(), IVec3::ZERO).collect();
        for chunk in world.drawn_chunks() {
            let (mesh, origin) = (world.chunk_mesh(chunk), world.origin(MeshKey::Chunk(chunk)));
            for (key, here) in keyed(&mesh, origin) {
                surface.triangles += 1;
                let Some(there) = others.remove(&key) else {
                    surface.missing += 1;
                    continue;
                };
                for (here, there) in here.iter().zip(&there) {
                    surface.other_materials += usize::from(here.materials != there.materials);
                    let differs = here.normal != there.normal && !is_at_border(world, here.position);
                    surface.other_normals += usize::from(differs);
                }
            }
        }
        surface.extra = others.keys().filter(|key| !is_heightmap(world, key)).count();
        surface
    }

    pub fn is_the_same(self) -> bool {
        self.triangles > 0 && self.missing + self.extra + self.other_materials + self.other_normals == 0
    }
}

/// The up to four cells that touch a position in x and z, given in units of `1 / scale` voxel.
fn cells_at(world: &World, x: i32, z: i32, scale: i32) -> impl Iterator<Item = Column> {
    let low = move |at: i32| (at - 1).div_euclid(scale);
    let cells = (low(z)..=z.div_euclid(scale)).flat_map(move |cell_z| {
        (low(x)..=x.div_euclid(scale)).map(move |cell_x| Column::new(cell_x, cell_z))
    });
    let grid = world.grid();
    cells.filter(move |&cell| grid.has_cell(cell))
}

/// Whether the hybrid draws one cell here as heightmap and another one with marching cubes.
fn is_at_border(world: &World, position: IVec3) -> bool {
    let volumetric = |wanted| {
        cells_at(world, position.x, position.z, SNAP).any(|cell| world.mask().contains(cell) == wanted)
    };
    volumetric(true) && volumetric(false)
}

/// Whether the hybrid draws the cell of this triangle as heightmap.
fn is_heightmap(world: &World, key: &Key) -> bool {
    // Three times the triangle's centroid, which lies in its cell or on the cell's boundary.
    let [x, _, z] = [0, 1, 2].map(|axis| key.iter().map(|corner| corner[axis]).sum::<i32>());
    cells_at(world, x, z, 3 * SNAP).any(|cell| !world.mask().contains(cell))
}

/// Plays both runs on both full fields and on a terrain, and compares them after each run.
pub fn all(scene: &Scene) -> Result<[(Ground, Surface); 2], PaperError> {
    let mut field = DenseField::new(&scene.ground)?;
    let mut full = FullWorld::new(scene)?;
    let mut terrain = scene.terrain(CHUNK_SIZES[0])?;
    let mut found = [(Ground::default(), Surface::default()); 2];
    for (run, found) in Run::BOTH.into_iter().zip(&mut found) {
        let brushes = scene.brushes(run);
        play::bare(&mut field, &brushes)?;
        play::same(&mut full, &brushes);
        terrain.apply(&brushes);
        let world = terrain.world();
        *found = (Ground::compare(&field, world), Surface::compare(&full, world));
    }
    Ok(found)
}
