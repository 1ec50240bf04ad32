//! A terrain that a player shares with others, and messages about it.

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;

use super::error::SharingError;
use super::link::Link;
use super::sharing::Sharing;
use crate::net::{self, ClientEvent, ContentTable, Refusal};
use crate::plugin::EditOutbox;
use crate::terrain::Receipt;

/// Insert it with a [`Terrain`](crate::terrain::Terrain) of the same ground and chunk size as the server's: the world
/// that players share replaces it, and brushes for it are sent to the server. If the terrain has edits already, such as
/// those of a level, only regions that differ from the server's are sent. While the terrain is
/// [`Held`](crate::plugin::Held), because its `StartLevel` is still loaded for example, it does not join yet.
///
/// It joins as soon as a server that this app is connected to, or this app itself, has a
/// [`GroundServer`](super::GroundServer), and again whenever there is a new connection or another server. It may be
/// despawned, removed and inserted again at any time, and another `Terrain` may be inserted on its entity. An app
/// shares one terrain at a time: the first one, until it is gone.
///
/// If it cannot stay in sync with a server, a [`SharingErrorFound`](super::SharingErrorFound) is sent.
#[derive(Component, Default)]
#[component(on_add = warn_without_plugin)]
pub struct SharedTerrain {
    /// Images, grids and prefabs that the player's edits may hold. The server needs them too; players that lack one get
    /// it from there.
    pub contents: ContentTable,
    /// The player's position, in voxels of the terrain: missing ground is fetched from there outwards.
    pub position: IVec3,
    pub(super) link: Option<Link>,
    /// The position among all shared terrains, in the order of insertion.
    pub(super) order: u64,
    /// Whether it has greeted a server, with this ground or another.
    pub(super) was_served: bool,
    /// The last reported error, while it persists.
    pub(super) error: Option<SharingError>,
}

impl SharedTerrain {
    /// The number in the server's log of the last entry that the player's world holds.
    pub fn number(&self) -> u64 {
        self.link.as_ref().map_or(0, |link| link.facts.number)
    }

    /// The player's edits that the server has not answered.
    pub fn pending(&self) -> usize {
        self.link.as_ref().map_or(0, |link| link.unanswered())
    }

    /// The number by which the server knows the player; `None` before it has joined once.
    pub fn id(&self) -> Option<net::ClientId> {
        self.link.as_ref().and_then(|link| link.facts.id)
    }

    /// Whether the ground around the player has arrived.
    pub fn is_playable(&self) -> bool {
        self.link.as_ref().is_some_and(|link| link.is_playable)
    }

    /// Whether the whole world has arrived and is in sync with the server.
    pub fn has_joined(&self) -> bool {
        self.link.as_ref().is_some_and(|link| link.facts.has_joined)
    }

    /// The reason why it is not in sync with a server; `None` while it is, or while it joins a server or waits for one.
    pub fn error(&self) -> Option<SharingError> {
        self.error
    }
}

/// Logs an error if the plugin is missing, because nothing else would show it.
fn warn_without_plugin(world: bevy::ecs::world::DeferredWorld, _: bevy::ecs::lifecycle::HookContext) {
    if world.get_resource::<Sharing>().is_none() {
        error!(
            "a SharedTerrain does nothing without TogetherPlugin: add it after RepliconPlugins and BurrowPlugins, before terrains are spawned"
        );
    }
}

/// The outcome of an edit.
#[derive(Clone, Debug, PartialEq)]
pub enum EditOutcome {
    /// The edit is shown, with the result that the player's machine predicts.
    Predicted(Receipt),
    /// The server has ordered the edit, with this result for all players. `None` if the player was disconnected at that
    /// moment, so that the result is not known; the [`BrushApplied`](crate::plugin::BrushApplied) then has an empty
    /// outcome.
    Confirmed(Option<Receipt>),
    /// The edit was refused, and is no longer shown. `None` if it could not be sent, or the player was disconnected
    /// when it was refused.
    Refused(Option<Refusal>),
}

/// The result of an edit on a [`SharedTerrain`]. Each edit that is confirmed or refused has exactly one
/// [`BrushApplied`](crate::plugin::BrushApplied) as well, so inventories need nothing else.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct GroundEdited {
    /// The terrain.
    pub terrain: Entity,
    /// The tag of the brush.
    pub tag: u64,
    /// The outcome.
    pub outcome: EditOutcome,
}

/// The progress of a [`SharedTerrain`] that joins, or that its player was removed.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct GroundJoined {
    /// The terrain.
    pub terrain: Entity,
    /// `Welcomed`, `Playable`, `Joined`, `Durable`, `Repaired` or `Kicked`.
    pub event: ClientEvent,
}

/// Inserts the outbox for edits into a shared terrain.
pub(super) fn begin(
    new: On<Insert, SharedTerrain>,
    mut commands: Commands,
    mut shared: Query<&mut SharedTerrain, Allow<Disabled>>,
    mut sharing: ResMut<Sharing>,
) {
    if let Ok(mut shared) = shared.get_mut(new.entity) {
        shared.order = sharing.next_order();
    }
    commands.entity(new.entity).try_insert_if_new(EditOutbox::default());
}

/// Removes the outbox from a terrain that is no longer shared, so that brushes apply directly again.
pub(super) fn end(gone: On<Remove, SharedTerrain>, mut commands: Commands) {
    commands.entity(gone.entity).try_remove::<EditOutbox>();
}
