//! Draws the figures of the guide from a real world, as SVG files: `make figures`.
//!
//! | file | subject |
//! | --- | --- |
//! | `canvas.rs` | SVG: lines, polygons, dots and labels in voxels |
//! | `draw.rs` | figures of a dug world |
//! | `strata.rs` | sections through the presets of strata |

mod canvas;
mod draw;
mod strata;

use std::path::Path;
use std::{fs, io};

use bevy_burrow::prelude::*;

/// Every figure with its file name.
fn all() -> Vec<(String, String)> {
    let presets = Strata::PRESETS.iter().map(|(name, preset)| {
        // High enough for the snow of the first one.
        let base = if *name == "alpine" { 88.0 } else { 20.0 };
        (format!("strata_{name}.svg"), strata::section(&preset(), base))
    });
    draw::all().into_iter().map(|(name, svg)| (name.into(), svg)).chain(presets).collect()
}

fn main() -> io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/guide/src/figures");
    fs::create_dir_all(&folder)?;
    for (name, svg) in all() {
        let path = folder.join(&name);
        fs::write(&path, svg)?;
        println!("{}", path.display());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_the_guide_are_up_to_date() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/guide/src/figures");
        for (name, svg) in all() {
            let stored = fs::read_to_string(folder.join(&name)).unwrap_or_default();
            assert!(stored == svg, "{name} differs from what the world gives: run `make figures`");
        }
    }
}
