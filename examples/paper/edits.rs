//! The landscape and the hundred edits, which depend only on the seed.

use std::sync::Arc;

use bevy_burrow::ground::{Ground, GroundError, MaterialId, NoiseHeights};
use bevy_burrow::lattice::{Column, ONE};
use bevy_burrow::prelude::{Brush, Shape};
use bevy_burrow::terrain::{Terrain, TerrainError, TerrainSettings};
use glam::{Quat, Vec3, Vec4};

/// The material that is built, distinct from the ground's.
const BUILT: MaterialId = MaterialId(3);

/// Distance of edits from the rim in voxels, so that each shape lies entirely in the world.
const MARGIN: f32 = 20.0;

/// The paper's two runs over the same places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Run {
    /// On untouched ground: no fields exist.
    First,
    /// Equal shapes at equal places with reversed polarity, so that each edit changes something:
    /// holes are filled, and built ground is dug.
    Second,
}

impl Run {
    pub const BOTH: [Self; 2] = [Self::First, Self::Second];

    pub const fn title(self) -> &'static str {
        match self {
            Self::First => "first run",
            Self::Second => "second run",
        }
    }
}

/// The landscape and the edits.
pub struct Scene {
    pub ground: Arc<Ground>,
    shapes: Vec<Planned>,
}

/// A shape, its size (radius or half extent), and whether the first run digs it.
#[derive(Clone, Copy)]
struct Planned {
    shape: Shape,
    size: f32,
    digs: bool,
}

impl Scene {
    /// A landscape of `side` x `side` columns and `count` edits.
    pub fn new(side: u32, count: usize, seed: u64) -> Result<Self, GroundError> {
        let height = f64::from(side);
        let hills = NoiseHeights {
            seed: seed as u32,
            octaves: 4,
            scale: height * 0.45,
            amplitude: height * 0.15,
            base: height * 0.5,
            ..NoiseHeights::default()
        };
        // There is one cell less than columns: like the full field, the lattice has exactly `side` points along each
        // axis.
        let ground = Ground::from_noise(side - 1, side - 1, &hills)?;
        let mut random = fastrand::Rng::with_seed(seed);
        let shapes = (0..count).map(|_| shape(&mut random, &ground)).collect();
        Ok(Self { ground: Arc::new(ground), shapes })
    }

    /// A terrain without edits.
    pub fn terrain(&self, chunk_size: u32) -> Result<Terrain, TerrainError> {
        let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
        Terrain::new(self.ground.clone(), &settings)
    }

    /// The brushes of a run, in order.
    pub fn brushes(&self, run: Run) -> Vec<Brush> {
        let brush = |(tag, &Planned { shape, digs, .. }): (u64, &Planned)| {
            let digs = digs == (run == Run::First);
            let brush = if digs { Brush::dig(shape) } else { Brush::add(shape, BUILT) };
            brush.with_tag(tag)
        };
        (0..).zip(&self.shapes).map(brush).collect()
    }

    /// The number of edits that dig in the first run.
    pub fn digs(&self) -> usize {
        self.shapes.iter().filter(|planned| planned.digs).count()
    }

    /// The size of each edit in voxels: the radius of a ball, the largest half extent of a box, half of the axis of a
    /// capsule or cylinder.
    pub fn sizes(&self) -> Vec<f64> {
        self.shapes.iter().map(|planned| f64::from(planned.size)).collect()
    }

    /// The share of columns steeper than 45 degrees, and the steepest slope.
    pub fn steepness(&self) -> (f64, f64) {
        let (width, depth) = (self.ground.width(), self.ground.depth());
        let columns = (0..=depth).flat_map(|z| (0..=width).map(move |x| Column::new(x, z)));
        let slopes: Vec<f64> = columns.map(|column| self.ground.slope(column)).collect();
        let steep = slopes.iter().filter(|&&slope| slope > 1.0).count();
        (steep as f64 / slopes.len() as f64, slopes.into_iter().fold(0.0, f64::max))
    }
}

/// A shape of 2 to 9 voxels at the surface.
fn shape(random: &mut fastrand::Rng, ground: &Ground) -> Planned {
    let mut between = |low: f32, high: f32| low + (high - low) * random.f32();
    let (width, depth) = (ground.width() as f32, ground.depth() as f32);
    let (x, z) = (between(MARGIN, width - MARGIN).round(), between(MARGIN, depth - MARGIN).round());
    let surface = ground.height(Column::new(x as i32, z as i32)) as f32 / ONE as f32;
    let size = between(2.0, 9.0);
    let digs = between(0.0, 1.0) < 0.5;
    // Digs go into the ground and buildings stand on it; both intersect the surface.
    let depth = between(0.0, 0.7) * size * if digs { -1.0 } else { 1.0 };
    let center = Vec3::new(x, surface + depth, z);
    // No sine, whose last bit differs between machines.
    let turn = Vec4::from_array([(); 4].map(|()| between(-1.0, 1.0))).normalize_or(Vec4::W);
    let turn = Quat::from_vec4(turn);
    let arm = turn * Vec3::Y * size;
    let shape = match between(0.0, 5.0) as u32 {
        0 => Shape::sphere(center, size),
        1 => {
            let half = Vec3::new(size, between(0.4, 1.0) * size, between(0.4, 1.0) * size);
            Shape::cuboid(center, half.max(Vec3::splat(1.0)))
        }
        2 => Shape::turned_cuboid(center, Vec3::new(size, 0.6 * size, 0.8 * size), turn),
        3 => Shape::capsule(center - arm, center + arm, 0.5 * size),
        _ => Shape::cylinder(center - arm, 2.0 * arm, 0.6 * size),
    };
    Planned { shape, size, digs }
}
