//! Ray and column queries against brute force over every drawn triangle.
//!
//! Brute force does not use cells, cubes or masks: it tests the drawn triangles near the ray. If a ray runs exactly
//! through an edge or a vertex, rounding decides which triangle is hit. Any answer is accepted then that a ray moved
//! by a millionth of a voxel could give.

mod columns;
mod inputs;
mod numbers;
mod rays;
mod ready;
mod triangles;
#[path = "../worlds/mod.rs"]
mod worlds;
