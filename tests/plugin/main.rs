//! The Bevy plugin from outside: brushes go in as messages; frames, messages and entities are checked frame by frame.
#![cfg(feature = "plugin")]

#[cfg(feature = "examples")]
mod big_space;
mod cameras;
#[cfg(feature = "debug")]
mod debug_views;
mod despawning;
mod diagnostics;
mod entities;
mod gates;
mod ground_files;
mod heightmaps;
mod history;
mod holes;
mod lifecycle;
mod loading;
mod lod;
#[cfg(feature = "examples")]
mod looks;
mod loose;
#[cfg(feature = "render")]
mod materials;
mod mistakes;
mod order;
mod origins;
#[cfg(feature = "examples")]
mod paused;
#[cfg(feature = "picking")]
mod picking;
mod plugins;
mod processors;
mod propagate;
mod queries;
mod receipts;
mod reflection;
mod replacing;
mod same_frame;
mod saved;
mod saved_changes;
mod saved_drawing;
mod saved_lifecycle;
mod saved_moments;
#[cfg(feature = "replicon")]
mod saved_or_shared;
mod saved_troubles;
mod saves;
#[cfg(feature = "replicon")]
mod served;
mod server;
mod several_terrains;
mod shown;
#[cfg(feature = "render")]
mod sky_light;
mod stage;
mod swap_budget;
#[cfg(feature = "replicon")]
mod together;
#[path = "../worlds/mod.rs"]
mod worlds;
