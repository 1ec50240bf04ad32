//! The figures printed in the paper: P. Andersson and S. Johansson, *Rendering with Marching Cubes, looking at Hybrid
//! Solutions* (2012), Tables 1 to 5. Seconds for 100 edits, kilobytes of the process.

use crate::backend::Backend;
use crate::edits::Run;

/// Chunk sizes of Tables 1 to 4, in columns from left to right.
pub const CHUNK_SIZES: [u32; 4] = [25, 50, 75, 100];

/// Edits in a run: the total is a hundred times the average, except for three averages that the paper gives with other
/// digits (Table 3, chunk size 100; Table 4, chunk size 50; Table 5, second run). All are given here as printed.
pub const EDITS: usize = 100;

/// Repeats of each scenario.
pub const REPEATS: usize = 10;

/// Number of tests in the paper: 4 scenarios x 3 solutions (CPU, GPU, full field) x 2 runs x 10 repeats.
pub const TESTS: usize = 240;

/// The paper's machine.
pub const MACHINE: &str = "Intel Core i5-2500 (4 cores), GeForce GTX 570, 4 GB";

/// One column of a table.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    pub total: f64,
    pub average: f64,
    pub max: f64,
    pub min: f64,
    /// Kilobytes; Tables 3 and 5 print none.
    pub memory: Option<u64>,
}

const fn column(total: f64, average: f64, max: f64, min: f64, memory: Option<u64>) -> Column {
    Column { total, average, max, min, memory }
}

/// Table 1.
const CPU_FIRST: [Column; 4] = [
    column(14.955078, 0.149551, 1.041016, 0.000000, Some(970_636)),
    column(6.681641, 0.066816, 0.451172, 0.003906, Some(325_192)),
    column(6.123047, 0.061230, 0.363281, 0.009766, Some(342_020)),
    column(6.855469, 0.068555, 0.541016, 0.001953, Some(536_464)),
];

/// Table 2.
const CPU_SECOND: [Column; 4] = [
    column(0.949219, 0.009492, 0.048828, 0.001953, Some(976_692)),
    column(1.533203, 0.015332, 0.044922, 0.001953, Some(331_564)),
    column(2.462891, 0.024629, 0.060547, 0.005859, Some(353_719)),
    column(3.646484, 0.036465, 0.083984, 0.000000, Some(536_384)),
];

/// Table 3.
const GPU_FIRST: [Column; 4] = [
    column(16.369141, 0.163691, 1.087891, 0.003906, None),
    column(7.160156, 0.071602, 0.453125, 0.003906, None),
    column(6.736280, 0.067363, 0.373047, 0.011719, None),
    column(7.212891, 0.072190, 0.556641, 0.003906, None),
];

/// Table 4.
const GPU_SECOND: [Column; 4] = [
    column(2.203125, 0.022031, 0.093750, 0.003906, Some(1_003_080)),
    column(2.350781, 0.0220508, 0.054688, 0.005859, Some(356_188)),
    column(3.011719, 0.030117, 0.074219, 0.007813, Some(376_284)),
    column(4.039063, 0.040391, 0.107422, 0.001953, Some(559_704)),
];

/// Table 5.
const FULL_FIRST: Column = column(29.783081, 0.297831, 0.978760, 0.117920, None);
const FULL_SECOND: Column = column(29.792974, 0.297980, 0.978760, 0.117676, None);

/// The hybrid's columns for a backend and run, one for each of [`CHUNK_SIZES`].
pub const fn hybrid(backend: Backend, run: Run) -> [Column; 4] {
    match (backend, run) {
        (Backend::Cpu, Run::First) => CPU_FIRST,
        (Backend::Cpu, Run::Second) => CPU_SECOND,
        (Backend::Cuda, Run::First) => GPU_FIRST,
        (Backend::Cuda, Run::Second) => GPU_SECOND,
    }
}

/// The whole terrain as one field.
pub const fn full(run: Run) -> Column {
    match run {
        Run::First => FULL_FIRST,
        Run::Second => FULL_SECOND,
    }
}
