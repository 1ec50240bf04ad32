//! A terrain that a player shares with others.

use bevy::platform::time::Instant;
use bevy::prelude::*;
use bevy_replicon::prelude::*;

use super::messages::{BulkLane, FromPlayer, OrderLane};
use super::server::GroundServer;
use crate::brush::Edit;
use crate::net::{self, Client, ClientEvent, Lane, Refusal, ShownChange, Stamps};
use crate::plugin::{BrushApplied, EditOutbox, HistoryMoved, LoosePieceFound, ThreadTask, Threads, pieces};
use crate::terrain::{
    HistoryReceipt, HistoryRejection, HistoryStep, Receipt, Rejection, Restored, Terrain, TerrainSettings,
};

/// Insert it with a pristine [`Terrain`] of the same ground and chunk size as the server's: the world that players share takes its
/// place, and brushes for it go to the server. It joins as soon as there is a connection, or a
/// [`GroundServer`] in this app, and again whenever there is a new one.
#[derive(Component, Default)]
#[require(EditOutbox)]
pub struct SharedTerrain {
    /// Images that stamps may have: the same as those of the server.
    pub stamps: Stamps,
    /// Where the player is, in voxels of the terrain: the ground comes from there outwards.
    pub place: IVec3,
    link: Option<Link>,
}

/// What is known of the connection.
struct Link {
    /// What is not under way.
    client: Option<Client>,
    under_way: Option<ThreadTask<Client>>,
    inbox: Vec<(Lane, Vec<u8>)>,
    edits: Vec<Edit>,
    undos: usize,
    wants: Option<Connection>,
    start: Instant,
    facts: Facts,
    /// The changes whose receipts are still to come.
    waiting: usize,
    /// Something went wrong with what is shown.
    is_broken: bool,
    is_playable: bool,
}

/// A change of the connection that the client was not told of yet.
#[derive(Clone, Copy, PartialEq)]
enum Connection {
    Begun,
    Gone,
}

/// What the client said last.
#[derive(Clone, Copy, Default)]
struct Facts {
    number: u64,
    pending: usize,
    id: Option<net::ClientId>,
    has_joined: bool,
}

impl SharedTerrain {
    /// The number in the server's order of the last entry that the player's world holds.
    pub fn number(&self) -> u64 {
        self.facts().number
    }

    /// The player's edits that the server has not answered.
    pub fn pending(&self) -> usize {
        self.facts().pending
    }

    /// Who the player is for the server; `None` before it has joined once.
    pub fn id(&self) -> Option<net::ClientId> {
        self.facts().id
    }

    /// Is the ground around the player there?
    pub fn is_playable(&self) -> bool {
        self.link.as_ref().is_some_and(|link| link.is_playable)
    }

    /// Is all of the world there, and does it follow the server?
    pub fn has_joined(&self) -> bool {
        self.facts().has_joined
    }

    fn facts(&self) -> Facts {
        self.link.as_ref().map_or_else(Facts::default, |link| link.facts)
    }
}

/// What became of an edit.
#[derive(Clone, Debug, PartialEq)]
pub enum WhatBecame {
    /// It is shown, as far as the player's machine can tell now.
    Predicted(Receipt),
    /// The server has ordered it; this is what it came to for all. `None` where the player was away when that happened.
    Confirmed(Option<Receipt>),
    /// It is not done, and no longer shown. `None` where it could not be sent, or the player was away when that was told.
    Refused(Option<Refusal>),
}

/// Something became of an edit on a [`SharedTerrain`]. A [`BrushApplied`] follows for those that are confirmed or refused, so inventories
/// need nothing else.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct GroundEdited {
    /// The terrain.
    pub terrain: Entity,
    /// The tag of the brush.
    pub tag: u64,
    /// What became of it.
    pub outcome: WhatBecame,
}

/// How far a [`SharedTerrain`] has come, or that its player has to go.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct GroundJoined {
    /// The terrain.
    pub terrain: Entity,
    /// `Welcomed`, `Playable`, `Joined`, `Durable`, `Repaired` or `Kicked`.
    pub event: ClientEvent,
}

/// Makes the client of a new shared terrain.
pub(super) fn begin(
    new: On<Insert, SharedTerrain>,
    mut shared: Query<(&mut SharedTerrain, &Terrain)>,
    server: Option<Res<GroundServer>>,
    state: Option<Res<State<ClientState>>>,
) {
    let Ok((mut shared, terrain)) = shared.get_mut(new.entity) else {
        error!("a SharedTerrain needs a Terrain beside it");
        return;
    };
    let world = terrain.world();
    let settings =
        TerrainSettings { chunk_size: world.grid().size() as u32, voxel_size: terrain.voxel_size() };
    let is_connected = server.is_some() || state.is_some_and(|state| *state.get() == ClientState::Connected);
    match Client::new(world.shared_ground(), &settings) {
        Ok(mut client) => {
            *client.stamps_mut() = shared.stamps.clone();
            client.set_place(shared.place);
            shared.link = Some(Link {
                client: Some(client),
                under_way: None,
                inbox: Vec::new(),
                edits: Vec::new(),
                undos: 0,
                wants: is_connected.then_some(Connection::Begun),
                start: Instant::now(),
                facts: Facts::default(),
                waiting: 0,
                is_broken: world.revision() != 0,
                is_playable: false,
            });
        }
        Err(why) => error!("the terrain can't be shared: {why}"),
    }
}

/// Brushes on a terrain that is no longer shared are its own again.
pub(super) fn end(gone: On<Remove, SharedTerrain>, mut commands: Commands) {
    commands.entity(gone.entity).try_remove::<EditOutbox>();
}

/// There is a connection.
pub(super) fn connect(mut shared: Query<&mut SharedTerrain>) {
    for link in shared.iter_mut().filter_map(|shared| shared.into_inner().link.as_mut()) {
        link.inbox.clear();
        link.wants = Some(Connection::Begun);
    }
}

/// The connection is gone.
pub(super) fn disconnect(mut shared: Query<&mut SharedTerrain>) {
    for link in shared.iter_mut().filter_map(|shared| shared.into_inner().link.as_mut()) {
        link.inbox.clear();
        link.wants = Some(Connection::Gone);
    }
}

/// Takes what the server sent.
pub(super) fn receive(
    mut shared: Query<&mut SharedTerrain>,
    mut order: MessageReader<OrderLane>,
    mut bulk: MessageReader<BulkLane>,
) {
    let messages = order.read().map(|message| (Lane::Order, &message.0));
    let messages: Vec<_> = messages.chain(bulk.read().map(|message| (Lane::Bulk, &message.0))).collect();
    for link in shared.iter_mut().filter_map(|shared| shared.into_inner().link.as_mut()) {
        link.inbox.extend(messages.iter().map(|(lane, bytes)| (*lane, Vec::clone(bytes))));
    }
}

/// Takes what the player asked for, and sends it as soon as the client is not at work.
pub(super) fn send(
    mut shared: Query<(Entity, &mut SharedTerrain, &mut EditOutbox, &mut Terrain)>,
    mut messages: MessageWriter<FromPlayer>,
    mut moved: MessageWriter<HistoryMoved>,
) {
    for (entity, mut shared, mut outbox, mut terrain) in &mut shared {
        let place = shared.place;
        let Some(link) = &mut shared.bypass_change_detection().link else { continue };
        if !outbox.edits.is_empty() || !outbox.steps.is_empty() {
            link.edits.append(&mut outbox.edits);
            for step in outbox.steps.drain(..) {
                match step {
                    HistoryStep::Undo => link.undos += 1,
                    // Others may have dug there: the player digs again.
                    HistoryStep::Redo => {
                        let receipt = HistoryReceipt { step, outcome: Err(HistoryRejection::NothingToRedo) };
                        moved.write(HistoryMoved { terrain: Some(entity), receipt });
                    }
                }
            }
        }
        if let Some(client) = link.under_way.as_mut().and_then(ThreadTask::finish) {
            (link.client, link.under_way) = (Some(client), None);
        }
        let now = link.start.elapsed();
        let Some(mut client) = link.client.take() else { continue };
        client.set_place(place);
        match link.wants.take() {
            Some(Connection::Begun) => client.connect(now),
            Some(Connection::Gone) => client.disconnect(),
            None => {}
        }
        link.edits.drain(..).for_each(|edit| client.dig(edit));
        (0..std::mem::take(&mut link.undos)).for_each(|_| client.undo(None));
        messages.write_batch(client.take_outgoing().into_iter().map(FromPlayer));
        link.inbox.drain(..).for_each(|(lane, bytes)| client.receive(lane, bytes));
        // What is put in place comes out of the client in order, so all of it waits for what is shown to be whole again.
        let receipts = terrain.bypass_change_detection().take_change_receipts();
        link.waiting = link.waiting.saturating_sub(receipts.len());
        link.is_broken |= receipts.iter().any(Result::is_err);
        link.facts = Facts {
            number: client.number(),
            pending: client.pending(),
            id: client.id(),
            has_joined: client.has_joined(),
        };
        link.client = Some(client);
    }
}

/// The messages that tell what became of edits.
#[derive(bevy::ecs::system::SystemParam)]
pub(super) struct Answers<'w> {
    edited: MessageWriter<'w, GroundEdited>,
    joined: MessageWriter<'w, GroundJoined>,
    applied: MessageWriter<'w, BrushApplied>,
    moved: MessageWriter<'w, HistoryMoved>,
    pieces: MessageWriter<'w, LoosePieceFound>,
}

/// Puts into terrains what is to be shown, and tells what happened.
pub(super) fn show(mut shared: Query<(Entity, &mut SharedTerrain, &mut Terrain)>, mut answers: Answers) {
    for (entity, mut shared, mut terrain) in &mut shared {
        let Some(link) = &mut shared.bypass_change_detection().link else { continue };
        let Some(client) = &mut link.client else { continue };
        let mut changes = client.take_shown();
        if link.is_broken {
            // All of it comes once those that wait are answered.
            changes.clear();
            if link.waiting == 0 {
                link.is_broken = false;
                changes.push(client.show_whole(terrain.world()));
            }
        }
        for ShownChange { change, hash } in changes {
            // One that finds no room comes again with all others.
            match terrain.bypass_change_detection().submit_change(change, Some(hash)) {
                Ok(()) => link.waiting += 1,
                Err(_) => link.is_broken = true,
            }
        }
        for event in client.take_events() {
            link.is_playable |= event == ClientEvent::Playable;
            answers.tell(entity, event);
        }
        let Some(mut client) = link.client.take() else { continue };
        let now = link.start.elapsed();
        link.under_way = Some(ThreadTask::start(Threads::Transactions, move || {
            client.advance(now);
            client
        }));
    }
}

impl Answers<'_> {
    fn tell(&mut self, terrain: Entity, event: ClientEvent) {
        let edited = |tag, outcome| GroundEdited { terrain, tag, outcome };
        match event {
            ClientEvent::Predicted(receipt) => {
                self.pieces.write_batch(pieces(terrain, std::slice::from_ref(&receipt)));
                self.edited.write(edited(receipt.tag, WhatBecame::Predicted(receipt)));
            }
            ClientEvent::Confirmed { tag, receipt } => {
                if let Some(receipt) = receipt.clone() {
                    self.applied.write(BrushApplied { terrain: Some(terrain), receipt });
                }
                self.edited.write(edited(tag, WhatBecame::Confirmed(receipt)));
            }
            ClientEvent::Refused { tag, why } => {
                let receipt = Receipt { tag, outcome: Err(Rejection::Refused) };
                self.applied.write(BrushApplied { terrain: Some(terrain), receipt });
                self.edited.write(edited(tag, WhatBecame::Refused(why)));
            }
            ClientEvent::Others { receipt, .. } => {
                self.pieces.write_batch(pieces(terrain, std::slice::from_ref(&receipt)));
            }
            ClientEvent::UndoRefused(_) => {
                self.moved.write(undone(terrain, Err(HistoryRejection::NothingToUndo)));
            }
            ClientEvent::Undone(restored) => {
                self.moved.write(undone(terrain, Ok(restored.unwrap_or_default())));
            }
            event => drop(self.joined.write(GroundJoined { terrain, event })),
        }
    }
}

fn undone(terrain: Entity, outcome: Result<Restored, HistoryRejection>) -> HistoryMoved {
    HistoryMoved { terrain: Some(terrain), receipt: HistoryReceipt { step: HistoryStep::Undo, outcome } }
}
