//! A picture of what a camera drew into an image. Shared by tests and benchmarks, which include this file by path.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use image::RgbImage;

/// Draws a frame, and reads back the image, of format `Rgba8UnormSrgb`; `None` if that takes longer than `timeout`. Cameras
/// are off while it waits: a software renderer would draw a frame for nothing at each look.
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
    app.update();
    let world = app.world_mut();
    let mut drawing: Vec<Entity> = vec![];
    for (entity, mut camera) in world.query::<(Entity, &mut Camera)>().iter_mut(world) {
        if camera.is_active {
            camera.is_active = false;
            drawing.push(entity);
        }
    }
    let start = Instant::now();
    let mut picture = None;
    while picture.is_none() && start.elapsed() < timeout {
        std::thread::sleep(Duration::from_millis(1));
        app.update();
        picture = taken.lock().expect("not poisoned").take();
    }
    for entity in drawing {
        if let Some(mut camera) = app.world_mut().get_mut::<Camera>(entity) {
            camera.is_active = true;
        }
    }
    picture
}
