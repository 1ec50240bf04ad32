//! Heightmaps as assets: grey PNG and headerless 16-bit RAW, decoded within limits.

use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, LoadContext};
use bevy::prelude::*;
use bevy::reflect::TypePath;
use serde::{Deserialize, Serialize};

use crate::ground::{GreyImage, ImageError, ImageLimits, RawFormat};

/// A grey image whose samples are heights; make a [`Ground`](crate::ground::Ground) of it.
#[derive(Asset, TypePath, Clone, Debug)]
pub struct HeightmapImage(pub GreyImage);

/// How a heightmap file is read.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HeightmapSettings {
    /// For RAW files: width, height and byte order, which they do not tell.
    pub raw: Option<RawHeightmap>,
    /// What a file may cost.
    pub limits: ImageLimits,
}

/// What a headerless RAW file does not tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RawHeightmap {
    /// Samples along x.
    pub width: u32,
    /// Samples along z.
    pub height: u32,
    /// Byte order.
    pub format: RawFormat,
}

/// Why a heightmap asset can't be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HeightmapError {
    /// The file can't be read.
    #[error("reading a heightmap: {0}")]
    Read(#[from] std::io::Error),
    /// The file is no usable heightmap.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A RAW file needs its size told.
    #[error("a RAW heightmap has no header: load it with HeightmapSettings {{ raw: Some(..) }}")]
    RawSize,
}

/// Loads `.png`, `.raw` and `.r16` files as [`HeightmapImage`]. Who loads a `.png` says of which type, as
/// `load::<HeightmapImage>` does; without that it is an ordinary picture.
#[derive(Default, TypePath)]
pub struct HeightmapLoader;

impl AssetLoader for HeightmapLoader {
    type Asset = HeightmapImage;
    type Settings = HeightmapSettings;
    type Error = HeightmapError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &Self::Settings,
        context: &mut LoadContext<'_>,
    ) -> Result<Self::Asset, Self::Error> {
        let bytes = read_limited(reader, settings.limits.max_file_bytes).await?;
        let name = context.path().to_string().to_lowercase();
        let image = match settings.raw {
            Some(RawHeightmap { width, height, format }) => {
                GreyImage::decode_raw(&bytes, width, height, &format, &settings.limits)?
            }
            None if name.ends_with(".png") => GreyImage::decode_png(&bytes, &settings.limits)?,
            None => return Err(HeightmapError::RawSize),
        };
        Ok(HeightmapImage(image))
    }

    fn extensions(&self) -> &[&str] {
        // Not "png": the last loader of an extension gets all files that nobody asks a type for.
        &["raw", "r16"]
    }
}

/// Reads a file, but no further than one byte past the limit: the decoder then says what is wrong.
async fn read_limited(reader: &mut dyn Reader, limit: u64) -> Result<Vec<u8>, std::io::Error> {
    use bevy::tasks::futures_lite::AsyncReadExt;
    let mut bytes = Vec::new();
    reader.take(limit.saturating_add(1)).read_to_end(&mut bytes).await?;
    Ok(bytes)
}

/// Adds the heightmap asset and its loader, where there is an asset server.
#[derive(Default)]
pub struct HeightmapPlugin;

impl Plugin for HeightmapPlugin {
    // At once where that is possible: games may load a heightmap while they are built, in a `FromWorld` say.
    fn build(&self, app: &mut App) {
        register(app);
    }

    // Else once all plugins are there, in whatever order they were added.
    fn finish(&self, app: &mut App) {
        register(app);
    }
}

/// The asset and its loader are registered.
#[derive(Resource)]
struct Registered;

/// Does nothing without an asset server, or the second time.
fn register(app: &mut App) {
    let world = app.world();
    if world.contains_resource::<AssetServer>() && !world.contains_resource::<Registered>() {
        // A game may have told of the asset by itself.
        if !world.contains_resource::<Assets<HeightmapImage>>() {
            app.init_asset::<HeightmapImage>();
        }
        app.insert_resource(Registered).init_asset_loader::<HeightmapLoader>();
    }
}
