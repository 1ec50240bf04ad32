//! Clients that come, come back, or have another world.

use std::sync::Arc;
use std::time::Duration;

use glam::IVec3;

use super::sender::Job;
use super::session::Stage;
use super::{Server, ServerEvent};
use crate::lattice::RegionPos;
use crate::net::message::{ClientId, Epoch, Hello, Join, Lane, Terms, ToClient, Welcome};
use crate::net::regions::regions_of;
use crate::terrain::World;

/// Regions that are encoded to tell how many bytes all of them take.
const MEASURED: usize = 16;

/// Regions that a client asked for.
pub(super) struct Fetch {
    pub client: ClientId,
    /// The number that its world is at.
    number: u64,
    regions: Vec<RegionPos>,
}

impl Server {
    /// Welcomes clients that have greeted, and answers fetches.
    pub(super) fn welcome_all(&mut self) {
        self.flush();
        let greeted: Vec<(ClientId, Hello)> = self
            .sessions
            .iter_mut()
            .filter_map(|(client, session)| match std::mem::replace(&mut session.stage, Stage::Joined) {
                Stage::Greeted(hello) => Some((*client, hello)),
                stage => {
                    session.stage = stage;
                    None
                }
            })
            .collect();
        for (client, hello) in greeted {
            self.welcome(client, &hello);
        }
        let (due, later) =
            std::mem::take(&mut self.fetches).into_iter().partition(|fetch| fetch.number <= self.applied);
        self.fetches = later;
        due.into_iter().for_each(|fetch| self.answer(fetch));
    }

    fn welcome(&mut self, client: ClientId, hello: &Hello) {
        let ours = hello.epoch.filter(|epoch| epoch.world == self.epoch.world);
        let (join, jobs) = match ours {
            Some(epoch) if epoch.run == self.epoch.run && epoch.number <= self.epoch.number => {
                match self.entries_after(epoch.number) {
                    Some(log) => log,
                    None => self.compare(client),
                }
            }
            Some(_) => self.compare(client),
            // It has the pristine world, or another one.
            None => match self.entries_after(0).filter(|_| self.is_whole && hello.epoch.is_none()) {
                Some(log) => log,
                None => self.all_regions(hello.place),
            },
        };
        // Old entries lead up to the last one, regions are those of the world as it is.
        let number = if matches!(join, Join::Log { .. }) { self.epoch.number } else { self.applied };
        let welcome = Welcome {
            client,
            epoch: Epoch { number, ..self.epoch },
            own: self.own_numbers.last(client),
            reach: self.settings.reach.map(|reach| reach.allowed()),
            cost: [self.settings.cost.per_second, self.settings.cost.burst],
            join,
        };
        self.send(client, &ToClient::Welcome(welcome));
        for message in self.log.after(number).unwrap_or_default() {
            self.figures.order_bytes += message.len() as u64;
            self.outgoing.push((client, Lane::Order, message.to_vec()));
        }
        if let Some(session) = self.sessions.get_mut(&client) {
            jobs.into_iter().for_each(|job| session.bulk.push(job));
        }
        self.tell(ServerEvent::Joined(client));
    }

    /// The messages with all entries after a number, if they are there, and take fewer bytes than the regions that changed since.
    fn entries_after(&self, number: u64) -> Option<(Join, Vec<Job>)> {
        let messages = self.log.after(number)?;
        let bytes: usize = messages.iter().map(|message| message.len()).sum();
        // A few entries are sent in any case.
        if bytes > super::FULL_MESSAGE {
            let changed = self.changed.iter().filter(|(_, at)| **at > number);
            let changed: Vec<RegionPos> = changed.map(|(region, _)| *region).collect();
            if bytes > bytes_of(&self.terrain.snapshot(), &changed) {
                return None;
            }
        }
        let voids = self.voids.range(number.saturating_add(1)..).copied().collect();
        Some((Join::Log { voids }, messages.into_iter().map(Job::Message).collect()))
    }

    /// All regions, nearest first.
    fn all_regions(&self, place: IVec3) -> (Join, Vec<Job>) {
        let world = self.terrain.snapshot();
        let mut regions: Vec<RegionPos> = regions_of(&world).into_iter().collect();
        regions.sort_by_cached_key(|region| squared_distance(*region, place));
        let terms = Box::new(self.terms());
        let jobs = jobs(&world, self.applied, &regions);
        (Join::Regions { regions: regions.len() as u32, terms }, jobs)
    }

    /// The table of all regions. The world stays as it is for the client, until it goes on.
    fn compare(&mut self, client: ClientId) -> (Join, Vec<Job>) {
        let (world, number) = (self.terrain.snapshot(), self.applied);
        let regions = self.hashes_of(regions_of(&world));
        let table = ToClient::Table { number, regions }.to_bytes();
        if let Some(session) = self.sessions.get_mut(&client) {
            session.compared = Some((number, world));
        }
        (Join::Compare { terms: Box::new(self.terms()) }, vec![Job::Message(table.into())])
    }

    fn terms(&self) -> Terms {
        Terms {
            rules: self.terrain.rules().cloned(),
            loose: self.terrain.loose().copied(),
            next_field: self.terrain.world().next_field(),
        }
    }

    /// Notes that a client wants regions.
    pub(super) fn fetch(&mut self, client: ClientId, number: u64, regions: Vec<RegionPos>) {
        self.fetches.push(Fetch { client, number, regions });
    }

    /// How many regions wait to be answered.
    pub(super) fn fetches_of(&self, client: ClientId) -> usize {
        let own = self.fetches.iter().filter(|fetch| fetch.client == client);
        own.map(|fetch| fetch.regions.len() + 1).sum()
    }

    fn answer(&mut self, fetch: Fetch) {
        let Some(session) = self.sessions.get_mut(&fetch.client) else { return };
        let compared = session.compared.as_ref().filter(|(number, _)| *number == fetch.number);
        let is_repair = compared.is_none();
        let (number, world) = compared.cloned().unwrap_or_else(|| (self.applied, self.terrain.snapshot()));
        jobs(&world, number, &fetch.regions).into_iter().for_each(|job| session.bulk.push(job));
        if is_repair {
            self.figures.repairs += fetch.regions.len() as u64;
            self.tell(ServerEvent::Repaired(fetch.client, fetch.regions));
        }
    }

    /// Sends of the bulk lanes what may be sent.
    pub(super) fn send_bulk(&mut self, now: Duration) {
        for (client, session) in &mut self.sessions {
            while let Some(piece) = session.bulk.next_piece(now) {
                let message = ToClient::Piece(piece).to_bytes();
                self.figures.bulk_bytes += message.len() as u64;
                self.outgoing.push((*client, Lane::Bulk, message));
            }
        }
    }
}

fn jobs(world: &Arc<World>, number: u64, regions: &[RegionPos]) -> Vec<Job> {
    let left = (0..regions.len() as u32).rev();
    let job =
        |(pos, left): (&RegionPos, u32)| Job::Region { world: Arc::clone(world), number, pos: *pos, left };
    regions.iter().zip(left).map(job).collect()
}

/// About how many bytes regions take in messages, as some of them do.
fn bytes_of(world: &Arc<World>, regions: &[RegionPos]) -> usize {
    let step = regions.len().div_ceil(MEASURED).max(1);
    let some: Vec<RegionPos> = regions.iter().step_by(step).copied().collect();
    let bytes: usize = jobs(world, 0, &some).iter().map(|job| job.to_bytes().len()).sum();
    bytes * regions.len() / some.len().max(1)
}

/// From a place to the middle of a region.
fn squared_distance(region: RegionPos, place: IVec3) -> i128 {
    let way = region.samples().min.as_i64vec3() + i64::from(RegionPos::VOXELS / 2) - place.as_i64vec3();
    way.to_array().into_iter().map(|way| i128::from(way).pow(2)).sum()
}
