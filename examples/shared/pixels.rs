//! Does a picture show anything? Examples have it in common; each takes it in by its path.

use std::io;
use std::path::Path;

use image::Rgb;

/// Differences of a channel up to this are noise of a renderer.
const NOISE: u8 = 6;

/// Is there a picture that shows more than one colour? One that can't be read shows nothing.
pub fn show_something(path: &Path) -> bool {
    let Ok(picture) = image::open(path) else { return false };
    let picture = picture.to_rgb8();
    let mut pixels = picture.pixels();
    let Some(first) = pixels.next() else { return false };
    pixels.any(|pixel| pixel.0.iter().zip(first.0).any(|(a, b)| a.abs_diff(b) > NOISE))
}

/// What a picture shows: shares of its pixels that are 1 together.
#[derive(Clone, Copy, Debug)]
#[allow(dead_code, reason = "for tests")]
pub struct Shares {
    /// Nothing at all: so dark is no ground that light falls on.
    pub black: f32,
    /// More blue than anything else.
    pub sky: f32,
    /// All the rest.
    pub ground: f32,
}

#[allow(dead_code, reason = "for tests")]
impl Shares {
    /// Of a picture in a file.
    ///
    /// # Errors
    /// When it can't be read; names the file.
    pub fn of(path: &Path) -> io::Result<Self> {
        let at = |error: image::ImageError| io::Error::other(format!("{}: {error}", path.display()));
        let picture = image::open(path).map_err(at)?.into_rgb8();
        let is_black = |pixel: &Rgb<u8>| pixel.0.iter().all(|channel| *channel < 16);
        let is_sky = |&Rgb([red, green, blue]): &Rgb<u8>| blue > red.saturating_add(NOISE) && blue >= green;
        let share = |is_so: &dyn Fn(&Rgb<u8>) -> bool| {
            picture.pixels().filter(|pixel| is_so(pixel)).count() as f32 / picture.pixels().len() as f32
        };
        let black = share(&is_black);
        let sky = share(&|pixel| !is_black(pixel) && is_sky(pixel));
        Ok(Self { black, sky, ground: 1.0 - black - sky })
    }
}

/// Was a PNG file written to its end? On a full disk it is there, but not all of it.
///
/// # Errors
/// When it was not, or can't be read; names the file.
#[allow(dead_code, reason = "for those who take pictures of one colour too")]
pub fn check_is_whole(path: &Path) -> io::Result<()> {
    const END: &[u8] = b"IEND\xaeB`\x82";
    let at = |why: String| io::Error::other(format!("{}: {why}", path.display()));
    let bytes = std::fs::read(path).map_err(|error| at(error.to_string()))?;
    if bytes.ends_with(END) { Ok(()) } else { Err(at("not written to its end".into())) }
}

#[cfg(test)]
mod tests {
    use image::RgbImage;

    use super::*;

    #[test]
    fn a_picture_is_judged_by_its_colours_and_not_by_its_size() {
        let folder = std::env::temp_dir().join(format!("burrow_pixels_{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder of its own");
        let path = folder.join("picture.png");
        let mut picture = RgbImage::from_pixel(64, 64, Rgb([90, 120, 60]));
        picture.put_pixel(3, 3, Rgb([92, 118, 60]));
        picture.save(&path).expect("a file");
        assert!(!show_something(&path), "noise is nothing");
        picture.put_pixel(40, 50, Rgb([130, 120, 60]));
        picture.save(&path).expect("a file");
        assert!(show_something(&path) && check_is_whole(&path).is_ok());
        // A disk that got full.
        let bytes = std::fs::read(&path).expect("the file");
        std::fs::write(&path, &bytes[..bytes.len() - 9]).expect("a shorter one");
        assert!(check_is_whole(&path).is_err_and(|error| error.to_string().contains("picture.png")));
        let missing = folder.join("missing.png");
        assert!(check_is_whole(&missing).is_err() && !show_something(&missing));
        std::fs::remove_dir_all(&folder).expect("its own folder");
    }
}
