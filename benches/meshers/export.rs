//! Writes the grids to files, so that programs in other languages can mesh the same samples.

use std::fs;
use std::io;
use std::path::Path;

use serde::Serialize;

use crate::fields::{Border, Field};

/// One file of samples.
#[derive(Serialize)]
struct Entry {
    field: Field,
    /// Samples along a side.
    size: usize,
    /// Whether the border is two samples of air.
    closed: bool,
    file: String,
}

/// The index file.
#[derive(Serialize)]
struct Index {
    format: &'static str,
    solid: &'static str,
    grids: Vec<Entry>,
}

/// Writes every field at every size, cut and closed, and `grids.json`.
pub fn write(folder: &Path, fields: &[Field], sizes: &[usize]) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let mut grids = Vec::new();
    for &field in fields {
        for &size in sizes {
            for (border, closed, ending) in [(Border::Cut, false, ""), (Border::Closed, true, "_closed")] {
                let file = format!("{}_{size}{ending}.f32", field.name());
                let samples = field.grid(size, border).samples;
                let bytes: Vec<u8> = samples.iter().flat_map(|sample| sample.to_le_bytes()).collect();
                fs::write(folder.join(&file), bytes)?;
                grids.push(Entry { field, size, closed, file });
            }
        }
    }
    let format = "little-endian f32, x fastest, then y, then z";
    let index = Index { format, solid: "negative", grids };
    fs::write(folder.join("grids.json"), serde_json::to_vec_pretty(&index)?)
}
