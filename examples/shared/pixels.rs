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
