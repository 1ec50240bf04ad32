//! The player's settings, stored as JSON in the user's configuration folder.

use std::io;
use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy::window::ExitSystems;
use serde::{Deserialize, Serialize};

use crate::player::bindings::Bindings;
use crate::player::game_state::MenuPage;
use crate::tools::aim::BuildShape;
use crate::world::folders::user_folder;

/// Fields that the file lacks get their defaults, and fields that are not known are ignored.
#[derive(Resource, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Factor for the speed of mouse and sticks.
    pub sensitivity: f32,
    /// Whether pushing the mouse forward looks down.
    pub invert_y: bool,
    /// Vertical field of view in degrees.
    pub field_of_view: f32,
    /// Metres up to which ground is visible; what is farther fades into the sky.
    pub view_distance: f32,
    /// Quality of shadows, textures and far ground.
    pub quality: Quality,
    /// Factor for the size of menus and the heads-up display, as far as there is room.
    pub ui_scale: f32,
    /// Volume of all sounds, with the feature `sound`.
    pub volume: f32,
    /// Minutes from sunrise to sunrise; 0 stops the sun.
    pub day_minutes: f32,
    /// The radius of pickaxe and builder in metres.
    pub radius: f32,
    /// The shape of what is built.
    pub shape: BuildShape,
    /// Whether the inventory limits building.
    pub survival: bool,
    /// What others call the player.
    pub name: String,
    /// The host that was joined last.
    pub host_address: String,
    pub bindings: Bindings,
}

/// Quality of the graphics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    Low,
    #[default]
    Medium,
    High,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            sensitivity: 1.0,
            invert_y: false,
            field_of_view: 70.0,
            view_distance: 6000.0,
            quality: Quality::default(),
            ui_scale: 1.0,
            volume: 0.7,
            day_minutes: 20.0,
            radius: 2.0,
            shape: BuildShape::default(),
            survival: true,
            name: String::new(),
            host_address: String::new(),
            bindings: Bindings::default(),
        }
    }
}

/// The defaults on this machine.
#[derive(Resource, Clone, Debug, Default)]
pub struct DefaultSettings(pub Settings);

/// Why a settings file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SettingsError {
    #[error("{}: {error}", path.display())]
    File { path: PathBuf, error: io::Error },
    #[error("{}: {error}", path.display())]
    Content { path: PathBuf, error: serde_json::Error },
}

impl Settings {
    /// Reads a file. A missing file means defaults.
    ///
    /// # Errors
    /// If the file cannot be read, or holds no settings.
    pub fn read(path: &Path) -> Result<Self, SettingsError> {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            Err(error) => return Err(SettingsError::File { path: path.into(), error }),
        };
        let settings: Self = serde_json::from_str(&text)
            .map_err(|error| SettingsError::Content { path: path.into(), error })?;
        Ok(settings.clamped())
    }

    /// Writes a file. It is replaced as a whole, so a crash leaves the old one.
    ///
    /// # Errors
    /// If the folder or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), SettingsError> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|error| SettingsError::Content { path: path.into(), error })?;
        let new = path.with_extension("new");
        let write = || {
            path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
            std::fs::write(&new, text)?;
            std::fs::rename(&new, path)
        };
        write().map_err(|error| SettingsError::File { path: path.into(), error })
    }

    /// Limits numbers that someone wrote into the file.
    fn clamped(mut self) -> Self {
        for (number, low, high) in [
            (&mut self.sensitivity, 0.1, 5.0),
            (&mut self.field_of_view, 40.0, 110.0),
            (&mut self.view_distance, 200.0, 8000.0),
            (&mut self.day_minutes, 0.0, 120.0),
            (&mut self.radius, 1.0, 12.0),
            (&mut self.ui_scale, 0.5, 1.5),
            (&mut self.volume, 0.0, 1.0),
        ] {
            *number = number.clamp(low, high);
        }
        self
    }
}

/// Where the settings are stored. Scripts do not store them.
#[derive(Resource, Clone, Debug, Default)]
pub struct SettingsFile(pub Option<PathBuf>);

impl SettingsFile {
    /// The file in the user's configuration folder.
    pub fn of_user() -> Self {
        Self(user_folder("XDG_CONFIG_HOME", ".config").map(|settings| settings.join("digger.json")))
    }
}

/// The file could not be read. It is renamed before a new one is written, so that the player can repair it.
#[derive(Resource)]
struct IsBroken(bool);

/// Reads the settings at once, and writes them when the player leaves a settings page, or quits the game on one.
pub struct SettingsPlugin(pub SettingsFile);

impl Plugin for SettingsPlugin {
    fn build(&self, app: &mut App) {
        let read = self.0.0.as_deref().map_or_else(|| Ok(Settings::default()), Settings::read);
        let is_broken = read.is_err();
        let settings = read.unwrap_or_else(|error| {
            warn!("the default settings are used: {error}");
            Settings::default()
        });
        app.init_resource::<DefaultSettings>()
            .insert_resource(settings)
            .insert_resource(self.0.clone())
            .insert_resource(IsBroken(is_broken))
            .add_systems(OnExit(MenuPage::Settings), save)
            .add_systems(OnExit(MenuPage::Controls), save)
            .add_systems(OnExit(MenuPage::Together), save)
            .add_systems(
                Last,
                // After Bevy's own exit systems, because the last window may close in this frame.
                save.after(ExitSystems).run_if(on_message::<AppExit>).run_if(is_settings_page),
            );
    }
}

fn is_settings_page(page: Option<Res<State<MenuPage>>>) -> bool {
    page.is_some_and(|page| {
        matches!(page.get(), MenuPage::Settings | MenuPage::Controls | MenuPage::Together)
    })
}

fn save(settings: Res<Settings>, file: Res<SettingsFile>, mut is_broken: ResMut<IsBroken>) {
    let Some(path) = &file.0 else { return };
    if is_broken.0 {
        let renamed = path.with_extension("json.broken");
        if let Err(error) = std::fs::rename(path, &renamed) {
            warn!("the settings are not saved: {}: {error}", renamed.display());
            return;
        }
        is_broken.0 = false;
    }
    if let Err(error) = settings.write(path) {
        warn!("the settings are not saved: {error}");
    }
}

#[cfg(test)]
#[path = "settings_tests.rs"]
mod tests;
