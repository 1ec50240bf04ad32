//! The logo and the icons of the tools.

use bevy::asset::RenderAssetUsages;
use bevy::image::{CompressedImageFormats, ImageSampler, ImageType, TextureError};
use bevy::prelude::*;

use crate::tools::Tool;

/// Pixels along an edge of an icon.
const ICON: f32 = 16.0;

#[derive(Resource)]
pub struct Images {
    pub logo: Handle<Image>,
    /// The icons of all tools, in the order of their slots.
    tools: Handle<Image>,
}

impl Images {
    /// The icon of a tool.
    pub fn icon(&self, tool: Tool) -> ImageNode {
        let left = ICON * f32::from(tool as u8);
        ImageNode::new(self.tools.clone()).with_rect(Rect::new(left, 0.0, left + ICON, ICON))
    }
}

impl FromWorld for Images {
    fn from_world(world: &mut World) -> Self {
        let mut images = world.resource_mut::<Assets<Image>>();
        // A broken image is a broken program, so it is left out with an error.
        let mut add = |png: &[u8]| match pixel_art(png) {
            Ok(image) => images.add(image),
            Err(error) => {
                error!("an image cannot be read: {error}");
                default()
            }
        };
        Self { logo: add(include_bytes!("logo.png")), tools: add(include_bytes!("tools.png")) }
    }
}

/// Decodes a PNG file whose pixels stay sharp.
fn pixel_art(png: &[u8]) -> Result<Image, TextureError> {
    Image::from_buffer(
        png,
        ImageType::Extension("png"),
        CompressedImageFormats::NONE,
        true,
        ImageSampler::nearest(),
        RenderAssetUsages::RENDER_WORLD,
    )
}
