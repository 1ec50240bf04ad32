//! The first program that anyone starts is the one in the documents, and shows ground.

#[path = "../shared/offscreen.rs"]
mod offscreen;
#[path = "../shared/photo.rs"]
mod photo;

use std::path::Path;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use photo::Photographer;
use photo::pixels::Shares;

/// Small: without a GPU, a picture as large as the window takes fifteen times as long.
const SIZE: (u32, u32) = (320, 180);

/// Longest time to a picture. Two cores without a GPU take 10 seconds, and 40 while others keep them busy.
const LIMIT: Duration = Duration::from_secs(120);

#[test]
fn grass_under_a_sky_is_drawn_in_time() -> Result {
    let start = Instant::now();
    let Some(renderer) = offscreen::find_renderer() else {
        let is_required = std::env::var_os("BURROW_REQUIRE").is_some_and(|value| !value.is_empty());
        assert!(!is_required, "BURROW_REQUIRE is set, but there is no Vulkan device to draw with");
        eprintln!(
            "\n*** SKIPPED: no Vulkan device, so no picture was made. Install mesa-vulkan-drivers. ***\n"
        );
        return Ok(());
    };
    // A driver that hangs does so within a call, and its threads keep a process from ending in peace.
    std::thread::spawn(|| {
        std::thread::sleep(LIMIT);
        eprintln!("minimal: no picture within {} seconds", LIMIT.as_secs());
        std::process::abort();
    });
    let mut app = offscreen::build(Some(renderer), |app| {
        app.add_plugins(super::game);
    });
    app.update();
    let camera = app.world_mut().query_filtered::<Entity, With<Camera3d>>().single(app.world())?;
    let photographer = Photographer::new(&mut app, camera, SIZE);
    photo::wait_until(&mut app, |app| {
        app.update();
        std::thread::sleep(Duration::from_millis(1));
        let mut tiles = app.world_mut().query_filtered::<Has<MeshMaterial3d<GroundMaterial>>, With<Tile>>();
        let dressed: Vec<bool> = tiles.iter(app.world()).collect();
        let are_fine = app.world().resource::<GroundLoading>().is_ready();
        !dressed.is_empty() && dressed.iter().all(|is_dressed| *is_dressed) && are_fine
    })?;
    let path = proof()?.join("ground.png");
    photographer.shoot_after(2, &mut app, &path, photo::draw)?;
    println!("minimal: a picture after {:.1} s", start.elapsed().as_secs_f32());
    let seen = Shares::of(&path)?;
    // The hills fill some 73 hundredths of it.
    assert!(seen.ground > 0.6 && seen.sky > 0.2 && seen.black < 0.01, "{}: {seen:.2?}", path.display());
    Ok(())
}

/// The folder for pictures, in the target folder.
fn proof() -> Result<std::path::PathBuf> {
    let program = std::env::current_exe()?;
    let target = program.ancestors().nth(3).map(Path::to_owned).ok_or("the test is in no target folder")?;
    let folder = target.join("proof").join("minimal");
    std::fs::create_dir_all(&folder)?;
    Ok(folder)
}

/// A program within a text: from its first `use` to its last brace.
fn program(text: &str) -> String {
    let lines = text.lines().map(|line| line.trim_start_matches("//! ").trim_start_matches("//!"));
    let program = lines.skip_while(|line| {
        *line != "use bevy::camera_controller::free_camera::{FreeCamera, FreeCameraPlugin};"
    });
    program.take_while(|line| !["```", "# }", "#[cfg(test)]"].contains(line)).collect::<Vec<_>>().join("\n")
}

#[test]
fn it_is_the_program_of_the_documents() {
    let own = program(include_str!("main.rs"));
    assert!(own.contains("fn main()"));
    assert_eq!(program(include_str!("../../README.md")).trim_end(), own.trim_end(), "README.md");
    assert_eq!(program(include_str!("../../src/lib.rs")).trim_end(), own.trim_end(), "src/lib.rs");
}
