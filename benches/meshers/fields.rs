//! The density fields that are meshed, and the grids of their samples. Negative is solid; x varies fastest, then y,
//! then z.

use clap::ValueEnum;
use noise::{Fbm, MultiFractal, NoiseFn, Perlin};
use serde::Serialize;

/// The density function of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Field {
    /// A ball whose centre is not on a lattice point.
    Sphere,
    /// Hills: five octaves of noise, y upwards.
    Terrain,
    /// Three octaves of noise in space: a surface in most bricks.
    Caves,
    /// Only air, as in most chunks of a world.
    Empty,
}

/// The border of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Border {
    /// The field continues beyond the grid: used for timing.
    Cut,
    /// Two samples of air all round, so that the surface is closed: used for checks.
    Closed,
}

/// Samples of a cube.
pub struct Grid {
    /// Samples along a side.
    pub size: usize,
    /// Densities in voxels.
    pub samples: Vec<f32>,
    /// These densities in 1/256 voxel.
    pub fixed: Vec<i16>,
}

/// The smallest absolute density. All programs then agree on what is solid, whether they test `< 0` or `<= 0`, in
/// floats or in 1/256 voxel, and no two vertices fall on the same lattice point.
const LEAST: f64 = 1.0 / 256.0;

impl Field {
    /// Every field, in the order of the tables.
    pub const ALL: [Self; 4] = [Self::Sphere, Self::Terrain, Self::Caves, Self::Empty];

    /// The name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Terrain => "terrain",
            Self::Caves => "caves",
            Self::Empty => "empty",
        }
    }

    /// The field over `size` samples along a side.
    pub fn grid(self, size: usize, border: Border) -> Grid {
        let middle = (size as f64 - 1.0) / 2.0;
        let density: Box<Density> = match self {
            Self::Sphere => ball([middle + 0.13, middle - 0.21, middle + 0.37], 0.37 * size as f64),
            Self::Terrain => hills([0.0, middle, 0.0]),
            Self::Caves => caves([0.0; 3]),
            Self::Empty => sky(),
        };
        Grid::sample(size, |[x, y, z]| {
            let inside = density([x, y, z]);
            match border {
                Border::Cut => inside,
                Border::Closed => {
                    let from_middle =
                        [x, y, z].map(|along| (along - middle).abs()).into_iter().fold(0.0, f64::max);
                    inside.max(from_middle - (middle - 1.5))
                }
            }
        })
    }

    /// Chunk `number` of a stream of chunks that all differ; `size` includes the apron's samples.
    pub fn chunk(self, number: usize, size: usize) -> Grid {
        let mut random = fastrand::Rng::with_seed(number as u64);
        let mut between = |low: f64, high: f64| low + (high - low) * random.f64();
        let middle = (size as f64 - 1.0) / 2.0;
        let density: Box<Density> = match self {
            Self::Sphere => {
                let center = [(); 3].map(|()| middle + between(-8.0, 8.0));
                ball(center, between(10.0, 20.0))
            }
            Self::Terrain => hills([between(0.0, 4e4), middle, between(0.0, 4e4)]),
            Self::Caves => caves([(); 3].map(|()| between(0.0, 4e4))),
            Self::Empty => sky(),
        };
        Grid::sample(size, density)
    }
}

type Density = dyn Fn([f64; 3]) -> f64;

fn ball(center: [f64; 3], radius: f64) -> Box<Density> {
    Box::new(move |at| {
        let square = |axis: usize| (at[axis] - center[axis]).powi(2);
        (square(0) + square(1) + square(2)).sqrt() - radius
    })
}

/// Hills around the height `shift[1]`, at another place of the noise.
fn hills(shift: [f64; 3]) -> Box<Density> {
    let noise = Fbm::<Perlin>::new(1).set_octaves(5);
    Box::new(move |[x, y, z]| {
        let height = 16.0 * noise.get([(x + shift[0]) / 60.0 + 0.37, (z + shift[2]) / 60.0 + 0.71]);
        y - shift[1] - height
    })
}

fn caves(shift: [f64; 3]) -> Box<Density> {
    let noise = Fbm::<Perlin>::new(2).set_octaves(3);
    Box::new(move |at| {
        let place: [f64; 3] = std::array::from_fn(|axis| (at[axis] + shift[axis]) / 20.0 + 0.37);
        8.0 * noise.get(place)
    })
}

/// Air whose density grows with the distance from the ground.
fn sky() -> Box<Density> {
    Box::new(|[x, y, z]| 9.0 + y + (0.11 * x).sin() + (0.07 * z).cos())
}

impl Grid {
    fn sample(size: usize, density: impl Fn([f64; 3]) -> f64) -> Self {
        let mut samples = Vec::with_capacity(size.pow(3));
        for z in 0..size {
            for y in 0..size {
                for x in 0..size {
                    let value = density([x as f64, y as f64, z as f64]);
                    let kept = if value < 0.0 { value.min(-LEAST) } else { value.max(LEAST) };
                    samples.push(kept as f32);
                }
            }
        }
        // Rounds to nearest and saturates at the limits of i16.
        let fixed = samples.iter().map(|sample| (sample * 256.0).round() as i16).collect();
        Self { size, samples, fixed }
    }

    /// Samples along each axis.
    pub fn sides(&self) -> [usize; 3] {
        [self.size; 3]
    }

    /// Cells between the samples.
    pub fn cells(&self) -> usize {
        (self.size - 1).pow(3)
    }

    /// Bytes of both kinds of samples.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.samples[..]) + size_of_val(&self.fixed[..])
    }
}
