//! Textures: baked by the project, or a game's own.

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};

use super::bake::{Baked, Meter, bake};
use super::look::{GroundLook, MAX_LAYERS};

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
    /// samplers that repeat. [`GroundArrays`](super::GroundArrays) makes them of ordinary pictures;
    /// a warning tells of arrays that differ, or have fewer layers than a look names.
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
    /// What was wrong with them when somebody last looked.
    misfit: Option<Misfit>,
}

/// What materials are made with.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Textures {
    pub albedo: Handle<Image>,
    pub relief: Handle<Image>,
    pub noise: Handle<Image>,
}

/// Why arrays don't fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
enum Misfit {
    #[error("albedo has {albedo} layers, relief {relief}")]
    Unequal { albedo: u32, relief: u32 },
    #[error("they have {layers} layers, the GroundLook of {terrain} names {named}")]
    TooFew { layers: u32, terrain: Entity, named: u32 },
}

impl Misfit {
    fn find<'a>(
        [albedo, relief]: [u32; 2],
        looks: impl Iterator<Item = (Entity, &'a GroundLook)>,
    ) -> Option<Self> {
        if albedo != relief {
            return Some(Self::Unequal { albedo, relief });
        }
        let named = |look: &GroundLook| {
            let layers = look.layers.iter().zip(1..).take(MAX_LAYERS);
            layers.map(|(layer, count)| layer.top.map_or(0, |top| u32::from(top) + 1).max(count)).max()
        };
        let (terrain, named) = looks
            .map(|(terrain, look)| (terrain, named(look).unwrap_or(1)))
            .max_by_key(|&(terrain, named)| (named, terrain))?;
        (named > albedo).then_some(Self::TooFew { layers: albedo, terrain, named })
    }
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
    looks: Query<(Entity, &GroundLook)>,
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
        (loading.baked, loading.is_current, loading.misfit) = (None, false, None);
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
    if let (Some(albedo), Some(relief)) = (images.get(&textures.albedo), images.get(&textures.relief)) {
        loading.is_current = true;
        let counts = [albedo, relief].map(|image| image.texture_descriptor.array_layer_count());
        let misfit = Misfit::find(counts, looks.iter());
        // In every frame, but told once per change.
        if let Some(misfit) = misfit
            && loading.misfit != Some(misfit)
        {
            warn!("the arrays of GroundTextures don't fit: {misfit}");
        }
        loading.misfit = misfit;
        if loading.ready.as_ref() != Some(&textures) {
            loading.ready = Some(textures);
        }
    } else if let Some(server) = server
        && [&textures.albedo, &textures.relief].iter().any(|image| server.load_state(*image).is_failed())
    {
        warn_once!("the ground has no look: an image of GroundTextures can't be loaded");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_must_be_alike_and_hold_what_looks_name() {
        let terrain = Entity::PLACEHOLDER;
        let look = GroundLook::default();
        let find = |counts| Misfit::find(counts, [(terrain, &look)].into_iter());
        assert_eq!(find([14, 12]), Some(Misfit::Unequal { albedo: 14, relief: 12 }));
        // Twelve layers, and two that are seen from above.
        assert_eq!(find([13, 13]), Some(Misfit::TooFew { layers: 13, terrain, named: 14 }));
        assert_eq!(find([14, 14]), None);
        assert_eq!(find([20, 20]), None);
    }
}
