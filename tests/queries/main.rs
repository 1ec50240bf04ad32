//! Rays and columns answer what is drawn: checked against every drawn triangle, one by one.
//!
//! Brute force knows nothing of cells, cubes or masks. It takes the triangles as a renderer gets them and tests all that
//! lie anywhere near the ray. Where a ray runs exactly through an edge or a vertex, arithmetic decides which of the
//! triangles around it is hit, so there any answer counts that the ray, moved by a millionth of a voxel, could give.

mod asked;
mod columns;
mod numbers;
mod rays;
mod ready;
mod triangles;
#[path = "../worlds/mod.rs"]
mod worlds;
