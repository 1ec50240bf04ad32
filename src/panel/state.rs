//! Resources: what the panel shows.

use std::path::PathBuf;

use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use super::texts;
use crate::terrain::World;

/// The state of the panel. [`BrushTool`](super::BrushTool) holds the brush that it edits.
#[derive(Resource, Reflect, Clone, Debug, PartialEq)]
#[reflect(Resource, Default)]
pub struct BurrowPanel {
    /// Whether the panel is shown.
    pub is_open: bool,
    /// Whether the left column, the brush, is shown.
    pub shows_brush: bool,
    /// Whether the right column, terrain and statistics, is shown.
    pub shows_world: bool,
    /// Whether that column has buttons for files. A game that saves its worlds itself hides them: they replace the
    /// terrain.
    pub shows_files: bool,
    /// The terrain that the right column shows. Without one, or if it is gone, that is the first terrain.
    pub terrain: Option<Entity>,
    /// Names of the materials by id. The panel offers these materials; the terrain's
    /// [`MaterialColors`](crate::plugin::MaterialColors) give their colours.
    pub materials: Vec<String>,
    /// Folder in which pictures are saved, as `burrow_0001.png` and so on.
    pub pictures: PathBuf,
    /// Folder in which levels are saved and from which they are loaded; it can be typed into the panel.
    pub level: PathBuf,
    /// Keys that the game binds to the panel's tiles and buttons, by their names: shown on them.
    pub keys: HashMap<String, String>,
    /// Where the pointer meets the ground, if the game wants it shown.
    pub pointer: Option<Vec3>,
    /// Index of the material whose rules are shown.
    pub(super) material: usize,
    /// The current message: the last seam check or picture.
    pub(super) note: Option<Note>,
    /// Why the last brush was rejected, if it was.
    pub(super) rejection: Option<String>,
}

impl Default for BurrowPanel {
    /// Open, with the materials of the plugin's default ground look.
    fn default() -> Self {
        Self {
            is_open: true,
            shows_brush: true,
            shows_world: true,
            shows_files: true,
            terrain: None,
            materials: texts::MATERIALS.map(String::from).to_vec(),
            pictures: PathBuf::from("pictures"),
            level: PathBuf::from("level"),
            keys: HashMap::default(),
            pointer: None,
            material: 0,
            note: None,
            rejection: None,
        }
    }
}

impl BurrowPanel {
    /// Shows a message, as of something that was done or that failed.
    pub fn report(&mut self, message: Result<String, String>) {
        self.note = Some(message.map_or_else(Note::Bad, Note::Good));
    }
}

/// A message in the panel.
#[derive(Reflect, Clone, Debug, PartialEq, Eq)]
pub(super) enum Note {
    Good(String),
    Bad(String),
    Busy(String),
    /// The result of a seam check.
    Seams(Verdict),
}

/// The result of a seam check of a terrain at one revision.
#[derive(Reflect, Clone, Debug, PartialEq, Eq)]
pub(super) struct Verdict {
    pub terrain: Entity,
    pub revision: u64,
    /// Hash of the world that was checked.
    pub hash: u64,
    pub is_flawless: bool,
    pub text: String,
}

impl Verdict {
    /// The text for a terrain. `None` for another terrain than the checked one. Names the revision if the terrain
    /// has changed since.
    pub fn about(&self, terrain: Entity, world: &World) -> Option<String> {
        if terrain != self.terrain {
            return None;
        }
        let then = || texts::at_revision(self.revision, &self.text);
        Some(if world.hash() == self.hash { self.text.clone() } else { then() })
    }
}

/// A button of the panel. Games may send these messages too, for example on key presses.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PanelAction {
    /// Checks in a task that all seams of the terrain are closed, and shows the result.
    CheckSeams,
    /// Undoes the last transaction of the terrain.
    Undo,
    /// Redoes the transaction that was undone last.
    Redo,
    /// Saves a screenshot of the camera that draws the panel, including the panel.
    SavePicture,
    /// Saves the terrain as a [level](crate::format::Level) in a task: where it was opened from or saved last, or else
    /// in the [folder](BurrowPanel::level). Asks before another level is replaced.
    SaveLevel,
    /// Saves the terrain as a level in the [folder](BurrowPanel::level). Asks before another level is replaced.
    SaveLevelAs,
    /// Puts the level of that folder, or packed file, in the terrain's place; it must have been made on the same
    /// ground. Asks before unsaved changes are lost.
    LoadLevel,
    /// Puts the ground without any edits in the terrain's place. Asks before unsaved changes are lost.
    NewLevel,
    /// [Places](super::BrushTool::placed) the brush where the pointer is on the ground, or, while the pointer is over
    /// the panel, where the middle of the view is.
    PlaceBrush,
    /// Applies the placed brush, which stays where it is, or the [path](super::BrushTool::finish_path), whose points are
    /// forgotten. Each time is one undo step.
    ApplyBrush,
    /// Moves the placed brush up or down to the nearest ground.
    SnapBrush,
    /// Lets the placed brush follow the pointer again, or drops the points of the path.
    ReleaseBrush,
    /// Ends the app. Asks before unsaved changes are lost.
    Quit,
}

/// Positions of the panel's widgets in the last frame, by name, in logical pixels from the window's upper left
/// corner. For a slider it is the rail, for a section the heading, for a value its line, for a handle a point to grab
/// it.
/// While the panel is closed, there are only the handles of a [placed brush](super::BrushTool::placed) and a message.
#[derive(Resource, Reflect, Clone, Debug, Default, PartialEq)]
#[reflect(Resource, Default)]
pub struct PanelPlaces(pub HashMap<String, Rect>);
