//! Paths of the tour's camera and of the points that it looks at.

use bevy::math::cubic_splines::{CubicCardinalSpline, CubicCurve, CubicGenerator};
use bevy::prelude::*;

use crate::film::places::{Land, Ravine};

/// A smooth curve through points.
pub struct CameraPath(CubicCurve<Vec3>);

impl CameraPath {
    /// A curve through points.
    ///
    /// # Errors
    /// If there are too few points.
    pub fn through(places: impl IntoIterator<Item = Vec3>) -> Result<Self> {
        Ok(Self(CubicCardinalSpline::new_catmull_rom(places).to_curve()?))
    }

    /// A curve through points at heights above the ground.
    ///
    /// # Errors
    /// If there are too few points, or one is outside the world.
    pub fn over(land: &Land, places: &[(Vec3, f32)]) -> Result<Self> {
        let points = places.iter().map(|&(place, metres)| {
            let height = land.height(place.xz()).ok_or("the tour left the world")?;
            Ok(place.with_y(height + metres))
        });
        Self::through(points.collect::<Result<Vec<Vec3>>>()?)
    }

    /// A curve around the middle of a bridge and towards it, on the side of `aside`.
    ///
    /// # Errors
    /// If it leads out of the world.
    pub fn around(land: &Land, middle: Vec3, aside: Vec3) -> Result<Self> {
        let swing = |angle: f32, out: f32| middle + Quat::from_rotation_y(angle) * aside * out;
        let places = [
            (swing(0.75, 40.0), 12.0),
            (swing(0.40, 37.0), 9.0),
            (swing(0.12, 34.0), 7.0),
            (swing(-0.1, 33.0), 6.5),
        ];
        Self::over(land, &places)
    }

    /// How much of a bridge is visible along the whole path.
    pub fn visibility(&self, land: &Land, ravine: &Ravine) -> usize {
        (0..=8).map(|i| ravine.points_visible_from(land, self.at(i as f32 / 8.0))).sum()
    }

    /// The point at a part of the path, from 0 to 1.
    pub fn at(&self, part: f32) -> Vec3 {
        self.0.position(part.clamp(0.0, 1.0) * self.0.segments().len() as f32)
    }
}
