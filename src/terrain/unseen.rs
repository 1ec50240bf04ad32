//! What a game committed by itself to a terrain that is shown, until that is shown as well.

use std::collections::BTreeSet;

use super::commit::Commit;
use super::field_log::FieldNews;
use super::world::{Drawn, Version, World};
use super::{StaleCommit, Terrain};
use crate::lattice::ChunkPos;

/// What changed of a world that is shown.
pub(crate) struct Unseen {
    from: Version,
    to: Version,
    drawn: BTreeSet<Drawn>,
    fields: Vec<(ChunkPos, FieldNews)>,
}

impl Unseen {
    /// Nothing, over what is shown.
    fn nothing(shown: Version) -> Self {
        Self { from: shown, to: shown, drawn: BTreeSet::new(), fields: Vec::new() }
    }

    /// The world that it comes to.
    pub fn version(&self) -> Version {
        self.to
    }

    /// Is it of this world, whatever was committed to that since?
    pub fn is_of(&self, world: &World) -> bool {
        self.to.is_same_world(world.version())
    }

    /// Does it begin where this version is?
    pub fn follows(&self, shown: Version) -> bool {
        self.from == shown
    }

    /// The tiles and chunks that changed, each once.
    pub fn drawn(&self) -> impl Iterator<Item = Drawn> {
        self.drawn.iter().copied()
    }

    /// How many they are.
    pub fn len(&self) -> usize {
        self.drawn.len()
    }

    /// What happened to fields, in order.
    pub fn fields(&self) -> &[(ChunkPos, FieldNews)] {
        &self.fields
    }

    fn add(&mut self, news: News, to: Version) {
        self.drawn.extend(news.drawn);
        self.fields.extend(news.fields);
        self.to = to;
    }
}

/// What a commit will change of what is shown.
pub(super) struct News {
    before: Version,
    drawn: Vec<Drawn>,
    fields: Vec<(ChunkPos, FieldNews)>,
}

impl Terrain {
    /// From now on the plugin shows this world, and wants to know what else is committed to it.
    pub(crate) fn watch(&mut self) {
        self.unseen = Some(Unseen::nothing(self.world.version()));
    }

    /// What the game committed since `shown`; `None` where that is not known.
    pub(crate) fn take_unseen(&mut self, shown: Version) -> Option<Unseen> {
        let now = self.world.version();
        let unseen = self.unseen.replace(Unseen::nothing(now))?;
        (unseen.from == shown && unseen.to == now).then_some(unseen)
    }

    /// What a commit will change, if anybody wants to know.
    pub(super) fn note(&self, commit: &Commit) -> Option<News> {
        self.unseen.as_ref()?;
        // Its own lists: whoever committed it may have taken its meshes.
        let tiles = commit.rings.iter().map(|(tile, _)| Drawn::Tile(*tile));
        let chunks = commit.surfaces.iter().map(|(chunk, _)| Drawn::Chunk(*chunk));
        let drawn = tiles.chain(chunks).collect();
        Some(News { before: self.world.version(), drawn, fields: commit.news.clone() })
    }

    /// The commit of the game's that was noted is settled.
    pub(super) fn enter_unseen(&mut self, news: Option<News>) {
        let to = self.world.version();
        if let (Some(news), Some(unseen)) = (news, &mut self.unseen)
            && unseen.to == news.before
        {
            unseen.add(news, to);
        }
    }

    /// The commit that answers the transaction of this ticket without doing it, because its task panicked; `None` unless that
    /// is under way.
    pub(crate) fn refused(&self, ticket: u64) -> Option<Commit> {
        let waiting = self.in_flight.as_ref().filter(|waiting| waiting.ticket == ticket)?;
        let work = waiting.work.clone();
        Some(super::Transaction { ticket, world: self.snapshot(), work, engine: None }.refused())
    }

    /// Is the transaction of this ticket under way?
    pub(crate) fn waits_for(&self, ticket: u64) -> bool {
        self.in_flight.as_ref().is_some_and(|waiting| waiting.ticket == ticket)
    }

    /// What was not shown is not known any more.
    pub(crate) fn forget_unseen(&mut self) {
        self.unseen = None;
    }

    /// Settles a commit of the plugin's, which shows it by itself.
    pub(crate) fn settle_shown(&mut self, commit: Commit) -> Result<super::Settled, StaleCommit> {
        let settled = self.settle(commit)?;
        if let Some(unseen) = &mut self.unseen {
            *unseen = Unseen::nothing(self.world.version());
        }
        Ok(settled)
    }
}
