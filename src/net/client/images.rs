//! Images, grids and prefabs that this client lacks: entries with them wait until the server has sent them.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::super::ContentId;
use super::super::message::{Lane, MAX_IMAGES, ToServer};
use super::Client;
use crate::brush::Prefab;
use crate::ground::GreyImage;

/// Messages that wait for images.
#[derive(Default)]
pub(super) struct Images {
    parked: Vec<(Lane, Vec<u8>)>,
    /// Images that were requested and have not arrived.
    awaited: BTreeSet<ContentId>,
}

impl Images {
    /// Forgets everything.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Stores a message until its images arrive; returns the messages that request them.
    pub fn park(&mut self, lane: Lane, bytes: Vec<u8>, missing: BTreeSet<ContentId>) -> Vec<Vec<u8>> {
        self.parked.push((lane, bytes));
        let new: Vec<ContentId> = missing.into_iter().filter(|id| self.awaited.insert(*id)).collect();
        new.chunks(MAX_IMAGES).map(|some| ToServer::Images { images: some.to_vec() }.to_bytes()).collect()
    }
}

impl Client {
    /// Adds an image: messages that waited for it are read again.
    pub(super) fn take_image(&mut self, image: Arc<GreyImage>) {
        if !self.images.awaited.remove(&ContentId::of(&image)) {
            self.figures.malformed += 1;
            return;
        }
        self.contents.add(image);
        self.read_parked();
    }

    /// Adds a prefab: messages that waited for it are read again.
    pub(super) fn take_prefab(&mut self, prefab: Arc<Prefab>) {
        let is_awaited = self.images.awaited.remove(&ContentId::of_prefab(&prefab));
        if !is_awaited || self.contents.add_prefab(prefab).is_none() {
            self.figures.malformed += 1;
            return;
        }
        self.read_parked();
    }

    fn read_parked(&mut self) {
        for (lane, bytes) in std::mem::take(&mut self.images.parked) {
            self.read(lane, bytes);
        }
    }
}
