//! Pictures of what the camera with the panel sees.

use std::path::{Path, PathBuf};

use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::window::WindowRef;

use super::state::{BurrowPanel, Note};

/// Pictures of one folder that are numbered; more overwrite the last.
const MOST: u32 = 9999;

/// Asks for a picture of a camera's target, and saves it when it comes.
pub(super) fn save(commands: &mut Commands, panel: &mut BurrowPanel, target: Option<&RenderTarget>) {
    let screenshot = match target {
        Some(RenderTarget::Image(image)) => Screenshot::image(image.handle.clone()),
        Some(RenderTarget::Window(WindowRef::Entity(window))) => Screenshot::window(*window),
        None | Some(RenderTarget::Window(WindowRef::Primary)) => Screenshot::primary_window(),
        Some(_) => {
            panel.note = Some(Note::Bad("this camera draws where no picture can be taken".into()));
            return;
        }
    };
    let path = match next_path(&panel.pictures) {
        Ok(path) => path,
        Err(error) => {
            let folder = panel.pictures.display();
            panel.note = Some(Note::Bad(format!("{folder} can't be made: {error}")));
            return;
        }
    };
    panel.note = Some(Note::Busy("taking a picture ...".into()));
    let name = path.display().to_string();
    let tell = move |_: On<ScreenshotCaptured>, mut panel: ResMut<BurrowPanel>| {
        info!("saved picture {name}");
        panel.note = Some(Note::Good(format!("saved {name}")));
    };
    commands.spawn(screenshot).observe(save_to_disk(path)).observe(tell);
}

/// The first free name in a folder, which is made if it is not there.
fn next_path(folder: &Path) -> std::io::Result<PathBuf> {
    std::fs::create_dir_all(folder)?;
    let free =
        (1..MOST).map(|number| folder.join(format!("burrow_{number:04}.png"))).find(|path| !path.exists());
    Ok(free.unwrap_or_else(|| folder.join(format!("burrow_{MOST:04}.png"))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_numbered_from_the_first_free_name() {
        let folder = std::env::temp_dir().join(format!("burrow_panel_{}", std::process::id()));
        let first = next_path(&folder).expect("the folder is made");
        assert!(first.ends_with("burrow_0001.png"), "{first:?}");
        std::fs::write(&first, b"").expect("written");
        assert!(next_path(&folder).expect("there").ends_with("burrow_0002.png"));
        std::fs::remove_dir_all(&folder).expect("removed");
        let file = std::env::temp_dir().join(format!("burrow_panel_file_{}", std::process::id()));
        std::fs::write(&file, b"").expect("written");
        assert!(next_path(&file).is_err());
        std::fs::remove_file(&file).expect("removed");
    }
}
