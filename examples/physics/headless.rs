//! The same without a window: pictures, and a report.

use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use avian3d::prelude::*;
use bevy::app::PluginsState;
use bevy::camera::RenderTarget;
use bevy::log::{Level, LogPlugin};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{PollType, TextureFormat};
use bevy::render::renderer::{RenderDevice, initialize_renderer};
use bevy::render::settings::{RenderCreation, RenderResources, WgpuSettings};
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::time::TimeUpdateStrategy;
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_burrow::physics::PhysicsFigures;
use bevy_burrow::prelude::*;

use crate::Options;
use crate::rain::{Ball, Rain};

/// Time from frame to frame.
const FRAME: Duration = Duration::from_micros(15_625);

/// Longest wait for the ground or a picture.
const PATIENCE: Duration = Duration::from_secs(300);

/// Moments of the pictures, as shares of the time played.
const PICTURES: [(f32, &str); 3] = [(0.15, "rain"), (0.55, "digging"), (1.0, "after")];

/// Pictures that lie on the disk.
#[derive(Resource, Default)]
struct Developed(usize);

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
    std::fs::create_dir_all(&options.out)?;
    let (mut app, renders) = build(options);
    let film = renders.then(|| load_film(&mut app, options)).transpose()?;
    let start = Instant::now();
    // Ground first: its colliders and the tunnels.
    while app.world().resource::<BurrowFigures>().commits == 0
        || app.world().resource::<PhysicsFigures>().missing > 0
    {
        app.update();
        std::thread::sleep(Duration::from_millis(1));
        if start.elapsed() > PATIENCE {
            return Err("the ground did not load".into());
        }
    }
    let frames = (options.seconds / FRAME.as_secs_f32()) as u32;
    let mut longest = Duration::ZERO;
    let mut below_ever = 0;
    for frame in 1..=frames {
        let start = Instant::now();
        app.update();
        longest = longest.max(start.elapsed());
        if frame % 64 == 0 {
            below_ever = below_ever.max(below(&mut app)?);
        }
        for (share, name) in PICTURES {
            if frame == (frames as f32 * share) as u32
                && let Some(film) = &film
            {
                shoot(&mut app, film, &options.out.join(name).with_extension("png"))?;
            }
        }
    }
    app.world_mut().resource_mut::<Rain>().digs = false;
    let below = below(&mut app)?;
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
        "drawn": renders,
    });
    let text = serde_json::to_string_pretty(&report)?;
    println!("{text}");
    std::fs::write(options.out.join("report.json"), text)?;
    Ok(below.max(below_ever))
}

/// How many balls have their middle in the ground.
fn below(app: &mut App) -> Result<usize> {
    let world = app.world_mut();
    let mut balls = world.query_filtered::<&Position, With<Ball>>();
    let mut terrains = world.query::<&Terrain>();
    let model = terrains.single(world)?.world();
    Ok(balls.iter(world).filter(|place| model.is_solid(place.as_dvec3()) || place.y < -200.0).count())
}

fn build(options: &Options) -> (App, bool) {
    let renderer = find_renderer();
    let renders = renderer.is_some();
    let (render_creation, filter) = match renderer {
        Some(renderer) => (RenderCreation::Manual(renderer), ""),
        None => {
            println!("no graphics adapter: there will be no pictures");
            let settings = WgpuSettings { backends: None, ..default() };
            (settings.into(), "bevy_render=off,bevy_gizmos_render=off,bevy_gltf=off")
        }
    };
    let mut app = App::new();
    app.add_plugins(
        DefaultPlugins
            .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
            .set(RenderPlugin { render_creation, synchronous_pipeline_compilation: true, ..default() })
            .set(LogPlugin { level: Level::WARN, filter: filter.into(), ..default() })
            .disable::<WinitPlugin>()
            .disable::<PipelinedRenderingPlugin>(),
    )
    .insert_resource(TimeUpdateStrategy::ManualDuration(FRAME))
    .init_resource::<Developed>();
    crate::game(&mut app, options);
    while app.plugins_state() == PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
    app.update();
    (app, renders)
}

/// A renderer without a window, if there is an adapter for one, be it in software.
fn find_renderer() -> Option<RenderResources> {
    let settings = WgpuSettings::default();
    let backends = settings.backends?;
    // Bevy panics where there is none, and prints it; here that is an answer and no accident.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let found =
        std::panic::catch_unwind(|| bevy::tasks::block_on(initialize_renderer(backends, None, &settings)));
    std::panic::set_hook(hook);
    found.ok()
}

/// Makes the camera draw into a picture, when told to.
fn load_film(app: &mut App, options: &Options) -> Result<Handle<Image>> {
    let image = Image::new_target_texture(options.width, options.height, TextureFormat::Rgba8UnormSrgb, None);
    let film = app.world_mut().resource_mut::<Assets<Image>>().add(image);
    let world = app.world_mut();
    let camera = world.query_filtered::<Entity, With<Camera3d>>().single(world)?;
    world.entity_mut(camera).insert(RenderTarget::from(film.clone()));
    set_filming(app, false);
    Ok(film)
}

fn set_filming(app: &mut App, runs: bool) {
    let world = app.world_mut();
    for mut camera in world.query::<&mut Camera>().iter_mut(world) {
        camera.is_active = runs;
    }
}

/// Takes a picture. Time stands still meanwhile.
fn shoot(app: &mut App, film: &Handle<Image>, path: &Path) -> Result {
    set_filming(app, true);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    for _ in 0..6 {
        draw(app);
    }
    let before = app.world().resource::<Developed>().0;
    let mut save = save_to_disk(path.to_owned());
    let develop = move |picture: On<ScreenshotCaptured>, mut developed: ResMut<Developed>| {
        save(picture);
        developed.0 += 1;
    };
    app.world_mut().spawn(Screenshot::image(film.clone())).observe(develop);
    let start = Instant::now();
    while app.world().resource::<Developed>().0 == before {
        draw(app);
        if start.elapsed() > PATIENCE {
            return Err("the picture was not written".into());
        }
    }
    set_filming(app, false);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(FRAME));
    println!("wrote {}", path.display());
    Ok(())
}

fn draw(app: &mut App) {
    app.update();
    if let Some(device) = app.world().get_resource::<RenderDevice>() {
        // An error here is the device's end, and shows as a missing picture.
        let _ = device.wgpu_device().poll(PollType::Wait { submission_index: None, timeout: None });
    }
}
