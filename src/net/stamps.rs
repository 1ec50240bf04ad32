//! Images of stamps: messages name them, and a client that lacks one gets it from the server.

use std::sync::Arc;

use rustc_hash::FxHashMap;
use xxhash_rust::xxh3::Xxh3Default;

use crate::brush::Edit;
use crate::ground::GreyImage;

/// Identifies an image by its content.
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
}

/// The images that stamps may have. A client sends no edits with other images, and a server refuses them. Clients that
/// lack an image of the server get it at its first use, so only players that use stamps need their own images.
#[derive(Clone, Debug, Default)]
pub struct Stamps(FxHashMap<StampId, Arc<GreyImage>>);

impl Stamps {
    /// Adds an image.
    pub fn add(&mut self, image: impl Into<Arc<GreyImage>>) -> StampId {
        let image = image.into();
        let id = StampId::of(&image);
        self.0.insert(id, image);
        id
    }

    /// Adds all images of others.
    pub fn add_all(&mut self, others: &Self) {
        self.0.extend(others.0.iter().map(|(id, image)| (*id, Arc::clone(image))));
    }

    /// The image of this name.
    pub fn get(&self, id: StampId) -> Option<&Arc<GreyImage>> {
        self.0.get(&id)
    }

    /// Whether the edit can be sent: it is no stamp, or its image is in the list.
    pub fn can_send(&self, edit: &Edit) -> bool {
        edit.stamp_image().is_none_or(|image| self.0.contains_key(&StampId::of(image)))
    }
}
