//! Images that edit kernels read: those of stamps, and those that hold shape grids.

use rustc_hash::FxHashMap;

use super::super::layout::{GridRecord, NONE};
use super::super::staging::{InputBuffer, Section, StagingLayout};
use crate::edits::PreparedEdits;
use crate::ground::GreyImage;

/// The images and the grids of edits.
pub(super) struct ImageInput<'a> {
    images: Images<'a>,
    grids: Vec<GridRecord>,
    pub numbers: GridNumbers,
    image_list: Section,
    grid_list: Section,
}

/// The edits whose shapes are the grids, in order.
pub(super) struct GridNumbers(Vec<u32>);

impl GridNumbers {
    /// Index of an edit's grid, [`NONE`] without.
    pub fn of(&self, edit: usize) -> u32 {
        self.0.binary_search(&(edit as u32)).map_or(NONE, |number| number as u32)
    }
}

impl<'a> ImageInput<'a> {
    /// The grids of edits. Images of stamps are [added](Self::first) afterwards.
    pub fn new(work: &'a PreparedEdits) -> Self {
        let (mut images, mut grids, mut edits) = (Images::default(), Vec::new(), Vec::new());
        for (number, edit) in (0..).zip(&work.edits) {
            if let Some(grid) = edit.evaluator.grid() {
                grids.push(GridRecord::new(&grid, images.first(grid.image)));
                edits.push(number);
            }
        }
        let [image_list, grid_list] = [Section::default(); 2];
        Self { images, grids, numbers: GridNumbers(edits), image_list, grid_list }
    }

    /// Index of an image's first sample.
    pub fn first(&mut self, image: &'a GreyImage) -> u32 {
        self.images.first(image)
    }

    /// Whether there were more samples than a launch may have.
    pub fn is_full(&self) -> bool {
        self.images.is_full
    }

    /// Reserves staging sections.
    pub fn plan(&mut self, plan: &mut StagingLayout) {
        self.image_list = plan.section::<u16>(self.images.samples.len());
        self.grid_list = plan.section::<GridRecord>(self.grids.len());
    }

    /// Writes images and grids.
    pub fn put(&self, input: &mut InputBuffer) {
        input.put(self.image_list, &self.images.samples);
        input.put(self.grid_list, &self.grids);
    }

    /// Addresses of the grids and of the images.
    pub fn addresses(&self, input: &InputBuffer) -> [u64; 2] {
        [self.grid_list, self.image_list].map(|list| input.address(list))
    }
}

/// Maximum number of image samples of one launch (32 MiB): 256 different stamps of the largest size, or five
/// grids.
const MOST_SAMPLES: usize = 1 << 24;

/// Image samples, one image after the other. Equal images are stored once.
#[derive(Default)]
struct Images<'a> {
    samples: Vec<u16>,
    /// Index of the first sample, by content.
    first: FxHashMap<&'a [u16], u32>,
    /// Index of the first sample, by identity: most edits of a stroke share an image, which then need not be
    /// compared.
    known: FxHashMap<*const GreyImage, u32>,
    /// Whether there were too many samples.
    is_full: bool,
}

impl<'a> Images<'a> {
    /// Index of an image's first sample.
    fn first(&mut self, image: &'a GreyImage) -> u32 {
        if let Some(&first) = self.known.get(&std::ptr::from_ref(image)) {
            return first;
        }
        let fresh = self.samples.len() as u32;
        let first = *self.first.entry(image.samples()).or_insert(fresh);
        if first == fresh {
            self.is_full |= self.samples.len() + image.samples().len() > MOST_SAMPLES;
            if self.is_full {
                return 0;
            }
            self.samples.extend_from_slice(image.samples());
        }
        self.known.insert(image, first);
        first
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(side: u32, of: u16) -> GreyImage {
        GreyImage::from_samples(side, side, vec![of; (side * side) as usize]).expect("as many as it has")
    }

    #[test]
    fn equal_images_are_sent_once() {
        let (one, same, other) = (image(3, 7), image(3, 7), image(2, 7));
        let mut images = Images::default();
        let first = [&one, &same, &other, &one, &other, &same].map(|image| images.first(image));
        assert_eq!(first, [0, 0, 9, 0, 9, 0]);
        assert_eq!((images.samples, images.is_full), (vec![7; 13], false));
    }

    #[test]
    fn more_images_than_a_launch_takes_are_reported() {
        let all: Vec<GreyImage> = (0..257).map(|of| image(256, of)).collect();
        let mut images = Images::default();
        for image in &all[..256] {
            images.first(image);
        }
        assert!(!images.is_full);
        assert_eq!((images.first(&all[255]), images.samples.len()), (255 << 16, MOST_SAMPLES));
        images.first(&all[256]);
        assert!(images.is_full);
        assert_eq!(images.samples.len(), MOST_SAMPLES);
    }
}
