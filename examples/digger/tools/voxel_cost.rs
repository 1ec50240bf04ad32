//! How many voxels a shape holds: the lattice points within it, counted one by one, as the ground counts them.

use bevy::prelude::*;
use bevy_burrow::brush::shapes::{Capsule, Cuboid, Sphere};
use bevy_burrow::prelude::*;

use crate::tools::Tool;

/// Brushes are rounded to 1/256 voxel; so much larger than it was meant to be a shape may get by that.
const SLACK: f32 = 0.01;

/// Lattice points in a shape of the hand's; never fewer than the ground will find in it.
pub fn voxels(shape: &Shape) -> i64 {
    let Some((low, high)) = bounds(shape) else { return i64::MAX };
    let (low, high) = ((low - SLACK).ceil().as_ivec3(), (high + SLACK).floor().as_ivec3());
    let mut count = 0;
    for z in low.z..=high.z {
        for y in low.y..=high.y {
            for x in low.x..=high.x {
                count += i64::from(outside(shape, IVec3::new(x, y, z).as_vec3()) <= SLACK);
            }
        }
    }
    count
}

/// The radius up to a wish for which a stock of so many voxels is enough, and how many it takes; `None` where that would be
/// next to nothing.
pub fn affordable(tool: Tool, wish: f32, stock: i64, shape: impl Fn(f32) -> Shape) -> Option<(f32, i64)> {
    largest(wish, 0.8 * tool.radii().0, stock, shape)
}

/// The largest radius up to a wish at which a shape holds no more than so many voxels, and how many it holds then;
/// `None` where that would be less than the least.
pub fn largest(wish: f32, least: f32, most: i64, shape: impl Fn(f32) -> Shape) -> Option<(f32, i64)> {
    let mut radius = wish;
    while radius >= least {
        let held = voxels(&shape(radius));
        if held <= most {
            return Some((radius, held));
        }
        radius *= (most.max(0) as f32 / held as f32).cbrt().clamp(0.2, 0.985);
    }
    None
}

/// A box around a shape that a hand can have.
fn bounds(shape: &Shape) -> Option<(Vec3, Vec3)> {
    match *shape {
        Shape::Sphere(Sphere { center, radius }) => Some((center - radius, center + radius)),
        Shape::Cuboid(Cuboid { center, half, .. }) => Some((center - half.length(), center + half.length())),
        Shape::Capsule(Capsule { from, to, radius }) => Some((from.min(to) - radius, from.max(to) + radius)),
        _ => None,
    }
}

/// How far outside a place is; at most 0 within.
fn outside(shape: &Shape, place: Vec3) -> f32 {
    match *shape {
        Shape::Sphere(Sphere { center, radius }) => place.distance(center) - radius,
        Shape::Cuboid(Cuboid { center, half, rotation }) => {
            ((rotation.inverse() * (place - center)).abs() - half).max_element()
        }
        Shape::Capsule(Capsule { from, to, radius }) => {
            let axis = to - from;
            let along = (place - from).dot(axis) / axis.length_squared().max(f32::MIN_POSITIVE);
            place.distance(from + axis * along.clamp(0.0, 1.0)) - radius
        }
        _ => f32::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tools::shape::{Aim, Form};
    use crate::world::landscape::ROCK;

    #[test]
    fn the_ground_never_takes_more_than_was_counted() {
        let mut chance = fastrand::Rng::with_seed(8);
        let mut between = |low: f32, high: f32| low + (high - low) * chance.f32();
        for number in 0..120 {
            let form = [Form::Sphere, Form::Cube, Form::Capsule][number % 3];
            // In the air, so that nothing of it is there yet; now and then between lattice points, where balls are fullest.
            let mut place = Vec3::new(between(20.0, 40.0), between(50.0, 60.0), between(20.0, 40.0));
            if number % 4 == 0 {
                place = place.floor() + 0.5;
            }
            let along =
                Vec3::new(between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0)).normalize_or(Vec3::X);
            let shape = form.shape(&Aim { place, along, normal: Vec3::Y }, between(0.8, 3.5));
            let ground = Ground::from_fn(64, 64, |_, _| 5.0).expect("a small world");
            let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
            let receipts = terrain.apply([Brush::add(shape, ROCK)]);
            let added = receipts[0].outcome.as_ref().expect("a valid brush").added.total() as i64;
            let counted = voxels(&shape);
            assert!(added <= counted && counted <= added + added / 3 + 8, "{shape:?}: {added} of {counted}");
        }
    }

    #[test]
    fn as_large_as_the_stock_allows() {
        let ball = |radius| Shape::sphere(Vec3::new(3.5, 3.5, 3.5), radius);
        assert_eq!(largest(2.0, 0.8, 3, ball), None);
        assert_eq!(largest(2.0, 0.8, 0, ball), None);
        for most in [8, 30, 200, 900] {
            let (radius, held) = largest(12.0, 0.8, most, ball).expect("enough for a small one");
            assert!(held <= most && held == voxels(&ball(radius)), "{held} of {most} at {radius}");
        }
        assert_eq!(largest(2.0, 0.8, 900, ball).map(|found| found.0), Some(2.0));
    }
}
