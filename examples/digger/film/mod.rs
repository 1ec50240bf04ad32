//! Plays the game without a window, for pictures and films.

pub mod camera;
pub mod event_log;
pub mod frames;
pub mod headless;
pub mod places;
pub mod report;
pub mod script;
pub mod scripted_brushes;
pub mod studio;
pub mod tour;
