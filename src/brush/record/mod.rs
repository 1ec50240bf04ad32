//! Brushes as one flat JSON object each, for scripts and exports.
//!
//! ```json
//! {"shape":"sphere","center":[8,0,8],"radius":4,"op":"dig"}
//! {"shape":"box","center":[8,0,8],"half":[2,3,2],"rotation":[0,0,0,1],"op":"add","material":3,"tag":7}
//! {"shape":"cone","base":[0,0,0],"axis":[0,9,0],"radius":4,"op":"paint","material":1,
//!  "roughness":{"amplitude":1,"scale":6,"seed":5}}
//! {"shape":"sphere","center":[8,0,8],"radius":6,"op":"flatten","point":[8,0,8],"normal":[0,1,0.2],"falloff":2}
//! {"shape":"sphere","center":[8,0,8],"radius":6,"op":"smooth","strength":0.5}
//! ```

mod names;
mod read;
mod stamp;
#[cfg(test)]
mod tests;
mod write;

pub use names::{OperationName, ShapeName};
pub use read::RecordError;
pub use stamp::{ImageRecord, StampRecord};

use serde::{Deserialize, Serialize};

use super::Roughness;
use crate::ground::MaterialId;

/// A brush as one flat object. Lengths are in voxels of terrain space.
///
/// | `shape` | its fields |
/// | --- | --- |
/// | `sphere` | `center`, `radius` |
/// | `box` | `center`, `half`, perhaps `rotation` (x, y, z, w) |
/// | `cylinder`, `cone` | `base`, `axis`, `radius` |
/// | `capsule` | `from`, `to`, `radius` |
///
/// | `op` | its fields |
/// | --- | --- |
/// | `dig` | |
/// | `add`, `paint` | `material` |
/// | `smooth`, `sharpen` | |
/// | `flatten` | `point`, `normal` |
/// | `level` | `height` |
/// | `raise`, `lower` | `amount` |
/// | `stamp` | `stamp`: `image` (`width`, `height`, `samples` from 0 to 65535), `center`, `size`, `height`, perhaps `rotation` |
/// | `terrace` | `step`, perhaps `height` (of a tread, else 0) |
///
/// All but the first three may have `strength`, `falloff` and `material`, which are those of a [`Blend`](super::Blend);
/// `roughness`, `power`, `tag` and `stroke` may be left out. Deserialising refuses fields of any other name, and turning the record
/// into a [`Brush`](super::Brush) refuses those that its shape and operation do not have. The numbers themselves are
/// checked by [`Edit::quantize`](super::Edit::quantize).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the table above says which field is for what")]
pub struct BrushRecord {
    pub shape: ShapeName,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub center: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f32; 4]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f32>,
    pub op: OperationName,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<MaterialId>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roughness: Option<Roughness>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tag: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stroke: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amount: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stamp: Option<StampRecord>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strength: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub falloff: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power: Option<u8>,
}
