//! Runs without a window: makes pictures and a report.

#[path = "../shared/headless_app.rs"]
mod headless_app;

use std::process::ExitCode;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::paths::NavigationTiles;
use bevy_burrow::prelude::*;
use headless_app::photo::wait_until;
use headless_app::{FRAME, shoot};

use crate::Options;
use crate::figures::COUNT;
use crate::story::{Chapter, Story};

/// The most frames of a run, even if figures are still on their way.
const FRAMES: u32 = 64 * 90;

/// Plays, and says how it went.
pub fn run(options: &Options) -> ExitCode {
    match play(options) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => {
            eprintln!("not all figures arrived through the tunnel");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn play(options: &Options) -> Result<bool> {
    std::fs::create_dir_all(&options.out).map_err(|error| format!("{}: {error}", options.out.display()))?;
    let (mut app, photographer) = headless_app::build((options.width, options.height), |app| {
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
        crate::game(app, options);
    })?;
    // Time stands still until there is ground to walk on.
    wait_until(&mut app, |app| {
        app.update();
        std::thread::sleep(Duration::from_millis(1));
        let world = app.world_mut();
        let mut navigations = world.query::<&NavigationTiles>();
        navigations.single(world).is_ok_and(|tiles| !tiles.is_empty() && !tiles.is_loading())
    })?;
    app.insert_resource(TimeUpdateStrategy::ManualDuration(FRAME));
    let (mut longest, mut pictures) = (Duration::ZERO, Vec::new());
    let mut frames = 0;
    while frames < FRAMES {
        frames += 1;
        let start = Instant::now();
        app.update();
        longest = longest.max(start.elapsed());
        let story = app.world().resource::<Story>();
        let (chapter, seconds) = (story.chapter, story.seconds);
        let moment = match chapter {
            Chapter::Crossing => (5.0, "crossing"),
            Chapter::Wall => (2.0, "wall"),
            Chapter::Tunnel => (11.0, "tunnel"),
            Chapter::Arrived => (0.5, "arrived"),
        };
        if seconds >= moment.0 && !pictures.contains(&moment.1) {
            pictures.push(moment.1);
            if let Some(photographer) = &photographer {
                shoot(&mut app, photographer, &options.out.join(moment.1).with_extension("png"))?;
            }
            if chapter == Chapter::Arrived {
                break;
            }
        }
    }
    let story = app.world().resource::<Story>();
    let (arrived, stopped, in_tunnel) = (story.arrived, story.stopped, story.in_tunnel);
    let figures = app.world().resource::<BurrowFigures>().clone();
    let world = app.world_mut();
    let mut navigations = world.query::<&NavigationTiles>();
    let tiles = navigations.single(world)?;
    let report = serde_json::json!({
        "figures": COUNT,
        "arrived": arrived,
        "stopped_by_the_wall": stopped,
        "most_in_the_tunnel_at_once": in_tunnel,
        "seconds": frames as f32 * FRAME.as_secs_f32(),
        "commits": figures.commits,
        "tiles": tiles.len(),
        "islands": tiles.islands().count(),
        "polygons": tiles.islands().map(|(.., polygons)| polygons.len()).sum::<usize>(),
        "bytes_of_polygons": tiles.bytes(),
        "longest_frame_ms": longest.as_secs_f32() * 1e3,
        "drawn": photographer.is_some(),
    });
    headless_app::save_report(&report, &options.out)?;
    Ok(arrived == COUNT && stopped > 0 && in_tunnel > 0)
}
