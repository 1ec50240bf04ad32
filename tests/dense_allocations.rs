//! Once a mesher and its mesh have grown, grids that are no larger and no richer are meshed without allocating.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use bevy_burrow::surface::dense::{DenseGrid, DenseMesh, DenseMesher, Density, Normals};

/// The system's allocator, counting what each thread asks of it.
struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

#[expect(unsafe_code, reason = "an allocator is unsafe by its trait")]
// SAFETY: every call is handed on to the system's allocator as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        unsafe { System.alloc(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn sphere(side: usize, radius: f32) -> Vec<f32> {
    let at = |index: usize| {
        let offsets =
            [index % side, index / side % side, index / side / side].map(|v| v as f32 - side as f32 / 2.0);
        offsets.iter().map(|v| v * v).sum::<f32>().sqrt() - radius
    };
    (0..side.pow(3)).map(at).collect()
}

/// Allocations while meshing.
fn allocations<S: Density>(
    mesher: &mut DenseMesher,
    grid: DenseGrid<S>,
    normals: Normals,
    mesh: &mut DenseMesh,
) -> usize {
    let before = COUNT.get();
    mesher.mesh(grid, normals, mesh);
    COUNT.get() - before
}

#[test]
fn a_grid_is_meshed_again_without_allocating() {
    let mut mesher = DenseMesher::new();
    let mut mesh = DenseMesh::default();
    let (large, small) = (sphere(70, 30.0), sphere(33, 12.0));
    let whole: Vec<i16> = small.iter().map(|&sample| sample as i16).collect();
    let large = DenseGrid::new(&large, [70; 3]).expect("a grid");
    let small = DenseGrid::with_apron(&small, [33; 3]).expect("a grid");
    let whole = DenseGrid::new(&whole, [33; 3]).expect("a grid");

    assert!(allocations(&mut mesher, large, Normals::Gradient, &mut mesh) > 0);
    assert!(!mesh.indices.is_empty());
    for normals in [Normals::Gradient, Normals::None, Normals::Gradient] {
        assert_eq!(allocations(&mut mesher, large, normals, &mut mesh), 0);
        assert_eq!(allocations(&mut mesher, small, normals, &mut mesh), 0);
        assert_eq!(allocations(&mut mesher, whole, normals, &mut mesh), 0);
    }
}

#[test]
fn it_does_not_matter_which_layers_hold_the_surface() {
    let mut mesher = DenseMesher::new();
    let mut mesh = DenseMesh::default();
    // Cells in every layer first, then as many triangles in few layers, at either end.
    let spread = sphere(50, 20.0);
    let checkered = |layers: std::ops::Range<usize>| -> Vec<f32> {
        let at = |index: usize| {
            if layers.contains(&(index / 2500)) && index.is_multiple_of(3) { -1.0 } else { 1.0 }
        };
        (0..50_usize.pow(3)).map(at).collect()
    };
    let all = |samples: &[f32], mesher: &mut DenseMesher, mesh: &mut DenseMesh| {
        allocations(mesher, DenseGrid::new(samples, [50; 3]).expect("a grid"), Normals::Gradient, mesh)
    };
    all(&spread, &mut mesher, &mut mesh);
    let (vertices, triangles) = (mesh.positions.len(), mesh.indices.len());
    for layers in [1..2, 25..26, 48..49] {
        let dense = checkered(layers);
        assert_eq!(all(&dense, &mut mesher, &mut mesh), 0);
        assert!(
            mesh.positions.len() < vertices && mesh.indices.len() < triangles,
            "a case of no more surface"
        );
    }
}
