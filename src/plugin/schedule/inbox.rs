//! Brushes, undos and redos until they are queued.
//!
//! Bevy drops messages after two frames. Games that run the plugin's sets in one state only still get an answer to each
//! message: messages that are written meanwhile are kept here.

use bevy::ecs::message::MessageCursor;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use crate::brush::Brush;
use crate::plugin::{Redo, TargetedBrush, Undo};

/// Messages of one type that were not queued yet.
struct Unread<M: Message> {
    cursor: MessageCursor<M>,
    kept: Vec<M>,
}

impl<M: Message> Default for Unread<M> {
    fn default() -> Self {
        Self { cursor: MessageCursor::default(), kept: Vec::new() }
    }
}

impl<M: Message + Clone> Unread<M> {
    fn has_any(&self, messages: &Messages<M>) -> bool {
        !self.cursor.is_empty(messages)
    }

    fn keep(&mut self, messages: &Messages<M>) {
        self.kept.extend(self.cursor.read(messages).cloned());
    }

    fn take(&mut self, messages: &Messages<M>) -> Vec<M> {
        self.keep(messages);
        std::mem::take(&mut self.kept)
    }
}

/// Messages that were not queued yet.
#[derive(Resource, Default)]
pub(in crate::plugin) struct Inbox {
    brushes: Unread<Brush>,
    targeted: Unread<TargetedBrush>,
    undos: Unread<Undo>,
    redos: Unread<Redo>,
}

/// The game's requests to terrains, in the order in which they are queued.
#[derive(SystemParam)]
pub(in crate::plugin) struct Requests<'w> {
    inbox: ResMut<'w, Inbox>,
    brushes: Res<'w, Messages<Brush>>,
    targeted: Res<'w, Messages<TargetedBrush>>,
    undos: Res<'w, Messages<Undo>>,
    redos: Res<'w, Messages<Redo>>,
}

impl Requests<'_> {
    /// All brushes that were not taken yet.
    pub fn take_brushes(&mut self) -> (Vec<Brush>, Vec<TargetedBrush>) {
        (self.inbox.brushes.take(&self.brushes), self.inbox.targeted.take(&self.targeted))
    }

    /// All steps of history that were not taken yet.
    pub fn take_steps(&mut self) -> (Vec<Undo>, Vec<Redo>) {
        (self.inbox.undos.take(&self.undos), self.inbox.redos.take(&self.redos))
    }
}

/// Whether there is a message that was neither kept nor taken: a run condition.
pub(in crate::plugin) fn has_unread(
    inbox: Res<Inbox>,
    brushes: Res<Messages<Brush>>,
    targeted: Res<Messages<TargetedBrush>>,
    undos: Res<Messages<Undo>>,
    redos: Res<Messages<Redo>>,
) -> bool {
    inbox.brushes.has_any(&brushes)
        || inbox.targeted.has_any(&targeted)
        || inbox.undos.has_any(&undos)
        || inbox.redos.has_any(&redos)
}

/// Stores messages of this frame. Runs in every frame, regardless of the game's run conditions.
pub(in crate::plugin) fn keep_requests(mut requests: Requests) {
    let Requests { inbox, brushes, targeted, undos, redos } = &mut requests;
    // Other systems do not see this as a change.
    let inbox = inbox.bypass_change_detection();
    inbox.brushes.keep(brushes);
    inbox.targeted.keep(targeted);
    inbox.undos.keep(undos);
    inbox.redos.keep(redos);
}
