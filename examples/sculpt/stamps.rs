//! Stamps and prefabs from files: named by `--stamp`, or dropped on the window.

use std::fs::File;
use std::io::{self, Read};
use std::ops::DerefMut;
use std::path::Path;
use std::sync::Arc;

use bevy::prelude::*;
use bevy_burrow::ground::ImageError;
use bevy_burrow::panel::{BrushTool, BurrowPanel, StampImage, ToolOperation, ToolPrefab};
use bevy_burrow::prelude::*;

use crate::models::{self, Reading};

/// The script's default stamp.
const CRATER: &[u8] = include_bytes!("../../assets/stamps/crater.png");

/// No valid stamp is larger than this; a larger file must contain something else.
const LIMITS: ImageLimits =
    ImageLimits { max_file_bytes: 4 << 20, max_width: 256, max_height: 256, max_alloc_bytes: 16 << 20 };

/// The extension of prefab files, and the most bytes of one.
const PREFAB: &str = "prefab";
const MOST_PREFAB: u64 = 128 << 20;

/// Uses files that are dropped on the window: prefabs are pasted, images are stamps, models are shapes.
pub struct DropPlugin;

impl Plugin for DropPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<FileDragAndDrop>().add_systems(Update, take_dropped);
    }
}

/// Why a file cannot be used as a stamp.
#[derive(Debug, thiserror::Error)]
pub enum StampError {
    /// The file cannot be read.
    #[error("the file cannot be read: {0}")]
    File(#[from] io::Error),
    /// The file is not a grey PNG, or is too large.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The image is not valid for a brush.
    #[error(transparent)]
    Brush(#[from] BrushError),
}

/// Uses a file's image as the stamp. Returns what to tell; on an error, the tool stays as it is.
///
/// # Errors
/// If the file is no valid stamp.
pub fn take(file: &Path, tool: &mut impl DerefMut<Target = BrushTool>) -> Result<String, String> {
    let stamp = read(file).map_err(|why| format!("{} can't be used as a stamp: {why}", file.display()))?;
    let tool = &mut **tool;
    (tool.stamp, tool.operation) = (stamp, ToolOperation::Stamp);
    Ok(format!("{} is the stamp now", file.display()))
}

/// A file's image, or the crater if there is no file.
pub fn read_or_crater(file: Option<&Path>) -> Result<StampImage> {
    Ok(match file {
        Some(file) => {
            read(file).map_err(|why| format!("{} cannot be used as a stamp: {why}", file.display()))?
        }
        None => decode("crater".into(), CRATER)?,
    })
}

fn take_dropped(
    mut drops: MessageReader<FileDragAndDrop>,
    mut tool: ResMut<BrushTool>,
    mut panel: ResMut<BurrowPanel>,
    mut models: Option<ResMut<Reading>>,
) {
    for message in drops.read() {
        if let FileDragAndDrop::DroppedFile { path_buf, .. } = message {
            if let (true, Some(models)) = (models::is_model(path_buf), &mut models) {
                models.start(path_buf.clone());
                continue;
            }
            let is_prefab =
                path_buf.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(PREFAB));
            panel.report(if is_prefab {
                take_prefab(path_buf, &mut tool)
            } else {
                take(path_buf, &mut tool)
            });
        }
    }
}

/// Pastes a file's prefab from now on. On an error, the tool stays as it is.
fn take_prefab(file: &Path, tool: &mut BrushTool) -> Result<String, String> {
    let failed = |why: String| format!("{} can't be pasted: {why}", file.display());
    let mut bytes = Vec::new();
    let opened = File::open(file).map_err(|why| failed(why.to_string()))?;
    opened.take(MOST_PREFAB).read_to_end(&mut bytes).map_err(|why| failed(why.to_string()))?;
    let prefab = Prefab::from_bytes(&bytes).map_err(|why| failed(why.to_string()))?;
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    tool.prefab = ToolPrefab { name: Some(name.into()), ..ToolPrefab::new(prefab, 1.0) };
    tool.operation = ToolOperation::Paste;
    Ok(format!("{} is pasted now", file.display()))
}

/// Writes what was copied to the first free file of a folder.
pub fn keep(copy: &ToolPrefab, folder: &Path) -> Result<String, String> {
    let Some(prefab) = &copy.prefab else { return Err("Nothing was copied".into()) };
    let file = |number: u32| folder.join(format!("copy_{number}.{PREFAB}"));
    let file = file((1..10_000).find(|number| !file(*number).exists()).unwrap_or_default());
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&file, prefab.to_bytes()))
        .map_err(|why| format!("The copy could not be saved in {}: {why}", file.display()))?;
    Ok(format!("Copied, and saved to {}", file.display()))
}

fn read(file: &Path) -> Result<StampImage, StampError> {
    let mut bytes = Vec::new();
    // One byte more than the limit, to detect larger files.
    File::open(file)?.take(LIMITS.max_file_bytes + 1).read_to_end(&mut bytes)?;
    decode(file.file_stem().unwrap_or_default().to_string_lossy().into_owned(), &bytes)
}

fn decode(name: String, png: &[u8]) -> Result<StampImage, StampError> {
    let image = Arc::new(GreyImage::decode_png(png, &LIMITS)?);
    // Images that no brush accepts are refused now, and not at each stroke.
    let stamp = Stamp::new(Arc::clone(&image), Vec3::ZERO, Vec2::splat(2.0), 1.0);
    Edit::quantize(&Brush::stamp(Shape::sphere(Vec3::ZERO, 1.0), stamp))?;
    Ok(StampImage::new(name, image))
}

#[cfg(test)]
#[path = "stamps_tests.rs"]
mod tests;
