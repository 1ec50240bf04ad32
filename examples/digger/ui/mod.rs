//! Menus, settings, and what is shown over the game.

pub mod hud;
pub mod images;
pub mod labels;
pub mod menu;
pub mod panel;
pub mod settings;
pub mod texts;
pub mod widgets;
