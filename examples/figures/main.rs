//! Draws the figures of the guide from a real world, as SVG files: `make figures`.
//!
//! | file | subject |
//! | --- | --- |
//! | `canvas.rs` | SVG: lines, polygons, dots and labels in voxels |
//! | `draw.rs` | the figures |

mod canvas;
mod draw;

use std::path::Path;
use std::{fs, io};

fn main() -> io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/guide/src/figures");
    fs::create_dir_all(&folder)?;
    for (name, svg) in draw::all() {
        let path = folder.join(name);
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
        for (name, svg) in draw::all() {
            let stored = fs::read_to_string(folder.join(name)).unwrap_or_default();
            assert!(stored == svg, "{name} differs from what the world gives: run `make figures`");
        }
    }
}
