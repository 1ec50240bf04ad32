//! Heights from files of every format, whole, odd and broken.

mod damage;
mod export;
mod exrs;
mod glb;
mod guesses;
mod materials;
mod repairs;
mod sizes;
mod table;
mod tiffs;
mod tiles;

use bevy_burrow::ground::ElevationGrid;

/// FNV-1a of the samples' bits, low byte first; every NaN counts as the same one.
fn hash(grid: &ElevationGrid) -> u64 {
    let bits = |&value: &f32| if value.is_nan() { f32::NAN.to_bits() & 0x7FFF_FFFF } else { value.to_bits() };
    let bytes = grid.samples().iter().map(bits).flat_map(u32::to_le_bytes);
    bytes.fold(0xCBF2_9CE4_8422_2325, |state: u64, byte| {
        (state ^ u64::from(byte)).wrapping_mul(0x100_0000_01B3)
    })
}
