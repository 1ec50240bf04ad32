//! Species as integers. Lengths are in 1/256 voxel, shares and chances in 1/65536.

use super::rules::{ScatterError, Species};
use crate::ground::MaterialId;
use crate::lattice::hash::hash_words;
use crate::lattice::{LIMIT, ONE};

/// All of a share, and a certain chance.
pub(super) const WHOLE: i64 = 1 << 16;

/// The rules of a species, in integers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Rule {
    /// Distinguishes species and seeds.
    pub key: u64,
    pub spacing: i32,
    pub density: i64,
    pub distance: i32,
    pub room: i32,
    /// In 1/256.
    pub size: (i32, i32),
    pub height: (i32, i32),
    /// Squares of the slope, as the ground gives them.
    pub squared_slope: (u64, u64),
    /// Materials on which it grows, a bit each; `None` for all.
    pub materials: Option<[u64; 4]>,
    /// The size of groups, and the square of their radius.
    pub clusters: Option<(i32, i64)>,
    pub clearance_radius: i32,
    pub clearance_height: i32,
    pub stem: Option<(i32, i32)>,
}

/// Checks numbers of one species, and rounds them.
struct Numbers<'a>(&'a str);

impl Numbers<'_> {
    /// A number of a range, times `scale`, rounded. Products by powers of two are exact, so all machines agree.
    fn take(
        &self,
        what: &'static str,
        value: f32,
        (low, high): (f32, f32),
        allowed: &'static str,
        scale: i32,
    ) -> Result<i32, ScatterError> {
        if (low..=high).contains(&value) {
            return Ok((f64::from(value) * f64::from(scale)).round() as i32);
        }
        Err(ScatterError::Parameter { species: self.0.to_owned(), what, value, allowed })
    }

    /// Both ends of a range.
    fn range(
        &self,
        what: &'static str,
        (first, last): (f32, f32),
        limits: (f32, f32),
        allowed: &'static str,
        scale: i32,
    ) -> Result<(i32, i32), ScatterError> {
        let low = self.take(what, first, limits, allowed, scale)?;
        let high = self.take(what, last, limits, allowed, scale)?;
        if first <= last {
            return Ok((low, high));
        }
        let allowed = "at most the end of its range";
        Err(ScatterError::Parameter { species: self.0.to_owned(), what, value: first, allowed })
    }
}

impl Rule {
    /// The rules of a species, for a seed.
    pub fn new(seed: u64, species: &Species) -> Result<Self, ScatterError> {
        let numbers = Numbers(&species.name);
        let take = |what, value, limits, allowed| numbers.take(what, value, limits, allowed, ONE);
        let spacing = take("spacing", species.spacing, (1.0 / 16.0, 1024.0), "1/16 to 1024 voxels")?;
        let distance = (0.0, 4.0 * species.spacing);
        let distance = take("distance", species.distance, distance, "0 to 4 times the spacing")?;
        let limit = LIMIT as f32;
        let height =
            numbers.range("height", species.height, (-limit, limit), "-32768 to 32768 voxels", ONE)?;
        let slope = numbers.range("slope", species.slope, (0.0, 128.0), "0 to 128", 2 * ONE)?;
        let square = |slope: i32| u64::from(slope.unsigned_abs()).pow(2);
        let clusters = species.clusters.map(|clusters| {
            let size = take("clusters.size", clusters.size, (1.0, 1024.0), "1 to 1024 voxels")?;
            let cover = ("clusters.cover", clusters.cover, (0.0, 1.0), "0 to 1");
            let cover = numbers.take(cover.0, cover.1, cover.2, cover.3, WHOLE as i32)?;
            // A disc of this area: 20861 is 65536 / pi.
            let squared_radius = i64::from(size).pow(2) * i64::from(cover) / WHOLE * 20861 / WHOLE;
            Ok((size, squared_radius))
        });
        let stem = species.stem.map(|stem| {
            let least = 1.0 / 256.0;
            let radius = take("stem.radius", stem.radius, (least, 16.0), "1/256 to 16 voxels")?;
            Ok((radius, take("stem.height", stem.height, (least, 256.0), "1/256 to 256 voxels")?))
        });
        let view = &species.view;
        for (what, value) in
            [("view.detail", view.detail), ("view.end", view.end), ("view.shadows", view.shadows)]
        {
            take(what, value, (0.0, 65536.0), "0 to 65536 voxels")?;
        }
        let clearance = species.clearance;
        let share = WHOLE as i32;
        let density = numbers.take("density", species.density, (0.0, 1.0), "0 to 1", share)?;
        Ok(Self {
            key: hash_words(std::iter::once(seed).chain(species.name.bytes().map(u64::from))),
            spacing,
            density: density.into(),
            distance,
            room: take("room", species.room, (0.0, 64.0), "0 to 64 voxels")?,
            size: numbers.range("size", species.size, (1.0 / 16.0, 16.0), "1/16 to 16", ONE)?,
            height,
            squared_slope: (square(slope.0), square(slope.1)),
            materials: (!species.materials.is_empty()).then(|| bits(&species.materials)),
            clusters: clusters.transpose()?,
            clearance_radius: take("clearance.radius", clearance.radius, (0.0, 16.0), "0 to 16 voxels")?,
            clearance_height: take("clearance.height", clearance.height, (0.0, 256.0), "0 to 256 voxels")?,
            stem: stem.transpose()?,
        })
    }

    /// Whether it grows on this material.
    pub fn grows_on(&self, material: MaterialId) -> bool {
        let MaterialId(id) = material;
        self.materials.is_none_or(|bits| bits[usize::from(id >> 6)] >> (id & 63) & 1 == 1)
    }

    /// The farthest column of any plant's clearance, in whole voxels.
    pub fn reach(&self) -> i32 {
        // Its cell's own columns are within two voxels.
        (self.clearance_radius * self.size.1 / ONE / ONE).max(1) + 1
    }
}

fn bits(materials: &[MaterialId]) -> [u64; 4] {
    let mut bits = [0; 4];
    for &MaterialId(id) in materials {
        bits[usize::from(id >> 6)] |= 1 << (id & 63);
    }
    bits
}
