//! Updates a player's shared terrain in each frame.

use std::time::Duration;

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::lifecycle::Discard;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::error::{SharingError, SharingErrorFound};
use super::link::{Link, MAX_PENDING, PieceMessage, Standing, Worked};
use super::messages::{BulkLane, FromPlayer, MainLane};
use super::replicon::ToOwnServer;
use super::service::Service;
use super::shared::{EditOutcome, GroundEdited, GroundJoined, SharedTerrain};
use super::sharing::Sharing;
use crate::net::{Client, ClientEvent, KickReason, Lane, Refusal};
use crate::plugin::{BrushApplied, EditOutbox, Held, HistoryMoved, LoosePieceFound, LoosePieceReturned};
use crate::terrain::{Applied, Order, OrderKind, Receipt, Rejection, Terrain};
use crate::threads::{ThreadTask, Threads, free_later};

/// The writers of messages about edits.
#[derive(SystemParam)]
pub(super) struct EditMessages<'w> {
    edited: MessageWriter<'w, GroundEdited>,
    joined: MessageWriter<'w, GroundJoined>,
    errors: MessageWriter<'w, SharingErrorFound>,
    applied: MessageWriter<'w, BrushApplied>,
    moved: MessageWriter<'w, HistoryMoved>,
}

/// Reads messages of the server. The client ignores those from before its last greeting.
pub(super) fn receive(
    mut shared: Query<&mut SharedTerrain>,
    mut order: MessageReader<MainLane>,
    mut bulk: MessageReader<BulkLane>,
) {
    let order = order.read().map(|message| (Lane::Main, &message.0));
    let messages: Vec<_> = order.chain(bulk.read().map(|message| (Lane::Bulk, &message.0))).collect();
    if messages.is_empty() {
        return;
    }
    for mut shared in &mut shared {
        let Some(link) = &mut shared.bypass_change_detection().link else { continue };
        if link.greeted.is_some() {
            link.inbox.extend(messages.iter().map(|(lane, bytes)| (*lane, Vec::clone(bytes))));
        }
    }
}

/// Reports pieces of ground in the frame in which the ground loses them, and their return in the frame in which they
/// are ground again.
pub(super) fn release_pieces(
    mut shared: Query<(&mut SharedTerrain, &mut Terrain)>,
    mut found: MessageWriter<LoosePieceFound>,
    mut returned: MessageWriter<LoosePieceReturned>,
) {
    for (mut shared, mut terrain) in &mut shared {
        let Some(link) = &mut shared.bypass_change_detection().link else { continue };
        for message in link.display.follow(terrain.bypass_change_detection()) {
            match message {
                PieceMessage::Found(message) => drop(found.write(message)),
                PieceMessage::Returned(message) => drop(returned.write(message)),
            }
        }
    }
}

/// Takes the player's requests, follows the present server, and sends messages as soon as the client is not
/// busy.
pub(super) fn send(
    service: Res<Service>,
    mut sharing: ResMut<Sharing>,
    mut shared: Query<(Entity, &mut SharedTerrain, Option<&mut EditOutbox>, Option<&mut Terrain>, Has<Held>)>,
    mut disabled: Query<&mut SharedTerrain, (With<Disabled>, Allow<Disabled>)>,
    mut edit_messages: EditMessages,
    mut messages: MessageWriter<FromPlayer>,
) {
    for mut shared in &mut disabled {
        let link = shared.bypass_change_detection().link.as_mut();
        link.into_iter().for_each(|link| leave_meanwhile(link, *service, &mut messages));
    }
    let with_terrain = shared.iter().filter(|(_, _, _, terrain, _)| terrain.is_some());
    sharing.choose(with_terrain.map(|(entity, shared, ..)| (entity, shared.order)));
    let active = sharing.active;
    for (entity, mut shared, outbox, terrain, is_held) in &mut shared {
        let is_changed = shared.is_changed();
        let shared = shared.bypass_change_detection();
        if is_held && shared.link.is_none() && active == Some(entity) {
            // It begins with the level that the terrain waits for.
            shared.error = None;
            continue;
        }
        let requests = outbox.map(take_requests).unwrap_or_default();
        let error = match (terrain, active) {
            (Some(mut terrain), Some(active)) if active == entity => {
                let terrain = terrain.bypass_change_detection();
                let mut turn = Turn { entity, edit_messages: &mut edit_messages };
                turn.send(*service, (shared, is_changed), terrain, requests, &mut messages)
            }
            (terrain, active) => {
                requests.into_iter().for_each(|request| edit_messages.refuse(entity, request, None));
                edit_messages.close(entity, shared.link.take(), &mut messages);
                let other = active.filter(|_| terrain.is_some()).map(SharingError::AnotherIsShared);
                Some(other.unwrap_or(SharingError::NoTerrain))
            }
        };
        if error != shared.error {
            shared.error = error;
            if let Some(SharingError::OtherGround { ours, theirs, .. }) = error
                && !shared.was_served
            {
                // As over other transports. The connection stays.
                let why = if ours == theirs { KickReason::ChunkSize } else { KickReason::Ground };
                edit_messages.joined.write(GroundJoined { terrain: entity, event: ClientEvent::Kicked(why) });
            }
            error.into_iter().for_each(|error| edit_messages.warn(entity, error));
        }
    }
}

/// Takes the requests of a player.
fn take_requests(mut outbox: Mut<EditOutbox>) -> Vec<Order> {
    if outbox.orders.is_empty() {
        return Vec::new();
    }
    std::mem::take(&mut outbox.orders)
}

/// The shared terrain of a frame, and the messages about its edits.
struct Turn<'a, 'w> {
    entity: Entity,
    edit_messages: &'a mut EditMessages<'w>,
}

impl Turn<'_, '_> {
    /// Returns what keeps the terrain from following a server.
    fn send(
        &mut self,
        service: Service,
        (shared, is_changed): (&mut SharedTerrain, bool),
        terrain: &mut Terrain,
        requests: Vec<Order>,
        messages: &mut MessageWriter<FromPlayer>,
    ) -> Option<SharingError> {
        let ground = super::messages::GroundId::of(terrain.world());
        if shared.link.as_ref().is_some_and(|link| link.ground != ground) {
            self.edit_messages.close(self.entity, shared.link.take(), messages);
        }
        if shared.link.is_none() {
            // A terrain that is there has valid settings.
            shared.link = Link::new(terrain, &shared.contents).ok();
        }
        let link = shared.link.as_mut()?;
        requests.into_iter().for_each(|request| link.request(request));
        if terrain.rules() != link.rules.as_ref() {
            link.rules = terrain.rules().cloned();
            self.edit_messages.warn(self.entity, SharingError::RulesIgnored);
        }
        link.take_back_client();
        let standing = link.standing(service);
        let follows = match standing {
            Standing::Follows(invitation) => Some(invitation),
            _ => None,
        };
        link.facts.has_joined &= follows.is_some() && follows == link.greeted;
        link.has_new_contents |= is_changed;
        let Some(mut client) = link.client.take() else { return standing.error() };
        if std::mem::take(&mut link.has_new_contents) {
            // It may have got others from the server.
            client.contents_mut().add_all(&shared.contents);
        }
        client.set_position(shared.position);
        if follows != link.greeted {
            change_server(link, &mut client, follows, service, messages);
            shared.was_served |= link.was_served;
        }
        if let Standing::Refuses(_) = standing {
            client.give_up();
        }
        self.hand_over(link, &mut client, standing);
        if link.greeted.is_some() {
            let run = link.run;
            messages
                .write_batch(client.take_outgoing().into_iter().map(|bytes| FromPlayer::Bytes(run, bytes)));
        }
        link.inbox.drain(..).for_each(|(lane, bytes)| client.receive(lane, bytes));
        link.facts.number = client.number();
        link.facts.id = client.id();
        link.facts.has_joined = link.greeted.is_some() && client.has_joined();
        link.client = Some(client);
        standing.error()
    }

    /// Hands over what the player asked for, in order.
    fn hand_over(&mut self, link: &mut Link, client: &mut Client, standing: Standing) {
        let is_refused = matches!(standing, Standing::Refuses(_));
        let mut room = MAX_PENDING.saturating_sub(client.pending());
        for request in std::mem::take(&mut link.requests) {
            match request {
                Order::Edit(edit) if !is_refused && room > 0 => {
                    link.is_full = false;
                    room -= 1;
                    client.submit(edit);
                }
                Order::Undo if !is_refused => client.undo(None),
                request => {
                    let is_full = !is_refused && request.edit().is_some();
                    if is_full && !std::mem::replace(&mut link.is_full, true) {
                        self.edit_messages.warn(self.entity, SharingError::TooManyPending(MAX_PENDING));
                    }
                    self.edit_messages.refuse(self.entity, request, Some(link));
                }
            }
        }
    }
}

/// Leaves the server while a terrain is disabled, because it does not read messages of the server. The terrain joins
/// again once it is enabled, and what waits for an answer is sent again.
fn leave_meanwhile(link: &mut Link, service: Service, messages: &mut MessageWriter<FromPlayer>) {
    if link.greeted.is_none() {
        return;
    }
    link.take_back_client();
    if let Some(mut client) = link.client.take() {
        link.facts.has_joined = false;
        change_server(link, &mut client, None, service, messages);
        link.client = Some(client);
    }
}

/// Leaves the server that was followed, and greets the one of this invitation.
fn change_server(
    link: &mut Link,
    client: &mut Client,
    invitation: Option<u64>,
    service: Service,
    messages: &mut MessageWriter<FromPlayer>,
) {
    link.inbox.clear();
    link.greeted = invitation;
    if let (Some(_), Service::Served(served, _)) = (invitation, service) {
        link.run = served.run;
        client.connect(link.start.elapsed());
        (link.was_served, link.kicked) = (true, None);
    } else {
        client.disconnect();
        if service != Service::Apart {
            messages.write(FromPlayer::Left(link.run));
        }
    }
}

/// Submits changes to the shown terrains, and reports what happened.
pub(super) fn show(
    mut shared: Query<(Entity, &mut SharedTerrain, &mut Terrain)>,
    mut edit_messages: EditMessages,
) {
    for (entity, mut shared, mut terrain) in &mut shared {
        let Some(link) = &mut shared.bypass_change_detection().link else { continue };
        let Some(mut client) = link.client.take() else { continue };
        let terrain = terrain.bypass_change_detection();
        let display = &mut link.display;
        let mut changes = client.take_shown();
        if let Some(whole) = display.whole.take() {
            display.is_broken = false;
            changes.push(whole);
        } else if display.is_broken {
            // All of it comes once those that wait are answered.
            changes.clear();
        }
        display.submitted += changes.len() as u64;
        // One that finds no room is rejected, and comes again with all others.
        terrain.submit_all(changes);
        display.compare(terrain.world(), client.shown_hash());
        let broken = (display.is_broken && display.is_idle()).then(|| terrain.snapshot());
        client.take_events().into_iter().for_each(|event| edit_messages.report(entity, link, event));
        let now = link.start.elapsed();
        link.task = Some(ThreadTask::start(Threads::Transactions, move || {
            client.advance(now);
            let whole = broken.map(|shown| client.show_whole(&shown));
            Worked { client, whole }
        }));
    }
}

/// Answers what waits for a terrain that is no longer shared, and sends the server that it left.
pub(super) fn close(
    gone: On<Discard, SharedTerrain>,
    mut shared: Query<(&mut SharedTerrain, Option<&mut EditOutbox>), Allow<Disabled>>,
    mut edit_messages: EditMessages,
    mut messages: MessageWriter<FromPlayer>,
) {
    let Ok((mut shared, outbox)) = shared.get_mut(gone.entity) else { return };
    edit_messages.close(gone.entity, shared.link.take(), &mut messages);
    let requests = outbox.map(take_requests).unwrap_or_default();
    requests.into_iter().for_each(|request| edit_messages.refuse(gone.entity, request, None));
}

impl EditMessages<'_> {
    /// Reports what is wrong.
    fn warn(&mut self, terrain: Entity, error: SharingError) {
        warn!("{terrain}: {error}");
        self.errors.write(SharingErrorFound { terrain, error });
    }

    /// Answers something that is not sent to a server.
    fn refuse(&mut self, terrain: Entity, request: Order, link: Option<&mut Link>) {
        let why = match &request {
            Order::Edit(edit) => {
                link.into_iter().for_each(|link| link.answer(edit.tag()));
                return self.refused(terrain, edit.tag(), None);
            }
            Order::Undo => Rejection::Refused,
            // Others may have dug there: the player digs again.
            _ => Rejection::NothingToRedo,
        };
        link.into_iter().for_each(|link| link.undos = link.undos.saturating_sub(1));
        self.stepped(terrain, request.kind(), Err(why));
    }

    /// Answers what waits, and drops the link.
    fn close(&mut self, terrain: Entity, link: Option<Link>, messages: &mut MessageWriter<FromPlayer>) {
        let Some(link) = link else { return };
        link.tags.iter().for_each(|tag| self.refused(terrain, *tag, None));
        (0..link.undos).for_each(|_| self.stepped(terrain, OrderKind::Undo, Err(Rejection::Refused)));
        if link.greeted.is_some() {
            messages.write(FromPlayer::Left(link.run));
        }
        // It holds a world.
        free_later(link);
    }

    fn refused(&mut self, terrain: Entity, tag: u64, why: Option<Refusal>) {
        let receipt = Receipt::of_edit(tag, Err(Rejection::Refused));
        self.applied.write(BrushApplied { terrain: Some(terrain), receipt });
        self.edited.write(GroundEdited { terrain, tag, outcome: EditOutcome::Refused(why) });
    }

    fn stepped(&mut self, terrain: Entity, step: OrderKind, outcome: Result<Applied, Rejection>) {
        self.moved.write(HistoryMoved { terrain: Some(terrain), receipt: Receipt::of(step, outcome) });
    }

    fn report(&mut self, terrain: Entity, link: &mut Link, event: ClientEvent) {
        let edited = |tag, outcome| GroundEdited { terrain, tag, outcome };
        match event {
            ClientEvent::Predicted(receipt) => {
                self.edited.write(edited(receipt.tag, EditOutcome::Predicted(receipt)));
            }
            ClientEvent::Confirmed { tag, receipt } => {
                link.answer(tag);
                // If the player was away, its effect is not known here, and nothing is counted.
                let unknown = || Receipt::of_edit(tag, Ok(Applied::default()));
                let known = receipt.clone().unwrap_or_else(unknown);
                self.applied.write(BrushApplied { terrain: Some(terrain), receipt: known });
                self.edited.write(edited(tag, EditOutcome::Confirmed(receipt)));
            }
            ClientEvent::Refused { tag, why } => {
                link.answer(tag);
                self.refused(terrain, tag, why);
            }
            ClientEvent::RemoteEdit { .. } => {}
            ClientEvent::PiecesChanged { tag, found, returned } => {
                let found = found.into_iter().map(|piece| LoosePieceFound::new(terrain, tag, piece));
                let returned = returned.into_iter().map(|piece| LoosePieceReturned { terrain, piece });
                let found = found.map(PieceMessage::Found);
                link.display.add_pieces(found.chain(returned.map(PieceMessage::Returned)));
            }
            ClientEvent::UndoRefused(why) => {
                link.undos = link.undos.saturating_sub(1);
                let outcome = match why {
                    Some(Refusal::Nothing) => Rejection::NothingToUndo,
                    _ => Rejection::Refused,
                };
                if let Some(why) = why.filter(|why| *why != Refusal::Nothing) {
                    self.warn(terrain, SharingError::UndoRefused(why));
                }
                self.stepped(terrain, OrderKind::Undo, Err(outcome));
            }
            ClientEvent::Undone(restored) => {
                link.undos = link.undos.saturating_sub(1);
                self.stepped(terrain, OrderKind::Undo, Ok(restored.unwrap_or_default()));
            }
            event => {
                link.is_playable |= event == ClientEvent::Playable;
                if let (ClientEvent::Kicked(why), Some(invitation)) = (&event, link.greeted) {
                    link.kicked = Some((*why, invitation));
                }
                self.joined.write(GroundJoined { terrain, event });
            }
        }
    }
}

/// How long the app's last frame waits for a client that is at work.
const LAST_FRAME: Duration = Duration::from_secs(2);

/// Hands over to the server in this app what its player asked for in the app's last frame, so that it is saved.
pub(super) fn send_last(mut shared: Query<&mut SharedTerrain>, mut messages: ToOwnServer) {
    for mut shared in &mut shared {
        let Some(link) = &mut shared.bypass_change_detection().link else { continue };
        if link.client.is_none()
            && let Some(task) = &mut link.task
        {
            link.client = task.finish_within(LAST_FRAME).map(|worked| worked.client);
        }
        let Some(client) = link.client.as_mut().filter(|_| link.greeted.is_some()) else { continue };
        for request in link.requests.drain(..) {
            match request {
                Order::Edit(edit) => client.submit(edit),
                Order::Undo => client.undo(None),
                _ => {}
            }
        }
        let run = link.run;
        messages.send(client.take_outgoing().into_iter().map(|bytes| FromPlayer::Bytes(run, bytes)));
    }
}
