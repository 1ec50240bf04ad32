//! The link of a shared terrain to its server: the client, the invitation that it follows, and waiting requests.

use std::collections::VecDeque;
use std::time::Duration;

use bevy::platform::time::Instant;

use super::error::SharingError;
use super::messages::GroundId;
use super::service::Service;
use crate::net::{self, Client, ContentTable, KickReason, Lane};
use crate::plugin::{LoosePieceFound, LoosePieceReturned};
use crate::terrain::{Order, OrderKind, Terrain, TerrainError, TerrainSettings, Version, World};
use crate::threads::{ThreadTask, Threads};
use crate::volume::DiggingRules;

/// The maximum number of edits that wait for the server's answer.
pub(super) const MAX_PENDING: usize = 1 << 16;

/// What a shared terrain knows of its server.
pub(super) struct Link {
    /// `None` while a task has it.
    pub client: Option<Client>,
    pub task: Option<ThreadTask<Worked>>,
    /// The ground that the client was made for.
    pub ground: GroundId,
    /// The invitation of the server that the client has greeted; `None` while there is none to greet.
    pub greeted: Option<u64>,
    /// The [run](super::messages::Served::run) of the server that it has greeted last.
    pub run: u32,
    /// Whether it has greeted any server.
    pub was_served: bool,
    /// The server of this invitation has sent the player away.
    pub kicked: Option<(KickReason, u64)>,
    pub inbox: Vec<(Lane, Vec<u8>)>,
    /// Requests of the player that the client does not have yet, in order.
    pub requests: Vec<Order>,
    /// Whether the limit of waiting edits is reached, so that no more are taken.
    pub is_full: bool,
    /// Tags of edits, and the number of undos, that are asked for and not answered.
    pub tags: VecDeque<u64>,
    pub undos: usize,
    pub start: Instant,
    pub facts: Facts,
    pub is_playable: bool,
    /// The game may have changed the contents that edits may hold.
    pub has_new_contents: bool,
    pub display: Display,
    /// The rules of the terrain, which have no effect.
    pub rules: Option<DiggingRules>,
}

/// A client that a task has worked with.
pub(super) struct Worked {
    pub client: Client,
    /// All that has to be put into the shown terrain, if that was asked for.
    pub whole: Option<Order>,
}

/// The client's values after its last update.
#[derive(Clone, Copy, Default)]
pub(super) struct Facts {
    pub number: u64,
    pub id: Option<net::ClientId>,
    pub has_joined: bool,
}

/// The changes of the shown terrain that were submitted, and those that wait.
pub(super) struct Display {
    /// The world that is shown.
    pub version: Version,
    /// Changes that were submitted, and those that were answered.
    pub submitted: u64,
    pub answered: u64,
    /// Whether the shown world is wrong, so that all of it has to be replaced.
    pub is_broken: bool,
    /// All of it, to be put next.
    pub whole: Option<Order>,
    /// Messages about pieces, each with the number of answered changes at which it is sent: the ground changes with
    /// these.
    pub pieces: VecDeque<(u64, PieceMessage)>,
}

/// A message about a piece.
#[derive(Clone, Debug)]
pub(super) enum PieceMessage {
    Found(LoosePieceFound),
    Returned(LoosePieceReturned),
}

/// The state of a shared terrain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Standing {
    /// The terrain follows the server that has sent this invitation.
    Follows(u64),
    /// No server has announced that it serves a ground. Edits wait until one does.
    Waits,
    /// There is no connection. Edits are shown, and wait for another one.
    Lost,
    /// Edits are refused.
    Refuses(SharingError),
}

impl Link {
    /// The client starts with the content of the terrain, such as the level that the game ships, so only regions that
    /// differ from the server's have to be sent.
    ///
    /// # Errors
    /// When the terrain's settings are invalid.
    pub fn new(terrain: &mut Terrain, contents: &ContentTable) -> Result<Self, TerrainError> {
        let world = terrain.snapshot();
        let ground = GroundId::of(&world);
        let settings =
            TerrainSettings { chunk_size: ground.chunk_size as u32, voxel_size: terrain.voxel_size() };
        let mut client = Client::new(world.shared_ground(), &settings)?;
        client.contents_mut().add_all(contents);
        let is_pristine = world.bricks().next().is_none() && world.fields().next().is_none();
        let (client, task) = if is_pristine {
            (Some(client), None)
        } else {
            let task = ThreadTask::start(Threads::Transactions, move || {
                // Parts of a world of the same ground and chunk size fit. Without them, everything would come.
                if client.begin_with(world.all_parts()).is_ok() {
                    client.advance(Duration::ZERO);
                    // The terrain shows it already.
                    drop(client.take_shown());
                }
                Worked { client, whole: None }
            });
            (None, Some(task))
        };
        Ok(Self {
            client,
            task,
            ground,
            greeted: None,
            run: 0,
            was_served: false,
            kicked: None,
            inbox: Vec::new(),
            requests: Vec::new(),
            is_full: false,
            tags: VecDeque::new(),
            undos: 0,
            start: Instant::now(),
            facts: Facts::default(),
            is_playable: false,
            has_new_contents: false,
            display: Display::of(terrain),
            rules: terrain.rules().cloned(),
        })
    }

    /// Takes the client from a task that has finished.
    pub fn take_back_client(&mut self) {
        if let Some(Worked { client, whole }) = self.task.as_mut().and_then(ThreadTask::finish) {
            (self.client, self.task) = (Some(client), None);
            self.display.whole = whole;
        }
    }

    /// Edits that are not answered.
    pub fn unanswered(&self) -> usize {
        self.tags.len()
    }

    /// Records a request of the player.
    pub fn request(&mut self, order: Order) {
        match order.edit() {
            Some(edit) => self.tags.push_back(edit.tag()),
            None => self.undos += 1,
        }
        self.requests.push(order);
    }

    /// Records that an edit with this tag was answered.
    pub fn answer(&mut self, tag: u64) {
        if let Some(at) = self.tags.iter().position(|asked| *asked == tag) {
            self.tags.remove(at);
        }
    }

    /// The state, given the present server.
    pub fn standing(&self, service: Service) -> Standing {
        if let Some((kick, at)) = self.kicked
            && !matches!(service, Service::Served(_, invitation) if invitation != at)
        {
            return Standing::Refuses(SharingError::Kicked(kick));
        }
        match service {
            Service::Served(served, invitation) if served.ground == self.ground => {
                Standing::Follows(invitation)
            }
            Service::Served(served, _) => Standing::Refuses(SharingError::OtherGround {
                ours: self.ground.hash,
                our_chunks: self.ground.chunk_size,
                theirs: served.ground.hash,
                their_chunks: served.ground.chunk_size,
            }),
            Service::Silent => Standing::Waits,
            _ if !self.was_served => Standing::Waits,
            Service::Apart => Standing::Lost,
            Service::Unserved => Standing::Refuses(SharingError::NotServed),
        }
    }
}

impl Standing {
    pub fn error(self) -> Option<SharingError> {
        match self {
            Self::Follows(_) | Self::Waits => None,
            Self::Lost => Some(SharingError::ConnectionLost),
            Self::Refuses(why) => Some(why),
        }
    }
}

/// Whether an order is a change of what is shown, which only the link submits.
fn is_change(kind: OrderKind) -> bool {
    matches!(kind, OrderKind::Parts | OrderKind::Ground)
}

impl Display {
    /// The state for a terrain in which changes of an earlier link may still wait.
    fn of(terrain: &mut Terrain) -> Self {
        drop(terrain.take_receipts_of(is_change));
        Self {
            version: terrain.world().version(),
            submitted: terrain.unanswered().filter(|(kind, _)| is_change(*kind)).count() as u64,
            answered: 0,
            is_broken: false,
            whole: None,
            pieces: VecDeque::new(),
        }
    }

    /// Reads the results of changes in the terrain, and returns the messages about pieces that belong to them.
    pub fn follow(&mut self, terrain: &mut Terrain) -> Vec<PieceMessage> {
        let version = terrain.world().version();
        if !version.is_same_world(self.version) {
            // Another terrain replaced it, and waiting changes are lost.
            let pieces = std::mem::take(&mut self.pieces);
            *self = Self { is_broken: true, pieces, ..Self::of(terrain) };
            self.hold_pieces();
        }
        self.version = version;
        let receipts = terrain.take_receipts_of(is_change);
        self.answered += receipts.len() as u64;
        if receipts.iter().any(|receipt| receipt.outcome.is_err()) {
            self.is_broken = true;
            self.hold_pieces();
        }
        let is_shown = |(due, _): &(u64, PieceMessage)| *due <= self.answered;
        let count = self.pieces.iter().take_while(|piece| is_shown(piece)).count();
        self.pieces.drain(..count).map(|(_, piece)| piece).collect()
    }

    /// Compares what is shown with what should be, which has this hash, once nothing waits for the terrain. They differ
    /// if something else has changed the terrain, for example brushes that were running when it became shared.
    pub fn compare(&mut self, shown: &World, hash: u64) {
        if self.is_idle() && !self.is_broken && shown.hash() != hash {
            self.is_broken = true;
            self.hold_pieces();
        }
    }

    /// Keeps messages about pieces until the whole world is shown.
    fn hold_pieces(&mut self) {
        let due = self.submitted + 1;
        self.pieces.iter_mut().for_each(|(at, _)| *at = due);
    }

    /// Whether nothing waits for the terrain.
    pub fn is_idle(&self) -> bool {
        self.answered >= self.submitted
    }

    /// Attaches messages about pieces to the change that was submitted last.
    pub fn add_pieces(&mut self, pieces: impl IntoIterator<Item = PieceMessage>) {
        let due = self.submitted + u64::from(self.is_broken);
        self.pieces.extend(pieces.into_iter().map(|piece| (due, piece)));
    }
}
