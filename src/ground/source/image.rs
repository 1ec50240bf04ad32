//! A height source that scales a grey image on demand.

use super::{ColumnGrid, HeightSource, rounded};
use crate::ground::image_heights::DetailNoise;
use crate::ground::{GreyImage, GroundError, ImageScale};
use crate::lattice::Column;
use crate::lattice::hash::hash_words;

/// Heights from a grey image: the same as [`Ground::from_image`](crate::ground::Ground::from_image) gives. Keeps the
/// image's samples, two bytes each, and interpolates them when it is asked. A column beyond the image is like the
/// nearest one on its rim.
pub struct ImageSource {
    image: GreyImage,
    scale: ImageScale,
    detail: Option<DetailNoise>,
    id: u64,
    bounds: (i32, i32),
}

impl ImageSource {
    /// Checks the parameters, and looks through the image for the darkest and the brightest sample.
    ///
    /// # Errors
    /// - [`GroundError::ImageTooSmall`] for an image of less than 2 x 2 samples.
    /// - [`GroundError::Parameter`] for a parameter out of its range.
    pub fn new(image: GreyImage, scale: &ImageScale) -> Result<Self, GroundError> {
        let detail = scale.check(&image)?;
        let samples = image.samples();
        let (dark, bright) =
            samples.iter().fold((u16::MAX, 0), |(low, high), &grey| (low.min(grey), high.max(grey)));
        let ends = [dark, bright].map(|grey| scale.voxels(grey));
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        // Between samples, a spline leaves their range by at most an eighth of it, and by as much again across.
        let beyond = if scale.voxels_per_sample == 1 { 0.0 } else { 0.3 * (high - low) };
        let reach = beyond + scale.detail.map_or(0.0, |detail| detail.amplitude.abs());
        let bounds = (rounded(low - reach), rounded(high + reach));
        let id = id(&image, scale);
        Ok(Self { image, scale: *scale, detail, id, bounds })
    }

    /// Cells along x and z that the image covers.
    pub fn size(&self) -> [i32; 2] {
        [self.image.width(), self.image.height()].map(|samples| {
            let cells = u64::from(samples - 1) * u64::from(self.scale.voxels_per_sample);
            i32::try_from(cells).unwrap_or(i32::MAX)
        })
    }
}

fn id(image: &GreyImage, scale: &ImageScale) -> u64 {
    let &ImageScale { voxels_per_sample, low, high, detail } = scale;
    let size = [image.width(), image.height(), voxels_per_sample].map(u64::from);
    let detail = detail.into_iter().flat_map(|detail| {
        let [amplitude, scale] = [detail.amplitude, detail.scale].map(f64::to_bits);
        [amplitude, scale, detail.octaves.into(), detail.seed.into()]
    });
    let samples = image.samples().chunks(4).map(|four| {
        four.iter().fold(four.len() as u64, |word, &sample| word.rotate_left(16) ^ u64::from(sample))
    });
    let ends = [low, high].map(f64::to_bits);
    hash_words([0x696d_6167].into_iter().chain(size).chain(ends).chain(detail).chain(samples))
}

impl HeightSource for ImageSource {
    fn id(&self) -> u64 {
        self.id
    }

    fn bounds(&self) -> (i32, i32) {
        self.bounds
    }

    fn fill_heights(&self, grid: ColumnGrid, heights: &mut [i32]) {
        if grid.count() == 0 {
            return;
        }
        let [width, depth] = self.size();
        let inside = |Column { x, z }: Column| (x.clamp(0, width), z.clamp(0, depth));
        let ends = [inside(grid.low).0, inside(grid.column(grid.width - 1, 0)).0];
        let mut line = self.scale.line(&self.image, ends, grid.width);
        for (z, row) in heights.chunks_exact_mut(grid.width).enumerate() {
            line.go_to(inside(grid.column(0, z)).1);
            for (x, height) in row.iter_mut().enumerate() {
                let (x, z) = inside(grid.column(x, z));
                let smooth = line.height(x);
                *height = rounded(self.detail.as_ref().map_or(smooth, |detail| smooth + detail(x, z)));
            }
        }
    }

    fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(self.image.samples())
    }
}
