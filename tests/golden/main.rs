//! Golden pictures: renders the ground and compares it with approved pictures.
//!
//! | | |
//! | --- | --- |
//! | run | `cargo test --release --features examples --test golden` |
//! | approve of new looks | the same with `BURROW_GOLDEN=write`, then look at `tests/golden/pictures` and commit |
//! | after a failure | `$CARGO_TARGET_DIR/proof/golden` has the picture, the golden one and their difference |
//!
//! Pictures are compared by FLIP, an estimate of visible difference: 0 means none, 1 is the largest. The tests need a
//! Vulkan driver; lavapipe is enough. Without one, the tests print a notice and pass; with `BURROW_REQUIRE=1` they
//! fail.
//!
//! `make scenes` renders more views of one country, to be looked at: see `scenes.rs`.
//!
//! # A new scene
//!
//! Add a file with `pub fn shoot(studio: &mut Studio, album: &mut Album)`, and a line to the test below. A scene that
//! needs other plugins opens its own [`Studio`](studio::Studio) in a test of its own.
#![cfg(feature = "examples")]

mod album;
mod borders;
#[path = "../../examples/shared/capture.rs"]
mod capture;
mod color_map;
mod debug_views;
mod far;
#[path = "../../examples/shared/holes.rs"]
mod holes;
mod import;
mod landscape;
mod lod;
#[path = "../../examples/custom_material/map.rs"]
mod map;
#[path = "../../examples/shared/offscreen.rs"]
mod offscreen;
mod own_textures;
mod panel;
mod pieces;
mod return_of_ground;
mod sameness;
mod scenes;
#[path = "../../examples/shared/shaders.rs"]
mod shaders;
mod studio;
mod truth;
mod tunnel;
mod ways;
mod whole;

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
    ways::count_bindings(&mut studio, &mut album);
    own_textures::shoot(&mut studio, &mut album);
    color_map::shoot(&mut studio, &mut album);
    return_of_ground::shoot(&mut studio, &mut album);
    pieces::shoot(&mut studio, &mut album);
    truth::shoot(&mut studio, &mut album);
    album.close();
}

#[test]
fn borders_do_not_show_the_mesh() {
    let Some(mut studio) = Studio::open(|_| {}) else { return };
    let mut album = Album::default();
    borders::shoot(&mut studio, &mut album);
    album.close();
}

#[test]
fn levels_look_as_approved() {
    let add = |app: &mut App| {
        app.add_plugins(bevy_burrow::debug::BurrowDebugPlugin);
    };
    let Some(mut studio) = Studio::open(add) else { return };
    let mut album = Album::default();
    lod::shoot(&mut studio, &mut album);
    album.close();
}

#[test]
fn ground_has_no_holes() {
    let Some(mut studio) = Studio::open(|app| {
        app.add_plugins(map::MapPlugin);
    }) else {
        return;
    };
    let mut album = Album::default();
    whole::shoot(&mut studio, &mut album);
    album.close();
}

/// `cargo test --release --features examples --test golden -- --ignored --nocapture far_ground`
#[test]
#[ignore = "measures, and takes minutes on a software renderer"]
fn far_ground_is_measured() {
    let Some(mut studio) = Studio::open(|_| {}) else { return };
    let found = far::measure(&mut studio);
    assert!(found.iter().all(|(own, _)| (0.0..0.5).contains(own)), "{found:?}");
}

/// `BURROW_COMPARE=A:B` names two folders; each picture of A is compared with the one of that name in B.
#[test]
#[ignore = "compares pictures of two machines: tools/card.sh"]
fn two_renderers_draw_the_same() {
    let folders = std::env::var("BURROW_COMPARE").expect("BURROW_COMPARE=A:B");
    let (a, b) = folders.split_once(':').expect("two folders");
    let open = |folder: &str, name: &std::ffi::OsStr| {
        image::open(std::path::Path::new(folder).join(name)).map(image::DynamicImage::into_rgb8)
    };
    let mut album = Album::default();
    let mut compared = 0;
    for entry in std::fs::read_dir(a).expect("a folder with pictures").flatten() {
        let name = entry.file_name();
        if !name.to_string_lossy().ends_with(".png") {
            continue;
        }
        compared += 1;
        match (open(a, &name), open(b, &name)) {
            (Ok(first), Ok(second)) => album.compare_two(&name.to_string_lossy(), &first, &second),
            (_, Err(error)) | (Err(error), _) => {
                album.check(false, || format!("{}: {error}", name.display()))
            }
        }
    }
    album.check(compared > 0, || format!("{a} has no pictures"));
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
