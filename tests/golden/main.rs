//! Golden pictures: renders the ground and compares it with approved pictures.
//!
//! | | |
//! | --- | --- |
//! | run | `cargo test --release --features examples --test golden` |
//! | approve of new looks | the same with `BURROW_GOLDEN=write`, then look at `tests/golden/pictures` and commit |
//! | after a failure | `$CARGO_TARGET_DIR/proof/golden` has the picture, the golden one and their difference |
//!
//! Pictures are compared by FLIP, an estimate of visible difference: 0 is none, 1 is the largest. The tests need a
//! Vulkan driver; lavapipe is enough. Without one, the tests print a notice and pass; with `BURROW_REQUIRE=1` they
//! fail.
//!
//! # A new scene
//!
//! Add a file with `pub fn shoot(studio: &mut Studio, album: &mut Album)`, and a line to the test below. A scene that
//! needs other plugins opens its own [`Studio`](studio::Studio) in a test of its own.
#![cfg(feature = "examples")]

mod album;
mod debug_views;
mod landscape;
mod levels;
#[path = "../../examples/shared/offscreen.rs"]
mod offscreen;
mod own_textures;
mod panel;
mod pieces;
mod return_of_ground;
mod sameness;
#[path = "../../examples/shared/shaders.rs"]
mod shaders;
mod studio;
mod truth;
mod tunnel;
mod ways;

use album::Album;
use bevy::app::App;
use bevy::pbr::DefaultOpaqueRendererMethod;
use bevy_burrow::backend::{Backend, Engine};
use bevy_burrow::prelude::BurrowEngine;
use studio::Studio;

#[test]
fn ground_looks_as_approved() {
    let Some(mut studio) = Studio::open(|_| {}) else { return };
    let mut album = Album::default();
    landscape::shoot(&mut studio, &mut album);
    tunnel::shoot(&mut studio, &mut album);
    sameness::shoot(&mut studio, &mut album);
    ways::shoot(&mut studio, &mut album);
    own_textures::shoot(&mut studio, &mut album);
    return_of_ground::shoot(&mut studio, &mut album);
    pieces::shoot(&mut studio, &mut album);
    truth::shoot(&mut studio, &mut album);
    album.close();
}

#[test]
fn levels_look_as_approved() {
    let add = |app: &mut App| {
        app.add_plugins(bevy_burrow::debug::BurrowDebugPlugin);
    };
    let Some(mut studio) = Studio::open(add) else { return };
    let mut album = Album::default();
    levels::shoot(&mut studio, &mut album);
    album.close();
}

#[test]
fn debug_views_look_as_approved() {
    let add = |app: &mut App| {
        app.add_plugins(bevy_burrow::debug::BurrowDebugPlugin);
    };
    let Some(mut studio) = Studio::open(add) else { return };
    let mut album = Album::default();
    debug_views::shoot(&mut studio, &mut album);
    album.close();
}

#[test]
fn the_panel_looks_as_approved() {
    let add = |app: &mut App| {
        app.add_plugins(bevy_burrow::panel::BurrowPanelPlugin)
            .insert_resource(BurrowEngine(Engine::new(Backend::Cpu)));
    };
    let Some(mut studio) = Studio::open(add) else { return };
    let mut album = Album::default();
    panel::shoot(&mut studio, &mut album);
    album.close();
}

#[test]
fn deferred_ground_looks_the_same() {
    let deferred = |app: &mut App| {
        app.insert_resource(DefaultOpaqueRendererMethod::deferred());
    };
    let Some(mut studio) = Studio::open(deferred) else { return };
    let mut album = Album::default();
    ways::shoot_deferred(&mut studio, &mut album);
    album.close();
}
