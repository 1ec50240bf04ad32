//! The file bar: which level is open, whether it has unsaved changes, and questions before they are lost.

use bevy::prelude::*;
use bevy_egui::egui::{self, Id, Key, Modal, RichText, TextEdit, Ui};

use super::open_level::{Answer, Files, Question};
use super::state::{BurrowPanel, Note, PanelAction};
use super::theme::{self, ACCENT, BAD, BRIGHT, FAINT};
use super::widgets::{button, key_button, note, share};
use super::{level, survey, texts, widgets};
use crate::terrain::Terrain;

/// Notes which terrains have changes that are not saved.
pub(super) fn track_changes(
    panel: Res<BurrowPanel>,
    terrains: Query<(Entity, &Terrain)>,
    mut files: ResMut<Files>,
) {
    files.bypass_change_detection().track(survey::chosen(&panel, &terrains), terrains.iter());
}

/// Carries out the answer to a question.
pub(super) fn answer(
    mut commands: Commands,
    mut panel: ResMut<BurrowPanel>,
    mut files: ResMut<Files>,
    terrains: Query<(Entity, &Terrain)>,
    mut actions: MessageWriter<PanelAction>,
) {
    if files.answer.is_none() {
        return;
    }
    let (answer, question) = (files.answer.take(), files.question.take());
    let chosen = survey::chosen(&panel, &terrains).and_then(|entity| terrains.get(entity).ok());
    match (question, answer) {
        (Some(Question::Unsaved(action)), Some(Answer::Discard)) => {
            (files.may_lose, files.then) = (Some(action), None);
            actions.write(action);
        }
        // A new level would be saved over the one that is to be opened.
        (Some(Question::Unsaved(PanelAction::LoadLevel)), Some(Answer::Yes))
            if files.opened().is_none() && panel.level.exists() =>
        {
            panel.report(Err(texts::SAVE_ELSEWHERE.into()));
        }
        (Some(Question::Unsaved(action)), Some(Answer::Yes)) => match files.unsaved_before(action) {
            Some(terrain) => {
                files.choose(terrain);
                (panel.terrain, files.then) = (Some(terrain), Some(action));
                actions.write(PanelAction::SaveLevel);
            }
            // Its terrain is gone.
            None => drop(actions.write(action)),
        },
        (Some(Question::Replace(target)), Some(Answer::Yes)) => {
            if let Some(terrain) = chosen {
                level::save(&mut commands, (&mut *panel, &mut *files), terrain, target);
            }
        }
        _ => files.then = None,
    }
}

/// Draws the bar: the folder, and the buttons below it.
pub(super) fn bar(
    ui: &mut Ui,
    panel: &mut BurrowPanel,
    files: &Files,
    actions: &mut Vec<PanelAction>,
    has_terrain: bool,
) {
    let is_free = has_terrain && !files.is_busy && !matches!(panel.note, Some(Note::Busy(_)));
    let mut folder = panel.level.display().to_string();
    let edit =
        ui.add(TextEdit::singleline(&mut folder).desired_width(f32::INFINITY).hint_text(texts::FOLDER));
    note(ui, texts::FOLDER, edit.rect);
    if edit.changed() {
        panel.level = folder.into();
    }
    let width = share(ui, 4);
    ui.horizontal(|ui| {
        for (name, help, action) in [
            (texts::NEW, texts::NEW_HELP, PanelAction::NewLevel),
            (texts::OPEN, texts::OPEN_HELP, PanelAction::LoadLevel),
            (texts::SAVE, texts::SAVE_HELP, PanelAction::SaveLevel),
            (texts::SAVE_AS, texts::SAVE_AS_HELP, PanelAction::SaveLevelAs),
        ] {
            if key_button(ui, (name, help), &panel.keys, width, is_free) {
                actions.push(action);
            }
        }
    });
    let opened = files.opened().map_or_else(|| texts::NEW.into(), |path| path.display().to_string());
    let (mark, color) =
        if files.is_unsaved() { (format!("{opened}: {}", texts::UNSAVED), ACCENT) } else { (opened, FAINT) };
    let line = ui.add(egui::Label::new(RichText::new(mark).color(color).size(11.0)).truncate());
    if files.is_unsaved() {
        note(ui, texts::UNSAVED, line.rect);
    }
}

/// Shows the question that waits, over everything else.
pub(super) fn ask(context: &egui::Context, files: &mut Files) {
    let Some(question) = files.question.clone() else {
        files.is_shown = false;
        return;
    };
    // The key may have been pressed before: games ask with it.
    let was_shown = std::mem::replace(&mut files.is_shown, true);
    if was_shown && context.input(|input| input.key_pressed(Key::Escape)) {
        files.answer = Some(Answer::Cancel);
    }
    let (text, answers) = (question.text(), question.answers());
    // Nothing behind it shines through.
    let frame = theme::card().fill(theme::NIGHT);
    Modal::new(Id::new("burrow question")).frame(frame).show(context, |ui| {
        ui.set_style(theme::style());
        ui.set_width(320.0);
        ui.label(RichText::new(text).color(BRIGHT).size(14.0));
        ui.add_space(8.0);
        for (name, answer) in answers {
            if button(ui, name, 320.0, true).clicked() {
                files.answer = Some(*answer);
            }
        }
    });
}

/// Shows a failure or running work at the top, for when the column that has the message is not in sight. Returns
/// whether a failure was clicked away.
pub(super) fn alert(context: &egui::Context, note: Option<&Note>) -> bool {
    let (color, text, sense) = match note {
        Some(Note::Bad(text)) => (BAD, text, egui::Sense::click()),
        Some(Note::Busy(text)) => (FAINT, text, egui::Sense::hover()),
        _ => return false,
    };
    let area = egui::Area::new(Id::new("burrow message")).order(egui::Order::Foreground);
    let shown = area.anchor(egui::Align2::CENTER_TOP, [0.0, theme::GAP]).show(context, |ui| {
        ui.set_style(theme::style());
        theme::card().fill(theme::NIGHT).show(ui, |ui| {
            ui.set_max_width(320.0);
            let text = egui::Label::new(RichText::new(text).color(color).size(12.0));
            let label = ui.add(text.sense(sense));
            widgets::note(ui, texts::MESSAGE, label.rect);
            label.clicked()
        })
    });
    shown.inner.inner
}
