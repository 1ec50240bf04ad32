//! The file bar: which level is open, whether it has unsaved changes, and questions before they are lost.

use std::path::PathBuf;

use bevy::prelude::*;
use bevy_egui::egui::{self, Id, Modal, RichText, TextEdit, Ui};

use super::state::{BurrowPanel, Note, PanelAction};
use super::theme::{self, ACCENT, BRIGHT, FAINT};
use super::widgets::{button, note, share};
use super::{level, survey, texts};
use crate::terrain::Terrain;
use crate::volume::DiggingRules;

/// The state of the level that is edited.
#[derive(Resource, Default)]
pub struct Files {
    /// Where it was opened from, or saved last.
    opened: Option<PathBuf>,
    /// The terrain as it was then.
    saved: Option<(Entity, u64, DiggingRules)>,
    /// Whether the terrain has changed since.
    pub is_unsaved: bool,
    /// What is asked now.
    question: Option<Question>,
    answer: Option<Answer>,
    /// The action that follows once the level is saved.
    then: Option<PanelAction>,
}

/// A question, and the action that waits for its answer.
#[derive(Clone, Debug, PartialEq)]
enum Question {
    Unsaved(PanelAction),
    Replace(PathBuf),
}

impl Question {
    fn text(&self) -> String {
        match self {
            Self::Unsaved(_) => texts::UNSAVED_QUESTION.into(),
            Self::Replace(path) => texts::replace(path.display()),
        }
    }

    /// The buttons below it.
    fn answers(&self) -> &'static [(&'static str, Answer)] {
        const UNSAVED: &[(&str, Answer)] = &[
            (texts::SAVE_CHANGES, Answer::Yes),
            (texts::DISCARD, Answer::Discard),
            (texts::CANCEL, Answer::Cancel),
        ];
        const REPLACE: &[(&str, Answer)] = &[(texts::REPLACE, Answer::Yes), (texts::CANCEL, Answer::Cancel)];
        match self {
            Self::Unsaved(_) => UNSAVED,
            Self::Replace(_) => REPLACE,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Answer {
    Yes,
    Discard,
    Cancel,
}

impl Files {
    /// Takes the terrain, as it is, for saved.
    fn take_as_saved(&mut self, entity: Entity, terrain: &Terrain) {
        self.saved = Some((entity, terrain.world().hash(), terrain.rules().cloned().unwrap_or_default()));
        self.is_unsaved = false;
    }

    /// Notes that the level is open, from where or as a new one. [`watch`] takes the terrain that comes for saved.
    pub fn note_opened(&mut self, from: Option<PathBuf>) {
        (self.opened, self.saved) = (from, None);
    }

    /// Notes where a state of the terrain was saved.
    pub fn note_saved(&mut self, to: PathBuf, entity: Entity, hash: u64, rules: DiggingRules) {
        (self.opened, self.saved) = (Some(to), Some((entity, hash, rules)));
    }

    /// Takes the action that waited until the level was saved.
    pub fn take_next(&mut self) -> Option<PanelAction> {
        self.then.take()
    }

    pub fn forget_next(&mut self) {
        self.then = None;
    }

    #[cfg(test)]
    pub fn is_asking(&self) -> bool {
        self.question.is_some()
    }

    /// Answers by the label of a button.
    #[cfg(test)]
    pub fn reply(&mut self, label: &str) {
        let answers = self.question.as_ref().map_or(&[][..], |question| question.answers());
        self.answer = answers.iter().find(|answer| answer.0 == label).map(|answer| answer.1);
    }

    /// The action to perform now, if it may be: one that loses something is asked about first.
    pub fn admit(&mut self, action: PanelAction, panel: &BurrowPanel) -> Option<PanelAction> {
        let loses = matches!(action, PanelAction::NewLevel | PanelAction::LoadLevel | PanelAction::Quit);
        if action == PanelAction::Quit && self.question.is_some() {
            // The key that asks also takes the question back.
            self.question = None;
            return None;
        }
        if loses && self.is_unsaved {
            self.question = Some(Question::Unsaved(action));
            return None;
        }
        let target = match action {
            PanelAction::SaveLevel => self.target(panel),
            PanelAction::SaveLevelAs => panel.level.clone(),
            _ => return Some(action),
        };
        if self.opened.as_ref() != Some(&target) && target.exists() {
            self.question = Some(Question::Replace(target));
            return None;
        }
        Some(action)
    }

    /// Where the level is saved: where it is from, or where it is named.
    pub fn target(&self, panel: &BurrowPanel) -> PathBuf {
        self.opened.clone().unwrap_or_else(|| panel.level.clone())
    }
}

/// Compares the terrain with what was saved.
pub(super) fn watch(panel: Res<BurrowPanel>, terrains: Query<(Entity, &Terrain)>, mut files: ResMut<Files>) {
    let Some((entity, terrain)) =
        survey::chosen(&panel, &terrains).and_then(|entity| terrains.get(entity).ok())
    else {
        return;
    };
    match &files.saved {
        Some((of, hash, rules)) if *of == entity => {
            let same_rules = terrain.rules().map_or(*rules == DiggingRules::default(), |now| now == rules);
            let is_unsaved = *hash != terrain.world().hash() || !same_rules;
            if files.is_unsaved != is_unsaved {
                files.is_unsaved = is_unsaved;
            }
        }
        _ => files.take_as_saved(entity, terrain),
    }
}

/// Does what was answered.
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
            // With this, the terrain counts as saved.
            files.saved = None;
            files.is_unsaved = false;
            actions.write(action);
        }
        (Some(Question::Unsaved(action)), Some(Answer::Yes)) => {
            files.then = Some(action);
            actions.write(PanelAction::SaveLevel);
        }
        (Some(Question::Replace(target)), Some(Answer::Yes)) => {
            if let Some(terrain) = chosen {
                level::save(&mut commands, &mut panel, terrain, target);
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
    let is_free = has_terrain && !matches!(panel.note, Some(Note::Busy(_)));
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
            let key = panel.keys.get(name).map(|key| format!("\n{key}")).unwrap_or_default();
            if button(ui, name, width, is_free).on_hover_text(format!("{help}{key}")).clicked() {
                actions.push(action);
            }
        }
    });
    let opened = files.opened.as_ref().map_or_else(|| texts::NEW.into(), |path| path.display().to_string());
    let (mark, color) =
        if files.is_unsaved { (format!("{opened}: {}", texts::UNSAVED), ACCENT) } else { (opened, FAINT) };
    let line = ui.add(egui::Label::new(RichText::new(mark).color(color).size(11.0)).truncate());
    if files.is_unsaved {
        note(ui, texts::UNSAVED, line.rect);
    }
}

/// Asks, over everything else.
pub(super) fn ask(context: &egui::Context, files: &mut Files) {
    let Some(question) = files.question.clone() else { return };
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
