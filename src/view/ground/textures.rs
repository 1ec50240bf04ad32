//! Textures: baked by this crate, or a game's own.

use std::fmt;

use bevy::asset::LoadState;
use bevy::prelude::*;
use bevy::render::render_resource::WgpuFeatures;
use bevy::render::renderer::{RenderAdapterInfo, RenderDevice};

use super::bake::{Layers, Meter};
use super::cache::{GroundTextureCache, fetch_or_paint};
use super::fit::{ArrayMismatch, GroundTexturesError, is_anisotropic, layers};
use super::look::GroundLook;
use crate::threads::{ThreadTask, Threads};

/// Which textures the ground is drawn with. Insert it before the first [`GroundLook`](super::GroundLook), or change it
/// at any time.
#[derive(Resource, Reflect, Clone, Debug, PartialEq)]
#[reflect(Resource, Default)]
#[non_exhaustive]
pub enum GroundTextures {
    /// This crate's own, painted from noise in a task when the first [`GroundLook`](super::GroundLook) is inserted,
    /// coarse ones at once and fine ones after some seconds, or read from a [`GroundTextureCache`]: 0 rock, 1 grass, 2
    /// sand, 3 snow, 4 clay, 5 concrete, 6 coal, 7 gold, 8 soil, 9 sandstone, 10 shale, 11 gravel, 12 iron, 13 copper;
    /// 14 and 15 are 9 and 10 as they look from above, see [`GroundLayer::top`](super::GroundLayer::top). The bytes are
    /// equal on every machine. They are kept when the last look is removed, so the next one need not wait.
    Baked {
        /// Texels along a side: a power of two from 16 to 2048, else the next larger one.
        side: u32,
        /// How much sharper than usual slanting ground is filtered, 1 (not at all) to 16. Software renderers go
        /// without.
        anisotropy: u16,
    },
    /// A game's own: two arrays with one layer for each material id, alike in number and size, with mip levels and
    /// samplers that repeat. [`GroundArrays`](super::GroundArrays) makes them of ordinary pictures;
    /// a warning is logged if arrays differ, or have fewer layers than a look names.
    ///
    /// Images that can't be loaded, or are not arrays that can be filtered, are not used: see
    /// [`GroundLoading::failure`].
    ///
    /// A software renderer goes without anisotropic filtering, which would take it minutes for each frame: where one of
    /// the samplers has it, or is the app's default one, both arrays are read with one that repeats and is linear.
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

/// The progress of the textures, for a progress bar. Change detection reports it when one of its methods returns
/// another value.
#[derive(Resource, Default)]
pub struct GroundLoading {
    meter: Meter,
    task: Option<ThreadTask<Painted>>,
    /// What the current textures were made for.
    wanted: Option<GroundTextures>,
    baked: Option<[Handle<Image>; 3]>,
    /// Whether these are as fine as the settings ask for.
    is_fine: bool,
    pub(super) ready: Option<Textures>,
    /// Whether `ready` has the textures that the settings ask for.
    is_current: bool,
    /// Whether usable images were there at the last check.
    was_sound: bool,
    /// The reason why there were none.
    failure: Option<GroundTexturesError>,
    /// A warning about usable images.
    misfit: Option<ArrayMismatch>,
    /// The state that change detection last reported.
    told: Answers,
}

impl fmt::Debug for GroundLoading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GroundLoading")
            .field("progress", &self.progress())
            .field("is_ready", &self.is_ready())
            .field("failure", &self.failure())
            .finish_non_exhaustive()
    }
}

/// The values that [`GroundLoading`] returns.
#[derive(Clone, Debug, Default, PartialEq)]
struct Answers {
    progress: f32,
    is_ready: bool,
    failure: Option<String>,
}

/// Texels along a side of the textures that are shown while finer ones are painted.
const COARSE: u32 = 64;

/// What a task painted.
struct Painted {
    layers: Layers,
    images: [Image; 3],
}

impl Painted {
    fn new(layers: Layers, anisotropy: u16) -> Self {
        Self { images: layers.clone().into_images(anisotropy), layers }
    }
}

/// The images of a material.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Textures {
    pub albedo: Handle<Image>,
    pub relief: Handle<Image>,
    pub noise: Handle<Image>,
    /// Whether the sampler of the noise replaces those of albedo and relief.
    pub without_anisotropy: bool,
}

/// The renderer that draws the ground.
#[derive(Clone, Copy)]
struct Renderer {
    features: WgpuFeatures,
    is_software: bool,
}

impl Renderer {
    /// Without a device or an adapter nothing is drawn.
    fn new(device: Option<&RenderDevice>, adapter: Option<&RenderAdapterInfo>) -> Self {
        Self {
            features: device.map_or(WgpuFeatures::empty(), RenderDevice::features),
            // Bevy does not re-export wgpu's type of these.
            is_software: adapter.is_some_and(|adapter| format!("{:?}", adapter.device_type) == "Cpu"),
        }
    }
}

impl GroundLoading {
    /// From 0 (nothing requested, or just started) to 1 (all terrains are textured). While other textures are made,
    /// terrains keep the old ones, or else show coarse ones, and this starts again at 0. After a
    /// [`failure`](Self::failure) it never reaches 1.
    pub fn progress(&self) -> f32 {
        if self.is_current { 1.0 } else { self.meter.progress().min(0.99) }
    }

    /// Whether the textures are there and applied to terrains. No longer `true` if a game removes its own images.
    pub fn is_ready(&self) -> bool {
        self.is_current
    }

    /// The reason why a game's own images are not used. A loading screen should stop waiting for them then. Terrains
    /// keep their textures; terrains without textures get this crate's own at the lowest resolution. It is returned
    /// until [`GroundTextures`] or the images change; a warning is logged too.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_burrow::prelude::*;
    /// fn fall_back(loading: Res<GroundLoading>, mut textures: ResMut<GroundTextures>) {
    ///     if loading.failure().is_some() {
    ///         *textures = GroundTextures::default();
    ///     }
    /// }
    /// ```
    pub fn failure(&self) -> Option<&GroundTexturesError> {
        self.failure.as_ref()
    }

    fn answers(&self) -> Answers {
        let failure = self.failure().map(ToString::to_string);
        Answers { progress: self.progress(), is_ready: self.is_ready(), failure }
    }

    /// Records why images are not used, and logs it once.
    fn fail(&mut self, failure: GroundTexturesError) {
        (self.is_current, self.was_sound) = (false, false);
        if self.failure.as_ref().is_none_or(|told| told.to_string() != failure.to_string()) {
            warn!("the images of GroundTextures are not used: {failure}");
            self.failure = Some(failure);
        }
    }
}

/// Bakes or fetches the textures of the settings once there is a look.
pub(super) fn load_textures(
    mut loading: ResMut<GroundLoading>,
    settings: Res<GroundTextures>,
    cache: Option<Res<GroundTextureCache>>,
    looks: Query<(Entity, &GroundLook)>,
    mut images: ResMut<Assets<Image>>,
    server: Option<Res<AssetServer>>,
    device: Option<Res<RenderDevice>>,
    adapter: Option<Res<RenderAdapterInfo>>,
) {
    let renderer = Renderer::new(device.as_deref(), adapter.as_deref());
    let unseen = loading.bypass_change_detection();
    unseen.paint(&settings, cache.as_deref(), &looks, &mut images);
    unseen.proceed(&settings, &looks, &mut images, server.as_deref(), renderer);
    // Marked as changed only if an answer of its methods changes.
    let answers = loading.answers();
    if loading.told != answers {
        loading.told = answers;
    }
}

impl GroundLoading {
    /// Has textures painted, first coarse and then fine.
    fn paint(
        &mut self,
        settings: &GroundTextures,
        cache: Option<&GroundTextureCache>,
        looks: &Query<(Entity, &GroundLook)>,
        images: &mut ResMut<Assets<Image>>,
    ) {
        if looks.is_empty() && self.wanted.is_none() {
            return;
        }
        if self.wanted.as_ref() != Some(settings) {
            self.begin(settings);
        }
        let Some(Painted { layers, images: painted }) = self.task.as_mut().and_then(ThreadTask::finish)
        else {
            return;
        };
        self.baked = Some(painted.map(|image| images.add(image)));
        let (side, anisotropy) = size_of(settings);
        self.is_fine = layers.side == side;
        let fine = (!self.is_fine).then(|| {
            let folder = cache.and_then(|cache| cache.0.clone());
            let meter = self.meter.clone();
            ThreadTask::start(Threads::Background, move || {
                Painted::new(fetch_or_paint(folder.as_deref(), &layers, side, &meter), anisotropy)
            })
        });
        self.task = fine;
    }

    fn proceed(
        &mut self,
        settings: &GroundTextures,
        looks: &Query<(Entity, &GroundLook)>,
        images: &mut ResMut<Assets<Image>>,
        server: Option<&AssetServer>,
        renderer: Renderer,
    ) {
        let Some([albedo, relief, noise]) = self.baked.clone() else { return };
        let read = |albedo: Handle<Image>, relief: Handle<Image>| {
            let filters = [&albedo, &relief].map(|image| images.get(image).is_some_and(is_anisotropic));
            // Lavapipe takes minutes for anisotropic filtering with explicit gradients, if it finishes at all.
            let without_anisotropy = renderer.is_software && filters.contains(&true);
            Textures { albedo, relief, noise: noise.clone(), without_anisotropy }
        };
        let baked = read(albedo, relief);
        let textures = match settings {
            GroundTextures::Baked { .. } => baked.clone(),
            GroundTextures::Images { albedo, relief } => read(albedo.clone(), relief.clone()),
        };
        // Until the fine ones are painted, coarse ones are better than none.
        if !self.is_fine {
            self.ready.get_or_insert(baked);
            return;
        }
        // In every frame, since images may change, and drawing with invalid ones would end the app.
        let find = |name, handle: &Handle<Image>| match (images.get(handle), server) {
            (Some(image), _) => layers(name, image, renderer.features).map(Some),
            (None, Some(server)) => match server.load_state(handle) {
                LoadState::Failed(source) => Err(GroundTexturesError::Load { image: name, source }),
                _ => Ok(None),
            },
            (None, None) => Ok(None),
        };
        let find_both = |Textures { albedo, relief, .. }: &Textures| {
            find("albedo", albedo).and_then(|layers| Ok(layers.zip(find("relief", relief)?)))
        };
        match find_both(&textures) {
            Ok(Some((albedo, relief))) => self.use_textures(textures, [albedo, relief], looks),
            // Not loaded yet, or removed.
            Ok(None) => (self.is_current, self.was_sound, self.failure) = (false, false, None),
            Err(failure) => {
                if self.ready.as_ref().is_none_or(|worn| find_both(worn).is_err()) {
                    self.ready = Some(baked);
                }
                self.fail(failure);
            }
        }
    }

    /// Uses textures that can be drawn with, and have these many layers: albedo and relief.
    fn use_textures(&mut self, textures: Textures, layers: [u32; 2], looks: &Query<(Entity, &GroundLook)>) {
        self.failure = None;
        // The renderer takes over images and materials in any order: it may still have the old version of an
        // image that was repaired in this frame.
        if !std::mem::replace(&mut self.was_sound, true) {
            return;
        }
        self.is_current = true;
        let misfit = ArrayMismatch::find(layers, looks.iter());
        if let Some(misfit) = misfit
            && self.misfit != Some(misfit)
        {
            warn!("the arrays of GroundTextures don't fit: {misfit}");
        }
        self.misfit = misfit;
        if self.ready.as_ref() != Some(&textures) {
            self.ready = Some(textures);
        }
    }

    /// Starts to make other textures.
    fn begin(&mut self, settings: &GroundTextures) {
        self.wanted = Some(settings.clone());
        self.meter = Meter::default();
        (self.baked, self.is_fine, self.is_current, self.was_sound) = (None, false, false, false);
        (self.failure, self.misfit) = (None, None);
        let (side, anisotropy) = size_of(settings);
        let side = side.min(COARSE);
        self.task = Some(ThreadTask::start(Threads::Background, move || {
            Painted::new(Layers::paint(side, &Meter::default()), anisotropy)
        }));
    }
}

/// Texels along a side of what is painted, and anisotropy.
fn size_of(settings: &GroundTextures) -> (u32, u16) {
    match settings {
        GroundTextures::Baked { side, anisotropy } => {
            (side.clamp(&16, &2048).next_power_of_two(), *anisotropy)
        }
        // Noise is needed in any case; with a game's own images the layers are painted at the smallest size.
        GroundTextures::Images { .. } => (16, 1),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use bevy::image::{ImageSampler, ImageSamplerDescriptor};
    use bevy::render::render_resource::{TextureViewDescriptor, TextureViewDimension};

    use super::GroundTexturesError::{Load, NoArray};
    use super::*;

    /// Painted fast.
    const SMALL: GroundTextures = GroundTextures::Baked { side: 16, anisotropy: 1 };

    /// An app that draws nothing, with a terrain that has a look.
    fn app() -> App {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default()))
            .init_asset::<Image>()
            .insert_resource(SMALL)
            .init_resource::<GroundLoading>()
            .add_systems(Update, load_textures);
        app.world_mut().spawn(GroundLook::default());
        app
    }

    fn loading(app: &App) -> &GroundLoading {
        app.world().resource()
    }

    fn update_until(app: &mut App, what: &str, is_so: impl Fn(&GroundLoading) -> bool) {
        for _ in 0..10_000 {
            app.update();
            if is_so(loading(app)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("{what}");
    }

    fn add(app: &mut App, image: Image) -> Handle<Image> {
        app.world_mut().resource_mut::<Assets<Image>>().add(image)
    }

    /// Runs [`load_textures`] as on a software renderer.
    fn load_in_software(
        mut loading: ResMut<GroundLoading>,
        settings: Res<GroundTextures>,
        looks: Query<(Entity, &GroundLook)>,
        mut images: ResMut<Assets<Image>>,
    ) {
        let renderer = Renderer { features: WgpuFeatures::empty(), is_software: true };
        loading.paint(&settings, None, &looks, &mut images);
        loading.proceed(&settings, &looks, &mut images, None, renderer);
    }

    #[test]
    fn coarse_textures_are_shown_until_fine_ones_are_painted() {
        let mut app = app();
        app.insert_resource(GroundTextures::Baked { side: 2 * COARSE, anisotropy: 1 });
        let side = |app: &App| {
            let ready = loading(app).ready.as_ref()?;
            let images = app.world().resource::<Assets<Image>>();
            Some(images.get(&ready.albedo).expect("it is kept").width())
        };
        update_until(&mut app, "coarse ones", |loading| loading.ready.is_some());
        assert_eq!((side(&app), loading(&app).is_ready()), (Some(COARSE), false));
        assert!(loading(&app).progress() < 1.0);
        update_until(&mut app, "fine ones", GroundLoading::is_ready);
        assert_eq!(side(&app), Some(2 * COARSE));
        // Others are worn until their successors are as fine as they shall be.
        app.insert_resource(GroundTextures::Baked { side: 4 * COARSE, anisotropy: 1 });
        app.update();
        update_until(&mut app, "finer ones", |loading| {
            assert!(loading.ready.is_some());
            loading.is_ready()
        });
        assert_eq!(side(&app), Some(4 * COARSE));
    }

    #[test]
    fn software_renderers_go_without_anisotropic_filtering() {
        let filtered = |anisotropy_clamp| {
            ImageSampler::Descriptor(ImageSamplerDescriptor {
                anisotropy_clamp,
                ..ImageSamplerDescriptor::linear()
            })
        };
        let nearest = ImageSampler::nearest();
        // Samplers of both arrays, and whether one that is not anisotropic takes their place.
        let own = [
            (filtered(1), filtered(1), false),
            (nearest.clone(), nearest, false),
            (filtered(1), filtered(2), true),
            (filtered(16), filtered(1), true),
            (ImageSampler::Default, filtered(1), true),
        ];
        for (albedo, relief, expected) in own {
            for is_software in [true, false] {
                let mut app = App::new();
                app.add_plugins((MinimalPlugins, AssetPlugin::default())).init_asset::<Image>();
                let images = [&albedo, &relief].map(|sampler| {
                    let image = add(&mut app, Image { sampler: sampler.clone(), ..default() });
                    see(&mut app, &image, TextureViewDimension::D2Array);
                    image
                });
                let [albedo, relief] = images;
                app.insert_resource(GroundTextures::Images { albedo, relief })
                    .init_resource::<GroundLoading>();
                app.world_mut().spawn(GroundLook::default());
                if is_software {
                    app.add_systems(Update, load_in_software);
                } else {
                    app.add_systems(Update, load_textures);
                }
                update_until(&mut app, "textures", GroundLoading::is_ready);
                let ready = loading(&app).ready.as_ref().expect("they are there");
                assert_eq!(ready.without_anisotropy, expected && is_software);
            }
        }
    }

    /// Sets the view dimension of an image.
    fn see(app: &mut App, image: &Handle<Image>, dimension: TextureViewDimension) {
        let mut images = app.world_mut().resource_mut::<Assets<Image>>();
        let mut image = images.get_mut(image).expect("an image");
        image.texture_view_descriptor =
            Some(TextureViewDescriptor { dimension: Some(dimension), ..default() });
    }

    fn uses(app: &App, albedo: &Handle<Image>) -> bool {
        loading(app).ready.as_ref().is_some_and(|ready| ready.albedo == *albedo)
    }

    #[test]
    fn ordinary_pictures_are_not_drawn_with_until_they_are_arrays() {
        let mut app = app();
        let [albedo, relief] = [(); 2].map(|()| add(&mut app, Image::default()));
        app.insert_resource(GroundTextures::Images { albedo: albedo.clone(), relief: relief.clone() });
        update_until(&mut app, "a failure", |loading| loading.failure().is_some());
        assert!(matches!(loading(&app).failure(), Some(NoArray { image: "albedo", .. })));
        assert!(!loading(&app).is_ready() && loading(&app).progress() < 1.0);
        assert!(loading(&app).ready.is_some() && !uses(&app, &albedo), "coarse ground is better than none");

        see(&mut app, &albedo, TextureViewDimension::D2Array);
        app.update();
        assert!(matches!(loading(&app).failure(), Some(NoArray { image: "relief", .. })));
        see(&mut app, &relief, TextureViewDimension::D2Array);
        app.update();
        assert!(
            loading(&app).failure().is_none() && !uses(&app, &albedo),
            "the renderer has them a frame later"
        );
        app.update();
        assert!(loading(&app).is_ready() && uses(&app, &albedo));

        // As if the image was loaded again.
        see(&mut app, &relief, TextureViewDimension::D2);
        app.update();
        assert!(loading(&app).failure().is_some() && !loading(&app).is_ready() && !uses(&app, &albedo));
    }

    #[test]
    fn an_image_that_cannot_be_loaded_is_told_until_there_are_others() {
        let mut app = app();
        update_until(&mut app, "textures", GroundLoading::is_ready);
        let own = loading(&app).ready.clone();
        let mut array = Image::default();
        array.texture_descriptor.size.depth_or_array_layers = 2;
        let albedo = add(&mut app, array);
        let relief = app.world().resource::<AssetServer>().load("nowhere.png");
        app.insert_resource(GroundTextures::Images { albedo, relief });
        update_until(&mut app, "a failure", |loading| loading.failure().is_some());
        assert!(matches!(loading(&app).failure(), Some(Load { image: "relief", .. })));
        assert!(!loading(&app).is_ready());
        assert_eq!(loading(&app).ready, own, "terrains keep what they have");

        app.insert_resource(SMALL);
        app.update();
        assert!(loading(&app).failure().is_none());
        update_until(&mut app, "textures", GroundLoading::is_ready);
    }

    /// Two usable images that are applied to a terrain.
    fn use_own(app: &mut App) -> [Handle<Image>; 2] {
        let own = [(); 2].map(|()| add(app, Image::default()));
        own.iter().for_each(|image| see(app, image, TextureViewDimension::D2Array));
        let [albedo, relief] = own.clone();
        app.insert_resource(GroundTextures::Images { albedo, relief });
        update_until(app, "textures", GroundLoading::is_ready);
        own
    }

    #[test]
    fn an_image_that_is_taken_away_is_not_ready_until_it_is_back() {
        let mut app = app();
        let [albedo, relief] = use_own(&mut app);
        assert!(uses(&app, &albedo));
        let mut images = app.world_mut().resource_mut::<Assets<Image>>();
        let image = images.remove(&relief).expect("it is there");
        app.update();
        assert!(!loading(&app).is_ready() && loading(&app).progress() < 1.0);
        assert!(loading(&app).failure().is_none(), "it may be on its way");
        let mut images = app.world_mut().resource_mut::<Assets<Image>>();
        images.insert(&relief, image).expect("its handle is there");
        app.update();
        assert!(!loading(&app).is_ready(), "the renderer has it a frame later");
        app.update();
        assert!(loading(&app).is_ready() && uses(&app, &albedo));
    }

    /// The number of changes that change detection reported.
    #[derive(Resource, Default)]
    struct Told(usize);

    #[test]
    fn whoever_watches_is_told_when_an_answer_changes_and_not_otherwise() {
        let mut app = app();
        app.init_resource::<Told>().add_systems(
            Last,
            |loading: Res<GroundLoading>, mut told: ResMut<Told>| {
                told.0 += usize::from(loading.is_changed());
            },
        );
        let told = |app: &App| app.world().resource::<Told>().0;
        app.update();
        let before = told(&app);
        update_until(&mut app, "textures", GroundLoading::is_ready);
        assert!(told(&app) > before, "they are ready");
        let before = told(&app);
        (0..5).for_each(|_| app.update());
        assert_eq!(told(&app), before);
        let [albedo, relief] = [(); 2].map(|()| add(&mut app, Image::default()));
        app.insert_resource(GroundTextures::Images { albedo, relief });
        app.update();
        assert_eq!(told(&app), before + 1, "it starts again");
        update_until(&mut app, "a failure", |loading| loading.failure().is_some());
        let before = told(&app);
        app.update();
        assert_eq!(told(&app), before);
        app.insert_resource(SMALL);
        app.update();
        assert!(loading(&app).failure().is_none() && told(&app) == before + 1);
    }
}
