//! A camera for films: every frame takes the same time, shows every edit that was sent before it, and becomes a
//! picture. The same script gives the same film on every machine, however slow it draws.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::prelude::*;

use crate::film::studio::{Developed, PATIENCE, Studio, pixels};

/// Why a frame of the film is not on the disk.
#[derive(Resource, Default)]
struct Spoilt(Option<String>);

/// A film that is being made.
pub struct Film {
    pub studio: Studio,
    /// Frames in a second of film.
    pub fps: u32,
    /// Every so many frames one is drawn.
    every: f64,
    /// Frames that were played, and drawn.
    played: usize,
    drawn: usize,
    /// Was the frame before this one drawn?
    is_warm: bool,
}

impl Film {
    /// `drawn` of all `frames` are drawn, evenly spread.
    pub fn new(mut studio: Studio, fps: u32, frames: usize, drawn: usize) -> Self {
        studio.world().init_resource::<Spoilt>();
        let every = frames as f64 / drawn.clamp(1, frames.max(1)) as f64;
        Self { studio, fps, every, played: 0, drawn: 0, is_warm: false }
    }

    /// Frames that are drawn, in a second of film.
    pub fn rate(&self) -> f32 {
        (f64::from(self.fps) / self.every) as f32
    }

    /// Frames that were drawn so far.
    pub fn drawn(&self) -> usize {
        self.drawn
    }

    /// Plays so many seconds. `direct` is called before each frame, with how far the scene is, 0 to 1.
    ///
    /// # Errors
    /// What `direct` says, or when edits or pictures get lost.
    pub fn play(&mut self, seconds: f32, mut direct: impl FnMut(&mut Studio, f32) -> Result) -> Result {
        let frames = (seconds * self.fps as f32).round() as usize;
        for frame in 0..frames {
            direct(&mut self.studio, frame as f32 / frames as f32)?;
            self.settle()?;
            self.frame()?;
        }
        Ok(())
    }

    /// Lets edits come home without any time passing.
    ///
    /// # Errors
    /// When they don't.
    pub fn settle(&mut self) -> Result {
        self.pass(Duration::ZERO);
        let start = Instant::now();
        loop {
            let is_ready =
                self.studio.world().run_system_cached(is_all_ready).map_err(|error| error.to_string())?;
            if is_ready {
                return Ok(());
            }
            if start.elapsed() > PATIENCE {
                return Err("an edit did not come home".into());
            }
            std::thread::sleep(Duration::from_millis(1));
            self.studio.app.update();
        }
    }

    fn pass(&mut self, time: Duration) {
        self.studio.world().insert_resource(TimeUpdateStrategy::ManualDuration(time));
    }

    fn frame(&mut self) -> Result {
        let is_drawn = self.played as f64 >= self.drawn as f64 * self.every;
        self.played += 1;
        self.studio.film_runs(is_drawn);
        if is_drawn && !self.is_warm {
            // Lights need a few frames to find what they shine on.
            for _ in 0..3 {
                self.studio.step_and_draw();
            }
        }
        self.is_warm = is_drawn;
        self.pass(Duration::from_secs(1) / self.fps);
        if is_drawn {
            self.expose()?;
        } else {
            self.studio.app.update();
        }
        Ok(())
    }

    /// Draws a frame into a file.
    fn expose(&mut self) -> Result {
        let photographer = self.studio.photographer.as_ref().ok_or("there is nothing to draw with")?;
        let image = photographer.film.clone();
        let path = self.path(self.drawn);
        let mut save = save_to_disk(path.clone());
        let develop = move |picture: On<ScreenshotCaptured>,
                            mut developed: ResMut<Developed>,
                            mut spoilt: ResMut<Spoilt>| {
            save(picture);
            developed.0 += 1;
            // Whoever saves tells nobody but the log.
            if let Err(error) = pixels::check_is_whole(&path) {
                spoilt.0.get_or_insert(error.to_string());
            }
        };
        self.studio.world().spawn(Screenshot::image(image)).observe(develop);
        self.studio.step_and_draw();
        self.drawn += 1;
        // Some pictures may be on their way, but not all of them.
        self.develop(3)
    }

    /// Waits until no more than some pictures are on their way to the disk.
    ///
    /// # Errors
    /// When they don't come, or can't be written.
    pub fn develop(&mut self, on_their_way: usize) -> Result {
        let start = Instant::now();
        while self.studio.world().resource::<Developed>().0 + on_their_way < self.drawn {
            if start.elapsed() > PATIENCE {
                return Err("a picture was not written".into());
            }
            self.pass(Duration::ZERO);
            self.studio.app.update();
        }
        match &self.studio.world().resource::<Spoilt>().0 {
            Some(error) => Err(error.clone().into()),
            None => Ok(()),
        }
    }

    fn path(&self, number: usize) -> PathBuf {
        frame_path(&self.studio.folder, number)
    }
}

fn frame_path(folder: &Path, number: usize) -> PathBuf {
    folder.join(format!("frame_{number:05}.png"))
}

/// Frames of an earlier film go, or some of them would be in the video of this one.
///
/// # Errors
/// When they can't be removed.
pub fn clear(folder: &Path) -> Result {
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

/// Is no edit on its way, anywhere?
fn is_all_ready(terrains: Terrains) -> bool {
    const FAR: f32 = 1.0e5;
    terrains.is_ready(Vec3::splat(-FAR), Vec3::splat(FAR))
}

/// Frames to a video, so many of them a second. Where there is no ffmpeg, frames are all there is to be.
pub fn join(folder: &Path, rate: f32, frames: usize) -> ExitCode {
    let video = folder.join("tour.mp4");
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args(["-y", "-loglevel", "error", "-framerate", &rate.to_string()]);
    ffmpeg.arg("-i").arg(folder.join("frame_%05d.png")).args(["-frames:v", &frames.to_string()]);
    // The colours of a video go by twos, so its sides have to.
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
            println!("There is no ffmpeg here. Where there is: {}", for_shell(&ffmpeg));
            ExitCode::SUCCESS
        }
    }
}

/// A command as it is typed into a shell.
fn for_shell(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(|word| quoted(&word.to_string_lossy())).collect::<Vec<_>>().join(" ")
}

/// A word that a shell takes as it is, in quotes where it has to be.
fn quoted(word: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-_./:=%+,@".contains(letter);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.into()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_to_be_typed_can_be_typed() {
        let mut command = Command::new("ffmpeg");
        command.args(["-i", "my films/%05d.png", "-vf", "pad=ceil(iw/2)*2", "", "it's", "tour.mp4"]);
        let line = r"ffmpeg -i 'my films/%05d.png' -vf 'pad=ceil(iw/2)*2' '' 'it'\''s' tour.mp4";
        assert_eq!(for_shell(&command), line);
    }
}
