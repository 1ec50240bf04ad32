//! Damaged files: cut, with flipped bits, with other bytes, with pieces repeated. An answer or an error, never a panic.

use bevy_burrow::ground::{ElevationGrid, ImageLimits, ImportOptions, Repair};

use super::table::entries;

/// Damages for each file; more of them with `BURROW_DAMAGES`.
fn damages() -> u64 {
    std::env::var("BURROW_DAMAGES").ok().and_then(|count| count.parse().ok()).unwrap_or(40)
}

fn damaged(rng: &mut fastrand::Rng, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..rng.usize(1..4) {
        if bytes.is_empty() {
            break;
        }
        // Headers lie at either end.
        let at = match rng.u8(0..4) {
            0 => rng.usize(0..bytes.len().min(64)),
            1 => bytes.len() - 1 - rng.usize(0..bytes.len().min(400)),
            _ => rng.usize(0..bytes.len()),
        };
        match rng.u8(0..5) {
            0 => bytes.truncate(at),
            1 => bytes[at] ^= 1 << rng.u8(0..8),
            2 => bytes[at] = rng.u8(..),
            3 => bytes[at..].iter_mut().take(4).for_each(|byte| *byte = [0, 255][usize::from(rng.bool())]),
            _ => {
                let end = (at + rng.usize(0..32)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
        }
    }
    bytes
}

#[test]
fn damaged_files_are_answered() {
    let limits =
        ImageLimits { max_width: 4097, max_height: 4097, max_alloc_bytes: 64 << 20, ..Default::default() };
    let repairs = [Repair::Keep, Repair::Fill, Repair::Clamp, Repair::Refuse];
    for (number, entry) in entries().into_iter().enumerate() {
        let mut rng = fastrand::Rng::with_seed(number as u64);
        for damage in 0..damages() {
            let bytes = damaged(&mut rng, &entry.bytes);
            let (voids, outliers) = (repairs[rng.usize(0..4)], repairs[rng.usize(0..4)]);
            let options = ImportOptions { voids, outliers, limits, ..entry.options.clone() };
            let answer = std::panic::catch_unwind(|| ElevationGrid::decode(&bytes, &options));
            let Ok(answer) = answer else { panic!("{} panics with damage {damage}", entry.name) };
            match answer {
                Ok((grid, report)) => {
                    let count = grid.samples().len() as u64;
                    assert_eq!(count, u64::from(report.width) * u64::from(report.height), "{}", entry.name);
                    let has_voids = grid.samples().iter().any(|value| !value.is_finite());
                    assert!(!has_voids || voids == Repair::Keep, "{}", entry.name);
                }
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    }
}
