//! A picture of what a camera drew into an image. Shared by tests and benchmarks, which include this file by path.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use image::RgbImage;

/// Draws frames until the image, of format `Rgba8UnormSrgb`, is read back; `None` if that takes longer than `timeout`.
pub fn capture(app: &mut App, film: &Handle<Image>, timeout: Duration) -> Option<RgbImage> {
    let taken = Arc::new(Mutex::new(None));
    let place = Arc::clone(&taken);
    let shot = Screenshot::image(film.clone());
    app.world_mut().spawn(shot).observe(move |shot: On<ScreenshotCaptured>| {
        let data = shot.image.data.clone().unwrap_or_default();
        let rgb = data.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
        *place.lock().expect("not poisoned") =
            RgbImage::from_raw(shot.image.width(), shot.image.height(), rgb);
    });
    let start = Instant::now();
    while start.elapsed() < timeout {
        app.update();
        let picture = taken.lock().expect("not poisoned").take();
        if picture.is_some() {
            return picture;
        }
    }
    None
}
