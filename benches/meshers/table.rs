//! The rows of the tables, and their formatting.

use std::fmt::Write;

use serde::Serialize;

use crate::contender::{Class, Shading, Sharing};
use crate::fields::Field;
use crate::timing::{Spread, Times};
use crate::{fast_surface_nets, ours};

/// The input that was meshed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Input {
    /// One grid with this number of samples along a side, meshed repeatedly.
    Grid(usize),
    /// This number of chunks, meshed once each.
    Stream(usize),
}

/// One contender on one input.
#[derive(Debug, Serialize)]
pub struct Row {
    /// The field.
    pub field: Field,
    /// Grid or stream.
    pub input: Input,
    /// The contender.
    pub name: &'static str,
    /// The content of its meshes.
    pub class: Class,
    /// Triangles that are timed in one round of a grid, or in the whole stream.
    pub triangles: usize,
    /// Number of rounds, or of chunks.
    pub rounds: usize,
    /// Nanoseconds per cell.
    pub per_cell: Spread,
    /// Our times divided by this contender's, round by round; with normals if it has normals.
    pub ratio: Option<Spread>,
    /// Our times without normals divided by this contender's.
    pub bare_ratio: Option<Spread>,
}

/// The rows of one input.
pub fn rows(field: Field, input: Input, cells: usize, times: &[Times]) -> Vec<Row> {
    let named = |name: &str| times.iter().find(|times| times.name == name);
    let (reference, bare) = (named(ours::REFERENCE), named(ours::REFERENCE_BARE));
    let row = |times: &Times| {
        let has_normals = times.class.shading != Shading::None;
        let with_normals = reference.filter(|_| has_normals);
        // fast-surface-nets cannot omit its normals; games that need none use it as well.
        let without = bare.filter(|_| !has_normals || times.name == fast_surface_nets::NAME);
        Row {
            field,
            input,
            name: times.name,
            class: times.class,
            triangles: times.triangles,
            rounds: times.rounds.len(),
            per_cell: times.per_cell(cells),
            ratio: with_normals.map(|ours| ours.over(times)),
            bare_ratio: without.map(|ours| ours.over(times)),
        }
    };
    times.iter().map(row).collect()
}

/// The classes, each of which is compared separately.
const SECTIONS: [(&str, fn(&Row) -> bool, fn(&Row) -> Option<Spread>); 3] = [
    (
        "with normals, shared vertices",
        |row| row.ratio.is_some() && row.class.sharing != Sharing::TriangleSoup,
        |row| row.ratio,
    ),
    (
        "with normals, three vertices per triangle; ours are shared",
        |row| row.ratio.is_some() && row.class.sharing == Sharing::TriangleSoup,
        |row| row.ratio,
    ),
    ("ours without normals", |row| row.bare_ratio.is_some(), |row| row.bare_ratio),
];

/// The rows of one input as a table.
pub fn print(rows: &[Row], cells: usize) -> String {
    let mut text = String::new();
    let Some(first) = rows.first() else { return text };
    let what = match first.input {
        Input::Grid(size) => format!("n = {size}, {cells} cells, {} rounds", first.rounds),
        Input::Stream(chunks) => format!("stream of {chunks} chunks of {cells} cells, once each"),
    };
    let _ = writeln!(text, "\n{}, {what}", first.field.name());
    let _ = writeln!(text, "{:<46} {:>9} {:>10}   ours / it (quartiles)", "", "ns/cell", "triangles");
    for (title, belongs, ratio) in SECTIONS {
        let mut members = rows.iter().filter(|row| belongs(row)).peekable();
        if members.peek().is_some() {
            let _ = writeln!(text, "  {title}");
        }
        for row in members {
            let _ = write!(text, "    {:<42} {:>9.3} {:>10}", label(row), row.per_cell.median, row.triangles);
            let _ = match ratio(row) {
                Some(_) if is_reference(row) => writeln!(text),
                Some(Spread { low, median, high }) => {
                    writeln!(text, "   {median:.3} ({low:.3} to {high:.3})")
                }
                None => writeln!(text),
            };
        }
    }
    text
}

fn is_reference(row: &Row) -> bool {
    [ours::REFERENCE, ours::REFERENCE_BARE].contains(&row.name)
}

/// A name, with the differences from our meshes in the same section.
fn label(row: &Row) -> String {
    let note = match row.class {
        Class { shading: Shading::Gradients, .. } => " (normals not unit)",
        Class { sharing: Sharing::Partly, .. } => " (partly shared)",
        _ => "",
    };
    format!("{}{note}", row.name)
}
