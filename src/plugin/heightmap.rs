//! Heightmaps as assets: grey PNG and headerless 16-bit RAW, decoded within limits.

use std::marker::PhantomData;

use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, LoadContext};
use bevy::prelude::*;
use bevy::reflect::TypePath;
use serde::{Deserialize, Serialize};

use crate::ground::{GreyImage, ImageError, ImageLimits, RawFormat};

/// A grey image whose samples are heights, for a [`Ground`](crate::ground::Ground).
#[derive(Asset, TypePath, Clone, Debug)]
pub struct HeightmapImage(pub GreyImage);

/// How a heightmap file is read.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HeightmapSettings {
    /// For RAW files: width, height and byte order, which the file does not contain.
    pub raw: Option<RawHeightmap>,
    /// Limits of decoding a file.
    pub limits: ImageLimits,
}

/// The layout of a RAW file, which has no header.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RawHeightmap {
    /// Samples along x.
    pub width: u32,
    /// Samples along z.
    pub height: u32,
    /// Byte order.
    pub format: RawFormat,
}

/// The reason why a heightmap asset cannot be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HeightmapError {
    /// The file cannot be read.
    #[error("reading a heightmap: {0}")]
    Read(#[from] std::io::Error),
    /// The file is not a usable heightmap.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A RAW file was loaded without its size.
    #[error("a RAW heightmap has no header: load it with HeightmapSettings {{ raw: Some(..) }}")]
    RawSize,
}

/// Loads `.png`, `.raw` and `.r16` files as [`HeightmapImage`]. A `.png` needs its type, as in
/// `load::<HeightmapImage>`; otherwise Bevy loads it as an ordinary image.
#[derive(Default, TypePath)]
#[doc(hidden)]
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
        // Not "png": the last loader of an extension gets all files that are loaded without a type.
        &["raw", "r16"]
    }
}

/// Reads a file up to one byte past the limit; the decoder reports what is wrong.
pub(crate) async fn read_limited(reader: &mut dyn Reader, limit: u64) -> Result<Vec<u8>, std::io::Error> {
    use bevy::tasks::futures_lite::AsyncReadExt;
    let mut bytes = Vec::new();
    reader.take(limit.saturating_add(1)).read_to_end(&mut bytes).await?;
    Ok(bytes)
}

/// Adds the heightmap asset and its loader, where there is an asset server.
#[derive(Default)]
#[doc(hidden)]
pub struct HeightmapPlugin;

impl Plugin for HeightmapPlugin {
    // At once if possible: games may load a heightmap while plugins are built, for example in a `FromWorld`.
    fn build(&self, app: &mut App) {
        register(app);
    }

    // Otherwise once all plugins are there, in any order.
    fn finish(&self, app: &mut App) {
        register(app);
    }
}

/// The loader and its asset are registered.
#[derive(Resource)]
struct Registered<L: Send + Sync + 'static>(PhantomData<L>);

fn register(app: &mut App) {
    register_loader::<HeightmapLoader>(app);
}

/// Registers a loader and its asset. Does nothing and returns `false` without an asset server, or if called again.
pub(crate) fn register_loader<L: AssetLoader + FromWorld>(app: &mut App) -> bool {
    let world = app.world();
    if !world.contains_resource::<AssetServer>() || world.contains_resource::<Registered<L>>() {
        return false;
    }
    // The game may have registered the asset itself.
    if !world.contains_resource::<Assets<L::Asset>>() {
        app.init_asset::<L::Asset>();
    }
    app.insert_resource(Registered::<L>(PhantomData)).init_asset_loader::<L>();
    true
}
