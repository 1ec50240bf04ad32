//! Packs a game's own pictures into the texture arrays of the ground.

use bevy::image::IntoDynamicImageError;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureFormat};
use rayon::prelude::*;

use super::GroundTextures;
use super::bake::array;
use super::paint::{levels, mean_roughness};

/// The maximum number of texels along a side.
const MAX_SIDE: u32 = 4096;
/// The maximum number of layers: the limit that every GPU supports, and the number of values of a `u8`.
const MAX_ARRAY_LAYERS: usize = 256;
/// Anisotropic filtering of slanting ground.
const ANISOTROPY: u16 = 4;

/// The pictures of one layer, as texture libraries provide them. All must be square, as large as those of the other
/// layers, and have 8 bits per channel. Their bytes are used as they are in the file, whether it was loaded as sRGB or
/// not.
#[derive(Clone, Debug, Default)]
pub struct GroundLayerImages {
    /// Colours in sRGB; heights in alpha, unless [`height`](Self::height) has them.
    pub albedo: Image,
    /// Heights in red, 0 low to 255 high: the higher layer is on top where layers meet. Without it, and with an albedo
    /// that is opaque throughout, the layer lies flat at half height.
    pub height: Option<Image>,
    /// A normal map as for [`StandardMaterial`], x right and y up. Without one, the surface is flat.
    pub normal: Option<Image>,
    /// Whether the normal map is made for DirectX, with a green channel that points down.
    pub flip_normal_map_y: bool,
    /// Occlusion in red, as in glTF. Without it, nothing is occluded.
    pub occlusion: Option<Image>,
    /// Perceptual roughness in green, as in glTF. Without it, the roughness is 0.9. If one picture holds both occlusion
    /// and roughness, set both fields to it.
    pub roughness: Option<Image>,
}

/// The reason why pictures can't be packed into [`GroundArrays`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GroundArraysError {
    /// There is no layer, or there are too many.
    #[error("{layers} layers were given: ground takes 1 to {MAX_ARRAY_LAYERS}")]
    Layers {
        /// Layers given.
        layers: usize,
    },
    /// A picture is empty, too large, not square, no power of two, or several in one.
    #[error(
        "the {picture} of layer {layer} has {size} texels: it must be one square picture, \
         a power of two up to {MAX_SIDE} along a side"
    )]
    Size {
        /// Which picture.
        picture: &'static str,
        /// The layer's number.
        layer: usize,
        /// Width, height, and depth or number of layers.
        size: UVec3,
    },
    /// A picture is larger or smaller than the first one.
    #[error(
        "the {picture} of layer {layer} is {side} texels wide, the albedo of layer 0 {expected}: all must be alike"
    )]
    Unequal {
        /// Which picture.
        picture: &'static str,
        /// The layer's number.
        layer: usize,
        /// Texels along its side.
        side: u32,
        /// Texels along the side of the first albedo.
        expected: u32,
    },
    /// A picture has another format than grey or RGBA of 8 bits per channel, or its bytes are not in the main world.
    #[error("the {picture} of layer {layer} can't be packed: {source}")]
    Unreadable {
        /// Which picture.
        picture: &'static str,
        /// The layer's number.
        layer: usize,
        /// Bevy's error.
        source: IntoDynamicImageError,
    },
}

/// Texture arrays for [`GroundTextures::Images`], packed from a game's own pictures, with all mip levels.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy::tasks::{AsyncComputeTaskPool, Task};
/// # use bevy_burrow::prelude::*;
/// # use bevy_burrow::view::GroundArraysError;
/// // Behind a loading screen: clones of images that are loaded, one item for each material id.
/// fn pack(layers: Vec<GroundLayerImages>) -> Task<Result<GroundArrays, GroundArraysError>> {
///     AsyncComputeTaskPool::get().spawn(async move { GroundArrays::pack(layers) })
/// }
///
/// // When the task is done.
/// fn take_over(arrays: GroundArrays, images: &mut Assets<Image>, commands: &mut Commands) {
///     commands.insert_resource(arrays.add_to(images));
/// }
///
/// let rock = GroundLayerImages { albedo: Image::default(), ..default() };
/// let grass = GroundLayerImages { normal: Some(Image::default()), ..rock.clone() };
/// let arrays = GroundArrays::pack([rock, grass])?;
/// assert_eq!(arrays.albedo.texture_descriptor.array_layer_count(), 2);
/// # Ok::<(), GroundArraysError>(())
/// ```
#[derive(Clone, Debug)]
pub struct GroundArrays {
    /// Colours and heights.
    pub albedo: Image,
    /// Normals, occlusion and roughness.
    pub relief: Image,
}

impl GroundArrays {
    /// Packs the pictures of all layers, in the order of their numbers. This can take seconds on all of rayon's
    /// threads, so run it in a task or during a loading screen. For smaller mip levels, colours are averaged as light,
    /// normals keep their length, and the variation of normals makes them rougher, so that distant ground does not
    /// sparkle. Samplers repeat, with fourfold anisotropic filtering, which software renderers skip; both images can be
    /// given other samplers.
    ///
    /// # Errors
    ///
    /// [`GroundArraysError`] names the picture that doesn't fit, and its layer.
    pub fn pack(layers: impl IntoIterator<Item = GroundLayerImages>) -> Result<Self, GroundArraysError> {
        let layers: Vec<_> = layers.into_iter().collect();
        let side = match layers.first() {
            Some(first) if layers.len() <= MAX_ARRAY_LAYERS => first.albedo.width(),
            _ => return Err(GroundArraysError::Layers { layers: layers.len() }),
        };
        let packed: Vec<_> = layers
            .into_par_iter()
            .enumerate()
            .map(|(layer, images)| pack_layer(layer, images, side))
            .collect();
        // The first error by number, whichever came first.
        let packed: Vec<_> = packed.into_iter().collect::<Result<_, _>>()?;
        let count = packed.len() as u32;
        let (albedo, relief): (Vec<_>, Vec<_>) = packed.into_iter().unzip();
        let array = |layers: Vec<Vec<u8>>, format| array(layers.concat(), count, side, format, ANISOTROPY);
        Ok(Self {
            albedo: array(albedo, TextureFormat::Rgba8UnormSrgb),
            relief: array(relief, TextureFormat::Rgba8Unorm),
        })
    }

    /// Adds both arrays to the images of the app. Insert the returned value as a resource.
    pub fn add_to(self, images: &mut Assets<Image>) -> GroundTextures {
        GroundTextures::Images { albedo: images.add(self.albedo), relief: images.add(self.relief) }
    }
}

type Texels = Vec<[u8; 4]>;

/// One layer of both arrays, with all mip levels; all its pictures must be as wide as the first one of all layers.
fn pack_layer(
    layer: usize,
    images: GroundLayerImages,
    expected: u32,
) -> Result<(Vec<u8>, Vec<u8>), GroundArraysError> {
    let read = |picture: &'static str, image: Image| {
        let Extent3d { width: side, height, depth_or_array_layers: depth } = image.texture_descriptor.size;
        if side != height || depth != 1 || !side.is_power_of_two() || side > MAX_SIDE {
            return Err(GroundArraysError::Size { picture, layer, size: UVec3::new(side, height, depth) });
        }
        if side != expected {
            return Err(GroundArraysError::Unequal { picture, layer, side, expected });
        }
        texels(image).map_err(|source| GroundArraysError::Unreadable { picture, layer, source })
    };
    // Without a picture there are no texels, so nothing is overwritten.
    let overlay = |picture, image: Option<Image>| image.map_or(Ok(vec![]), |image| read(picture, image));
    let mut albedo = read("albedo", images.albedo)?;
    // No heights are in an opaque albedo, and at 255 the layer would be on top of all others.
    if images.height.is_none() && albedo.iter().all(|texel| texel[3] == u8::MAX) {
        albedo.iter_mut().for_each(|texel| texel[3] = 128);
    }
    for (texel, [height, ..]) in albedo.iter_mut().zip(overlay("height", images.height)?) {
        texel[3] = height;
    }
    let mut relief: Texels = vec![[128, 128, 255, 230]; albedo.len()];
    for (texel, [x, y, ..]) in relief.iter_mut().zip(overlay("normal", images.normal)?) {
        // In the arrays, y runs down.
        let y = if images.flip_normal_map_y { y } else { 255 - y };
        (texel[0], texel[1]) = (x, y);
    }
    for (texel, [occlusion, ..]) in relief.iter_mut().zip(overlay("occlusion", images.occlusion)?) {
        texel[2] = occlusion;
    }
    for (texel, [_, roughness, ..]) in relief.iter_mut().zip(overlay("roughness", images.roughness)?) {
        texel[3] = roughness;
    }
    Ok((levels(albedo, expected, mean_color), levels(relief, expected, mean_relief)))
}

/// The bytes of a picture, four to a texel.
fn texels(mut image: Image) -> Result<Texels, IntoDynamicImageError> {
    match image.texture_descriptor.format {
        // Both formats have equal bytes; Bevy's conversion accepts only one of them.
        TextureFormat::Rgba8Unorm => image.texture_descriptor.format = TextureFormat::Rgba8UnormSrgb,
        // Bevy reads grey and alpha there, others red and green.
        format @ TextureFormat::Rg8Unorm => return Err(IntoDynamicImageError::UnsupportedFormat(format)),
        _ => {}
    }
    Ok(image.try_into_dynamic()?.into_rgba8().pixels().map(|texel| texel.0).collect())
}

/// Colours are averaged as light.
fn mean_color(four: [[u8; 4]; 4]) -> [u8; 4] {
    let [a, b, c, d] = four.map(|texel| LinearRgba::from(Srgba::from_u8_array(texel)));
    Srgba::from((a + b + c + d) / 4.0).to_u8_array()
}

/// Normals are averaged as directions; the more they vary, the rougher is the mean.
fn mean_relief(four: [[u8; 4]; 4]) -> [u8; 4] {
    let [a, b, c, d] = four.map(|[x, y, ..]| {
        let lean = Vec2::new(x.into(), y.into()) / 127.5 - 1.0;
        lean.extend((1.0 - lean.length_squared()).max(0.0).sqrt())
    });
    let lean = ((a + b + c + d).normalize_or(Vec3::Z).truncate() + 1.0) * 127.5;
    let occlusion = four.map(|texel| f32::from(texel[2])).iter().sum::<f32>() / 4.0;
    [lean.x, lean.y, occlusion, 255.0 * mean_roughness(four)].map(|value| value.round() as u8)
}

#[cfg(test)]
mod tests {
    use bevy::asset::RenderAssetUsages;
    use bevy::render::render_resource::TextureDimension;

    use super::*;

    fn plain(side: u32, texel: [u8; 4]) -> Image {
        let size = Extent3d { width: side, height: side, depth_or_array_layers: 1 };
        let (format, usage) = (TextureFormat::Rgba8UnormSrgb, RenderAssetUsages::default());
        Image::new_fill(size, TextureDimension::D2, &texel, format, usage)
    }

    fn layer(albedo: Image) -> GroundLayerImages {
        GroundLayerImages { albedo, ..default() }
    }

    #[test]
    fn four_times_the_same_is_the_same() {
        for (x, y) in (0..=255_u8).flat_map(|x| (0..=255_u8).map(move |y| (x, y))) {
            assert_eq!(mean_color([[x, y, 255 - x, y]; 4]), [x, y, 255 - x, y]);
            let lean = Vec2::new(x.into(), y.into()) / 127.5 - 1.0;
            if lean.length() < 1.0 {
                assert_eq!(mean_relief([[x, y, x, y]; 4]), [x, y, x, y]);
            }
        }
    }

    #[test]
    fn colors_are_averaged_as_light_and_normals_as_directions() {
        let [black, white] = [[0, 0, 0, 0], [255; 4]];
        assert_eq!(mean_color([black, white, white, black]), [188, 188, 188, 128]);
        // 45 degrees to the right and 45 down: a plain mean is 172.5.
        let [right, down] = [[217, 128, 0, 10], [128, 217, 0, 20]];
        let [x, y, occlusion, roughness] = mean_relief([right, right, down, down]);
        assert_eq!([x, y, occlusion], [179, 179, 0]);
        // Smooth and bent as much as a sphere's eighth: rough.
        assert!(roughness > 150, "{roughness}");
    }

    #[test]
    fn layers_keep_their_order_and_their_colour_at_every_level() {
        let colors = [[200, 20, 90, 60], [1, 2, 3, 4], [250, 251, 252, 253]];
        let arrays = GroundArrays::pack(colors.map(|color| GroundLayerImages {
            normal: Some(plain(8, [100, 150, 255, 255])),
            roughness: Some(plain(8, [0, color[1], 0, 255])),
            occlusion: Some(plain(8, [color[0], 0, 0, 255])),
            ..layer(plain(8, color))
        }))
        .unwrap();
        let reliefs = colors.map(|[red, green, ..]| [100, 105, red, green]);
        for (image, expected) in [(arrays.albedo, colors), (arrays.relief, reliefs)] {
            let expected: Vec<_> = expected.iter().flat_map(|texel| [*texel; 64 + 16 + 4 + 1]).collect();
            assert_eq!(image.data.as_deref(), Some(expected.as_flattened()));
            assert_eq!(image.texture_descriptor.mip_level_count, 4);
            assert_eq!(image.texture_descriptor.array_layer_count(), 3);
        }
    }

    #[test]
    fn heights_come_from_a_picture_or_are_half() {
        let height = |layer| GroundArrays::pack([layer]).unwrap().albedo.data.unwrap()[3];
        let opaque = layer(plain(1, [9, 9, 9, 255]));
        assert_eq!(height(opaque.clone()), 128);
        let mut grey = plain(1, [70; 4]);
        (grey.texture_descriptor.format, grey.data) = (TextureFormat::R8Unorm, Some(vec![70]));
        assert_eq!(height(GroundLayerImages { height: Some(grey), ..opaque }), 70);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        use GroundArraysError::{Layers, Size, Unequal, Unreadable};
        let fault = |layers: Vec<GroundLayerImages>| GroundArrays::pack(layers).unwrap_err();
        assert!(matches!(fault(vec![]), Layers { layers: 0 }));
        assert!(matches!(fault(vec![layer(Image::default()); 257]), Layers { layers: 257 }));
        for size in [[0, 0, 1], [3, 3, 1], [4, 8, 1], [8192, 8192, 1], [4, 4, 2], [4, 4, 0]] {
            let [width, height, depth_or_array_layers] = size;
            let mut image = Image::default_uninit();
            image.texture_descriptor.size = Extent3d { width, height, depth_or_array_layers };
            let found = fault(vec![layer(image)]);
            assert!(
                matches!(found, Size { picture: "albedo", layer: 0, size: at } if at == UVec3::from(size))
            );
        }
        let good = layer(plain(4, [7; 4]));
        let small = GroundLayerImages { normal: Some(plain(2, [7; 4])), ..good.clone() };
        let found = fault(vec![good.clone(), small]);
        assert!(matches!(found, Unequal { picture: "normal", layer: 1, side: 2, expected: 4 }), "{found}");
        let mut broken = [(); 4].map(|()| plain(4, [7; 4]));
        broken[0].texture_descriptor.format = TextureFormat::Rgba16Unorm;
        broken[1].texture_descriptor.format = TextureFormat::Bc7RgbaUnorm;
        broken[2].data = None;
        broken[3].data = Some(vec![7; 63]);
        for image in broken {
            let found = fault(vec![good.clone(), GroundLayerImages { height: Some(image), ..good.clone() }]);
            assert!(matches!(found, Unreadable { picture: "height", layer: 1, .. }), "{found}");
        }
    }
}
