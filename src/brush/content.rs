//! The content of edits: images and prefabs, which may be megabytes, and which many edits share.
//!
//! Messages and journals write the name of each content in its place. Everything that does so walks the content of an
//! edit here, so an edit that holds several, such as a paste within a grid, holds several for all of them.

use std::sync::Arc;

use super::{Prefab, ShapeGrid};
use crate::ground::GreyImage;

/// A content of an edit.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Content<'a> {
    /// The image of a stamp.
    Image(&'a Arc<GreyImage>),
    /// The samples of a shape.
    Grid(&'a ShapeGrid),
    /// What is pasted.
    Prefab(&'a Arc<Prefab>),
}

/// The place of a content in an edit.
pub(crate) enum ContentMut<'a> {
    /// The image of a stamp.
    Image(&'a mut Arc<GreyImage>),
    /// The samples of a shape.
    Grid(&'a mut ShapeGrid),
    /// What is pasted.
    Prefab(&'a mut Arc<Prefab>),
}

impl ContentMut<'_> {
    /// Puts a placeholder there: an image of 2 x 2 black samples, a grid in such an image, or a prefab of a single
    /// sample of air.
    pub fn clear(&mut self) {
        match self {
            Self::Image(image) => **image = Arc::new(GreyImage::placeholder()),
            Self::Grid(grid) => **grid = ShapeGrid::in_image(Arc::new(GreyImage::placeholder())),
            Self::Prefab(prefab) => **prefab = Arc::new(Prefab::placeholder()),
        }
    }

    /// Whether a placeholder is there.
    pub fn is_clear(&self) -> bool {
        match self {
            Self::Image(image) => image.is_placeholder(),
            Self::Grid(grid) => grid.image().is_placeholder(),
            Self::Prefab(prefab) => prefab.is_placeholder(),
        }
    }
}
