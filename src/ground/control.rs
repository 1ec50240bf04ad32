//! Material control: decides the materials of columns.

use std::sync::Arc;

use super::error::GroundError;
use super::grey_image::GreyImage;
use super::material::{ColumnMaterial, MaterialId};
use super::material_map::MaterialMap;
use super::rules::MaterialRule;
use crate::lattice::hash::hash_words;

/// Decides the materials of every column. Images are stretched over the world, their first sample at column (0, 0),
/// their last at the far corner. None of the materials may be [`MaterialId::GROUND`], which stands for the ground's own
/// materials.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum MaterialControl {
    /// One material for every column.
    Uniform(ColumnMaterial),
    /// By height and slope: `base` everywhere, and over it the rules like coats of paint, the first on top. A column
    /// shows as overlay the rule that covers most of it, blended by how much all rules together cover.
    Rules {
        /// The material below all rules.
        base: MaterialId,
        /// The overlays, topmost first.
        rules: Vec<MaterialRule>,
    },
    /// By a mask: black shows the base, white the overlay, samples are blended linearly.
    Blend {
        /// The mask.
        mask: GreyImage,
        /// The material of black, and of the deep.
        base: MaterialId,
        /// The material of white.
        overlay: MaterialId,
    },
    /// By a map of ids: each column's overlay is the id in the nearest sample, and covers the base fully. An id is the
    /// grey level of an 8-bit image, or the high byte of a 16-bit one; 255 means no overlay.
    Ids {
        /// The map.
        map: GreyImage,
        /// The material of the deep.
        base: MaterialId,
    },
    /// By a material map: each column has the materials of the nearest sample.
    Map(Arc<MaterialMap>),
}

impl Default for MaterialControl {
    /// Material 0 everywhere.
    fn default() -> Self {
        Self::Uniform(ColumnMaterial::default())
    }
}

impl MaterialControl {
    /// Checks that ground can be made of these materials.
    pub(super) fn check(&self) -> Result<(), GroundError> {
        let check_base = |base: &MaterialId| base.check("the base material");
        match self {
            Self::Uniform(ColumnMaterial { base, overlay, .. }) | Self::Blend { base, overlay, .. } => {
                check_base(base)?;
                overlay.check("the overlay material")
            }
            Self::Rules { base, rules } => {
                check_base(base)?;
                rules.iter().enumerate().try_for_each(|(index, rule)| rule.check(index))
            }
            Self::Ids { map, base } => {
                check_base(base)?;
                map.samples().iter().try_for_each(|sample| id(*sample).check("an id of the material map"))
            }
            Self::Map(map) => map.check(),
        }
    }
}

impl MaterialControl {
    /// Hash of all of it, for grounds that do not hash what it makes.
    pub(super) fn hash(&self) -> u64 {
        let of_image = |image: &GreyImage| {
            let size = [image.width(), image.height()].map(u64::from);
            hash_words(size.into_iter().chain(image.samples().iter().map(|&sample| u64::from(sample))))
        };
        match self {
            Self::Uniform(material) => hash_words([1, material.word()]),
            Self::Rules { base, rules } => {
                let words = rules.iter().flat_map(|rule| {
                    let numbers = [rule.height.0, rule.height.1, rule.height_fade].into_iter().chain([
                        rule.slope.0,
                        rule.slope.1,
                        rule.slope_fade,
                    ]);
                    [u64::from(rule.overlay.0)].into_iter().chain(numbers.map(f64::to_bits))
                });
                hash_words([2, base.0.into()].into_iter().chain(words))
            }
            Self::Blend { mask, base, overlay } => {
                hash_words([3, base.0.into(), overlay.0.into(), of_image(mask)])
            }
            Self::Ids { map, base } => hash_words([4, base.0.into(), of_image(map)]),
            Self::Map(map) => hash_words([5, map.hash()]),
        }
    }

    /// Bytes of memory that it takes.
    pub(super) fn bytes(&self) -> usize {
        let own = match self {
            Self::Uniform(_) => 0,
            Self::Rules { rules, .. } => size_of_val(rules.as_slice()),
            Self::Blend { mask: image, .. } | Self::Ids { map: image, .. } => size_of_val(image.samples()),
            Self::Map(map) => map.bytes(),
        };
        size_of::<Self>() + own
    }
}

/// The id in a sample of a map.
pub(super) fn id(sample: u16) -> MaterialId {
    let [id, _] = sample.to_be_bytes();
    MaterialId(id)
}
