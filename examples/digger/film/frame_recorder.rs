//! Records a film: every frame takes the same time, shows every edit that was sent before it, and is written as a
//! picture. The same script gives the same film on every machine, however slowly it draws.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::prelude::*;

use crate::film::studio::{Developed, PATIENCE, Studio, pixels};

/// The first error of a picture that was not written.
#[derive(Resource, Default)]
struct PictureError(Option<String>);

/// Records what happens in a studio.
pub struct FrameRecorder {
    pub studio: Studio,
    /// Frames per second of the film.
    fps: u32,
    /// One of this many frames is drawn.
    interval: f64,
    played: usize,
    drawn: usize,
    /// Whether the previous frame was drawn.
    is_warm: bool,
}

impl FrameRecorder {
    /// Draws `drawn` of all `frames`, evenly spread.
    pub fn new(mut studio: Studio, fps: u32, frames: usize, drawn: usize) -> Self {
        studio.world().init_resource::<PictureError>();
        studio.frame = Duration::from_secs(1) / fps;
        let interval = frames as f64 / drawn.clamp(1, frames.max(1)) as f64;
        Self { studio, fps, interval, played: 0, drawn: 0, is_warm: false }
    }

    /// Drawn frames per second of the film.
    pub fn rate(&self) -> f32 {
        (f64::from(self.fps) / self.interval) as f32
    }

    /// The number of drawn frames.
    pub fn drawn(&self) -> usize {
        self.drawn
    }

    /// Plays a scene of this many seconds. `direct` is called before each frame, with the progress of the scene from 0
    /// to
    /// 1.
    ///
    /// # Errors
    /// The errors of `direct`, and those of edits and pictures that did not arrive.
    pub fn play(&mut self, seconds: f32, mut direct: impl FnMut(&mut Studio, f32) -> Result) -> Result {
        let frames = (seconds * self.fps as f32).round() as usize;
        for frame in 0..frames {
            direct(&mut self.studio, frame as f32 / frames as f32)?;
            if frame == 0 {
                self.notice_camera();
            }
            self.settle()?;
            self.frame()?;
        }
        Ok(())
    }

    /// Lets the plugin notice that the camera is at another place, without any game time.
    fn notice_camera(&mut self) {
        self.set_frame_time(Duration::ZERO);
        (0..2).for_each(|_| self.studio.app.update());
    }

    /// Waits until all edits are applied and all ground is drawn in detail, without any game time.
    ///
    /// # Errors
    /// If that takes too long.
    pub fn settle(&mut self) -> Result {
        self.set_frame_time(Duration::ZERO);
        let start = Instant::now();
        let is_idle = |terrains: Terrains| terrains.is_ready(Vec3::splat(-1.0e5), Vec3::splat(1.0e5));
        loop {
            let is_applied =
                self.studio.world().run_system_cached(is_idle).map_err(|error| error.to_string())?;
            if is_applied && self.studio.is_detailed() {
                return Ok(());
            }
            if start.elapsed() > PATIENCE {
                return Err("an edit was not applied, or the ground not drawn in detail".into());
            }
            std::thread::sleep(Duration::from_millis(1));
            self.studio.app.update();
        }
    }

    fn set_frame_time(&mut self, time: Duration) {
        self.studio.world().insert_resource(TimeUpdateStrategy::ManualDuration(time));
    }

    fn frame(&mut self) -> Result {
        let is_drawn = self.played as f64 >= self.drawn as f64 * self.interval;
        self.played += 1;
        self.studio.draw_frames(is_drawn);
        if is_drawn && !self.is_warm {
            // After a pause in drawing, lights need a few frames.
            for _ in 0..3 {
                self.studio.step_and_draw();
            }
        }
        self.is_warm = is_drawn;
        self.set_frame_time(self.studio.frame);
        if !is_drawn {
            self.studio.app.update();
            return Ok(());
        }
        self.write_picture()
    }

    /// Draws a frame into a file.
    fn write_picture(&mut self) -> Result {
        let photographer = self.studio.photographer.as_ref().ok_or("there is nothing to draw with")?;
        let image = photographer.film.clone();
        let path = frame_path(&self.studio.folder, self.drawn);
        let mut save = save_to_disk(path.clone());
        let on_captured = move |picture: On<ScreenshotCaptured>,
                                mut written: ResMut<Developed>,
                                mut first_error: ResMut<PictureError>| {
            save(picture);
            written.0 += 1;
            // `save_to_disk` only logs its errors.
            if let Err(error) = pixels::check_is_whole(&path) {
                first_error.0.get_or_insert(error.to_string());
            }
        };
        self.studio.world().spawn(Screenshot::image(image)).observe(on_captured);
        self.studio.step_and_draw();
        self.drawn += 1;
        self.wait_for_pictures(3)
    }

    /// Waits until no more than `pending` pictures are still to be written.
    ///
    /// # Errors
    /// If pictures are not written in time, or cannot be written.
    pub fn wait_for_pictures(&mut self, pending: usize) -> Result {
        let start = Instant::now();
        while self.studio.world().resource::<Developed>().0 + pending < self.drawn {
            if start.elapsed() > PATIENCE {
                return Err("a picture was not written".into());
            }
            self.set_frame_time(Duration::ZERO);
            self.studio.app.update();
        }
        match &self.studio.world().resource::<PictureError>().0 {
            Some(error) => Err(error.clone().into()),
            None => Ok(()),
        }
    }
}

fn frame_path(folder: &Path, number: usize) -> PathBuf {
    folder.join(format!("frame_{number:05}.png"))
}

/// Removes the frames of an earlier film, which would otherwise get into the video.
///
/// # Errors
/// If they cannot be removed.
pub fn remove_frames(folder: &Path) -> Result {
    for number in 0.. {
        let path = frame_path(folder, number);
        match std::fs::remove_file(&path) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::NotFound => break,
            Err(error) => return Err(format!("{}: {error}", path.display()).into()),
        }
    }
    Ok(())
}

/// Makes a video of the frames if ffmpeg is installed.
pub fn make_video(folder: &Path, rate: f32, frames: usize) -> ExitCode {
    let video = folder.join("tour.mp4");
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args(["-y", "-loglevel", "error", "-framerate", &rate.to_string()]);
    ffmpeg.arg("-i").arg(folder.join("frame_%05d.png")).args(["-frames:v", &frames.to_string()]);
    // The video format needs even sides.
    ffmpeg.args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2"]);
    ffmpeg.args(["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20"]).arg(&video);
    match ffmpeg.status() {
        Ok(status) if status.success() => {
            println!("video: {}", video.display());
            ExitCode::SUCCESS
        }
        Ok(status) => {
            eprintln!("ffmpeg made no video: {status}");
            ExitCode::FAILURE
        }
        Err(_) => {
            // `Debug` quotes the arguments.
            println!("ffmpeg is not installed. This command makes the video: {ffmpeg:?}");
            ExitCode::SUCCESS
        }
    }
}
