//! Questions about plants that stand: the nearest one, those in a box, the first along a ray. Lengths are in voxels.

use glam::{DVec2, DVec3, IVec2, Vec3Swizzles};

use super::plants::{Plant, Scatter};
use crate::lattice::{Column, ONE};
use crate::terrain::World;

/// Cells along a side of the squares that are searched one after the other.
const STEP: i32 = 16;

/// Cells from a place up to which the nearest plant is searched for.
const SEARCHED: i32 = 1024;

/// The plant that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantHit {
    /// The plant.
    pub plant: Plant,
    /// Voxels from the ray's origin.
    pub distance: f64,
}

impl Scatter {
    /// Plants that stand, with their feet in a box.
    pub fn in_box(
        &self,
        world: &World,
        low: DVec3,
        high: DVec3,
        is_wanted: impl Fn(usize) -> bool,
    ) -> Vec<Plant> {
        let is_inside = |plant: &Plant| {
            let at = plant.position();
            at.cmpge(low).all() && at.cmple(high).all()
        };
        let mut plants = self.standing(world, low, high, is_wanted);
        plants.retain(is_inside);
        plants
    }

    /// The plant whose foot is nearest to a place, at most `most` away, of the species that `is_wanted` accepts.
    ///
    /// Ground is searched outwards, each cell once, up to 1,024 voxels from the column of the world that is nearest to
    /// the place: where nothing stands within that distance, there is none.
    pub fn nearest(
        &self,
        world: &World,
        place: DVec3,
        most: f64,
        is_wanted: impl Fn(usize) -> bool,
    ) -> Option<Plant> {
        if !place.is_finite() || most.is_nan() || most < 0.0 {
            return None;
        }
        let size = [world.ground().width(), world.ground().depth()];
        let middle = DVec2::new(place.x, place.z).clamp(DVec2::ZERO, IVec2::from_array(size).as_dvec2());
        // A plant `far` from the middle is at least as far from the place, as that may lie outside.
        let aside = middle.distance_squared(DVec2::new(place.x, place.z));
        let cell = middle.floor().as_ivec2();
        let mut best: Option<(f64, Plant)> = None;
        for inner in (0..SEARCHED).step_by(STEP as usize) {
            let outer = inner + STEP;
            let ring = match inner {
                0 => vec![(IVec2::splat(-outer), IVec2::splat(outer))],
                _ => {
                    let long = |low: i32, high: i32| (IVec2::new(low, -outer), IVec2::new(high, outer));
                    let short = |low: i32, high: i32| (IVec2::new(-inner, low), IVec2::new(inner, high));
                    let (before, after) = ((-outer, -inner - 1), (inner + 1, outer));
                    vec![
                        long(before.0, before.1),
                        long(after.0, after.1),
                        short(before.0, before.1),
                        short(after.0, after.1),
                    ]
                }
            };
            for (low, high) in ring {
                let at = |corner: IVec2| (cell + corner).as_dvec2().extend(0.0).xzy();
                let plants = self.standing(world, at(low), at(high), &is_wanted).into_iter();
                let near = plants.map(|plant| (plant.position().distance(place), plant));
                let near = near.filter(|(apart, _)| *apart <= most).chain(best);
                best = near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id.cmp(&b.1.id)));
            }
            let far = f64::from(outer).powi(2) + aside;
            let has_all = cell.cmple(IVec2::splat(outer)).all()
                && (IVec2::from_array(size) - cell).cmple(IVec2::splat(outer)).all();
            if has_all || far > most * most || best.is_some_and(|(apart, _)| apart * apart < far) {
                break;
            }
        }
        best.map(|(_, plant)| plant)
    }

    /// The first plant whose [stem](super::Stem) a ray meets within `most` voxels. The ground is ignored: compare the
    /// distance with that of [`World::raycast`].
    pub fn raycast(
        &self,
        world: &World,
        origin: DVec3,
        direction: DVec3,
        most: f64,
        is_wanted: impl Fn(usize) -> bool,
    ) -> Option<PlantHit> {
        let direction = (direction / direction.abs().max_element()).try_normalize()?;
        if !origin.is_finite() || most.is_nan() || most < 0.0 {
            return None;
        }
        let wanted = |species: usize| self.rules[species].stem.is_some() && is_wanted(species);
        let widest =
            self.rules.iter().filter_map(|rule| Some(rule.stem?.0 * rule.size.1 / ONE / ONE + 1)).max()?;
        // Only as far as the world reaches.
        let (ground, wide) = (world.ground(), f64::from(widest));
        let (mut from, mut most) = (0.0f64, most);
        for (start, along, end) in
            [(origin.x, direction.x, ground.width()), (origin.z, direction.z, ground.depth())]
        {
            let (low, high) = (-wide, f64::from(end) + wide);
            if along == 0.0 {
                (low..=high).contains(&start).then_some(())?;
            } else {
                let (a, b) = ((low - start) / along, (high - start) / along);
                from = from.max(a.min(b));
                most = most.min(a.max(b));
            }
        }
        let level = DVec2::new(direction.x, direction.z).length();
        // Steps along the ray; one for a vertical ray.
        let stride = if level > 0.0 { f64::from(STEP) / level } else { f64::INFINITY };
        while from <= most {
            let to = (from + stride).min(most);
            // Where a vertical ray ends does not matter.
            let at = |distance: f64| {
                DVec3::new(origin.x + direction.x * distance, 0.0, origin.z + direction.z * distance)
            };
            let (a, b) = if level > 0.0 { (at(from), at(to)) } else { (at(0.0), at(0.0)) };
            let plants = self.standing(world, a.min(b) - wide, a.max(b) + wide, wanted);
            let hits = plants.into_iter().filter_map(|plant| {
                let distance = self.meet(&plant, origin, direction)?;
                // One that begins farther on may be hidden by others there.
                (distance <= to).then_some(PlantHit { plant, distance })
            });
            let first =
                hits.min_by(|a, b| a.distance.total_cmp(&b.distance).then(a.plant.id.cmp(&b.plant.id)));
            // A step that is too small to be one ends the search.
            if first.is_some() || to >= most || to <= from {
                return first;
            }
            from = to;
        }
        None
    }

    /// Where a ray enters the stem of a plant; 0 if it begins inside.
    fn meet(&self, plant: &Plant, origin: DVec3, direction: DVec3) -> Option<f64> {
        let (radius, height) = self.rules[usize::from(plant.id.species)].stem?;
        let scaled = |length: i32| f64::from(length) * f64::from(plant.size) / f64::from(ONE * ONE);
        let (radius, height) = (scaled(radius), scaled(height));
        let from = origin - plant.position();
        let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
        // Through the cylinder's side.
        let (along, start) = (DVec2::new(direction.x, direction.z), DVec2::new(from.x, from.z));
        let (a, b) = (along.length_squared(), along.dot(start));
        let c = start.length_squared() - radius * radius;
        if a > 0.0 {
            let root = (b * b - a * c).max(0.0).sqrt();
            if b * b < a * c {
                return None;
            }
            enter = enter.max((-b - root) / a);
            leave = leave.min((-b + root) / a);
        } else if c > 0.0 {
            return None;
        }
        // Between its ends.
        if direction.y == 0.0 {
            (0.0..=height).contains(&from.y).then_some(())?;
        } else {
            let (foot, head) = (-from.y / direction.y, (height - from.y) / direction.y);
            enter = enter.max(foot.min(head));
            leave = leave.min(foot.max(head));
        }
        (enter <= leave).then_some(enter)
    }

    /// Plants that stand on the cells of a rectangle, without regard to its heights.
    fn standing(
        &self,
        world: &World,
        low: DVec3,
        high: DVec3,
        is_wanted: impl Fn(usize) -> bool,
    ) -> Vec<Plant> {
        // Numbers saturate; NaN is 0.
        let cell = |at: DVec3| Column::new(at.x.floor() as i32, at.z.floor() as i32);
        let mut plants = self.plants(world.ground(), cell(low), cell(high), is_wanted);
        plants.retain(|plant| self.stands(world, plant));
        plants
    }
}
