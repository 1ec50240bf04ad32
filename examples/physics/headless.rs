//! Runs without a window: makes pictures and a report.

#[path = "../shared/headless_app.rs"]
mod headless_app;

use std::process::ExitCode;
use std::time::{Duration, Instant};

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::physics::PhysicsFigures;
use bevy_burrow::prelude::*;
use headless_app::photo::wait_until;
use headless_app::{FRAME, shoot};

use crate::Options;
use crate::rain::{Ball, Rain};

/// Moments of the pictures, as shares of the time played.
const PICTURES: [(f32, &str); 3] = [(0.15, "rain"), (0.55, "digging"), (1.0, "after")];

/// Plays, and says how it went.
pub fn run(options: &Options) -> ExitCode {
    match play(options) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(below) => {
            eprintln!("{below} balls are below the ground");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn play(options: &Options) -> Result<usize> {
    std::fs::create_dir_all(&options.out).map_err(|error| format!("{}: {error}", options.out.display()))?;
    let (mut app, photographer) = headless_app::build((options.width, options.height), |app| {
        app.insert_resource(TimeUpdateStrategy::ManualDuration(FRAME));
        crate::game(app, options);
    })?;
    // Ground first: its colliders and the tunnels.
    wait_until(&mut app, |app| {
        app.update();
        std::thread::sleep(Duration::from_millis(1));
        let world = app.world();
        world.resource::<BurrowFigures>().commits > 0 && world.resource::<PhysicsFigures>().missing == 0
    })?;
    let frames = (options.seconds / FRAME.as_secs_f32()) as u32;
    let mut longest = Duration::ZERO;
    let mut below_ever = 0;
    for frame in 1..=frames {
        let start = Instant::now();
        app.update();
        longest = longest.max(start.elapsed());
        if frame % 64 == 0 {
            below_ever = below_ever.max(stay_below(&mut app)?);
        }
        for (share, name) in PICTURES {
            if frame == (frames as f32 * share) as u32
                && let Some(photographer) = &photographer
            {
                shoot(&mut app, photographer, &options.out.join(name).with_extension("png"))?;
            }
        }
    }
    app.world_mut().resource_mut::<Rain>().digs = false;
    let below = stay_below(&mut app)?;
    let figures = app.world().resource::<PhysicsFigures>().clone();
    let burrow = app.world().resource::<BurrowFigures>().clone();
    let world = app.world_mut();
    let report = serde_json::json!({
        "balls": world.query_filtered::<(), With<Ball>>().iter(world).count(),
        "seconds": options.seconds,
        "edits": world.resource::<Rain>().edits,
        "commits": burrow.commits,
        "balls_below_ground": below,
        "balls_below_ground_at_any_look": below_ever,
        "colliders": figures.colliders,
        "collider_swaps": figures.swaps,
        "bodies_woken": figures.woken,
        "bodies_lifted": figures.lifted,
        "bodies_held": figures.held,
        "longest_frame_ms": longest.as_secs_f32() * 1e3,
        "drawn": photographer.is_some(),
    });
    headless_app::save_report(&report, &options.out)?;
    Ok(below.max(below_ever))
}

/// Balls in the ground in three frames running: built over, one is there for the frame of the commit.
fn stay_below(app: &mut App) -> Result<usize> {
    let mut count = below(app)?;
    for _ in 0..2 {
        if count > 0 {
            app.update();
            count = count.min(below(app)?);
        }
    }
    Ok(count)
}

/// Balls that have their middle in the ground, or have fallen out of the world.
fn below(app: &mut App) -> Result<usize> {
    let world = app.world_mut();
    let mut balls = world.query_filtered::<&Position, With<Ball>>();
    let mut terrains = world.query::<&Terrain>();
    let model = terrains.single(world)?.world();
    Ok(balls.iter(world).filter(|place| model.is_solid(place.as_dvec3()) || place.y < -200.0).count())
}
