//! Runs without a window: makes pictures and a report.

use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::paths::NavigationTiles;
use bevy_burrow::prelude::*;

use crate::figures::COUNT;
use crate::photo::{Photographer, wait_until};
use crate::story::{Chapter, Story};
use crate::{Options, offscreen};

/// Time from frame to frame.
const FRAME: Duration = Duration::from_micros(15_625);

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
    let at = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
    std::fs::create_dir_all(&options.out).map_err(|error| at(&options.out, error))?;
    let (mut app, renders) = build(options);
    let photographer = renders.then(|| hire(&mut app, options)).transpose()?;
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
        "drawn": renders,
    });
    let text = serde_json::to_string_pretty(&report)?;
    println!("{text}");
    let path = options.out.join("report.json");
    std::fs::write(&path, text).map_err(|error| at(&path, error))?;
    Ok(arrived == COUNT && stopped > 0 && in_tunnel > 0)
}

fn build(options: &Options) -> (App, bool) {
    let renderer = offscreen::find_renderer();
    let renders = renderer.is_some();
    if !renders {
        println!("no graphics adapter: there will be no pictures");
    }
    let mut app = offscreen::build(renderer, |app| {
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
        crate::game(app, options);
    });
    app.update();
    (app, renders)
}

/// Makes the camera draw into a picture, on request.
fn hire(app: &mut App, options: &Options) -> Result<Photographer> {
    let world = app.world_mut();
    let camera = world.query_filtered::<Entity, With<Camera3d>>().single(world)?;
    Ok(Photographer::new(app, camera, (options.width, options.height)))
}

/// Takes a picture. Time stands still meanwhile.
fn shoot(app: &mut App, photographer: &Photographer, path: &Path) -> Result {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    let shot = photographer.shoot(app, path);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(FRAME));
    shot
}
