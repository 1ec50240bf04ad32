//! Menus, settings, and what is drawn over the game.

pub mod art;
pub mod hud;
pub mod labels;
pub mod menu;
pub mod panel;
pub mod settings;
pub mod widgets;
