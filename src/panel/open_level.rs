//! Which level is open, whether it has unsaved changes, and which question waits.

use std::path::PathBuf;

use bevy::prelude::*;

use super::state::{BurrowPanel, PanelAction};
use super::texts;
use crate::terrain::Terrain;
use crate::volume::DiggingRules;

/// The state of the level that is edited.
#[derive(Resource, Default)]
pub struct Files {
    /// Where it was opened from, or saved last.
    pub(super) opened: Option<PathBuf>,
    /// The terrain as it was then.
    pub(super) saved: Option<(Entity, u64, DiggingRules)>,
    /// Whether the terrain has changed since.
    pub is_unsaved: bool,
    /// What is asked now.
    pub(super) question: Option<Question>,
    pub(super) answer: Option<Answer>,
    /// The action that follows once the level is saved.
    pub(super) then: Option<PanelAction>,
}

/// A question, and the action that waits for its answer.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Question {
    Unsaved(PanelAction),
    Replace(PathBuf),
}

impl Question {
    pub fn text(&self) -> String {
        match self {
            Self::Unsaved(_) => texts::UNSAVED_QUESTION.into(),
            Self::Replace(path) => texts::replace(path.display()),
        }
    }

    /// The buttons below it.
    pub fn answers(&self) -> &'static [(&'static str, Answer)] {
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
pub(super) enum Answer {
    Yes,
    Discard,
    Cancel,
}

impl Files {
    /// Takes the terrain, as it is, for saved.
    pub fn take_as_saved(&mut self, entity: Entity, terrain: &Terrain) {
        self.saved = Some((entity, terrain.world().hash(), terrain.rules().cloned().unwrap_or_default()));
        self.is_unsaved = false;
    }

    /// Notes that the level is open, from where or as a new one. The file bar takes the terrain that comes for saved.
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
