//! Performance targets of our mesher relative to fast-surface-nets, and whether they are met.

use std::fmt::Write;

use serde::Serialize;

use crate::fields::Field;
use crate::table::{Input, Row};
use crate::timing::Spread;
use crate::{fast_surface_nets, ours};

/// One target: our median paired ratio to fast-surface-nets.
#[derive(Debug, Serialize)]
pub struct Target {
    /// The compared meshers.
    pub what: String,
    /// The ratio that was measured.
    pub ratio: Spread,
    /// The largest median that meets the target.
    pub limit: f64,
    /// Whether the target is met.
    pub met: bool,
}

fn limit_with_normals(field: Field, input: Input) -> f64 {
    match (input, field) {
        (Input::Grid(0..64), _) => 0.35,
        (Input::Grid(_), Field::Sphere | Field::Terrain) => 0.25,
        (Input::Grid(_), Field::Caves) => 0.30,
        (Input::Grid(_), Field::Empty) => 0.05,
        (Input::Stream(_), Field::Sphere) => 0.33,
        (Input::Stream(_), Field::Terrain) => 0.36,
        (Input::Stream(_), Field::Caves) => 0.30,
        (Input::Stream(_), Field::Empty) => 0.08,
    }
}

fn limit_without(input: Input) -> Option<f64> {
    matches!(input, Input::Grid(64..)).then_some(0.20)
}

/// The targets for these rows.
pub fn targets(rows: &[Row]) -> Vec<Target> {
    let mut targets = Vec::new();
    for row in rows.iter().filter(|row| row.name == fast_surface_nets::NAME) {
        let input = match row.input {
            Input::Grid(size) => format!("n = {size}"),
            Input::Stream(_) => "stream".to_string(),
        };
        let mut add = |mesher: &str, ratio: Option<Spread>, limit: Option<f64>| {
            if let (Some(ratio), Some(limit)) = (ratio, limit) {
                let what = format!("{:<8} {input:<8} {mesher}", row.field.name());
                targets.push(Target { what, ratio, limit, met: ratio.median <= limit });
            }
        };
        add(ours::REFERENCE, row.ratio, Some(limit_with_normals(row.field, row.input)));
        add(ours::REFERENCE_BARE, row.bare_ratio, limit_without(row.input));
    }
    targets
}

/// Formats one line per target.
pub fn print(targets: &[Target]) -> String {
    let mut text = format!("\ntargets: our time over that of {}\n", fast_surface_nets::NAME);
    for Target { what, ratio, limit, met } in targets {
        let verdict = if *met { "met" } else { "missed" };
        let _ = writeln!(text, "  {what:<44} {:.3}  at most {limit:.2}  {verdict}", ratio.median);
    }
    text
}
