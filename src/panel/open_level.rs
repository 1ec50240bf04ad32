//! Which level is open, whether it has unsaved changes, and which question waits.

use std::path::PathBuf;

use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;

use super::state::{BurrowPanel, PanelAction};
use super::texts;
use crate::terrain::{LooseSettings, Terrain};
use crate::volume::DiggingRules;

/// The levels that are edited, one for each terrain.
#[derive(Resource, Default)]
pub struct Files {
    levels: EntityHashMap<OpenLevel>,
    /// The terrain whose level the file bar shows.
    chosen: Option<Entity>,
    /// Whether a level is being saved or opened.
    pub(super) is_busy: bool,
    /// What is asked now.
    pub(super) question: Option<Question>,
    /// Whether it was shown already.
    pub(super) is_shown: bool,
    pub(super) answer: Option<Answer>,
    /// The action that follows once the level is saved.
    pub(super) then: Option<PanelAction>,
    /// The action that may lose changes: its question was answered.
    pub(super) may_lose: Option<PanelAction>,
}

/// The level of a terrain.
#[derive(Default)]
struct OpenLevel {
    /// Where it was opened from, or saved last.
    from: Option<PathBuf>,
    /// The terrain as it was then; `None` until a terrain that was opened is there.
    saved: Option<LevelState>,
    /// Whether the terrain has changed since.
    is_unsaved: bool,
}

/// All of a terrain that a level saves.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LevelState {
    hash: u64,
    rules: DiggingRules,
    loose: Option<LooseSettings>,
}

impl LevelState {
    /// The state of a terrain.
    pub fn of(terrain: &Terrain) -> Self {
        let (rules, loose) = (terrain.rules().cloned().unwrap_or_default(), terrain.loose().cloned());
        Self { hash: terrain.world().hash(), rules, loose }
    }

    /// Whether a terrain is as it was then.
    fn is_still(&self, terrain: &Terrain) -> bool {
        self.hash == terrain.world().hash()
            && self.loose.as_ref() == terrain.loose()
            && terrain.rules().map_or(self.rules == DiggingRules::default(), |rules| *rules == self.rules)
    }
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
            Self::Unsaved(PanelAction::Quit) => texts::UNSAVED_QUIT.into(),
            Self::Unsaved(PanelAction::LoadLevel) => texts::UNSAVED_OPEN.into(),
            Self::Unsaved(_) => texts::UNSAVED_NEW.into(),
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
    /// Compares all terrains with what was saved of them. A terrain that is new counts as saved.
    pub fn track<'a>(
        &mut self,
        chosen: Option<Entity>,
        terrains: impl Iterator<Item = (Entity, &'a Terrain)>,
    ) {
        let mut there = EntityHashMap::default();
        for (entity, terrain) in terrains {
            let mut level = self.levels.remove(&entity).unwrap_or_default();
            let saved = level.saved.get_or_insert_with(|| LevelState::of(terrain));
            level.is_unsaved = !saved.is_still(terrain) || terrain.waiting_work() > 0;
            there.insert(entity, level);
        }
        (self.levels, self.chosen) = (there, chosen);
    }

    /// The terrain whose changes an action would lose: the one that the file bar shows, if it has any.
    pub fn unsaved_before(&self, action: PanelAction) -> Option<Entity> {
        let others = self.levels.iter().filter(|(_, level)| level.is_unsaved).map(|(terrain, _)| *terrain);
        match self.chosen.filter(|_| self.is_unsaved()) {
            None if action == PanelAction::Quit => others.min(),
            chosen => chosen,
        }
    }

    /// Chooses the terrain whose level the file bar shows.
    pub fn choose(&mut self, terrain: Entity) {
        self.chosen = Some(terrain);
    }

    /// Whether the level that the file bar shows has unsaved changes.
    pub fn is_unsaved(&self) -> bool {
        self.shown().is_some_and(|level| level.is_unsaved)
    }

    /// Where the level that the file bar shows was opened from, or saved last.
    pub fn opened(&self) -> Option<&PathBuf> {
        self.shown()?.from.as_ref()
    }

    fn shown(&self) -> Option<&OpenLevel> {
        self.levels.get(&self.chosen?)
    }

    /// Notes that a terrain's level was opened, from where or as a new one. The terrain that comes counts as saved.
    pub fn note_opened(&mut self, terrain: Entity, from: Option<PathBuf>) {
        self.levels.insert(terrain, OpenLevel { from, ..OpenLevel::default() });
    }

    /// Notes where a state of a terrain was saved. Whether it has changed since is found out before the next action.
    pub fn note_saved(&mut self, to: PathBuf, terrain: Entity, state: LevelState) {
        self.levels.insert(terrain, OpenLevel { from: Some(to), saved: Some(state), is_unsaved: false });
    }

    /// Takes the action that waited until the level was saved.
    pub fn take_next(&mut self) -> Option<PanelAction> {
        self.then.take()
    }

    pub fn forget_next(&mut self) {
        self.then = None;
    }

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
        let replaces = matches!(action, PanelAction::NewLevel | PanelAction::LoadLevel | PanelAction::Quit);
        let loses = replaces && self.unsaved_before(action).is_some();
        let may_lose = self.may_lose.take_if(|own| *own == action).is_some();
        // Until it is answered, nothing else is done.
        if self.question.is_some() {
            return None;
        }
        if loses && !may_lose {
            self.question = Some(Question::Unsaved(action));
            return None;
        }
        let target = match action {
            PanelAction::SaveLevel => self.target(panel),
            PanelAction::SaveLevelAs => panel.level.clone(),
            _ => return Some(action),
        };
        if self.opened() != Some(&target) && target.is_dir() {
            self.question = Some(Question::Replace(target));
            return None;
        }
        Some(action)
    }

    /// Where the level is saved: where it is from, or where it is named.
    pub fn target(&self, panel: &BurrowPanel) -> PathBuf {
        self.opened().cloned().unwrap_or_else(|| panel.level.clone())
    }
}
