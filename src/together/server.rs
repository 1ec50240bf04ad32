//! The server of a ground in a Bevy app: edits run on the plugin's threads.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;

use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::messages::Served;
use super::players::{PlayerMessage, Players};
use super::replicon::{FromPlayers, NetworkId, Peer, Peers, ReadMessages, ToPlayers, number};
use crate::net::{self, KickReason, Lane, Server, ServerEvent, ServerSettings, ToClient};
use crate::saves::{AbandonedStores, ClosingWorlds, EXIT_WAIT, ReadWorld, SavedWorld, WorldReader};
use crate::store::{Progress, Store, StoreError, StoreWarning};
use crate::terrain::Terrain;
use crate::threads::{ThreadTask, Threads};

/// The server of a shared world: insert it in the server's app. Its [`Server`] owns a terrain that is not
/// drawn; a player on the same machine has a [`SharedTerrain`](super::SharedTerrain) like all other players.
///
/// When it is replaced or removed, the remaining edits are saved and its world is closed, without blocking the main
/// thread; an app that exits waits for this, ten seconds at most.
#[derive(Resource)]
pub struct GroundServer {
    state: State,
    /// The served world; `None` until it is there.
    served: Option<Served>,
    waiting: Vec<Request>,
    start: Instant,
    players: Players,
    /// The messages of players that were read.
    read: ReadMessages,
    data: BTreeMap<String, Vec<u8>>,
    /// Where its store goes when it is dropped; `None` before its first frame in an app.
    closing: Option<AbandonedStores>,
    /// Whether an exit has already timed out while it waited for the disk.
    has_timed_out: bool,
}

/// The state of the server.
enum State {
    /// The server's world is being read.
    Opening(ThreadTask<Result<(Box<ServerState>, Vec<StoreWarning>), StoreError>>, Progress),
    Idle(Box<ServerState>),
    Running(ThreadTask<Box<ServerState>>),
    /// The server's world could not be read, or the server is taken out for a moment.
    Unavailable,
}

/// The data that is sent to a thread and returned.
struct ServerState {
    server: Server,
    store: Option<Store>,
    /// Whether it was logged that saving failed.
    has_failed: bool,
}

/// The most requests of the game that wait until a world is read; further ones are dropped.
const MAX_WAITING: usize = 1 << 14;

/// A request that waits until the server is not busy.
type Request = Box<dyn FnOnce(&mut ServerState, Duration) + Send + Sync>;

/// An event of the ground's server.
#[derive(Message, Clone, Debug)]
pub enum GroundServerEvent {
    /// The server's world was read; or it can't be read, and nothing is served.
    Opened(Result<(), Arc<StoreError>>),
    /// An event about its players.
    Players(ServerEvent),
    /// A problem with its saved world; play continues.
    Warning(StoreWarning),
}

impl GroundServer {
    /// Serves a world that is not saved.
    pub fn new(server: Server) -> Self {
        Self::with_state(State::Idle(Box::new(ServerState { server, store: None, has_failed: false })))
    }

    /// Serves a saved world: the one in this folder on the ground of this terrain, or where there is none, the terrain,
    /// which is saved there from now on. It is read on another thread; [`GroundServerEvent::Opened`] reports the
    /// result.
    pub fn saved(world: &SavedWorld, terrain: &Terrain, settings: ServerSettings) -> Self {
        let reader = WorldReader::new(world, terrain, None);
        let progress = reader.progress.clone();
        let task = ThreadTask::start(Threads::Background, move || {
            let ReadWorld { store, terrain, warnings } = reader.read()?;
            let server = Server::open(terrain, &store, settings);
            Ok((Box::new(ServerState { server, store: Some(store), has_failed: false }), warnings))
        });
        Self::with_state(State::Opening(task, progress))
    }

    /// The share of a saved world that has been read, 0 to 1; `None` once all of it has.
    pub fn opening(&self) -> Option<f32> {
        if let State::Opening(_, progress) = &self.state { Some(progress.share()) } else { None }
    }

    /// Serves the world of an open store, for example on a [level](crate::store::StoreOptions::level). Use
    /// [`Server::open`] to make the server.
    pub fn with_store(server: Server, store: Store) -> Self {
        let data = store.game_data().clone();
        let mut ground = Self::with_state(State::Idle(Box::new(ServerState {
            server,
            store: Some(store),
            has_failed: false,
        })));
        ground.data = data;
        ground
    }

    fn with_state(state: State) -> Self {
        let served = if let State::Idle(parts) = &state { Some(Served::by(&parts.server)) } else { None };
        Self {
            state,
            served,
            waiting: Vec::new(),
            start: Instant::now(),
            players: Players::default(),
            read: ReadMessages::default(),
            data: BTreeMap::new(),
            closing: None,
            has_timed_out: false,
        }
    }

    /// The served world; `None` while it is being read, and if it can't be read.
    pub(super) fn served(&self) -> Option<Served> {
        self.served
    }

    /// Calls a function with the server as soon as it is not busy, in the order of these calls: for example to set a
    /// player's position, or to [submit](Server::submit) orders.
    pub fn with(&mut self, work: impl FnOnce(&mut Server) + Send + Sync + 'static) {
        self.ask(move |parts, _| work(&mut parts.server));
    }

    fn ask(&mut self, work: impl FnOnce(&mut ServerState, Duration) + Send + Sync + 'static) {
        let is_read = matches!(self.state, State::Idle(_) | State::Running(_));
        if is_read || self.waiting.len() < MAX_WAITING {
            self.waiting.push(Box::new(work));
        }
    }

    /// Serves this world if the saved one [can't be read](GroundServerEvent::Opened). Players that have connected
    /// meanwhile join it.
    pub fn serve_instead(&mut self, server: Server) {
        if let State::Unavailable = self.state {
            self.served = Some(Served::by(&server));
            self.state = State::Idle(Box::new(ServerState { server, store: None, has_failed: false }));
        }
    }

    /// Stores data of the game with a saved world, like a [`WorldStore`](crate::saves::WorldStore).
    pub fn put(&mut self, key: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        let (key, bytes) = (key.into(), bytes.into());
        self.data.insert(key.clone(), bytes.clone());
        self.ask(move |parts, _| {
            if let Some(store) = &mut parts.store {
                store.put(key, bytes);
            }
        });
    }

    /// Data of the game as it was put last; nothing before the world is [read](GroundServerEvent::Opened).
    pub fn get(&self, key: &str) -> Option<&[u8]> {
        self.data.get(key).map(Vec::as_slice)
    }

    /// The number of a player on the server: one more than the transport's [`NetworkId`], so it stays the same over
    /// connections. A player on the server's own machine has the number 0.
    ///
    /// The two greatest network ids have no number: [`net::ClientId::SERVER`] is returned, and such clients are not
    /// served. A transport without network ids gives a new number to each connection, so a returning player counts as a
    /// new one.
    pub fn player(client: Peer, ids: &Query<&NetworkId>) -> net::ClientId {
        let id = client.entity().and_then(|entity| ids.get(entity).ok());
        number(client, id).unwrap_or(net::ClientId::SERVER)
    }

    /// Waits until all requests are done and saved, but no longer than ten seconds. An app that exits does this. A
    /// world that is still being read has nothing to save.
    pub fn finish(&mut self) {
        let deadline = Instant::now() + EXIT_WAIT;
        self.state = match std::mem::replace(&mut self.state, State::Unavailable) {
            State::Running(mut task) => match task.finish_within(EXIT_WAIT) {
                Some(parts) => State::Idle(parts),
                None => {
                    error!("the last edits are not saved: the server is still busy");
                    (self.state, self.has_timed_out) = (State::Running(task), true);
                    return;
                }
            },
            other => other,
        };
        let now = self.start.elapsed();
        if let State::Idle(parts) = &mut self.state {
            self.waiting.drain(..).for_each(|request| request(parts, now));
            self.players.forget_waiting();
            parts.advance(now);
            let left = deadline.saturating_duration_since(Instant::now());
            if let Some(Err(why)) = parts.store.as_mut().map(|store| store.flush_within(left)) {
                error!("the last edits are not saved: {why}");
                self.has_timed_out = matches!(why, StoreError::TimedOut);
            }
        }
    }

    /// Takes the server, if it is not busy.
    fn take_state(&mut self, mut report: impl FnMut(GroundServerEvent)) -> Option<Box<ServerState>> {
        match std::mem::replace(&mut self.state, State::Unavailable) {
            State::Idle(parts) => return Some(parts),
            State::Unavailable => {}
            State::Running(mut task) => match task.finish() {
                None => self.state = State::Running(task),
                done => return done,
            },
            State::Opening(mut task, progress) => match task.finish() {
                None => self.state = State::Opening(task, progress),
                Some(Ok((parts, warnings))) => {
                    // Values that were put meanwhile are newer.
                    let newer = std::mem::take(&mut self.data);
                    self.data.extend(parts.store.iter().flat_map(|store| store.game_data().clone()));
                    self.data.extend(newer);
                    self.served = Some(Served::by(&parts.server));
                    warnings.into_iter().map(GroundServerEvent::Warning).for_each(&mut report);
                    report(GroundServerEvent::Opened(Ok(())));
                    return Some(parts);
                }
                Some(Err(why)) => {
                    error!("the world is not served: {why}");
                    report(GroundServerEvent::Opened(Err(Arc::new(why))));
                }
            },
        }
        None
    }
}

/// Dropping it does not block: another thread finishes the requests that wait and closes the store. An app that exits
/// waits for that thread.
impl Drop for GroundServer {
    fn drop(&mut self) {
        let work = std::mem::replace(&mut self.state, State::Unavailable);
        let (waiting, now) = (std::mem::take(&mut self.waiting), self.start.elapsed());
        // What is being read has nothing to save yet, so no exit waits for it.
        let has_to_save = matches!(work, State::Idle(_) | State::Running(_)) && !self.has_timed_out;
        let (closed, closing) = channel();
        Threads::Background.spawn(move || {
            let Some(mut parts) = work.wait() else { return };
            waiting.into_iter().for_each(|request| request(&mut parts, now));
            parts.advance(now);
            if let Some(store) = parts.store.take() {
                // An error means that the result is no longer awaited.
                let _ = closed.send(store.close());
            }
        });
        if let Some(stores) = self.closing.take().filter(|_| has_to_save) {
            stores.add(closing);
        }
    }
}

impl State {
    /// Waits for the server, on another thread than the main one; `None` if there is none.
    fn wait(self) -> Option<Box<ServerState>> {
        match self {
            Self::Idle(parts) => Some(parts),
            Self::Running(task) => task.wait(),
            Self::Opening(task, _) => task.wait()?.ok().map(|(parts, _)| parts),
            Self::Unavailable => None,
        }
    }
}

impl ServerState {
    fn advance(&mut self, now: Duration) {
        self.server.advance(now);
        if let Some(store) = &mut self.store
            && let Err(why) = self.server.save(store)
            && !std::mem::replace(&mut self.has_failed, true)
        {
            error!("the world of the ground's server is not saved any more: {why}");
        }
    }
}

impl GroundServer {
    /// Reads messages of players. Without a world they are dropped: no player was invited.
    fn receive(&mut self, messages: &FromPlayers, peers: &Peers) {
        let is_open = matches!(self.state, State::Idle(_) | State::Running(_));
        let mut said = Vec::new();
        for (peer, message) in messages.read(&mut self.read) {
            // What was said to another server says nothing to this one: its ground may be another.
            let is_ours = self.served.is_some_and(|served| !message.is_for_another(served.run));
            if is_open
                && is_ours
                && let Some(number) = self.players.find(peer, peers)
            {
                said.push((number, self.players.receive(number, peer, message)));
            }
        }
        for (player, said) in said {
            match said {
                PlayerMessage::Bytes { begins, bytes } => self.ask(move |parts, now| {
                    if begins {
                        parts.server.connect(player, now);
                    }
                    parts.server.receive(player, &bytes, now);
                }),
                PlayerMessage::Leaves => self.ask(move |parts, _| parts.server.disconnect(player)),
                PlayerMessage::Flood => {
                    self.ask(move |parts, _| parts.server.kick_for(player, KickReason::Flood))
                }
                PlayerMessage::Nothing => {}
            }
        }
        for player in self.players.take_gone(peers) {
            self.ask(move |parts, _| parts.server.disconnect(player));
        }
    }
}

/// Passes messages of players to the server, and sends its messages to them.
pub(super) fn serve(
    mut ground: ResMut<GroundServer>,
    closing: Option<Res<ClosingWorlds>>,
    messages: FromPlayers,
    peers: Peers,
    mut to_players: ToPlayers,
    mut events: MessageWriter<GroundServerEvent>,
) {
    let ground = &mut *ground;
    if ground.closing.is_none() {
        ground.closing = closing.map(|closing| closing.abandoned().clone());
    }
    ground.receive(&messages, &peers);
    for client in ground.players.take_replaced(&peers) {
        to_players.send(client.into(), Lane::Main, ToClient::Kicked(KickReason::ConnectedAgain).to_bytes());
        to_players.disconnect(client);
    }
    let parts = ground.take_state(|event| {
        events.write(event);
    });
    let Some(mut parts) = parts else { return };
    let now = ground.start.elapsed();
    ground.waiting.drain(..).for_each(|request| request(&mut parts, now));
    ground.players.forget_waiting();
    let mut kicked = Vec::new();
    for event in parts.server.take_events() {
        if let ServerEvent::Kicked(player, _) = event {
            kicked.push(player);
        }
        events.write(GroundServerEvent::Players(event));
    }
    if let Some(store) = &parts.store {
        events.write_batch(store.take_warnings().into_iter().map(GroundServerEvent::Warning));
    }
    for (player, lane, bytes) in parts.server.take_outgoing() {
        if let Some(client) = ground.players.client(player) {
            to_players.send(client, lane, bytes);
        }
    }
    for player in kicked {
        if let Some(client) = ground.players.kick(player) {
            to_players.disconnect(client);
        }
    }
    ground.state = State::Running(ThreadTask::start(Threads::Transactions, move || {
        parts.advance(now);
        parts
    }));
}

/// Handles the requests of the last frame, and saves everything before the app ends.
pub(super) fn finish_at_exit(mut ground: ResMut<GroundServer>, messages: FromPlayers, peers: Peers) {
    ground.receive(&messages, &peers);
    ground.finish();
}
