//! Small pictures of saved worlds, in their folders: what the player saw last.

use std::path::{Path, PathBuf};

use bevy::asset::RenderAssetUsages;
use bevy::image::{CompressedImageFormats, ImageSampler, ImageType};
use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy::tasks::IoTaskPool;
use bevy::window::PrimaryWindow;

use super::saves::PlayedWorld;
use crate::party::connection::Party;
use crate::player::game_state::GameState;

/// The file in a world's folder.
const FILE: &str = "thumbnail.png";
/// Pixels of its longer side.
const SIDE: u32 = 192;

/// Takes a picture of the saved world when the player pauses: the display is hidden by then, and the menu not shown
/// yet.
pub struct ThumbnailsPlugin;

impl Plugin for ThumbnailsPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(OnExit(GameState::Playing), take);
    }
}

/// Takes a picture of the window, if there is one. It is made small and written on another thread.
fn take(
    mut commands: Commands,
    played: Res<PlayedWorld>,
    party: Res<Party>,
    windows: Query<(), With<PrimaryWindow>>,
) {
    let Some(folder) = played.open(&party).cloned().filter(|_| !windows.is_empty()) else { return };
    commands.spawn(Screenshot::primary_window()).observe(move |picture: On<ScreenshotCaptured>| {
        let (picture, folder) = (picture.image.clone(), folder.clone());
        let write = move || {
            if let Err(why) = write(picture, &folder) {
                debug!("no picture of {}: {why}", folder.display());
            }
        };
        IoTaskPool::get().spawn(async move { write() }).detach();
    });
}

fn write(picture: Image, folder: &Path) -> Result {
    let small = picture.try_into_dynamic()?.thumbnail(SIDE, SIDE).to_rgb8();
    // Another reader never sees half of it.
    let draft = folder.join("thumbnail.draft.png");
    small.save(&draft)?;
    std::fs::rename(draft, folder.join(FILE))?;
    Ok(())
}

/// The picture of the world in a folder, if it has one.
pub fn read(folder: &Path) -> Option<Image> {
    let bytes = std::fs::read(path(folder)).ok()?;
    let (kind, formats) = (ImageType::Extension("png"), CompressedImageFormats::NONE);
    Image::from_buffer(&bytes, kind, formats, true, ImageSampler::linear(), RenderAssetUsages::RENDER_WORLD)
        .ok()
}

fn path(folder: &Path) -> PathBuf {
    folder.join(FILE)
}

#[cfg(test)]
mod tests {
    use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};

    use super::*;

    #[test]
    fn a_picture_is_written_small_and_read_again() {
        let folder = std::env::temp_dir().join(format!("burrow_thumbnail_{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        assert!(read(&folder).is_none());
        let size = Extent3d { width: 640, height: 360, depth_or_array_layers: 1 };
        let format = TextureFormat::Rgba8UnormSrgb;
        let red =
            Image::new_fill(size, TextureDimension::D2, &[255, 0, 0, 255], format, RenderAssetUsages::all());
        write(red, &folder).expect("it is written");
        let small = read(&folder).expect("it is there");
        assert_eq!(small.size(), UVec2::new(SIDE, SIDE * 360 / 640));
        std::fs::remove_dir_all(&folder).expect("the folder goes");
    }
}
