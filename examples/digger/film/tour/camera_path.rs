//! Ways of the tour's camera, and of what it looks at.

use bevy::math::cubic_splines::{CubicCardinalSpline, CubicCurve, CubicGenerator};
use bevy::prelude::*;
use bevy_burrow::terrain::World as Model;

use crate::film::places::Ravine;

/// A curve through places.
pub struct Way(CubicCurve<Vec3>);

impl Way {
    /// Through all of some places.
    ///
    /// # Errors
    /// When there are too few of them.
    pub fn through(places: impl IntoIterator<Item = Vec3>) -> Result<Self> {
        Ok(Self(CubicCardinalSpline::new_catmull_rom(places).to_curve()?))
    }

    /// Through places at heights over the ground.
    ///
    /// # Errors
    /// When there are too few of them, or one has no ground.
    pub fn over(world: &Model, places: &[(Vec3, f32)]) -> Result<Self> {
        const RIM: f32 = 20.0;
        let (width, depth) = (world.grid().width() as f32, world.grid().depth() as f32);
        let points = places.iter().map(|&(place, metres)| {
            // Hills may lie near the rim; the way stays within it.
            let [x, z] = [(place.x, width), (place.z, depth)].map(|(at, end)| at.clamp(RIM, end - RIM));
            let height = world.height(x.into(), z.into()).ok_or("the tour left the world")?;
            Ok(Vec3::new(x, height as f32 + metres, z))
        });
        Self::through(points.collect::<Result<Vec<Vec3>>>()?)
    }

    /// Around the middle of a bridge and nearer to it, on the side that `aside` leads to.
    ///
    /// # Errors
    /// When there is no ground.
    pub fn around(world: &Model, middle: Vec3, aside: Vec3) -> Result<Self> {
        let swing = |angle: f32, out: f32| middle + Quat::from_rotation_y(angle) * aside * out;
        let places = [
            (swing(0.75, 40.0), 12.0),
            (swing(0.40, 37.0), 9.0),
            (swing(0.12, 34.0), 7.0),
            (swing(-0.1, 33.0), 6.5),
        ];
        Self::over(world, &places)
    }

    /// How much of a bridge is seen from all along it.
    pub fn sight(&self, world: &Model, ravine: &Ravine) -> usize {
        (0..=8).map(|i| ravine.seen_from(world, self.at(i as f32 / 8.0))).sum()
    }

    /// The place on it, 0 to 1.
    pub fn at(&self, part: f32) -> Vec3 {
        self.0.position(part.clamp(0.0, 1.0) * self.0.segments().len() as f32)
    }
}
