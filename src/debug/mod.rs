//! Debug views: what the model holds, as gizmos (feature `debug`).

mod shape;

pub use shape::draw_shape;
