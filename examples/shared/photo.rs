//! Pictures of what a camera sees, without a window. Examples have it in common; each takes it in by its path.

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

/// Longest wait for anything.
pub const PATIENCE: Duration = Duration::from_secs(300);

/// Pictures that lie on the disk, as far as the renderer told.
#[derive(Resource, Default)]
pub struct Developed(pub usize);

/// A camera that draws into an image, and only while pictures are taken: in software a frame takes long.
pub struct Photographer {
    camera: Entity,
    /// What it draws into.
    pub film: Handle<Image>,
    /// Does it draw between pictures too?
    pub draws_all: bool,
}

impl Photographer {
    /// Takes a camera over.
    pub fn new(app: &mut App, camera: Entity, (width, height): (u32, u32)) -> Self {
        app.init_resource::<Developed>();
        let image = Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None);
        let film = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        app.world_mut().entity_mut(camera).insert(RenderTarget::from(film.clone()));
        let photographer = Self { camera, film, draws_all: false };
        photographer.film_runs(app, false);
        photographer
    }

    /// Does the camera draw?
    pub fn film_runs(&self, app: &mut App, runs: bool) {
        if let Some(mut camera) = app.world_mut().get_mut::<Camera>(self.camera) {
            camera.is_active = runs;
        }
    }

    /// Takes a picture after a few frames: lights need some to find what they shine on.
    ///
    /// # Errors
    /// When it is not written, or shows nothing.
    #[allow(dead_code, reason = "for those who don't count the frames themselves")]
    pub fn shoot(&self, app: &mut App, path: &Path) -> Result {
        self.shoot_after(5, app, path, draw)?;
        println!("picture {}", path.display());
        Ok(())
    }

    /// Takes a picture after so many frames, or more of them while shaders are missing. `draw` is to draw a frame to its
    /// end.
    ///
    /// # Errors
    /// When it is not written, or shows nothing.
    pub fn shoot_after(
        &self,
        frames: usize,
        app: &mut App,
        path: &Path,
        mut draw: impl FnMut(&mut App),
    ) -> Result {
        // An old one would be taken for it.
        if path.exists() {
            std::fs::remove_file(path).map_err(|error| format!("{}: {error}", path.display()))?;
        }
        self.film_runs(app, true);
        (0..frames).for_each(|_| draw(app));
        draw_until(app, &mut draw, |app| !shaders::are_missing(app))?;
        let before = app.world().resource::<Developed>().0;
        let mut save = save_to_disk(path.to_owned());
        let develop = move |picture: On<ScreenshotCaptured>, mut developed: ResMut<Developed>| {
            save(picture);
            developed.0 += 1;
        };
        app.world_mut().spawn(Screenshot::image(self.film.clone())).observe(develop);
        draw(app);
        self.film_runs(app, self.draws_all);
        draw_until(app, &mut draw, |app| app.world().resource::<Developed>().0 > before)?;
        if !pixels::show_something(path) {
            return Err(format!("{} was not written, or shows nothing", path.display()).into());
        }
        Ok(())
    }
}

/// Asks again and again; whoever asks lets frames go by.
///
/// # Errors
/// When it takes too long.
pub fn wait_until(app: &mut App, mut is_so: impl FnMut(&mut App) -> bool) -> Result {
    let start = Instant::now();
    while !is_so(app) {
        if start.elapsed() > PATIENCE {
            return Err("waited in vain".into());
        }
    }
    Ok(())
}

/// Draws frames until something is so; none where it is so already.
fn draw_until(app: &mut App, mut draw: impl FnMut(&mut App), is_so: impl Fn(&App) -> bool) -> Result {
    wait_until(app, |app| {
        let is_over = is_so(app);
        if !is_over {
            draw(app);
        }
        is_over
    })
}

/// A frame, drawn to its end.
pub fn draw(app: &mut App) {
    app.update();
    finish_drawing(app);
}

/// Waits until all that was to be drawn is drawn.
pub fn finish_drawing(app: &App) {
    if let Some(device) = app.world().get_resource::<RenderDevice>() {
        // An error here is the device's end, and shows as a missing picture.
        let _ = device.wgpu_device().poll(PollType::Wait { submission_index: None, timeout: None });
    }
}
