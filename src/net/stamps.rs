//! Images of stamps, and prefabs: messages name them, and a client that lacks one gets it from the server.

use std::sync::Arc;

use rustc_hash::FxHashMap;
use xxhash_rust::xxh3::Xxh3Default;

use crate::brush::{Edit, Prefab};
use crate::format::write_prefab;
use crate::ground::GreyImage;

/// Most bytes of a prefab's file that is sent.
const MAX_PREFAB: usize = 4 << 20;

/// Identifies an image or a prefab by its content.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct StampId(pub u64);

impl StampId {
    /// The name of an image: a hash of its size and samples.
    pub fn of(image: &GreyImage) -> Self {
        let mut hash = Xxh3Default::new();
        hash.update(&image.width().to_le_bytes());
        hash.update(&image.height().to_le_bytes());
        let samples = image.samples().chunks(256);
        samples.for_each(|some| {
            let bytes: Vec<u8> = some.iter().flat_map(|sample| sample.to_le_bytes()).collect();
            hash.update(&bytes);
        });
        Self(hash.digest())
    }

    /// The name of a prefab: its hash.
    pub fn of_prefab(prefab: &Prefab) -> Self {
        Self(prefab.hash())
    }
}

/// The images that stamps may have, and the prefabs that may be pasted. A client sends no edits with others, and a server
/// refuses them. Clients that lack one of the server's get it at its first use, so only players that use them need
/// their own.
#[derive(Clone, Debug, Default)]
pub struct Stamps {
    images: FxHashMap<StampId, Arc<GreyImage>>,
    prefabs: FxHashMap<StampId, Arc<Prefab>>,
}

impl Stamps {
    /// Adds an image.
    pub fn add(&mut self, image: impl Into<Arc<GreyImage>>) -> StampId {
        let image = image.into();
        let id = StampId::of(&image);
        self.images.insert(id, image);
        id
    }

    /// Adds a prefab; `None` for one that is too large to be sent: its [file](write_prefab) takes more than 4 MiB.
    pub fn add_prefab(&mut self, prefab: impl Into<Arc<Prefab>>) -> Option<StampId> {
        let prefab = prefab.into();
        if write_prefab(&prefab).len() > MAX_PREFAB {
            return None;
        }
        let id = StampId::of_prefab(&prefab);
        self.prefabs.insert(id, prefab);
        Some(id)
    }

    /// Adds all images and prefabs of others.
    pub fn add_all(&mut self, others: &Self) {
        self.images.extend(others.images.iter().map(|(id, image)| (*id, Arc::clone(image))));
        self.prefabs.extend(others.prefabs.iter().map(|(id, prefab)| (*id, Arc::clone(prefab))));
    }

    /// The image of this name.
    pub fn get(&self, id: StampId) -> Option<&Arc<GreyImage>> {
        self.images.get(&id)
    }

    /// The prefab of this name.
    pub fn prefab(&self, id: StampId) -> Option<&Arc<Prefab>> {
        self.prefabs.get(&id)
    }

    /// Whether the edit can be sent: its image or prefab, if it has one, is in the list.
    pub fn can_send(&self, edit: &Edit) -> bool {
        edit.stamp_image().is_none_or(|image| self.images.contains_key(&StampId::of(image)))
            && edit.prefab().is_none_or(|prefab| self.prefabs.contains_key(&StampId::of_prefab(prefab)))
    }
}
