//! Edits that look around, sculpting ones and those that rules bear on: what they need besides.

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::super::device::Fault;
use super::super::layout::{self, CarefulParams, Chisel, EditParams};
use super::super::mail::{Inbox, Plan, Section};
use super::super::session::{Session, Uploads};
use super::super::windows::Windows;
use super::Site;
use crate::ground::GreyImage;
use crate::lattice::BrickPos;
use crate::volume::{EditWork, Job, Tool};

/// How far new ground looks for its material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// In the bricks around its own.
    Near,
    /// As far as it ever does: 64 voxels.
    Far,
}

impl Look {
    /// Bricks up and down.
    fn bricks(self) -> i32 {
        match self {
            Self::Near => 1,
            Self::Far => 8,
        }
    }
}

/// What edits that look around need besides: the bricks around, numbers, images, rules.
pub(super) struct Care<'a> {
    look: Look,
    /// The last columns of the world along x and z.
    last: [i32; 2],
    windows: Windows<'a>,
    refs: Vec<u32>,
    chisels: Vec<Chisel>,
    images: Vec<u16>,
    /// Bytes of the rules, and of what is protected; none where there are no rules.
    rules: Vec<u8>,
    ref_list: Section,
    chisel_list: Section,
    image_list: Section,
    rule_list: Section,
}

/// Where the edits of a brick are.
fn pos(jobs: &[Job]) -> BrickPos {
    jobs.first().map_or(BrickPos(IVec3::ZERO), |job| job.pos())
}

impl<'a> Care<'a> {
    pub fn new(work: &EditWork<'a>, bricks: &[&[Job]], look: Look) -> Self {
        let windows = Windows::around(work.base, bricks.iter().map(|jobs| pos(jobs)), look.bricks());
        let mut images = Images::default();
        let chisel = |tool: &Tool| layout::chisel(tool, |image| images.first(image));
        let chisels = work.tools.iter().map(chisel).collect();
        let rules = work.rules.as_ref().map(|rules| {
            let (rules, boxes) = layout::rules(rules);
            [bytemuck::bytes_of(&rules), bytemuck::cast_slice(&boxes)].concat()
        });
        let [ref_list, chisel_list, image_list, rule_list] = [Section::default(); 4];
        Self {
            look,
            last: [work.grid.width(), work.grid.depth()],
            windows,
            refs: Vec::new(),
            chisels,
            images: images.samples,
            rules: rules.unwrap_or_default(),
            ref_list,
            chisel_list,
            image_list,
            rule_list,
        }
    }

    /// Adds what there is to send.
    pub fn plan(&mut self, plan: &mut Plan) {
        self.ref_list = plan.section::<u32>(self.refs.len());
        self.chisel_list = plan.section::<Chisel>(self.chisels.len());
        self.image_list = plan.section::<u16>(self.images.len());
        self.rule_list = plan.section::<u8>(self.rules.len());
    }

    /// Writes it.
    pub fn put(&self, inbox: &mut Inbox) {
        inbox.put(self.ref_list, &self.refs);
        inbox.put(self.chisel_list, &self.chisels);
        inbox.put(self.image_list, &self.images);
        inbox.put(self.rule_list, &self.rules);
    }

    /// The parameter of the kernel.
    pub fn params(&self, edit: EditParams, inbox: &Inbox) -> CarefulParams {
        CarefulParams {
            edit,
            windows: inbox.address(self.ref_list),
            chisels: inbox.address(self.chisel_list),
            images: inbox.address(self.image_list),
            rules: if self.rules.is_empty() { 0 } else { inbox.address(self.rule_list) },
            look: self.look.bricks(),
            last: self.last,
            pad: 0,
        }
    }
}

/// Samples of images, one after the other; each image once.
#[derive(Default)]
struct Images {
    samples: Vec<u16>,
    first: FxHashMap<*const GreyImage, u32>,
}

impl Images {
    /// Where an image begins.
    fn first(&mut self, image: &GreyImage) -> u32 {
        *self.first.entry(image).or_insert_with(|| {
            let first = self.samples.len() as u32;
            self.samples.extend_from_slice(image.samples());
            first
        })
    }
}

impl Session {
    /// The bricks that edits may reach, as the device knows them, with those around.
    pub(super) fn careful_sites<'a>(
        &mut self,
        bricks: &[&[Job]],
        care: &mut Care<'a>,
        uploads: &mut Uploads<'a>,
    ) -> Result<Vec<Site>, Fault> {
        care.refs = self.refs(&care.windows, uploads)?;
        let (mut sites, mut first) = (Vec::with_capacity(bricks.len()), 0);
        for (number, jobs) in bricks.iter().enumerate() {
            let pos = pos(jobs);
            let entry = care.windows.entry(number, pos);
            sites.push(Site {
                pos,
                base: care.refs[entry.number as usize],
                stack: self.need_stack(uploads, (pos.0.x, pos.0.z))?,
                first,
                window: entry.number,
                strides: entry.strides,
            });
            first += jobs.len() as u32;
        }
        Ok(sites)
    }
}
