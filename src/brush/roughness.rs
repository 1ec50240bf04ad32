//! Bumps on a brush's surface: value noise on an integer hash.

use glam::{IVec3, Vec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::quantize::voxels;
use super::{BrushError, is_default};
use crate::lattice::{ONE, hash::mix};

/// Bumps added to a shape's signed distance: smooth noise in +-`amplitude`.
///
/// The noise is tied to space, not to the shape, so overlapping brushes with one seed and scale fit together. A brush
/// that is sent to the plugin has the same bumps in every terrain that it reaches: where two terrains with equal voxels
/// lie side by side, a whole number of voxels apart, they agree on the column that they share, bit for bit. The axes of
/// the pattern are those of the terrain's lattice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Roughness {
    /// Height of the bumps in voxels, 0 to 8.
    pub amplitude: f32,
    /// Width of a bump in voxels, 1 to 256.
    pub scale: f32,
    /// Seed of the pattern.
    pub seed: u32,
    /// The point that the pattern is tied to: by default the origin, of the world for a brush that is sent to the
    /// plugin, and of the terrain otherwise. Terrains that move keep their pattern if this point moves with them. It is
    /// rounded to 1/256 voxel and clamped to 4,194,304 voxels along each axis.
    #[serde(default, skip_serializing_if = "is_default")]
    pub origin: Vec3,
}

impl Roughness {
    /// Bumps of `amplitude` voxels (0 to 8), each about `scale` voxels wide (1 to 256).
    pub const fn new(amplitude: f32, scale: f32, seed: u32) -> Self {
        Self { amplitude, scale, seed, origin: Vec3::ZERO }
    }

    /// The bumps with their pattern tied to another point.
    #[must_use]
    pub const fn with_origin(self, origin: Vec3) -> Self {
        Self { origin, ..self }
    }
}

/// Quantised roughness. Lengths in 1/256 voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct QuantizedRoughness {
    pub(super) amplitude: i32,
    scale: i32,
    seed: u32,
    #[serde(default, skip_serializing_if = "is_default")]
    origin: [i32; 3],
}

/// The roughness of an edit, serialised. Edits without an origin have the form of those from before there was one,
/// which in compact formats is that of an `Option`.
pub(super) mod optional {
    use super::{Deserialize, Deserializer, QuantizedRoughness, Serialize, Serializer};

    /// The form in formats that do not name fields.
    #[derive(Serialize, Deserialize)]
    enum Compact {
        None,
        AtOrigin { amplitude: i32, scale: i32, seed: u32 },
        Moved { amplitude: i32, scale: i32, seed: u32, origin: [i32; 3] },
    }

    pub fn serialize<S: Serializer>(own: &Option<QuantizedRoughness>, to: S) -> Result<S::Ok, S::Error> {
        if to.is_human_readable() {
            return own.serialize(to);
        }
        match *own {
            None => Compact::None,
            Some(QuantizedRoughness { amplitude, scale, seed, origin: [0, 0, 0] }) => {
                Compact::AtOrigin { amplitude, scale, seed }
            }
            Some(QuantizedRoughness { amplitude, scale, seed, origin }) => {
                Compact::Moved { amplitude, scale, seed, origin }
            }
        }
        .serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<QuantizedRoughness>, D::Error> {
        if from.is_human_readable() {
            return Option::deserialize(from);
        }
        Ok(match Compact::deserialize(from)? {
            Compact::None => None,
            Compact::AtOrigin { amplitude, scale, seed } => {
                Some(QuantizedRoughness { amplitude, scale, seed, origin: [0; 3] })
            }
            Compact::Moved { amplitude, scale, seed, origin } => {
                Some(QuantizedRoughness { amplitude, scale, seed, origin })
            }
        })
    }
}

const AMPLITUDES: (i32, i32) = (0, 8 * ONE);
const SCALES: (i32, i32) = (ONE, 256 * ONE);

/// Noise is computed within this many voxels of the lattice's origin, far beyond every reach, and repeats its rim from
/// there on.
const RIM: i64 = 1 << 20;

/// The farthest origin, in voxels. Places relative to it, in 1/256 voxel, fit into 32 bits.
const FARTHEST_ORIGIN: i32 = 1 << 22;

impl QuantizedRoughness {
    pub(super) fn quantize(roughness: &Roughness) -> Result<Self, BrushError> {
        Ok(Self {
            amplitude: units("amplitude", roughness.amplitude, AMPLITUDES)?,
            scale: units("scale", roughness.scale, SCALES)?,
            seed: roughness.seed,
            origin: origin(roughness.origin)?,
        })
    }

    /// Returns the roughness as a brush has it.
    pub(super) fn roughness(&self) -> Roughness {
        let origin = Vec3::from_array(self.origin.map(voxels));
        Roughness::new(voxels(self.amplitude), voxels(self.scale), self.seed).with_origin(origin)
    }

    /// Amplitude, scale, seed, origin.
    #[cfg(feature = "cuda")]
    pub(super) fn constants(&self) -> (i32, i32, u32, [i32; 3]) {
        (self.amplitude, self.scale, self.seed, self.origin)
    }

    pub(super) fn check(&self) -> Result<(), BrushError> {
        for (what, value, (least, most)) in
            [("amplitude", self.amplitude, AMPLITUDES), ("scale", self.scale, SCALES)]
        {
            if value < least || value > most {
                return Err(out_of_range(what, voxels(value), (least, most)));
            }
        }
        let most = FARTHEST_ORIGIN * ONE;
        match self.origin.into_iter().find(|part| part.unsigned_abs() > most as u32) {
            Some(part) => Err(out_of_range("origin", voxels(part), (-most, most))),
            None => Ok(()),
        }
    }

    /// Adds the noise of a run of samples along +x, the first at (`x`, `start.y`, `start.z`), to `distances`.
    ///
    /// A sample's noise depends on its position only: interpolation goes y, z, x, and what neighbours on the run share
    /// is computed once.
    pub(super) fn add(&self, x: i64, start: IVec3, distances: &mut [f32]) {
        let (y, z) = (self.locate(1, i64::from(start.y)), self.locate(2, i64::from(start.z)));
        let mut near = self.locate(0, x).0;
        let (mut low, mut high) = (self.face(near, y, z), self.face(near + 1, y, z));
        for (i, distance) in distances.iter_mut().enumerate() {
            let (cell, t) = self.locate(0, x.saturating_add(i as i64));
            if cell != near {
                low = if cell == near + 1 { high } else { self.face(cell, y, z) };
                high = self.face(cell + 1, y, z);
                near = cell;
            }
            *distance += lerp(low, high, t).clamp(-1.0, 1.0) * self.amplitude as f32;
        }
    }

    /// The noise cell that a coordinate along an axis lies in, and the faded position between its ends.
    fn locate(&self, axis: usize, voxel: i64) -> (i32, f32) {
        let place = voxel.clamp(-RIM, RIM) as i32 * ONE - self.origin[axis];
        let cell = place.div_euclid(self.scale);
        let t = (place - cell * self.scale) as f32 / self.scale as f32;
        (cell, t * t * (3.0 - 2.0 * t))
    }

    /// The noise on the plane of noise points with one x, at (y, z).
    fn face(&self, x: i32, (y, ty): (i32, f32), (z, tz): (i32, f32)) -> f32 {
        let near = lerp(self.corner(x, y, z), self.corner(x, y + 1, z), ty);
        let far = lerp(self.corner(x, y, z + 1), self.corner(x, y + 1, z + 1), ty);
        lerp(near, far, tz)
    }

    /// The value of a noise point: 24 bits of a hash, in [-1, 1).
    fn corner(&self, x: i32, y: i32, z: i32) -> f32 {
        let bits = |v: i32| u64::from(v as u32 & 0x1f_ffff);
        let hash = mix((bits(x) << 42 | bits(y) << 21 | bits(z)) ^ mix(u64::from(self.seed)));
        ((hash >> 40) as i32 - (1 << 23)) as f32 / (1 << 23) as f32
    }
}

fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// An origin in 1/256 voxel.
fn origin(of: Vec3) -> Result<[i32; 3], BrushError> {
    match of.to_array().into_iter().find(|part| !part.is_finite()) {
        Some(value) => Err(BrushError::NotFinite { what: "origin", value }),
        None => {
            let most = FARTHEST_ORIGIN as f32;
            // Products of 2^22 and 256 are exact.
            Ok(of.to_array().map(|part| (part.clamp(-most, most) * ONE as f32).round_ties_even() as i32))
        }
    }
}

fn units(what: &'static str, value: f32, range: (i32, i32)) -> Result<i32, BrushError> {
    if !value.is_finite() {
        return Err(BrushError::NotFinite { what, value });
    }
    let units = value * ONE as f32;
    if units < range.0 as f32 || units > range.1 as f32 {
        return Err(out_of_range(what, value, range));
    }
    Ok(units.round_ties_even() as i32)
}

fn out_of_range(what: &'static str, value: f32, (least, most): (i32, i32)) -> BrushError {
    BrushError::Roughness { what, value, least: voxels(least), most: voxels(most) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(roughness: &QuantizedRoughness, p: IVec3) -> f32 {
        let mut out = [0.0];
        roughness.add(i64::from(p.x), p, &mut out);
        out[0]
    }

    #[test]
    fn noise_fills_its_range_and_stays_in_it() {
        let roughness = QuantizedRoughness::quantize(&Roughness::new(2.0, 3.5, 11)).unwrap();
        let (mut low, mut high, mut sum) = (0.0f32, 0.0f32, 0.0f64);
        for i in 0..20_000 {
            let value = noise(&roughness, IVec3::new(i % 41 - 20, i / 41 % 37 - 15, i / 1517 - 7));
            (low, high, sum) = (low.min(value), high.max(value), sum + f64::from(value));
        }
        assert!((-512.0..-400.0).contains(&low) && high > 400.0 && high <= 512.0, "{low} {high}");
        assert!((sum / 20_000.0).abs() < 30.0, "mean {}", sum / 20_000.0);
    }

    #[test]
    fn noise_points_carry_their_hash_and_seeds_differ() {
        let roughness = QuantizedRoughness::quantize(&Roughness::new(1.0, 4.0, 1)).unwrap();
        let other = QuantizedRoughness::quantize(&Roughness::new(1.0, 4.0, 2)).unwrap();
        for (cell, point) in [(0, 0), (1, 4), (-1, -4)] {
            let p = IVec3::new(point, 0, point);
            assert_eq!(noise(&roughness, p), roughness.corner(cell, 0, cell) * 256.0);
            assert_ne!(noise(&roughness, p), noise(&other, p));
        }
    }

    #[test]
    fn noise_moves_with_its_origin() {
        let own = QuantizedRoughness::quantize(&Roughness::new(1.0, 4.7, 1)).unwrap();
        let by = IVec3::new(9000, -31, 77_777);
        let moved = Roughness::new(1.0, 4.7, 1).with_origin(by.as_vec3());
        let moved = QuantizedRoughness::quantize(&moved).unwrap();
        for i in 0..3000 {
            let p = IVec3::new(i % 41 - 20, i / 41 % 37 - 15, i / 1517 - 7);
            assert_eq!(noise(&own, p), noise(&moved, p + by));
        }
        let far = |origin| QuantizedRoughness::quantize(&Roughness::new(1.0, 4.0, 1).with_origin(origin));
        assert_eq!(far(Vec3::splat(1e30)), far(Vec3::splat(4_194_304.0)));
        for end in [f32::MAX, f32::MIN] {
            let farthest = far(Vec3::splat(end)).unwrap();
            assert_eq!(farthest.check(), Ok(()));
            assert!(
                noise(&farthest, IVec3::MAX).abs() <= 256.0 && noise(&farthest, IVec3::MIN).abs() <= 256.0
            );
        }
        assert!(matches!(far(Vec3::NAN), Err(BrushError::NotFinite { what: "origin", .. })));
        let beyond = QuantizedRoughness { origin: [0, i32::MIN, 0], ..own };
        assert!(matches!(beyond.check(), Err(BrushError::Roughness { what: "origin", .. })));
    }

    #[test]
    fn the_form_without_an_origin_is_the_one_from_before_there_was_one() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Own(#[serde(with = "optional")] Option<QuantizedRoughness>);
        let own = |origin| {
            QuantizedRoughness::quantize(&Roughness::new(1.0, 4.0, 700).with_origin(origin)).unwrap()
        };
        let bytes = |own: Option<_>| postcard::to_stdvec(&Own(own)).unwrap();
        let before = |own: Option<(i32, i32, u32)>| postcard::to_stdvec(&own).unwrap();
        assert_eq!(bytes(None), before(None));
        assert_eq!(bytes(Some(own(Vec3::ZERO))), before(Some((256, 1024, 700))));
        for own in [None, Some(own(Vec3::ZERO)), Some(own(Vec3::new(-1.5, 900.0, 0.0)))] {
            assert_eq!(postcard::from_bytes::<Own>(&bytes(own)).unwrap(), Own(own));
            let json = serde_json::to_string(&own).unwrap();
            assert_eq!(serde_json::from_str::<Own>(&json).unwrap(), Own(own));
        }
        assert_eq!(
            serde_json::to_string(&Own(Some(own(Vec3::ZERO)))).unwrap(),
            r#"{"amplitude":256,"scale":1024,"seed":700}"#
        );
    }

    #[test]
    fn amplitude_and_scale_have_ends() {
        for (amplitude, scale, what) in [
            (-0.01, 4.0, "amplitude"),
            (8.01, 4.0, "amplitude"),
            (f32::MAX, 4.0, "amplitude"),
            (1.0, 0.99, "scale"),
            (1.0, 256.5, "scale"),
        ] {
            let error = QuantizedRoughness::quantize(&Roughness::new(amplitude, scale, 0)).unwrap_err();
            assert!(matches!(error, BrushError::Roughness { what: found, .. } if found == what), "{error}");
        }
        assert!(QuantizedRoughness::quantize(&Roughness::new(0.0, 1.0, 0)).is_ok());
        assert!(QuantizedRoughness::quantize(&Roughness::new(8.0, 256.0, 0)).is_ok());
    }
}
