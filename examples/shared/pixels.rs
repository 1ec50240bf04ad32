//! Checks the content of pictures. Shared by examples, which include this file by path.

use std::io;
use std::path::Path;

use image::Rgb;

/// Channel differences up to this are noise of a renderer.
const NOISE: u8 = 6;

/// Whether a picture exists and shows more than one colour. An unreadable one counts as blank.
pub fn show_something(path: &Path) -> bool {
    let Ok(picture) = image::open(path) else { return false };
    let picture = picture.to_rgb8();
    let mut pixels = picture.pixels();
    let Some(first) = pixels.next() else { return false };
    pixels.any(|pixel| pixel.0.iter().zip(first.0).any(|(a, b)| a.abs_diff(b) > NOISE))
}

/// Shares of a picture's pixels by colour, with sum 1.
#[derive(Clone, Copy, Debug)]
#[allow(dead_code, reason = "for tests")]
pub struct Shares {
    /// Black: darker than any lit ground.
    pub black: f32,
    /// Mostly blue: sky.
    pub sky: f32,
    /// The rest: ground.
    pub ground: f32,
}

#[allow(dead_code, reason = "for tests")]
impl Shares {
    /// The shares of a picture in a file.
    ///
    /// # Errors
    /// If it cannot be read; the message names the file.
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

/// Whether a PNG file is complete. On a full disk it may be truncated.
///
/// # Errors
/// If it is incomplete or cannot be read; the message names the file.
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
        assert!(!show_something(&path), "noise counts as blank");
        picture.put_pixel(40, 50, Rgb([130, 120, 60]));
        picture.save(&path).expect("a file");
        assert!(show_something(&path) && check_is_whole(&path).is_ok());
        // A file truncated by a full disk.
        let bytes = std::fs::read(&path).expect("the file");
        std::fs::write(&path, &bytes[..bytes.len() - 9]).expect("a shorter one");
        assert!(check_is_whole(&path).is_err_and(|error| error.to_string().contains("picture.png")));
        let missing = folder.join("missing.png");
        assert!(check_is_whole(&missing).is_err() && !show_something(&missing));
        std::fs::remove_dir_all(&folder).expect("its own folder");
    }
}
