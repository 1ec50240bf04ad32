//! Debug views: what the model holds, as gizmos (feature `debug`).
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_burrow::debug::{BurrowDebug, BurrowDebugPlugin};
//! # use bevy_burrow::prelude::*;
//! App::new()
//!     .add_plugins((DefaultPlugins, BurrowPlugins, BurrowDebugPlugin))
//!     .insert_resource(BurrowDebug { mask: true, rings: true, ..default() });
//! ```
//!
//! | view | shows |
//! | --- | --- |
//! | [`chunks`](BurrowDebug::chunks) | chunks that draw something or hold fields, and the borders of tiles on the ground |
//! | [`fields`](BurrowDebug::fields) | the box of each field, a colour each |
//! | [`mask`](BurrowDebug::mask) | cells that marching cubes draws, and the line around them |
//! | [`rings`](BurrowDebug::rings) | triangles of tiles that are fanned over the mask's border |
//! | [`dirty`](BurrowDebug::dirty) | bricks in the boxes of the latest edits, fading |
//! | [`normals`](BurrowDebug::normals) | normals of vertices: golden of tiles, blue of chunks |
//! | [`wires`](BurrowDebug::wires) | edges of triangles: golden of tiles, blue of chunks, white what both share |
//!
//! Views are lines below the terrain's entity, in its own space, so they move and scale along, and on its `RenderLayers`.
//! They are made for what is near a place, at most so many lines each, and again when the world or the place has changed.
//! Their cost depends on how far they reach, and not on how large the world is; `dirty` looks through the box of each edit
//! as well, once, by columns of bricks. [`SeamWires`] and [`draw_shape`] are for own use.

mod lines;
mod plugin;
mod settings;
mod shape;
mod views;
mod wires;

pub use plugin::{BurrowDebugPlugin, DebugLines};
pub use settings::{BurrowDebug, DebugView};
pub use shape::draw_shape;
pub use wires::SeamWires;
