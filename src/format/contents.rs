//! A table of the images, grids and prefabs that edits hold, by name. Messages and journals write names in their place.

#[cfg(feature = "store")]
use std::collections::BTreeSet;
use std::sync::Arc;

use rustc_hash::FxHashMap;
use xxhash_rust::xxh3::Xxh3Default;

use super::bytes::{Reader, put_number};
use super::error::FormatError;
use super::ids::ContentId;
#[cfg(feature = "store")]
use super::ids::{Kind, WorldId};
use super::prefab::packed_prefab;
#[cfg(feature = "store")]
use super::{bytes::put_bytes, frame};
use crate::brush::{BrushError, Content, ContentMut, Edit, Prefab, ShapeGrid};
use crate::ground::GreyImage;

/// The maximum size in bytes of a prefab's file that is sent.
const MAX_PREFAB: usize = 4 << 20;

impl ContentId {
    /// The name of an image: a hash of its size and samples. It is computed once for each image.
    pub fn of(image: &GreyImage) -> Self {
        Self(image.hash_with(|image| {
            let mut hash = Xxh3Default::new();
            hash.update(&image.width().to_le_bytes());
            hash.update(&image.height().to_le_bytes());
            let samples = image.samples().chunks(256);
            samples.for_each(|some| {
                let bytes: Vec<u8> = some.iter().flat_map(|sample| sample.to_le_bytes()).collect();
                hash.update(&bytes);
            });
            hash.digest()
        }))
    }

    /// The name of a prefab: its hash.
    pub fn of_prefab(prefab: &Prefab) -> Self {
        Self(prefab.hash())
    }

    /// The name of a content.
    pub(crate) fn of_content(content: Content) -> Self {
        match content {
            Content::Image(image) => Self::of(image),
            Content::Grid(grid) => Self::of(grid.image()),
            Content::Prefab(prefab) => Self::of_prefab(prefab),
        }
    }
}

/// The maximum size in bytes of an image that is sent or saved: no stamp has a larger one, and no grid, even with
/// materials.
pub(crate) const MAX_IMAGE: usize = (6 << 20) + (64 << 10);

/// The key of every image's frame.
#[cfg(feature = "store")]
const IMAGE: &[u8] = b"image";

/// An edit whose names were looked up in a table.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Resolved {
    /// The edit; with placeholders if any content is missing, or a limit is broken.
    pub edit: Edit,
    /// The names of content that the table lacks.
    pub missing: Vec<ContentId>,
    /// Why the edit is beyond the limits of edits with this content.
    pub refused: Option<BrushError>,
}

impl Resolved {
    /// The edit, if it is whole and within every limit.
    pub fn whole(self) -> Result<Edit, FormatError> {
        match (self.missing.first(), self.refused) {
            (Some(name), _) => Err(FormatError::ContentMissing(*name)),
            (None, Some(error)) => Err(FormatError::Edit(error.to_string())),
            (None, None) => Ok(self.edit),
        }
    }
}

/// The images, grids and prefabs that edits may hold. A client sends no edits with others, and a server refuses them.
/// Clients that lack one of the server's get it at its first use, so only players that use them need their own.
#[derive(Clone, Debug, Default)]
pub struct ContentTable {
    images: FxHashMap<ContentId, Arc<GreyImage>>,
    /// Images that hold a grid.
    grids: FxHashMap<ContentId, ShapeGrid>,
    prefabs: FxHashMap<ContentId, Arc<Prefab>>,
}

impl ContentTable {
    /// Adds an image.
    pub fn add(&mut self, image: impl Into<Arc<GreyImage>>) -> ContentId {
        let image = image.into();
        let id = ContentId::of(&image);
        if self.images.insert(id, Arc::clone(&image)).is_none() {
            let grid = ShapeGrid::in_image(image);
            self.grids.extend(grid.is_grid().then_some((id, grid)));
        }
        id
    }

    /// Adds a prefab; `None` for one that is too large to be sent: its [file](Prefab::to_bytes) takes more than
    /// 4 MiB.
    pub fn add_prefab(&mut self, prefab: impl Into<Arc<Prefab>>) -> Option<ContentId> {
        let prefab = prefab.into();
        (packed_prefab(&prefab).len() <= MAX_PREFAB).then(|| self.insert_prefab(prefab))
    }

    fn insert_prefab(&mut self, prefab: Arc<Prefab>) -> ContentId {
        let id = ContentId::of_prefab(&prefab);
        self.prefabs.insert(id, prefab);
        id
    }

    /// Adds all images and prefabs of others.
    pub fn add_all(&mut self, others: &Self) {
        self.images.extend(others.images.iter().map(|(id, image)| (*id, Arc::clone(image))));
        self.grids.extend(others.grids.iter().map(|(id, grid)| (*id, grid.clone())));
        self.prefabs.extend(others.prefabs.iter().map(|(id, prefab)| (*id, Arc::clone(prefab))));
    }

    /// The image of this name.
    pub fn get(&self, id: ContentId) -> Option<&Arc<GreyImage>> {
        self.images.get(&id)
    }

    /// The prefab of this name.
    pub fn prefab(&self, id: ContentId) -> Option<&Arc<Prefab>> {
        self.prefabs.get(&id)
    }

    /// Whether the edit can be sent: every content that it has is in the list.
    pub fn can_send(&self, edit: &Edit) -> bool {
        edit.contents().all(|content| match content {
            Content::Image(image) => self.images.contains_key(&ContentId::of(image)),
            Content::Grid(grid) => self.grids.contains_key(&ContentId::of(grid.image())),
            Content::Prefab(prefab) => self.prefabs.contains_key(&ContentId::of_prefab(prefab)),
        })
    }

    /// Adds a content of an edit.
    pub(crate) fn add_content(&mut self, content: Content) {
        match content {
            Content::Image(image) => {
                self.add(Arc::clone(image));
            }
            // Its samples were looked at already.
            Content::Grid(grid) => {
                let name = ContentId::of(grid.image());
                self.grids.insert(name, grid.clone());
                self.images.insert(name, Arc::clone(grid.image()));
            }
            Content::Prefab(prefab) => {
                self.insert_prefab(Arc::clone(prefab));
            }
        }
    }

    /// The names in it, in order.
    #[cfg(feature = "store")]
    pub(crate) fn names(&self) -> BTreeSet<ContentId> {
        self.images.keys().chain(self.prefabs.keys()).copied().collect()
    }

    /// Whether it has content of this name.
    #[cfg(any(feature = "net", feature = "store"))]
    pub(crate) fn has(&self, name: ContentId) -> bool {
        self.images.contains_key(&name) || self.prefabs.contains_key(&name)
    }

    /// Adds what [`content_file`] wrote. Returns `false` if the bytes are not what this name stands for.
    #[cfg(feature = "store")]
    pub(crate) fn add_file(&mut self, name: ContentId, bytes: &[u8]) -> bool {
        let (mut reader, mut found) = (Reader(bytes), Self::default());
        // Bytes after the last part that can be read belong to nothing.
        while let Ok(part) = reader.bytes() {
            match frame::open(part, Kind::Image, WorldId::default(), IMAGE, MAX_IMAGE) {
                Ok(opened) => {
                    let image = read_image(&mut Reader(&opened.payload));
                    image
                        .into_iter()
                        .for_each(|image| drop(found.images.insert(ContentId::of(&image), image)));
                }
                Err(_) => Prefab::from_bytes(part).into_iter().for_each(|prefab| {
                    found.insert_prefab(Arc::new(prefab));
                }),
            }
        }
        let (image, prefab) = (found.images.remove(&name), found.prefabs.remove(&name));
        let is_there = image.is_some() || prefab.is_some();
        image.into_iter().for_each(|image| {
            self.add(image);
        });
        prefab.into_iter().for_each(|prefab| {
            self.insert_prefab(prefab);
        });
        is_there
    }

    /// Puts the content of a name in its place. `Ok(false)` if the table lacks it.
    fn put(&self, name: ContentId, place: ContentMut) -> Result<bool, FormatError> {
        let found = match place {
            ContentMut::Image(own) => self.images.get(&name).map(|image| *own = Arc::clone(image)),
            // An image that holds no grid will never hold one.
            ContentMut::Grid(_) if self.images.contains_key(&name) && !self.grids.contains_key(&name) => {
                return Err(FormatError::Edit(BrushError::NoGrid.to_string()));
            }
            ContentMut::Grid(own) => self.grids.get(&name).map(|grid| *own = grid.clone()),
            ContentMut::Prefab(own) => self.prefabs.get(&name).map(|prefab| *own = Arc::clone(prefab)),
        };
        Ok(found.is_some())
    }

    /// Replaces the placeholders of an edit by the content of their names, and checks the edit again.
    pub(crate) fn resolve(&self, named: Edit, names: &[ContentId]) -> Result<Resolved, FormatError> {
        let (mut edit, mut missing) = (named.clone(), Vec::new());
        for (place, &name) in edit.contents_mut().zip(names) {
            if !place.is_clear() {
                return Err(FormatError::Invalid("edit: content next to its name"));
            }
            if !self.put(name, place)? {
                missing.push(name);
            }
        }
        let refused = if missing.is_empty() { edit.check().err() } else { None };
        let edit = if refused.is_some() || !missing.is_empty() { named } else { edit };
        Ok(Resolved { edit, missing, refused })
    }
}

/// The names of an edit's content, and the edit with placeholders.
pub(crate) fn named(edit: &Edit) -> (Vec<ContentId>, Edit) {
    let names = edit.contents().map(ContentId::of_content).collect();
    let mut edit = edit.clone();
    edit.contents_mut().for_each(|mut place| place.clear());
    (names, edit)
}

/// The bytes of a file with the content of a name.
#[cfg(feature = "store")]
pub(crate) fn content_file(contents: &ContentTable, name: ContentId) -> Vec<u8> {
    let mut bytes = Vec::new();
    if let Some(image) = contents.get(name) {
        let mut payload = Vec::new();
        put_image(&mut payload, image);
        put_bytes(&mut bytes, &frame::seal(Kind::Image, WorldId::default(), IMAGE, 0, 0, &payload));
    }
    if let Some(prefab) = contents.prefab(name) {
        put_bytes(&mut bytes, packed_prefab(prefab));
    }
    bytes
}

/// Appends an image.
pub(crate) fn put_image(to: &mut Vec<u8>, image: &GreyImage) {
    put_number(to, image.width().into());
    put_number(to, image.height().into());
    image.samples().iter().for_each(|sample| to.extend_from_slice(&sample.to_le_bytes()));
}

/// Reads what [`put_image`] appended, up to the end.
pub(crate) fn read_image(reader: &mut Reader) -> Result<Arc<GreyImage>, FormatError> {
    let invalid = FormatError::Invalid("image");
    let mut side = || u32::try_from(reader.number()?).map_err(|_| FormatError::Invalid("number"));
    let [width, height] = [side()?, side()?];
    let (samples, rest) = std::mem::take(&mut reader.0).as_chunks();
    if !rest.is_empty() {
        return Err(invalid);
    }
    let samples = samples.iter().map(|sample| u16::from_le_bytes(*sample)).collect();
    GreyImage::from_long_samples(width, height, samples).map(Arc::new).map_err(|_| invalid)
}
