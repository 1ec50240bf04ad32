//! Does a picture show anything? Examples have it in common; each takes it in by its path.

use std::io;
use std::path::Path;

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
    use image::{Rgb, RgbImage};

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
