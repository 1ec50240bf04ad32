//! Golden pictures and the comparison with them.

use std::path::PathBuf;

use bevy::math::UVec2;
use image::RgbImage;

/// Mean FLIP above which a picture counts as different.
///
/// On one machine, pictures are identical (0). A spot of another material, 4 m wide in a picture of about 20 m,
/// gives 0.018; a camera that moves by a quarter of a pixel gives 0.027. `sameness.rs` measures both.
const THRESHOLD: f32 = 0.01;

/// The threshold, or the value of `BURROW_FLIP`: another renderer filters textures and shadows a little differently.
pub fn threshold() -> f32 {
    std::env::var("BURROW_FLIP").ok().and_then(|value| value.parse().ok()).unwrap_or(THRESHOLD)
}

/// Compares pictures and collects the differences.
#[derive(Default)]
pub struct Album {
    faults: Vec<String>,
}

impl Album {
    /// Compares a picture with the golden one of that name, or saves it as the golden one if `BURROW_GOLDEN=write` is
    /// set.
    pub fn compare(&mut self, name: &str, picture: &RgbImage) {
        if std::env::var("BURROW_GOLDEN").is_ok_and(|value| value == "write") {
            let path = place_of(name);
            picture.save(&path).expect("a golden picture can be written");
            println!("{name}: written to {}", path.display());
            return;
        }
        let Some(golden) = self.golden(name) else {
            keep(name, "actual", picture);
            self.faults.push(format!("{name}: there is no golden picture; BURROW_GOLDEN=write makes it"));
            return;
        };
        self.compare_two(name, &golden, picture);
    }

    /// Compares two pictures.
    pub fn compare_two(&mut self, name: &str, golden: &RgbImage, picture: &RgbImage) {
        let (limit, (mean, map)) = (threshold(), flip(golden, picture));
        println!("{name}: FLIP {mean:.5}, threshold {limit}");
        if mean > limit {
            let path = keep(name, "actual", picture);
            keep(name, "golden", golden);
            keep(name, "difference", &map);
            self.faults.push(format!("{name}: FLIP {mean:.5} > {limit}; see {}", path.display()));
        }
    }

    /// The golden picture of that name.
    pub fn golden(&self, name: &str) -> Option<RgbImage> {
        Some(image::open(place_of(name)).ok()?.into_rgb8())
    }

    /// Records a fault with this message unless `is_right`.
    pub fn check(&mut self, is_right: bool, otherwise: impl FnOnce() -> String) {
        if !is_right {
            self.faults.push(otherwise());
        }
    }

    /// Ends the comparison.
    ///
    /// # Panics
    /// Panics if any picture differs; the message lists all faults.
    pub fn close(self) {
        assert!(self.faults.is_empty(), "pictures differ:\n{}", self.faults.join("\n"));
    }
}

/// The difference of two pictures: mean FLIP, and a map of it. Pictures of different sizes count as entirely different.
pub fn flip(a: &RgbImage, b: &RgbImage) -> (f32, RgbImage) {
    if a.dimensions() != b.dimensions() {
        return (1.0, b.clone());
    }
    let map = flip_map(a, b);
    let seen = map.apply_color_lut(&nv_flip::magma_lut());
    let mean = nv_flip::FlipPool::from_image(&map).mean();
    let seen = RgbImage::from_raw(seen.width(), seen.height(), seen.to_vec()).unwrap_or_else(|| b.clone());
    (mean, seen)
}

/// The FLIP of each pixel of two pictures of the same size.
fn flip_map(a: &RgbImage, b: &RgbImage) -> nv_flip::FlipImageFloat {
    let of =
        |picture: &RgbImage| nv_flip::FlipImageRgb8::with_data(picture.width(), picture.height(), picture);
    nv_flip::flip(of(a), of(b), nv_flip::DEFAULT_PIXELS_PER_DEGREE)
}

/// The mean FLIP over some pixels of two pictures of the same size.
pub fn flip_at(a: &RgbImage, b: &RgbImage, pixels: &[UVec2]) -> f32 {
    flip_anywhere(a, b)(pixels)
}

/// Like [`flip_at`], for any number of pixel sets after one comparison.
pub fn flip_anywhere(a: &RgbImage, b: &RgbImage) -> impl Fn(&[UVec2]) -> f32 + use<> {
    let (map, width) = (flip_map(a, b).to_vec(), a.width());
    move |pixels| {
        let sum: f32 = pixels.iter().map(|pixel| map[(pixel.y * width + pixel.x) as usize]).sum();
        sum / pixels.len().max(1) as f32
    }
}

/// Saves a picture in the target folder for inspection.
pub fn keep(name: &str, what: &str, picture: &RgbImage) -> PathBuf {
    // Cargo's folder for temporary files lies in the target folder.
    let target = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("a target folder");
    let proof = std::env::var_os("BURROW_PROOF").map_or_else(|| target.join("proof"), PathBuf::from);
    let folder = proof.join("golden");
    std::fs::create_dir_all(&folder).expect("a folder for proof");
    let path = folder.join(format!("{name}_{what}.png"));
    picture.save(&path).expect("a picture can be written");
    path
}

fn place_of(name: &str) -> PathBuf {
    // Cargo sets it for tests that it runs; elsewhere it says where the pictures were copied to.
    let root = std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
    PathBuf::from(root).join("tests/golden/pictures").join(name).with_extension("png")
}
