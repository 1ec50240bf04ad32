//! Pastes: where a prefab goes, and how it is turned.

use std::sync::Arc;

use glam::{I64Vec3, IVec3, Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::prefab::{PrefabSample, shared};
use super::quantize::{
    check_point, check_turn, in_range, matrix, point, restored_point, restored_turn, turn, voxels,
};
use super::{BrushError, Prefab, Shape, is_default};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{Column, LatticeBox, ONE};

/// The minimum and maximum scale.
const SCALE: (f32, f32) = (0.125, 8.0);

/// A [`Prefab`] at a place: its anchor is placed at [`at`](Self::at).
///
/// It is exact where the anchor is placed on a lattice point, the scale is 1, and the rotation is one of the 24 of
/// quarter turns: then every sample is one of the prefab's, mirrored or not. Otherwise densities are interpolated
/// between the eight nearest samples, in integers, and materials are those of the nearest solid one.
///
/// All samples of the prefab's box are pasted: ground and air that were never edited too, unless they are already the
/// same in the new place. With [`edited_only`](Self::edited_only), only samples that were edited are pasted, and the
/// ground around them stays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Paste {
    /// The prefab that is pasted.
    #[serde(with = "shared")]
    pub prefab: Arc<Prefab>,
    /// The place of its anchor.
    pub at: Vec3,
    /// From the prefab's axes to those of the terrain; of length 1.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rotation: Quat,
    /// Whether it is mirrored along its own x axis, before it is rotated.
    #[serde(default, skip_serializing_if = "is_default")]
    pub mirror: bool,
    /// The size of its voxels, 1/8 to 8. For a brush in metres, the terrain's voxel size.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f32,
    /// Whether only samples that were edited are pasted.
    #[serde(default, skip_serializing_if = "is_default")]
    pub edited_only: bool,
}

fn one() -> f32 {
    1.0
}

fn is_one(scale: &f32) -> bool {
    *scale == 1.0
}

/// The rotation by this many quarter turns about the axis x (0), y (1) or z (2), anticlockwise where the axis points
/// at the viewer.
fn quarter_turns(axis: Vec3, turns: i32) -> Quat {
    let half = [(0.0, 1.0), (std::f32::consts::FRAC_1_SQRT_2, std::f32::consts::FRAC_1_SQRT_2), (1.0, 0.0)];
    let (sine, cosine) = match turns.rem_euclid(4) {
        3 => (-half[1].0, half[1].1),
        turns => half[turns as usize],
    };
    let along = axis * sine;
    Quat::from_xyzw(along.x, along.y, along.z, cosine)
}

impl Paste {
    /// A prefab with its anchor at a place, as it was copied.
    pub fn new(prefab: impl Into<Arc<Prefab>>, at: Vec3) -> Self {
        let prefab = prefab.into();
        Self { prefab, at, rotation: Quat::IDENTITY, mirror: false, scale: 1.0, edited_only: false }
    }

    /// Rotates it further, about its anchor.
    #[must_use]
    pub fn rotated(self, rotation: Quat) -> Self {
        Self { rotation: rotation * self.rotation, ..self }
    }

    /// Rotates it further by quarter turns about the x axis, from y to z.
    #[must_use]
    pub fn turned_about_x(self, turns: i32) -> Self {
        self.rotated(quarter_turns(Vec3::X, turns))
    }

    /// Rotates it further by quarter turns about the y axis, from z to x.
    #[must_use]
    pub fn turned_about_y(self, turns: i32) -> Self {
        self.rotated(quarter_turns(Vec3::Y, turns))
    }

    /// Rotates it further by quarter turns about the z axis, from x to y.
    #[must_use]
    pub fn turned_about_z(self, turns: i32) -> Self {
        self.rotated(quarter_turns(Vec3::Z, turns))
    }

    /// Mirrors it along its own x axis, before it is rotated.
    #[must_use]
    pub fn mirrored(self) -> Self {
        Self { mirror: !self.mirror, ..self }
    }

    /// Pastes only samples that were edited where it was copied.
    #[must_use]
    pub fn edited_only(self) -> Self {
        Self { edited_only: true, ..self }
    }

    /// Moves it up or down, by whole voxels, so that its anchor lies as high above the ground as where it was copied.
    /// For pastes in voxels of the terrain; `ground` is the pristine ground.
    #[must_use]
    pub fn onto_ground(self, ground: &Ground) -> Self {
        let column = Column::new(self.at.x.round() as i32, self.at.z.round() as i32);
        let y = ground_level(ground, column).saturating_add(self.prefab.above_ground());
        Self { at: self.at.with_y(y as f32), ..self }
    }

    /// The box around all of its samples.
    pub fn shape(&self) -> Shape {
        let flip = if self.mirror { Vec3::new(-1.0, 1.0, 1.0) } else { Vec3::ONE };
        let middle = (self.prefab.size() - 1).as_vec3() / 2.0;
        let from_anchor = (middle - self.prefab.anchor().as_vec3()) * flip * self.scale;
        // Beyond its outer samples, which lie inside then: by a quarter of a voxel, whichever unit its places have.
        let half = middle * self.scale + 0.25 * self.scale.max(1.0);
        Shape::turned_cuboid(self.at + self.turn() * from_anchor, half, self.rotation)
    }

    /// The rotation; exactly by quarter turns where it is one of these.
    fn turn(&self) -> glam::Mat3 {
        let exact = |part: f32| if (part - part.round()).abs() < 1e-5 { part.round() } else { part };
        let of = glam::Mat3::from_quat(self.rotation);
        glam::Mat3::from_cols_array(&of.to_cols_array().map(exact))
    }
}

/// The lowest lattice point above the ground's surface.
pub(crate) fn ground_level(ground: &Ground, column: Column) -> i32 {
    crate::lattice::ceil(ground.height(column))
}

/// The rotation, exactly by quarter turns if it is within 1/1000 of these.
fn quarter_turn(rotation: [i16; 4]) -> [i16; 4] {
    let parts = rotation.map(i32::from);
    let most = parts.into_iter().map(i32::abs).max().unwrap_or(0);
    let is_near = |part: i32| part.abs() * 1000 < most || (part.abs() - most).abs() * 1000 < most;
    let is_part = |part: i32| part.abs() * 2 > most;
    let length = match parts.into_iter().filter(|&part| is_part(part)).count() {
        1 => 32767,
        2 => 23170,
        4 => 16384,
        _ => return rotation,
    };
    match parts.into_iter().all(is_near) {
        true => parts.map(|part| if is_part(part) { part.signum() as i16 * length } else { 0 }),
        false => rotation,
    }
}

/// A [`Paste`] in integers.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct QuantizedPaste {
    at: [i32; 3],
    rotation: [i16; 4],
    /// In 1/256.
    scale: i32,
    mirror: bool,
    edited_only: bool,
    #[serde(with = "shared")]
    prefab: Arc<Prefab>,
}

/// The farthest from the anchor, in 1/256 voxel, that any sample of a prefab lies.
const FARTHEST: i64 = 1 << 24;

impl QuantizedPaste {
    pub fn quantize(paste: &Paste) -> Result<Self, BrushError> {
        let own = Self {
            at: point("paste at", paste.at)?,
            rotation: quarter_turn(turn(paste.rotation)?),
            scale: in_range("paste scale", paste.scale, SCALE.0, SCALE.1)?,
            mirror: paste.mirror,
            edited_only: paste.edited_only,
            prefab: Arc::clone(&paste.prefab),
        };
        Ok(own)
    }

    /// Checks every limit. Deserialising has checked the prefab.
    pub fn check(&self) -> Result<(), BrushError> {
        check_point("paste at", self.at)?;
        check_turn(self.rotation)?;
        in_range("paste scale", voxels(self.scale), SCALE.0, SCALE.1).map(drop)
    }

    /// The brush's own numbers again.
    pub fn paste(&self) -> Paste {
        Paste {
            prefab: Arc::clone(&self.prefab),
            at: restored_point(self.at),
            rotation: restored_turn(self.rotation),
            mirror: self.mirror,
            scale: voxels(self.scale),
            edited_only: self.edited_only,
        }
    }

    pub fn prefab(&self) -> &Arc<Prefab> {
        &self.prefab
    }

    /// A box around every lattice point that it gives a sample, at most two voxels too wide on each side.
    pub fn bounds(&self) -> LatticeBox {
        let (rows, squared) = matrix(self.rotation);
        let (anchor, size) = (self.prefab.anchor().as_i64vec3(), self.prefab.size().as_i64vec3());
        let (mut low, mut high) = (-anchor, size - 1 - anchor);
        if self.mirror {
            (low.x, high.x) = (-high.x, -low.x);
        }
        let (low, high) = (low.to_array(), high.to_array());
        let ends = |axis: usize, toward_high: bool| {
            let part = |i: usize| if (rows[axis][i] > 0) == toward_high { high[i] } else { low[i] };
            let along: i64 = (0..3).map(|i| rows[axis][i] * part(i)).sum();
            i64::from(self.at[axis]) + along * i64::from(self.scale) / squared
        };
        // A voxel more for the rounding of places.
        let voxel = |end: i64, more: i64| (end.div_euclid(i64::from(ONE)) + more) as i32;
        LatticeBox {
            min: IVec3::from_array([0, 1, 2].map(|axis| voxel(ends(axis, false), -1))),
            max: IVec3::from_array([0, 1, 2].map(|axis| voxel(ends(axis, true), 2))),
        }
    }

    pub fn prefab_mut(&mut self) -> &mut Arc<Prefab> {
        &mut self.prefab
    }

    /// Ready to be evaluated.
    pub fn source(&self) -> PasteSource<'_> {
        let (rows, squared) = matrix(self.rotation);
        let is_exact = self.scale == ONE && rows.iter().flatten().all(|part| part % squared == 0);
        match is_exact {
            true => PasteSource {
                paste: self,
                rows: rows.map(|row| row.map(|part| part / squared)),
                divisor: None,
            },
            false => PasteSource { paste: self, rows, divisor: Some(squared * i64::from(self.scale)) },
        }
    }
}

/// The samples that a paste gives to lattice points.
pub(crate) struct PasteSource<'a> {
    paste: &'a QuantizedPaste,
    /// Rows of the rotation's matrix.
    rows: [[i64; 3]; 3],
    /// What to divide their products by, times 256; `None` by quarter turns, whose products are places.
    divisor: Option<i64>,
}

impl PasteSource<'_> {
    /// The place of a lattice point in the prefab, from its lowest sample, in 1/256 voxel. `None` outside its box.
    fn place(&self, at: IVec3) -> Option<I64Vec3> {
        let from = at.as_i64vec3() * i64::from(ONE) - IVec3::from_array(self.paste.at).as_i64vec3();
        if from.abs().max_element() > FARTHEST {
            return None;
        }
        let rows = &self.rows;
        let [x, y, z] = [0, 1, 2].map(|i| {
            let along = rows[0][i] * from.x + rows[1][i] * from.y + rows[2][i] * from.z;
            let Some(divisor) = self.divisor else { return along };
            // Up to 2^56 times 2^8, which only just does not fit.
            let (along, divisor) = (i128::from(along) * i128::from(ONE), i128::from(divisor));
            (along + divisor / 2).div_euclid(divisor) as i64
        });
        let (anchor, size) = (self.paste.prefab.anchor(), self.paste.prefab.size());
        let x = if self.paste.mirror { -x } else { x };
        let place = I64Vec3::new(x, y, z) + anchor.as_i64vec3() * i64::from(ONE);
        let last = (size - 1).as_i64vec3() * i64::from(ONE);
        let is_inside = place.cmpge(I64Vec3::ZERO).all() && place.cmple(last).all();
        is_inside.then_some(place)
    }

    /// The sample that it gives to a lattice point, if any.
    pub fn sample(&self, at: IVec3) -> Option<PrefabSample> {
        let place = self.place(at)?;
        let prefab = &*self.paste.prefab;
        // Places are not negative.
        let one = I64Vec3::splat(i64::from(ONE));
        let nearest = prefab.sample(((place + one / 2) / one).as_ivec3());
        if self.paste.edited_only && !nearest.is_edited {
            return None;
        }
        let (low, part) = ((place / one).as_ivec3(), place % one);
        if part == I64Vec3::ZERO && self.paste.scale == ONE {
            return Some(nearest);
        }
        let (mut sum, mut strongest) = (0, None);
        for corner in 0..8 {
            let step = IVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            let along = |step: i32, part: i64| if step == 1 { part } else { i64::from(ONE) - part };
            let weight = along(step.x, part.x) * along(step.y, part.y) * along(step.z, part.z);
            let sample = prefab.sample(low + step);
            sum += weight * i64::from(sample.density);
            let is_stronger = strongest.is_none_or(|(most, _)| weight > most);
            if weight > 0 && sample.density < 0 && is_stronger {
                strongest = Some((weight, sample));
            }
        }
        // Weights add up to 2^24, and the scale is in 1/256.
        let density = (sum * i64::from(self.paste.scale) + (1 << 31)) >> 32;
        let density = density.clamp(-i64::from(i16::MAX), i64::from(i16::MAX)) as i16;
        let solid = strongest.map_or(nearest, |(_, sample)| sample);
        let is_edited = nearest.is_edited;
        match density < 0 && solid.density < 0 {
            true => {
                let has_stored_material = is_edited && solid.has_stored_material;
                Some(PrefabSample { density, is_edited, has_stored_material, ..solid })
            }
            false => Some(PrefabSample {
                density: density.max(0),
                material: MaterialId::GROUND,
                is_edited,
                has_stored_material: false,
            }),
        }
    }
}
