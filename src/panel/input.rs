//! Whether the panel uses the input, so that it is not meant for the game.

use bevy::prelude::*;
use bevy_egui::EguiContext;

use super::open_level::Files;

/// Whether the panel, or any other egui context, uses the pointer or the keyboard in this frame. Contexts of all
/// cameras count. Updated in `PreUpdate`.
#[derive(Resource, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct PanelInput {
    /// The pointer is over a widget, or a handle of a [placed brush](super::BrushTool::placed), or drags one, or a
    /// question has to be answered first.
    pub has_pointer: bool,
    /// Text is being typed into a widget, or a question has to be answered first. Escape cancels it.
    pub has_keyboard: bool,
}

/// Run condition: egui does not use the pointer, so a click is meant for the world. Always true without the panel.
pub fn pointer_is_free(input: Option<Res<PanelInput>>) -> bool {
    input.is_none_or(|input| !input.has_pointer)
}

/// Run condition: no text is typed into egui, so keys are meant for the game. Always true without the panel.
pub fn keyboard_is_free(input: Option<Res<PanelInput>>) -> bool {
    input.is_none_or(|input| !input.has_keyboard)
}

/// Reads whether any egui context uses the input. Runs after egui has processed the frame's input and before
/// systems that act on it.
pub(super) fn read_input(
    mut contexts: Query<&mut EguiContext>,
    files: Res<Files>,
    mut input: ResMut<PanelInput>,
) {
    let is_asking = files.is_asking();
    let mut now = PanelInput { has_pointer: is_asking, has_keyboard: is_asking };
    for mut context in &mut contexts {
        let context = context.get_mut();
        now.has_pointer |= context.is_pointer_over_egui() || context.egui_is_using_pointer();
        // Keyboard focus alone does not count as typing.
        now.has_keyboard |= context.text_edit_focused();
    }
    input.set_if_neq(now);
}
