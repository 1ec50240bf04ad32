//! The land, the light on it, and what flies about in it.

pub mod day;
pub mod debris;
pub mod landscape;
pub mod light;
pub mod particles;
pub mod sky;
pub mod veins;
