//! Additional input of the stencil-edit kernel.

use super::super::device::Fault;
use super::super::layout::{self, EditJob, EditParams, SculptParams, StencilEditParams};
use super::super::lists::in_pieces;
use super::super::session::{Session, Uploads, windows};
use super::super::staging::{InputBuffer, Section, StagingLayout};
use super::super::windows::{KeptSlabs, Windows};
use super::images::ImageInput;
use super::output::LONG;
use crate::edits::PreparedEdits;

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

/// Additional input of stencil edits: windows of bricks, sculpting parameters, rules.
pub(super) struct StencilInput<'a> {
    look: Look,
    /// The last columns of the world along x and z.
    last: [i32; 2],
    windows: Windows<'a>,
    sculpt_params: Vec<SculptParams>,
    /// The rules followed by the protected boxes, as bytes; empty without rules.
    rules: Vec<u8>,
    ref_list: Section,
    sculpt_list: Section,
    rule_list: Section,
}

impl<'a> StencilInput<'a> {
    fn new<'w>(
        work: &'w PreparedEdits<'a>,
        windows: Windows<'a>,
        look: Look,
        images: &mut ImageInput<'w>,
    ) -> Self {
        let sculpt = |record| layout::sculpt(record, |image| images.first(image));
        let sculpt_params = work.edits.iter().map(sculpt).collect();
        let rules = work.rules.as_ref().map(|rules| {
            let (rules, boxes) = layout::rules(rules);
            [bytemuck::bytes_of(&rules), bytemuck::cast_slice(&boxes)].concat()
        });
        let [ref_list, sculpt_list, rule_list] = [Section::default(); 3];
        Self {
            look,
            last: [work.grid.width(), work.grid.depth()],
            windows,
            sculpt_params,
            rules: rules.unwrap_or_default(),
            ref_list,
            sculpt_list,
            rule_list,
        }
    }

    /// Reserves staging sections for the input.
    pub fn plan(&mut self, plan: &mut StagingLayout) {
        self.ref_list = plan.section::<u32>(self.windows.len());
        self.sculpt_list = plan.section::<SculptParams>(self.sculpt_params.len());
        self.rule_list = plan.section::<u8>(self.rules.len());
    }

    /// Writes the input, and returns the memory of the windows for reuse.
    pub fn put(&mut self, input: &mut InputBuffer, kept: &mut KeptSlabs) {
        self.windows.write(input.entries(self.ref_list));
        kept.put(std::mem::take(&mut self.windows));
        input.put(self.sculpt_list, &self.sculpt_params);
        input.put(self.rule_list, &self.rules);
    }

    /// The kernel's parameters. `surface` is the address of the distances to the surface.
    pub fn params(&self, edit: EditParams, surface: u64, input: &InputBuffer) -> StencilEditParams {
        StencilEditParams {
            edit,
            windows: input.address(self.ref_list),
            sculpt_params: input.address(self.sculpt_list),
            surface,
            rules: if self.rules.is_empty() { 0 } else { input.address(self.rule_list) },
            look: self.look.bricks(),
            last: self.last,
            pad: 0,
        }
    }
}

impl Session {
    /// Builds the input of jobs with stencil edits, and sets their window entries.
    pub(super) fn stencil_input<'w, 'a>(
        &mut self,
        work: &'w PreparedEdits<'a>,
        look: Look,
        jobs: &mut [EditJob],
        uploads: &mut Uploads<'a>,
        images: &mut ImageInput<'w>,
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
        Ok(StencilInput::new(work, windows, look, images))
    }
}
