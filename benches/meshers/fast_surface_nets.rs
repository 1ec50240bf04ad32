//! fast-surface-nets: dual, with one shared vertex per cell, whose normal is always the unnormalised gradient there.

use fast_surface_nets::ndshape::{ConstShape3u32, RuntimeShape};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};

use crate::contender::{Class, Contender, Mesh, Part, Shading, Sharing};
use crate::fields::Grid;

/// The mesher's name in tables.
pub const NAME: &str = "fast-surface-nets 0.2.1";

/// The peer and its buffers.
#[derive(Default)]
pub struct FastSurfaceNets {
    buffer: SurfaceNetsBuffer,
}

impl FastSurfaceNets {
    /// Uses compile-time strides, as the crate's examples and benchmarks do, which is faster.
    fn run<const N: u32>(&mut self, samples: &[f32], max: [u32; 3]) {
        surface_nets(samples, &ConstShape3u32::<N, N, N> {}, [0; 3], max, &mut self.buffer);
    }
}

impl Contender for FastSurfaceNets {
    fn name(&self) -> &'static str {
        NAME
    }

    fn class(&self) -> Class {
        Class { shading: Shading::Gradients, sharing: Sharing::Shared, dual: true }
    }

    fn mesh(&mut self, grid: &Grid, part: Part) {
        let side = grid.size as u32;
        // A chunk of n cells has n + 2 samples here, so that quads meet those of the next chunk; the apron has n + 3.
        let last = match part {
            Part::Whole => side - 1,
            Part::WithinApron => side - 2,
        };
        let (samples, max) = (&grid.samples[..], [last; 3]);
        match side {
            32 => self.run::<32>(samples, max),
            33 => self.run::<33>(samples, max),
            35 => self.run::<35>(samples, max),
            64 => self.run::<64>(samples, max),
            65 => self.run::<65>(samples, max),
            100 => self.run::<100>(samples, max),
            128 => self.run::<128>(samples, max),
            _ => {
                let shape = RuntimeShape::<u32, 3>::new([side; 3]);
                surface_nets(samples, &shape, [0; 3], max, &mut self.buffer);
            }
        }
    }

    fn triangles(&self) -> usize {
        self.buffer.indices.len() / 3
    }

    fn result(&self) -> Mesh {
        let SurfaceNetsBuffer { positions, normals, indices, .. } = &self.buffer;
        Mesh { positions: positions.clone(), normals: normals.clone(), indices: indices.clone() }
    }
}
