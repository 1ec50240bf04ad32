//! Checks whether a game's own images fit the ground's bindings.

use std::sync::Arc;

use bevy::asset::{AssetLoadError, RenderAssetUsages};
use bevy::image::ImageSampler;
use bevy::prelude::*;
use bevy::render::render_resource::{
    TextureDimension, TextureFormat, TextureSampleType, TextureUsages, TextureViewDimension, WgpuFeatures,
};

use super::look::{GroundLook, MAX_LAYERS};

/// The reason why a game's own images are not used; see [`GroundLoading::failure`](super::GroundLoading::failure).
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GroundTexturesError {
    /// An image can't be loaded.
    #[error("the {image} can't be loaded: {source}")]
    Load {
        /// `albedo` or `relief`.
        image: &'static str,
        /// Bevy's error.
        source: Arc<AssetLoadError>,
    },
    /// An image is not an array of layers, but for example an ordinary picture.
    #[error(
        "the {image} is not a texture array but {view:?}: GroundArrays makes arrays of ordinary pictures"
    )]
    NoArray {
        /// `albedo` or `relief`.
        image: &'static str,
        /// The image's view dimension; the renderer needs [`TextureViewDimension::D2Array`].
        view: TextureViewDimension,
    },
    /// An image has texels that the GPU can't filter: integers, depths, on most GPUs also 32-bit floats.
    #[error("the {image} can't be filtered: its format is {format:?}")]
    Format {
        /// `albedo` or `relief`.
        image: &'static str,
        /// The image's format.
        format: TextureFormat,
    },
    /// An image has several samples per texel.
    #[error("the {image} can't be filtered: it has {samples} samples per texel")]
    Multisampled {
        /// `albedo` or `relief`.
        image: &'static str,
        /// How many.
        samples: u32,
    },
    /// An image has a sampler that compares, as those of shadow maps do.
    #[error("the {image} can't be filtered: its sampler compares")]
    Comparison {
        /// `albedo` or `relief`.
        image: &'static str,
    },
    /// An image was not made for shaders to read.
    #[error("shaders can't read the {image}: its usage lacks TEXTURE_BINDING")]
    Usage {
        /// `albedo` or `relief`.
        image: &'static str,
    },
    /// An image never reaches the renderer.
    #[error("the {image} stays in the main world: its RenderAssetUsages lack RENDER_WORLD")]
    MainWorld {
        /// `albedo` or `relief`.
        image: &'static str,
    },
}

/// The layers that the renderer sees in an image, if it is what the bindings of
/// [`GroundExtension`](super::GroundExtension) ask for: wgpu refuses all others, and Bevy then quits the app.
pub(super) fn layers(
    name: &'static str,
    image: &Image,
    features: WgpuFeatures,
) -> Result<u32, GroundTexturesError> {
    let (texture, view) = (&image.texture_descriptor, image.texture_view_descriptor.as_ref());
    // wgpu's default if it is not set.
    let dimension = view.and_then(|view| view.dimension).unwrap_or(match texture.dimension {
        TextureDimension::D1 => TextureViewDimension::D1,
        TextureDimension::D2 if texture.array_layer_count() == 1 => TextureViewDimension::D2,
        TextureDimension::D2 => TextureViewDimension::D2Array,
        TextureDimension::D3 => TextureViewDimension::D3,
    });
    if dimension != TextureViewDimension::D2Array {
        return Err(GroundTexturesError::NoArray { image: name, view: dimension });
    }
    let filtered = TextureSampleType::Float { filterable: true };
    if texture.format.sample_type(None, Some(features)) != Some(filtered) {
        return Err(GroundTexturesError::Format { image: name, format: texture.format });
    }
    if texture.sample_count != 1 {
        return Err(GroundTexturesError::Multisampled { image: name, samples: texture.sample_count });
    }
    if matches!(&image.sampler, ImageSampler::Descriptor(sampler) if sampler.compare.is_some()) {
        return Err(GroundTexturesError::Comparison { image: name });
    }
    let usage = view.and_then(|view| view.usage).filter(|usage| !usage.is_empty()).unwrap_or(texture.usage);
    if !usage.contains(TextureUsages::TEXTURE_BINDING) {
        return Err(GroundTexturesError::Usage { image: name });
    }
    if !image.asset_usage.contains(RenderAssetUsages::RENDER_WORLD) {
        return Err(GroundTexturesError::MainWorld { image: name });
    }
    let (first, count) = view.map_or((0, None), |view| (view.base_array_layer, view.array_layer_count));
    Ok(count.unwrap_or(texture.array_layer_count().saturating_sub(first)))
}

/// Whether the sampler of an image is anisotropic, as the app's default one may be.
pub(super) fn is_anisotropic(image: &Image) -> bool {
    match &image.sampler {
        ImageSampler::Default => true,
        ImageSampler::Descriptor(sampler) => sampler.anisotropy_clamp > 1,
    }
}

/// A reason why usable arrays are probably a mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum ArrayMismatch {
    #[error("albedo has {albedo} layers, relief {relief}")]
    Unequal { albedo: u32, relief: u32 },
    #[error("they have {layers} layers, the GroundLook of {terrain} names {named}")]
    TooFew { layers: u32, terrain: Entity, named: u32 },
}

impl ArrayMismatch {
    /// Compares arrays with these numbers of layers with the looks.
    pub(super) fn find<'a>(
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

#[cfg(test)]
mod tests {
    use bevy::image::{ImageCompareFunction, ImageSamplerDescriptor};
    use bevy::render::render_resource::TextureViewDescriptor;

    use super::GroundTexturesError::{Comparison, Format, MainWorld, Multisampled, NoArray, Usage};
    use super::*;

    fn find(image: &Image) -> Result<u32, GroundTexturesError> {
        layers("relief", image, WgpuFeatures::empty())
    }

    /// An image of this many layers, without a view descriptor.
    fn stack(layers: u32) -> Image {
        let mut image = Image::default();
        image.texture_descriptor.size.depth_or_array_layers = layers;
        image
    }

    /// An image of this many layers with a view of this dimension.
    fn seen(layers: u32, dimension: TextureViewDimension) -> Image {
        let view = TextureViewDescriptor { dimension: Some(dimension), ..default() };
        Image { texture_view_descriptor: Some(view), ..stack(layers) }
    }

    #[test]
    fn layers_are_those_that_the_renderer_sees() {
        assert_eq!(find(&stack(2)).ok(), Some(2));
        assert_eq!(find(&seen(1, TextureViewDimension::D2Array)).ok(), Some(1));
        let mut part = seen(9, TextureViewDimension::D2Array);
        let view = part.texture_view_descriptor.as_mut().expect("a view");
        view.base_array_layer = 4;
        assert_eq!(find(&part).ok(), Some(5));
        let view = part.texture_view_descriptor.as_mut().expect("a view");
        view.array_layer_count = Some(3);
        assert_eq!(find(&part).ok(), Some(3));
    }

    #[test]
    fn what_is_no_array_of_layers_would_end_the_app() {
        use TextureViewDimension::{Cube, D2, D3};
        let mut solid = stack(4);
        solid.texture_descriptor.dimension = TextureDimension::D3;
        // An ordinary picture; a stacked one of a single layer, whose view may have been left open.
        let open = Image { texture_view_descriptor: Some(TextureViewDescriptor::default()), ..stack(1) };
        let images = [(stack(1), D2), (open, D2), (seen(6, D2), D2), (seen(6, Cube), Cube), (solid, D3)];
        for (image, expected) in images {
            let found = find(&image);
            assert!(
                matches!(found, Err(NoArray { image: "relief", view }) if view == expected),
                "{found:?}, not {expected:?}"
            );
        }
    }

    #[test]
    fn what_cannot_be_filtered_would_end_the_app() {
        for format in [
            TextureFormat::Rgba8Uint,
            TextureFormat::Rgba16Sint,
            TextureFormat::Depth32Float,
            TextureFormat::Depth24PlusStencil8,
            TextureFormat::Rgba32Float,
        ] {
            let mut image = stack(2);
            image.texture_descriptor.format = format;
            let found = find(&image);
            assert!(matches!(found, Err(Format { format: named, .. }) if named == format), "{found:?}");
        }
        let mut floats = stack(2);
        floats.texture_descriptor.format = TextureFormat::Rgba32Float;
        assert_eq!(layers("relief", &floats, WgpuFeatures::FLOAT32_FILTERABLE).ok(), Some(2));
        let mut samples = stack(2);
        samples.texture_descriptor.sample_count = 4;
        assert!(matches!(find(&samples), Err(Multisampled { samples: 4, .. })));
        let sampler = ImageSamplerDescriptor { compare: Some(ImageCompareFunction::Less), ..default() };
        let compares = Image { sampler: ImageSampler::Descriptor(sampler), ..stack(2) };
        assert!(matches!(find(&compares), Err(Comparison { .. })));
        let linear = Image { sampler: ImageSampler::linear(), ..stack(2) };
        assert_eq!(find(&linear).ok(), Some(2));
    }

    #[test]
    fn what_never_comes_to_the_shader_is_told() {
        let mut target = stack(2);
        target.texture_descriptor.usage = TextureUsages::RENDER_ATTACHMENT;
        assert!(matches!(find(&target), Err(Usage { .. })));
        let mut view = seen(2, TextureViewDimension::D2Array);
        let usage = view.texture_view_descriptor.as_mut().expect("a view");
        usage.usage = Some(TextureUsages::COPY_SRC);
        assert!(matches!(find(&view), Err(Usage { .. })));
        let kept = Image { asset_usage: RenderAssetUsages::MAIN_WORLD, ..stack(2) };
        assert!(matches!(find(&kept), Err(MainWorld { .. })));
    }

    #[test]
    fn arrays_must_be_alike_and_hold_what_looks_name() {
        let terrain = Entity::PLACEHOLDER;
        let look = GroundLook::default();
        let find = |counts| ArrayMismatch::find(counts, [(terrain, &look)].into_iter());
        assert_eq!(find([16, 14]), Some(ArrayMismatch::Unequal { albedo: 16, relief: 14 }));
        // Fourteen layers, and two that are seen from above.
        assert_eq!(find([15, 15]), Some(ArrayMismatch::TooFew { layers: 15, terrain, named: 16 }));
        assert_eq!(find([16, 16]), None);
        assert_eq!(find([20, 20]), None);
    }
}
