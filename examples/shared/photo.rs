//! Saves pictures of a camera's view without a window. Shared by examples, which include this file by path.

#[path = "pixels.rs"]
pub mod pixels;
#[path = "shaders.rs"]
mod shaders;

use std::path::Path;
use std::time::{Duration, Instant};

use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy::render::render_resource::{PollType, TextureFormat};
use bevy::render::renderer::RenderDevice;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};

/// The longest wait for any event.
pub const PATIENCE: Duration = Duration::from_secs(300);

/// The number of pictures that were saved.
#[derive(Resource, Default)]
pub struct Developed(pub usize);

/// A camera that renders into an image. It renders only while pictures are taken, as a frame in software is slow.
pub struct Photographer {
    camera: Entity,
    /// The camera's render target.
    pub film: Handle<Image>,
    /// Whether the camera also renders between pictures.
    pub draws_all: bool,
}

impl Photographer {
    /// Makes a camera render into an image of this size.
    pub fn new(app: &mut App, camera: Entity, (width, height): (u32, u32)) -> Self {
        app.init_resource::<Developed>();
        let image = Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None);
        let film = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        app.world_mut().entity_mut(camera).insert(RenderTarget::from(film.clone()));
        let photographer = Self { camera, film, draws_all: false };
        photographer.film_runs(app, false);
        photographer
    }

    /// Switches the camera on or off.
    pub fn film_runs(&self, app: &mut App, runs: bool) {
        if let Some(mut camera) = app.world_mut().get_mut::<Camera>(self.camera) {
            camera.is_active = runs;
        }
    }

    /// Takes a picture after a few frames, in which lights and shadows settle.
    ///
    /// # Errors
    /// If it is not written, or is blank.
    #[allow(dead_code, reason = "for those who don't count the frames themselves")]
    pub fn shoot(&self, app: &mut App, path: &Path) -> Result {
        self.shoot_after(5, app, path, draw)?;
        println!("picture {}", path.display());
        Ok(())
    }

    /// Takes a picture after `frames` frames, or more while shaders are missing. `draw` has to draw a frame and wait
    /// for its end.
    ///
    /// # Errors
    /// If it is not written, or is blank.
    pub fn shoot_after(
        &self,
        frames: usize,
        app: &mut App,
        path: &Path,
        mut draw: impl FnMut(&mut App),
    ) -> Result {
        // A picture from an earlier run must not count.
        if path.exists() {
            std::fs::remove_file(path).map_err(|error| format!("{}: {error}", path.display()))?;
        }
        self.film_runs(app, true);
        (0..frames).for_each(|_| draw(app));
        draw_until(app, &mut draw, |app| !shaders::are_missing(app))?;
        let before = app.world().resource::<Developed>().0;
        let mut save = save_to_disk(path.to_owned());
        let on_captured = move |picture: On<ScreenshotCaptured>, mut saved: ResMut<Developed>| {
            save(picture);
            saved.0 += 1;
        };
        app.world_mut().spawn(Screenshot::image(self.film.clone())).observe(on_captured);
        draw(app);
        self.film_runs(app, self.draws_all);
        draw_until(app, &mut draw, |app| app.world().resource::<Developed>().0 > before)?;
        if !pixels::show_something(path) {
            return Err(format!("{} was not written, or shows nothing", path.display()).into());
        }
        Ok(())
    }
}

/// Evaluates a condition until it holds; the closure has to update the app.
///
/// # Errors
/// If it takes too long.
pub fn wait_until(app: &mut App, mut is_so: impl FnMut(&mut App) -> bool) -> Result {
    let start = Instant::now();
    while !is_so(app) {
        if start.elapsed() > PATIENCE {
            return Err("timed out".into());
        }
    }
    Ok(())
}

/// Draws frames until a condition holds; none if it holds already.
fn draw_until(app: &mut App, mut draw: impl FnMut(&mut App), is_so: impl Fn(&App) -> bool) -> Result {
    wait_until(app, |app| {
        let is_over = is_so(app);
        if !is_over {
            draw(app);
        }
        is_over
    })
}

/// Draws a frame and waits for its end.
pub fn draw(app: &mut App) {
    app.update();
    finish_drawing(app);
}

/// Waits until the GPU has finished.
pub fn finish_drawing(app: &App) {
    if let Some(device) = app.world().get_resource::<RenderDevice>() {
        // An error means that the device is lost, which shows as a missing picture.
        let _ = device.wgpu_device().poll(PollType::Wait { submission_index: None, timeout: None });
    }
}
