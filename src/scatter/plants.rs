//! The plants of an area.

use glam::{DVec3, Vec3};

use super::rules::{ScatterError, ScatterRules, Species};
use super::species::Rule;
use super::spots::{Spot, Spots, nearest_column};
use crate::brush::{Brush, Shape};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{Column, ONE, ceil};

/// Identifies a plant; it stays the same as long as the ground and the rules of its species do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PlantId {
    /// The species, as an index of the rules.
    pub species: u8,
    /// The plant's square along z, in spacings of the species.
    pub z: i32,
    /// The plant's square along x, in spacings of the species.
    pub x: i32,
}

/// A plant on the undug ground. All numbers are integers, so equal plants are equal on every machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Plant {
    /// The plant's id.
    pub id: PlantId,
    /// Position along x, in 1/256 voxel.
    pub x: i32,
    /// Position along z, in 1/256 voxel.
    pub z: i32,
    /// The height of its foot, in 1/65536 voxel.
    pub y: i64,
    /// Rise of the ground under it along x and along z, in 1/256.
    pub rise: [i32; 2],
    /// The plant's size, in 1/256.
    pub size: u16,
    /// How far it is turned around its axis, in 1/65536 of a whole turn.
    pub turn: u16,
    /// A random number for a game's own use: a colour, or one of several meshes.
    pub variant: u16,
    /// The topmost solid sample of the column nearest to it, along y.
    pub(super) top: i32,
}

impl Plant {
    fn new(rule: &Rule, species: u8, spot: &Spot, ground: &Ground) -> Self {
        let (smallest, largest) = rule.size;
        let random = |from: u32| (spot.random >> from) as u16;
        let size = smallest + ((i64::from(largest - smallest) * i64::from(random(0))) >> 16) as i32;
        Self {
            id: PlantId { species, z: spot.square.1, x: spot.square.0 },
            x: spot.x,
            z: spot.z,
            y: spot.y,
            rise: spot.rise,
            size: size as u16,
            turn: random(16),
            variant: random(32),
            top: ceil(ground.height(nearest_column(spot.x, spot.z))) - 1,
        }
    }

    /// The place of its foot, in voxels.
    pub fn position(&self) -> DVec3 {
        let one = f64::from(ONE);
        DVec3::new(f64::from(self.x) / one, self.y as f64 / (one * one), f64::from(self.z) / one)
    }

    /// Unit normal of the triangle that it stands on.
    pub fn normal(&self) -> Vec3 {
        let [x, z] = self.rise.map(|rise| rise as f32 / ONE as f32);
        Vec3::new(-x, 1.0, -z).normalize()
    }

    /// The cell that it stands on.
    pub fn cell(&self) -> Column {
        Column::new(self.x.div_euclid(ONE), self.z.div_euclid(ONE))
    }

    /// The place of its [mark](Self::removal).
    fn mark(&self) -> Shape {
        let place = nearest_column(self.x, self.z).at(self.top);
        Shape::sphere(place.as_vec3(), 0.25)
    }

    /// The brush that removes it, in voxels: it paints the one sample nearest to its foot with the ground's own
    /// material, which changes nothing but that the sample counts as edited. Plants on the four cells around that
    /// sample go with it.
    pub fn removal(&self) -> Brush {
        Brush::paint(self.mark(), MaterialId::GROUND)
    }

    /// The brush that restores the ground at its foot, in voxels: the plant is back if nothing else is in its way.
    pub fn regrowth(&self) -> Brush {
        Brush::reset(self.mark())
    }
}

/// Checked rules, from which the plants of a ground are computed.
#[derive(Clone, Debug, PartialEq)]
pub struct Scatter {
    pub(super) rules: Vec<Rule>,
    species: Vec<Species>,
}

impl Scatter {
    /// Checks rules. Lengths are rounded to 1/256 voxel.
    ///
    /// # Errors
    /// When a number is not within its range, two species have the same name, or there are too many.
    pub fn new(rules: &ScatterRules) -> Result<Self, ScatterError> {
        let species = &rules.species;
        if species.len() > usize::from(u8::MAX) {
            return Err(ScatterError::TooMany(species.len()));
        }
        for (index, own) in species.iter().enumerate() {
            if species[..index].iter().any(|other| other.name == own.name) {
                return Err(ScatterError::SameName(own.name.clone()));
            }
        }
        let rules = species.iter().map(|own| Rule::new(rules.seed, own)).collect::<Result<_, _>>()?;
        Ok(Self { rules, species: species.clone() })
    }

    /// The species, in the order of their numbers.
    pub fn species(&self) -> &[Species] {
        &self.species
    }

    /// The plants of the undug ground on the cells from `low` to `high`, both included, of the species that `is_wanted`
    /// accepts; in order of their ids. An area gives the same plants whole or in parts.
    pub fn plants(
        &self,
        ground: &Ground,
        low: Column,
        high: Column,
        is_wanted: impl Fn(usize) -> bool,
    ) -> Vec<Plant> {
        // Of what lies beyond the world, nothing.
        let low = Column::new(low.x.max(0), low.z.max(0));
        let high = Column::new(high.x.min(ground.width() - 1), high.z.min(ground.depth() - 1));
        let mut plants = Vec::new();
        if low.x > high.x || low.z > high.z {
            return plants;
        }
        let points = |more: i32| {
            let end = |at: i32| at * ONE + ONE - 1 + more;
            ((low.x * ONE - more, low.z * ONE - more), (end(high.x), end(high.z)))
        };
        let has_later = |index: usize| (index + 1..self.rules.len()).any(&is_wanted);
        // Those that later species keep away from.
        let mut earlier: Vec<(i32, Spots)> = Vec::new();
        for (index, rule) in self.rules.iter().enumerate() {
            let keeps_others_away = rule.room > 0 && has_later(index);
            if !is_wanted(index) && !keeps_others_away {
                continue;
            }
            let spots = Spots::new(rule, ground, points(if keeps_others_away { rule.room } else { 0 }));
            if is_wanted(index) {
                let ((x0, z0), (x1, z1)) = points(0);
                let is_inside = |spot: &&Spot| (x0..=x1).contains(&spot.x) && (z0..=z1).contains(&spot.z);
                let has_room = |spot: &&Spot| {
                    !earlier.iter().any(|(room, spots)| spots.any_near(spot.point(), *room, |_| true))
                };
                let own = spots.iter().filter(is_inside).filter(has_room);
                plants.extend(own.map(|spot| Plant::new(rule, index as u8, spot, ground)));
            }
            if keeps_others_away {
                earlier.push((rule.room, spots));
            }
        }
        plants
    }
}
