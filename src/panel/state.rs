//! What the panel shows and where the pointer is: resources and run conditions.

use std::path::PathBuf;

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy_egui::EguiContext;

use crate::terrain::World;

/// The panel itself; [`BrushTool`](super::BrushTool) holds what it sets.
#[derive(Resource, Reflect, Clone, Debug, PartialEq)]
#[reflect(Resource, Default)]
pub struct BurrowPanel {
    /// Is it shown?
    pub is_open: bool,
    /// The left column: the brush.
    pub shows_brush: bool,
    /// The right column: terrain and figures.
    pub shows_world: bool,
    /// The terrain that the right column is about; the first one without, or when it is gone.
    pub terrain: Option<Entity>,
    /// What materials are called, by id. The panel offers these; their colours are those of the terrain's
    /// [`MaterialColors`](crate::plugin::MaterialColors).
    pub materials: Vec<String>,
    /// Where pictures are saved, as `burrow_0001.png` and so on.
    pub pictures: PathBuf,
    /// The material whose hardness is shown.
    pub(super) material: usize,
    /// What the panel has to say: the last seam check, the last picture.
    pub(super) note: Option<Note>,
    /// Why the last brush was rejected, if it was.
    pub(super) rejection: Option<String>,
}

impl Default for BurrowPanel {
    /// Open, with the materials of the plugin's own look of the ground.
    fn default() -> Self {
        let names = [
            "Rock",
            "Grass",
            "Sand",
            "Snow",
            "Clay",
            "Concrete",
            "Coal",
            "Gold",
            "Soil",
            "Sandstone",
            "Shale",
            "Gravel",
        ];
        Self {
            is_open: true,
            shows_brush: true,
            shows_world: true,
            terrain: None,
            materials: names.map(String::from).to_vec(),
            pictures: PathBuf::from("pictures"),
            material: 0,
            note: None,
            rejection: None,
        }
    }
}

/// A line that the panel shows.
#[derive(Reflect, Clone, Debug, PartialEq, Eq)]
pub(super) enum Note {
    Good(String),
    Bad(String),
    Busy(String),
    /// What a seam check found.
    Seams(Verdict),
}

/// What a seam check found: of a terrain as it was then.
#[derive(Reflect, Clone, Debug, PartialEq, Eq)]
pub(super) struct Verdict {
    pub terrain: Entity,
    pub revision: u64,
    /// Of the world that was checked.
    pub hash: u64,
    pub is_flawless: bool,
    pub text: String,
}

impl Verdict {
    /// What it says of a terrain: nothing of another one, and of one that has changed since, when that was.
    pub fn about(&self, terrain: Entity, world: &World) -> Option<String> {
        if terrain != self.terrain {
            return None;
        }
        let then = || format!("revision {}: {}", self.revision, self.text);
        Some(if world.hash() == self.hash { self.text.clone() } else { then() })
    }
}

/// A button of the panel. Games may send these too, from keys say.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PanelAction {
    /// Looks at every triangle of the terrain, in a task, and shows whether all seams are closed.
    CheckSeams,
    /// Undoes the last transaction of the terrain.
    Undo,
    /// Does again what was undone last.
    Redo,
    /// Saves what the camera with the panel sees, the panel included.
    SavePicture,
}

/// Does the panel, or anything else of egui, have the pointer or the keyboard in this frame? Contexts of all cameras count.
/// Known from `PreUpdate` on.
#[derive(Resource, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct PanelInput {
    /// The pointer is over it, or drags something of it.
    pub has_pointer: bool,
    /// Something is being typed into it.
    pub has_keyboard: bool,
}

/// Where the panel's widgets were drawn in the last frame, by name, in logical pixels from the window's upper left corner.
/// Of a slider it is the rail, of a section its heading, of a figure its line. Empty while the panel is closed.
#[derive(Resource, Reflect, Clone, Debug, Default, PartialEq)]
#[reflect(Resource, Default)]
pub struct PanelPlaces(pub HashMap<String, Rect>);

/// Run condition: nothing of egui has the pointer, so that a click means the world. Without the panel it always holds.
pub fn pointer_is_free(input: Option<Res<PanelInput>>) -> bool {
    input.is_none_or(|input| !input.has_pointer)
}

/// Run condition: nothing is being typed into egui, so that a key means the game. Without the panel it always holds.
pub fn keyboard_is_free(input: Option<Res<PanelInput>>) -> bool {
    input.is_none_or(|input| !input.has_keyboard)
}

/// Asks egui, each of its contexts, after it has read the frame's input and before anyone acts on it.
pub(super) fn read_input(mut contexts: Query<&mut EguiContext>, mut input: ResMut<PanelInput>) {
    let mut now = PanelInput::default();
    for mut context in &mut contexts {
        let context = context.get_mut();
        now.has_pointer |= context.is_pointer_over_egui() || context.egui_is_using_pointer();
        // A widget that has the focus is not typed into for that.
        now.has_keyboard |= context.text_edit_focused();
    }
    input.set_if_neq(now);
}
