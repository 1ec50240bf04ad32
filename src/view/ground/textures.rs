//! Textures: baked by the project, or a game's own.

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};

use super::bake::{Baked, Meter, bake};

/// Which textures the ground is drawn with. Insert it before the first [`GroundLook`](super::GroundLook), or change it
/// at any time.
#[derive(Resource, Reflect, Clone, Debug, PartialEq)]
#[reflect(Resource, Default)]
#[non_exhaustive]
pub enum GroundTextures {
    /// The project's own, painted from noise in a task when the first [`GroundLook`](super::GroundLook) comes:
    /// 0 rock, 1 grass, 2 sand, 3 snow, 4 clay, 5 concrete, 6 coal, 7 gold, 8 soil, 9 sandstone, 10 shale, 11 gravel;
    /// 12 and 13 are 9 and 10 as they look from above, see [`GroundLayer::top`](super::GroundLayer::top).
    /// The same bytes on every machine.
    Baked {
        /// Texels along a side: a power of two from 16 to 2048, else the next larger one.
        side: u32,
        /// Anisotropic filtering, 1 (none) to 16; dear on software renderers.
        anisotropy: u16,
    },
    /// A game's own: two arrays with one layer for each material id, alike in number and size, with mip levels and
    /// samplers that repeat.
    Images {
        /// sRGB colours, heights in alpha.
        albedo: Handle<Image>,
        /// Not sRGB: x and y of a normal map (x right, y down), occlusion, perceptual roughness.
        relief: Handle<Image>,
    },
}

impl Default for GroundTextures {
    fn default() -> Self {
        Self::Baked { side: 512, anisotropy: 4 }
    }
}

/// How far the textures are; for a progress bar.
#[derive(Resource, Default)]
pub struct GroundLoading {
    meter: Meter,
    task: Option<Task<Baked>>,
    /// What the current textures were made for.
    wanted: Option<GroundTextures>,
    baked: Option<[Handle<Image>; 3]>,
    pub(super) ready: Option<Textures>,
    /// Are those the ones that were wanted last?
    is_current: bool,
}

/// What materials are made with.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Textures {
    pub albedo: Handle<Image>,
    pub relief: Handle<Image>,
    pub noise: Handle<Image>,
}

impl GroundLoading {
    /// From 0 (nothing asked for, or just begun) to 1 (terrains are dressed). While other textures are made, terrains keep
    /// those they have, and this begins anew.
    pub fn progress(&self) -> f32 {
        if self.is_current { 1.0 } else { self.meter.progress().min(0.99) }
    }

    /// Are the textures there, and terrains dressed with them?
    pub fn is_ready(&self) -> bool {
        self.is_current
    }
}

/// Bakes or fetches what the settings say, once somebody looks.
pub(super) fn load_textures(
    mut loading: ResMut<GroundLoading>,
    settings: Res<GroundTextures>,
    looks: Query<(), With<super::GroundLook>>,
    mut images: ResMut<Assets<Image>>,
    server: Option<Res<AssetServer>>,
) {
    let loading = loading.bypass_change_detection();
    if looks.is_empty() && loading.wanted.is_none() {
        return;
    }
    if loading.wanted.as_ref() != Some(&*settings) {
        loading.wanted = Some(settings.clone());
        // Noise is needed in any case; with a game's own images the layers are baked as small as can be.
        let (side, anisotropy) = match &*settings {
            GroundTextures::Baked { side, anisotropy } => {
                (side.clamp(&16, &2048).next_power_of_two(), *anisotropy)
            }
            GroundTextures::Images { .. } => (16, 1),
        };
        loading.meter = Meter::default();
        (loading.baked, loading.is_current) = (None, false);
        let meter = loading.meter.clone();
        loading.task = Some(AsyncComputeTaskPool::get().spawn(async move { bake(side, anisotropy, &meter) }));
    }
    if let Some(baked) = loading.task.as_mut().and_then(check_ready) {
        loading.task = None;
        loading.baked = Some([baked.albedo, baked.relief, baked.noise].map(|image| images.add(image)));
    }
    let Some([albedo, relief, noise]) = loading.baked.clone() else { return };
    let textures = match &*settings {
        GroundTextures::Baked { .. } => Textures { albedo, relief, noise },
        GroundTextures::Images { albedo, relief } => {
            Textures { albedo: albedo.clone(), relief: relief.clone(), noise }
        }
    };
    let is_there = |image: &Handle<Image>| images.contains(image);
    if is_there(&textures.albedo) && is_there(&textures.relief) {
        loading.is_current = true;
        if loading.ready.as_ref() != Some(&textures) {
            loading.ready = Some(textures);
        }
    } else if let Some(server) = server
        && [&textures.albedo, &textures.relief].iter().any(|image| server.load_state(*image).is_failed())
    {
        warn_once!("the ground has no look: an image of GroundTextures can't be loaded");
    }
}
