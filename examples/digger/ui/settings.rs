//! Settings of the player, in a small file in the folder where programs keep such things.

use std::io;
use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy::window::ExitSystems;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::player::bindings::Bindings;
use crate::player::game_state::Page;
use crate::tools::shape::Form;

/// What the player may set. A file without some of it has the rest by default; what it does not know is ignored.
#[derive(Resource, Clone, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// Times as fast as usual.
    pub sensitivity: f32,
    /// Does pushing the mouse away look down?
    pub invert_y: bool,
    /// Vertical field of view in degrees.
    pub field_of_view: f32,
    /// Metres to the far end of what is seen.
    pub view_distance: f32,
    pub quality: Quality,
    /// Minutes from sunrise to sunrise; 0 stops the sun.
    pub day_minutes: f32,
    /// Of the pickaxe and the builder, in metres.
    pub radius: f32,
    /// Of what is built.
    pub form: Form,
    /// Does the inventory limit what is built?
    pub survival: bool,
    pub bindings: Bindings,
}

/// How much is spent on a picture.
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
            view_distance: 3000.0,
            quality: Quality::default(),
            day_minutes: 20.0,
            radius: 2.0,
            form: Form::default(),
            survival: true,
            bindings: Bindings::default(),
        }
    }
}

/// Settings as a player of this machine begins with them, and goes back to.
#[derive(Resource, Clone, Debug, Default)]
pub struct AsMade(pub Settings);

/// Why a file of settings was not read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    #[error("{}: {error}", path.display())]
    File { path: PathBuf, error: io::Error },
    #[error("{}: {error}", path.display())]
    Content { path: PathBuf, error: serde_json::Error },
}

/// Settings as a file had them.
#[derive(Clone, Debug, Default)]
pub struct Found {
    pub settings: Settings,
    /// What in it could not be read, and has its default.
    pub unread: Vec<String>,
}

impl Settings {
    /// Reads a file, each setting by itself: what one of them can't be read for costs nobody the others. A missing file
    /// means defaults.
    ///
    /// # Errors
    /// When the file can't be read, or is none of settings at all.
    pub fn read(path: &Path) -> Result<Found, SettingsError> {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Found::default()),
            Err(error) => return Err(SettingsError::File { path: path.into(), error }),
        };
        let fields: Map<String, Value> = serde_json::from_str(&text)
            .map_err(|error| SettingsError::Content { path: path.into(), error })?;
        let Found { settings, mut unread } = Self::of(fields);
        let mut settings = settings.within_reason();
        let mended = settings.bindings.complete();
        unread.extend(mended.iter().map(|action| format!("bindings: some of \"{}\"", action.label())));
        Ok(Found { settings, unread })
    }

    fn of(mut fields: Map<String, Value>) -> Found {
        let mut unread = Vec::new();
        let defaults = Self::default();
        let settings = Self {
            sensitivity: take(&mut fields, "sensitivity", defaults.sensitivity, &mut unread),
            invert_y: take(&mut fields, "invert_y", defaults.invert_y, &mut unread),
            field_of_view: take(&mut fields, "field_of_view", defaults.field_of_view, &mut unread),
            view_distance: take(&mut fields, "view_distance", defaults.view_distance, &mut unread),
            quality: take(&mut fields, "quality", defaults.quality, &mut unread),
            day_minutes: take(&mut fields, "day_minutes", defaults.day_minutes, &mut unread),
            radius: take(&mut fields, "radius", defaults.radius, &mut unread),
            form: take(&mut fields, "form", defaults.form, &mut unread),
            survival: take(&mut fields, "survival", defaults.survival, &mut unread),
            bindings: take(&mut fields, "bindings", defaults.bindings, &mut unread),
        };
        Found { settings, unread }
    }

    /// Writes a file, whole or not at all.
    ///
    /// # Errors
    /// When the folder or the file can't be written.
    pub fn write(&self, path: &Path) -> Result<(), SettingsError> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|error| SettingsError::Content { path: path.into(), error })?;
        let fresh = path.with_extension("new");
        let write = || {
            path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
            std::fs::write(&fresh, text)?;
            std::fs::rename(&fresh, path)
        };
        write().map_err(|error| SettingsError::File { path: path.into(), error })
    }

    /// Numbers that someone wrote into the file by hand, as far as they make sense.
    fn within_reason(mut self) -> Self {
        let all = [
            (&mut self.sensitivity, 0.1, 5.0),
            (&mut self.field_of_view, 40.0, 110.0),
            (&mut self.view_distance, 200.0, 6000.0),
            (&mut self.day_minutes, 0.0, 120.0),
            (&mut self.radius, 1.0, 12.0),
        ];
        for (number, low, high) in all {
            *number = number.clamp(low, high);
        }
        self
    }
}

/// A setting of a file, or its default.
fn take<T: DeserializeOwned>(
    fields: &mut Map<String, Value>,
    name: &str,
    default: T,
    unread: &mut Vec<String>,
) -> T {
    let Some(value) = fields.remove(name) else { return default };
    serde_json::from_value(value).unwrap_or_else(|error| {
        unread.push(format!("{name}: {error}"));
        default
    })
}

/// Where the settings are kept; nowhere for scripts.
#[derive(Resource, Clone, Debug, Default)]
pub struct SettingsFile(pub Option<PathBuf>);

impl SettingsFile {
    /// In the user's folder of settings.
    pub fn of_user() -> Self {
        let folder =
            |name: &str| std::env::var_os(name).filter(|folder| !folder.is_empty()).map(PathBuf::from);
        let settings = if cfg!(windows) {
            folder("APPDATA")
        } else if cfg!(target_os = "macos") {
            folder("HOME").map(|home| home.join("Library/Application Support"))
        } else {
            folder("XDG_CONFIG_HOME").or_else(|| folder("HOME").map(|home| home.join(".config")))
        };
        Self(settings.map(|settings| settings.join("bevy_burrow").join("digger.json")))
    }
}

/// Reads the settings before anything else, and writes them when the player leaves their page, or from there the game.
pub struct SettingsPlugin(pub SettingsFile);

impl Plugin for SettingsPlugin {
    fn build(&self, app: &mut App) {
        let read = self.0.0.as_deref().map_or_else(|| Ok(Found::default()), Settings::read);
        // A broken file costs nobody the game.
        let Found { settings, unread } = read
            .unwrap_or_else(|error| Found { settings: Settings::default(), unread: vec![error.to_string()] });
        for setting in &unread {
            warn!("settings have their defaults: {setting}");
        }
        app.init_resource::<AsMade>()
            .insert_resource(settings)
            .insert_resource(self.0.clone())
            .insert_resource(Broken(!unread.is_empty()))
            .add_systems(OnExit(Page::Settings), save)
            .add_systems(OnExit(Page::Controls), save)
            .add_systems(
                Last,
                // The last window may close in this very frame.
                save.after(ExitSystems).run_if(on_message::<AppExit>).run_if(are_open),
            );
    }
}

/// Is there something in the file that was not understood? It is set aside then, before the file is written anew: another
/// version of the game may know what it means.
#[derive(Resource)]
struct Broken(bool);

/// Is a page open on which settings change?
fn are_open(page: Option<Res<State<Page>>>) -> bool {
    page.is_some_and(|page| matches!(page.get(), Page::Settings | Page::Controls))
}

fn save(settings: Res<Settings>, file: Res<SettingsFile>, mut broken: ResMut<Broken>) {
    let Some(path) = &file.0 else { return };
    if broken.0 {
        let aside = path.with_extension("json.broken");
        if let Err(error) = std::fs::rename(path, &aside) {
            warn!("the settings are not kept: {}: {error}", aside.display());
            return;
        }
        broken.0 = false;
    }
    if let Err(error) = settings.write(path) {
        warn!("the settings are not kept: {error}");
    }
}

#[cfg(test)]
#[path = "settings_tests.rs"]
mod tests;
