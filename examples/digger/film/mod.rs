//! Plays the game by script, for pictures, films and tests: no part of the game needs it, except for [`places`].

pub mod event_log;
pub mod frame_recorder;
pub mod places;
pub mod report;
pub mod script;
pub mod scripted_brushes;
pub mod studio;
pub mod tour;
