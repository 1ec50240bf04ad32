//! New ground from noise: the device computes the heights, which are copied back slice by slice.

use rayon::prelude::*;

use super::device::{Device, Fault, HostMemory, Launch};
use super::layout::{COLUMNS, HeightsParams};
use super::session::Session;
use super::staging::StagingLayout;
use super::{Cuda, guarded, try_lock};
use crate::ground::{Ground, NoiseHeights, NoiseKind, NoiseParams};

/// From this many columns on, the device is assumed to be faster: 16 threads take 3.3 ms for them, an H200 0.7 to 2
/// ms. For a fourth of them the times are 1.0 and 0.6 ms, and a slower GPU may lose.
const LEAST: usize = 1 << 18;

/// Maximum number of columns per launch: 4 MiB of heights, twice on the host. That keeps a GPU busy, and is short
/// enough for copies out of pinned memory to overlap with the next launch.
const SLICE: usize = 1 << 20;

/// Columns that a thread of the host copies at a time.
const PIECE: usize = 1 << 14;

impl Cuda {
    /// Ground from noise if the device is available, chosen and succeeds; otherwise the CPU has to compute it. That
    /// includes invalid parameters.
    pub fn ground(&self, width: u32, depth: u32, noise: &NoiseHeights) -> Option<Ground> {
        let params = noise.params(width, depth).ok()?;
        if self.is_auto && params.columns() < LEAST {
            return None;
        }
        if !self.is_auto {
            self.open();
        }
        let heights = {
            let mut place = try_lock(&self.shared.session)?;
            let session = place.as_mut()?;
            // The memory is first touched by the threads that fill it.
            let mut heights = bytemuck::allocation::try_zeroed_vec(params.columns()).ok()?;
            // As for transactions, a panic counts as a fault.
            let done = guarded(|| session.heights(&params, &mut heights));
            if let Err(fault) = done {
                self.handle_fault(&mut place, &fault);
                return None;
            }
            heights
        };
        params.ground(heights)
    }
}

/// Heights of one slice on the device, and of two on the host: one is copied from while the other is written.
struct Buffers {
    own: u64,
    host: [Box<dyn HostMemory>; 2],
}

impl Buffers {
    fn new(device: &mut dyn Device, bytes: usize) -> Result<Self, Fault> {
        let host = [device.alloc_host(bytes)?, device.alloc_host(bytes)?];
        Ok(Self { own: device.alloc(bytes)?, host })
    }
}

impl Session {
    /// Computes the heights of a world in 1/256 voxel, `i32::MIN` where one exceeds the lattice's limit.
    pub(super) fn heights(&mut self, params: &NoiseParams, heights: &mut [i32]) -> Result<(), Fault> {
        self.heights_in_slices(params, heights, SLICE)
    }

    /// Computes heights in slices of `slice` columns.
    pub(super) fn heights_in_slices(
        &mut self,
        params: &NoiseParams,
        heights: &mut [i32],
        slice: usize,
    ) -> Result<(), Fault> {
        let mut plan = StagingLayout::default();
        let tables = plan.section::<[u8; 256]>(params.tables.len());
        self.input.open(&mut *self.device, &plan)?;
        // Allocation failures must show before any work is in flight.
        let mut buffers = Buffers::new(&mut *self.device, heights.len().min(slice) * size_of::<i32>())?;
        self.input.put(tables, &params.tables);
        let params =
            HeightsParams { heights: buffers.own, ..kernel_params(params, self.input.address(tables)) };
        let sent = self.input.send(&mut *self.device, &plan);
        let filled = sent.and_then(|()| fill(&mut *self.device, params, &mut buffers, heights, slice));
        // Work in flight uses buffers that are freed next.
        let ended = self.device.wait();
        self.device.free(buffers.own);
        filled.and(ended)
    }
}

/// Launches slice after slice, and copies out each one during the next launch.
fn fill(
    device: &mut dyn Device,
    mut params: HeightsParams,
    buffers: &mut Buffers,
    heights: &mut [i32],
    slice: usize,
) -> Result<(), Fault> {
    let mut arrived: Option<&mut [i32]> = None;
    let [mut next, mut last] = buffers.host.each_mut();
    for part in heights.chunks_mut(slice) {
        params.count = part.len() as u32;
        let blocks = part.len().div_ceil(COLUMNS) as u32;
        // SAFETY: the buffers in the parameters are as long as the parameters say, and stay allocated until the wait.
        unsafe { device.launch(Launch::new(blocks, &params)) }?;
        // SAFETY: the kernel writes this many heights, and they are read after the wait.
        unsafe { device.download(params.heights, &mut **next, 0..size_of_val(part)) }?;
        params.first += params.count;
        if let Some(part) = arrived.replace(part) {
            copy(&**last, part);
        }
        device.wait()?;
        std::mem::swap(&mut next, &mut last);
    }
    if let Some(part) = arrived {
        copy(&**last, part);
    }
    Ok(())
}

/// Copies heights out of a buffer in parallel: most of the time goes into page faults of fresh memory.
fn copy(from: &dyn HostMemory, to: &mut [i32]) {
    let bytes = &from.bytes()[..size_of_val(to)];
    let pieces = to.par_chunks_mut(PIECE).zip(bytes.par_chunks(PIECE * size_of::<i32>()));
    pieces.for_each(|(to, from)| bytemuck::cast_slice_mut(to).copy_from_slice(from));
}

/// Parameters of the first slice, without the address of the heights.
fn kernel_params(params: &NoiseParams, tables: u64) -> HeightsParams {
    HeightsParams {
        tables,
        heights: 0,
        noise: params.numbers,
        first: 0,
        count: 0,
        row_len: params.row_len() as u32,
        octaves: params.tables.len() as u32,
        is_ridged: (params.kind == NoiseKind::Ridged).into(),
        pad: 0,
    }
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;

    use super::super::tests::{device, limits, worlds};
    use super::*;
    use crate::ground::{MAX_OCTAVES, MAX_SCALE, MAX_SIZE};

    /// Asserts that the device's ground is the CPU's, or none if the CPU rejects a height. Returns whether there is
    /// one.
    fn compare(
        session: &mut Session,
        (width, depth): (u32, u32),
        noise: &NoiseHeights,
        slice: usize,
    ) -> bool {
        let params = noise.params(width, depth).expect("parameters in range");
        let mut heights = vec![77; params.columns()];
        session.heights_in_slices(&params, &mut heights, slice).expect("the device is fine");
        let (found, expected) = (params.ground(heights), Ground::from_noise(width, depth, noise).ok());
        assert!(found == expected, "{width} x {depth}, {noise:?}: {found:?}, not {expected:?}");
        found.is_some()
    }

    fn random_noise(rng: &mut Rng) -> NoiseHeights {
        let sign = |rng: &mut Rng| if rng.bool() { 1.0 } else { -1.0 };
        // From a thousandth of a voxel up to lengths of which two exceed the lattice's limit.
        let length = |rng: &mut Rng| match rng.u32(0..10) {
            0 => 0.0,
            1 => sign(rng) * 32_768.0,
            2 => sign(rng) * 32_768.0 * rng.f64(),
            _ => sign(rng) * f64::powf(10.0, rng.f64() * 7.5 - 3.0),
        };
        NoiseHeights {
            seed: if rng.u32(0..8) == 0 { u32::MAX - rng.u32(0..16) } else { rng.u32(..) },
            kind: if rng.bool() { NoiseKind::Fractal } else { NoiseKind::Ridged },
            octaves: rng.u32(1..=MAX_OCTAVES),
            scale: match rng.u32(0..6) {
                0 => 1.0,
                1 => MAX_SCALE,
                2 => f64::from(1 << rng.u32(0..20)),
                _ => MAX_SCALE.powf(rng.f64()),
            },
            amplitude: length(rng),
            base: length(rng),
        }
    }

    #[test]
    fn ground_of_any_noise_equals_the_cpus() {
        let Some(device) = device() else { return };
        let mut session = Session::new(device, 1 << 20).expect("a session");
        let mut rng = Rng::with_seed(23);
        let (worlds, mut made) = (worlds::world_count(40) * 10, 0);
        for _ in 0..worlds {
            let noise = random_noise(&mut rng);
            let size = (rng.u32(1..80), rng.u32(1..60));
            // All at once, slices of several rows, and slices of parts of a row or column.
            let slice = [1 << 20, rng.usize(900..5000), rng.usize(30..200)][rng.usize(0..3)];
            made += u64::from(compare(&mut session, size, &noise, slice));
        }
        println!("{made} of {worlds} worlds were within the limit");
        assert!(made > worlds / 2 && made < worlds);
    }

    #[test]
    fn noise_equals_the_cpus_to_the_last_bit_of_a_double() {
        let Some(device) = device() else { return };
        let mut session = Session::new(device, 1 << 20).expect("a session");
        let mut rng = Rng::with_seed(29);
        // Large enough for the rounded heights to show the last bit.
        let amplitude = 2.0_f64.powi(100);
        for _ in 0..worlds::world_count(40) * 50 {
            let noise = NoiseHeights { amplitude: 1.0, ..random_noise(&mut rng) };
            let (width, depth) = (rng.u32(1..40), rng.u32(1..20));
            let (x, z) = (rng.u32(0..=width), rng.u32(0..=depth));
            let expected = noise.by_column()(x as i32, z as i32);
            let mut params = noise.params(width, depth).expect("parameters in range");
            (params.numbers.amplitude, params.numbers.base) = (amplitude, -amplitude * expected);
            let mut heights = vec![77; params.columns()];
            session.heights(&params, &mut heights).expect("the device is fine");
            let found = heights[z as usize * params.row_len() + x as usize];
            assert_eq!(found, 0, "({x}, {z}) of {noise:?}");
        }
    }

    #[test]
    fn every_kind_and_number_of_octaves_equals_the_cpus() {
        let Some(device) = device() else { return };
        let mut session = Session::new(device, 1 << 20).expect("a session");
        for kind in [NoiseKind::Fractal, NoiseKind::Ridged] {
            for octaves in 1..=MAX_OCTAVES {
                let noise = NoiseHeights { kind, octaves, amplitude: 30_000.0, ..NoiseHeights::default() };
                assert!(compare(&mut session, (63, 64), &noise, SLICE));
            }
        }
    }

    #[test]
    fn the_far_ends_of_the_widest_worlds_equal_the_cpus() {
        let Some(device) = device() else { return };
        let mut session = Session::new(device, 1 << 20).expect("a session");
        for kind in [NoiseKind::Fractal, NoiseKind::Ridged] {
            let noise = NoiseHeights { kind, octaves: 16, scale: 1.0, ..NoiseHeights::default() };
            assert!(compare(&mut session, (MAX_SIZE, 1), &noise, SLICE));
            assert!(compare(&mut session, (1, MAX_SIZE), &noise, 10_000));
        }
    }

    #[test]
    fn a_gpu_makes_ground_where_that_is_faster_and_blocks_no_caller() {
        let open = |is_auto| {
            let device = device()?;
            let cuda = Cuda::with_device(is_auto, limits(64 << 20), &[(1, 2.0)], |_| Ok(device));
            cuda.open();
            while cuda.state() == crate::backend::EngineState::Opening {
                std::thread::sleep(std::time::Duration::from_millis(2));
            }
            Some(cuda)
        };
        let noise = NoiseHeights { octaves: 1, ..NoiseHeights::default() };
        let (Some(auto), Some(always)) = (open(true), open(false)) else { return };
        assert!(auto.ground(511, 510, &noise).is_none());
        assert_eq!(auto.ground(511, 511, &noise), Ground::from_noise(511, 511, &noise).ok());
        assert_eq!(always.ground(1, 1, &noise), Ground::from_noise(1, 1, &noise).ok());
        let _taken = super::super::lock(&always.shared.session);
        assert!(always.ground(1, 1, &noise).is_none());
    }
}
