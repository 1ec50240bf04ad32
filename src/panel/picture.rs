//! Screenshots of the camera that draws the panel.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy::render::view::screenshot::{Capturing, Screenshot, ScreenshotCaptured};
use bevy::tasks::{IoTaskPool, Task, futures::check_ready};
use bevy::window::WindowRef;
use image::ImageFormat;

use super::state::{BurrowPanel, Note};
use super::texts;

/// Maximum number of pictures in a folder.
const MAX_PICTURES: u32 = 9999;

/// Note that is shown until a picture is captured.
const CAPTURING_NOTE: &str = texts::TAKING_PICTURE;

/// How many frames to wait for a picture. Most are captured after a few.
const MAX_WAIT_FRAMES: u32 = 300;

/// Marks a screenshot that the panel requested.
#[derive(Component)]
pub(super) struct RequestedPicture;

/// Tasks that write pictures to disk.
#[derive(Resource, Default)]
pub(super) struct Saving(Vec<Task<io::Result<PathBuf>>>);

/// Takes a screenshot of a camera's target. When it is captured, a task saves it.
pub(super) fn save(commands: &mut Commands, panel: &mut BurrowPanel, target: Option<&RenderTarget>) {
    let screenshot = match target {
        Some(RenderTarget::Image(image)) => Screenshot::image(image.handle.clone()),
        Some(RenderTarget::Window(WindowRef::Entity(window))) => Screenshot::window(*window),
        None | Some(RenderTarget::Window(WindowRef::Primary)) => Screenshot::primary_window(),
        Some(_) => {
            panel.note = Some(Note::Bad(texts::NO_PICTURE_HERE.into()));
            return;
        }
    };
    panel.note = Some(Note::Busy(CAPTURING_NOTE.into()));
    let folder = panel.pictures.clone();
    let save_captured = move |mut shot: On<ScreenshotCaptured>, mut saving: ResMut<Saving>| {
        let (image, folder) = (std::mem::take(&mut shot.image), folder.clone());
        saving.0.push(IoTaskPool::get().spawn(async move { write(image, &folder) }));
    };
    commands.spawn((screenshot, RequestedPicture)).observe(save_captured);
}

/// Reports which pictures were saved or failed.
pub(super) fn finish(mut saving: ResMut<Saving>, mut panel: ResMut<BurrowPanel>) {
    if saving.0.is_empty() {
        return;
    }
    saving.0.retain_mut(|task| {
        let Some(done) = check_ready(task) else { return true };
        panel.note = Some(match done {
            Ok(path) => Note::Good(texts::saved(path.display())),
            Err(error) => Note::Bad(texts::not_saved_picture(panel.pictures.display(), error)),
        });
        false
    });
}

/// Stops waiting for a picture that is never captured, such as one of a closed window.
pub(super) fn give_up(
    mut commands: Commands,
    mut panel: ResMut<BurrowPanel>,
    saving: Res<Saving>,
    requested: Query<Entity, (With<RequestedPicture>, Without<Capturing>)>,
    mut waited: Local<u32>,
) {
    let is_waiting = matches!(&panel.note, Some(Note::Busy(text)) if text == CAPTURING_NOTE);
    *waited = if is_waiting && saving.0.is_empty() { *waited + 1 } else { 0 };
    if *waited > MAX_WAIT_FRAMES {
        panel.note = Some(Note::Bad(texts::NO_PICTURE.into()));
        // Keep those that Bevy is capturing: it still looks for the entity, and a late picture is saved.
        requested.iter().for_each(|picture| commands.entity(picture).try_despawn());
    }
}

/// Writes a picture to a folder under the first free name. Creates the folder if necessary.
fn write(image: Image, folder: &Path) -> io::Result<PathBuf> {
    let picture = image.try_into_dynamic().map_err(io::Error::other)?.into_rgb8();
    fs::create_dir_all(folder)?;
    let (path, file) = create(folder)?;
    let mut file = BufWriter::new(file);
    let written = picture.write_to(&mut file, ImageFormat::Png).map_err(io::Error::other);
    match written.and_then(|()| file.flush()) {
        Ok(()) => Ok(path),
        Err(error) => {
            // Leave no incomplete file.
            drop(file);
            let _ = fs::remove_file(&path);
            Err(error)
        }
    }
}

/// Creates a file under the first free name of a folder.
fn create(folder: &Path) -> io::Result<(PathBuf, File)> {
    for number in 1..=MAX_PICTURES {
        let path = folder.join(format!("burrow_{number:04}.png"));
        match File::create_new(&path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            file => return Ok((path, file?)),
        }
    }
    Err(io::Error::new(io::ErrorKind::AlreadyExists, format!("{MAX_PICTURES} pictures are there already")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_numbered_and_none_takes_the_name_of_another() {
        let folder = std::env::temp_dir().join(format!("burrow_panel_{}", std::process::id()));
        let image = || {
            Image::new_target_texture(
                3,
                2,
                bevy::render::render_resource::TextureFormat::Rgba8UnormSrgb,
                None,
            )
        };
        let _ = fs::remove_dir_all(&folder);
        for name in ["burrow_0001.png", "burrow_0002.png"] {
            let path = write(image(), &folder).expect("written");
            assert!(path.ends_with(name), "{path:?}");
            let picture = image::open(&path).expect("a picture").into_rgb8();
            assert_eq!(picture.dimensions(), (3, 2));
        }
        fs::remove_dir_all(&folder).expect("removed");
        let file = std::env::temp_dir().join(format!("burrow_panel_file_{}", std::process::id()));
        fs::write(&file, b"").expect("written");
        assert!(write(image(), &file).is_err());
        fs::remove_file(&file).expect("removed");
    }

    /// The final note about a picture that is never captured, and how many screenshots are left.
    fn final_note(is_begun: bool) -> (Option<Note>, usize) {
        let mut app = App::new();
        app.init_resource::<BurrowPanel>().init_resource::<Saving>().add_systems(Update, (finish, give_up));
        let mut panel = BurrowPanel::default();
        save(&mut app.world_mut().commands(), &mut panel, None);
        app.insert_resource(panel);
        app.world_mut().flush();
        let mut pictures = app.world_mut().query_filtered::<Entity, With<Screenshot>>();
        if is_begun {
            let picture = pictures.single(app.world()).expect("asked for");
            app.world_mut().entity_mut(picture).insert(Capturing);
        }
        for frame in 0..MAX_WAIT_FRAMES {
            app.update();
            let note = &app.world().resource::<BurrowPanel>().note;
            assert_eq!(*note, Some(Note::Busy(CAPTURING_NOTE.into())), "after {frame} frames");
        }
        app.update();
        let note = app.world().resource::<BurrowPanel>().note.clone();
        (note, pictures.iter(app.world()).count())
    }

    #[test]
    fn a_picture_that_does_not_come_is_given_up() {
        let given_up = Some(Note::Bad(texts::NO_PICTURE.into()));
        assert_eq!(final_note(false), (given_up.clone(), 0));
        assert_eq!(final_note(true), (given_up, 1), "Bevy may have it in hand");
    }

    #[test]
    fn an_image_that_is_no_picture_leaves_no_file() {
        let folder = std::env::temp_dir().join(format!("burrow_panel_none_{}", std::process::id()));
        assert!(write(Image { data: None, ..Image::default() }, &folder).is_err());
        assert!(!folder.exists());
    }
}
