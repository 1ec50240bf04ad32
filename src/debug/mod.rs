//! Debug views of the model as gizmos (feature `debug`).
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
//! | [`rings`](BurrowDebug::rings) | triangles of tiles that are fanned over the border of the mask or of steep cells, or are bands of these |
//! | [`dirty`](BurrowDebug::dirty) | bricks in the boxes of the latest edits, fading |
//! | [`normals`](BurrowDebug::normals) | normals of vertices: golden of tiles, blue of chunks |
//! | [`levels`](BurrowDebug::levels) | edges of triangles, coloured by level of detail |
//! | `walkable` | with the feature `navigation`: polygons that an agent walks on (green), and the air above floors (blue) |
//! | [`wires`](BurrowDebug::wires) | edges of triangles: golden of tiles, blue of chunks, white what both share |
//!
//! Views are lines on children of the terrain's entity, on its `RenderLayers`. They cover the surroundings of a place,
//! up to a limit of lines, and are drawn again when the world or the place changes. Their cost depends on the radius
//! and not on the size of the world. [`SeamWires`] and [`Shape::draw`](crate::brush::Shape::draw) can be used by
//! themselves.

mod lines;
mod place;
mod plugin;
mod settings;
mod shape;
mod views;
#[cfg(feature = "navigation")]
mod walkable;
mod wires;

pub use plugin::BurrowDebugPlugin;
#[doc(hidden)]
pub use plugin::DebugLines;
pub use settings::{BurrowDebug, DebugView};
pub use wires::SeamWires;
