//! The landscape, what grows on it, the light, and particles.

pub mod air;
pub mod day;
pub mod debris;
pub mod folders;
pub mod landscape;
pub mod light;
pub mod particles;
pub mod plants;
pub mod saves;
pub mod sky;
#[cfg(any(feature = "sound", test))]
pub mod sounds;
pub mod strata;
pub mod thumbnails;
