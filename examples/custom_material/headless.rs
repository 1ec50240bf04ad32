//! The app without a window: a script digs, and pictures are written.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bevy::app::PluginsState;
use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::render_resource::TextureFormat;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_burrow::prelude::*;

const SIZE: (u32, u32) = (960, 540);
const PATIENCE: Duration = Duration::from_secs(120);

/// Pictures written so far.
#[derive(Resource, Default)]
struct Written(usize);

/// Two pictures: before and after digging.
pub fn run(folder: &Path) -> Result {
    std::fs::create_dir_all(folder)?;
    let mut app = App::new();
    app.add_plugins(
        DefaultPlugins
            .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
            .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
            .disable::<WinitPlugin>(),
    )
    .add_plugins(super::table)
    .init_resource::<Written>();
    while app.plugins_state() == PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
    let film = Image::new_target_texture(SIZE.0, SIZE.1, TextureFormat::Rgba8UnormSrgb, None);
    let film = app.world_mut().resource_mut::<Assets<Image>>().add(film);
    let place = Transform::from_translation(super::VIEW.0).looking_at(super::VIEW.1, Vec3::Y);
    app.world_mut().spawn((Camera3d::default(), RenderTarget::from(film.clone()), place));
    until(&mut app, |app| {
        let mut tiles = app.world_mut().query_filtered::<(), (With<Tile>, With<Mesh3d>)>();
        tiles.iter(app.world()).count() == 64
    })?;
    shoot(&mut app, &film, folder.join("1_map.png"))?;
    let at = |app: &mut App, x: f32, z: f32| -> Result<Vec3> {
        let world = app.world_mut();
        let terrain = world.query::<&Terrain>().single(world)?;
        let height = terrain.world().height(f64::from(x), f64::from(z)).ok_or("outside the world")?;
        Ok(Vec3::new(x, height as f32, z))
    };
    let (pit, wall) = (at(&mut app, 110.0, 170.0)?, at(&mut app, 175.0, 165.0)?);
    let trench = at(&mut app, 60.0, 130.0)?;
    app.world_mut().write_message_batch([
        Brush::dig(Shape::sphere(pit, 18.0)),
        Brush::dig(Shape::capsule(pit, trench, 6.0)),
        Brush::add(Shape::capsule(wall, wall + Vec3::new(20.0, 4.0, -25.0), 6.0), MaterialId(2)),
    ]);
    until(&mut app, |app| app.world().resource::<BurrowFigures>().brushes == 3)?;
    shoot(&mut app, &film, folder.join("2_dug.png"))
}

fn shoot(app: &mut App, film: &Handle<Image>, path: PathBuf) -> Result {
    for _ in 0..4 {
        app.update();
    }
    let before = app.world().resource::<Written>().0;
    let mut save = save_to_disk(path.clone());
    let note = move |picture: On<ScreenshotCaptured>, mut written: ResMut<Written>| {
        save(picture);
        written.0 += 1;
    };
    app.world_mut().spawn(Screenshot::image(film.clone())).observe(note);
    until(app, |app| app.world().resource::<Written>().0 > before)?;
    // A frame of one colour is compressed to next to nothing.
    if std::fs::metadata(&path)?.len() < 20_000 {
        return Err(format!("{} shows nothing", path.display()).into());
    }
    println!("{}", path.display());
    Ok(())
}

fn until(app: &mut App, mut done: impl FnMut(&mut App) -> bool) -> Result {
    let start = Instant::now();
    while !done(app) {
        if start.elapsed() > PATIENCE {
            return Err("waited in vain".into());
        }
        app.update();
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(())
}
