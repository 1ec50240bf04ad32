//! Additional input of the stencil-edit kernel.

use rustc_hash::FxHashMap;

use super::super::device::Fault;
use super::super::layout::{self, EditJob, EditParams, SculptParams, StencilEditParams};
use super::super::lists::in_pieces;
use super::super::session::{Session, Uploads, windows};
use super::super::staging::{InputBuffer, Section, StagingLayout};
use super::super::windows::{KeptSlabs, Windows};
use super::output::LONG;
use crate::edits::PreparedEdits;
use crate::ground::GreyImage;

/// Distance within which new ground searches for its material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// In adjacent bricks.
    Near,
    /// Up to the limit of 64 voxels.
    Far,
}

impl Look {
    /// The distance in bricks, up and down.
    fn bricks(self) -> i32 {
        match self {
            Self::Near => 1,
            Self::Far => 8,
        }
    }
}

/// Additional input of stencil edits: windows of bricks, sculpting parameters, images, rules.
pub(super) struct StencilInput<'a> {
    look: Look,
    /// The last columns of the world along x and z.
    last: [i32; 2],
    windows: Windows<'a>,
    sculpt_params: Vec<SculptParams>,
    images: Vec<u16>,
    /// The rules followed by the protected boxes, as bytes; empty without rules.
    rules: Vec<u8>,
    ref_list: Section,
    sculpt_list: Section,
    image_list: Section,
    rule_list: Section,
}

impl<'a> StencilInput<'a> {
    fn new(work: &PreparedEdits<'a>, windows: Windows<'a>, look: Look) -> Result<Self, Fault> {
        let mut images = Images::default();
        let sculpt = |record| layout::sculpt(record, |image| images.first(image));
        let sculpt_params = work.edits.iter().map(sculpt).collect();
        if images.is_full {
            return Err(Fault::TooLarge(work.jobs().len()));
        }
        let rules = work.rules.as_ref().map(|rules| {
            let (rules, boxes) = layout::rules(rules);
            [bytemuck::bytes_of(&rules), bytemuck::cast_slice(&boxes)].concat()
        });
        let [ref_list, sculpt_list, image_list, rule_list] = [Section::default(); 4];
        Ok(Self {
            look,
            last: [work.grid.width(), work.grid.depth()],
            windows,
            sculpt_params,
            images: images.samples,
            rules: rules.unwrap_or_default(),
            ref_list,
            sculpt_list,
            image_list,
            rule_list,
        })
    }

    /// Reserves staging sections for the input.
    pub fn plan(&mut self, plan: &mut StagingLayout) {
        self.ref_list = plan.section::<u32>(self.windows.len());
        self.sculpt_list = plan.section::<SculptParams>(self.sculpt_params.len());
        self.image_list = plan.section::<u16>(self.images.len());
        self.rule_list = plan.section::<u8>(self.rules.len());
    }

    /// Writes the input, and returns the memory of the windows for reuse.
    pub fn put(&mut self, input: &mut InputBuffer, kept: &mut KeptSlabs) {
        self.windows.write(input.entries(self.ref_list));
        kept.put(std::mem::take(&mut self.windows));
        input.put(self.sculpt_list, &self.sculpt_params);
        input.put(self.image_list, &self.images);
        input.put(self.rule_list, &self.rules);
    }

    /// The kernel's parameters.
    pub fn params(&self, edit: EditParams, input: &InputBuffer) -> StencilEditParams {
        StencilEditParams {
            edit,
            windows: input.address(self.ref_list),
            sculpt_params: input.address(self.sculpt_list),
            images: input.address(self.image_list),
            rules: if self.rules.is_empty() { 0 } else { input.address(self.rule_list) },
            look: self.look.bricks(),
            last: self.last,
            pad: 0,
        }
    }
}

/// Maximum number of image samples of one launch (32 MiB): 256 different stamps of the largest size.
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

impl Session {
    /// Builds the input of jobs with stencil edits, and sets their window entries.
    pub(super) fn stencil_input<'a>(
        &mut self,
        work: &PreparedEdits<'a>,
        look: Look,
        jobs: &mut [EditJob],
        uploads: &mut Uploads<'a>,
    ) -> Result<StencilInput<'a>, Fault> {
        let mut windows = windows(&self.bricks, work.base, jobs, EditJob::pos, look.bricks(), &mut self.kept);
        self.complete(uploads, &mut windows)?;
        in_pieces(jobs, LONG, |first, jobs| {
            for (number, job) in (first..).zip(jobs) {
                let entry = windows.entry(number);
                (job.window, job.strides) = (entry.number, entry.strides);
                job.base = windows.reference(number);
            }
        });
        StencilInput::new(work, windows, look)
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
