//! Checks before timing: all meshes are closed, and are the same surface where the algorithms have to agree.
//!
//! Where two solid corners of a cube's face lie diagonally, meshers may join or separate them; both are correct.
//! Balls have no such faces and hills hardly any. Caves have many, so components and handles may differ there and are
//! only reported. A dual mesh has a single vertex for all sheets in a cell, so it may be non-manifold.

use std::fmt::Write;

use serde::Serialize;

use crate::contender::{Contender, Part, Shading};
use crate::fields::{Border, Field, Grid};
use crate::timing::CHUNK_CELLS;
use crate::topology::{Topology, open_inside};

/// The result of one contender on a closed grid.
#[derive(Debug, Serialize)]
pub struct Finding {
    /// The field.
    pub field: Field,
    /// Samples along the grid's side.
    pub size: usize,
    /// The contender.
    pub name: &'static str,
    /// The topology of its mesh, if it could be computed.
    pub topology: Option<Topology>,
    /// Faults, and differences from the first contender.
    pub remarks: Vec<String>,
    /// Whether this stops the benchmark.
    pub fatal: bool,
}

/// Meshes a closed grid with every contender.
pub fn closed_grid(contenders: &mut [Box<dyn Contender>], field: Field, size: usize) -> Vec<Finding> {
    let grid = field.grid(size, Border::Closed);
    let mut findings: Vec<Finding> = Vec::new();
    for contender in contenders {
        let (name, class) = (contender.name(), contender.class());
        contender.load(&grid);
        contender.mesh(&grid, Part::Whole);
        let mesh = contender.result();
        let (mut remarks, mut broken) = (Vec::new(), false);
        let topology = match Topology::of(&mesh, class.sharing) {
            Ok(topology) => Some(topology),
            Err(error) => {
                remarks.push(error.to_string());
                broken = true;
                None
            }
        };
        if let Some(topology) = &topology {
            if topology.unbalanced > 0 {
                remarks.push(format!("not closed: {} unbalanced edges", topology.unbalanced));
                broken = true;
            }
            if !topology.faces_air {
                remarks.push("faces the ground".into());
                broken = true;
            }
            if topology.degenerate > 0 {
                remarks.push(format!("{} degenerate triangles", topology.degenerate));
            }
            if topology.crowded > 0 {
                remarks.push(format!("{} edges of more than two triangles", topology.crowded));
            }
        }
        if class.shading == Shading::Unit && !mesh.normals.iter().all(|&normal| is_unit(normal)) {
            remarks.push("normals that are not of unit length".into());
        }
        let is_ours = name.starts_with("burrow");
        let mut fatal = is_ours && broken;
        if let (Some(topology), Some(first)) = (&topology, findings.first().and_then(|first| first.topology))
        {
            let same = (topology.components, topology.euler) == (first.components, first.euler);
            if !same {
                remarks.push(format!(
                    "{} pieces and Euler characteristic {}, not {} and {}",
                    topology.components, topology.euler, first.components, first.euler
                ));
            }
            // Nothing follows from a broken peer.
            fatal |= !same && !broken && !class.dual && field != Field::Caves;
            fatal |= is_ours && topology.triangles != first.triangles;
        }
        findings.push(Finding { field, size, name, topology, remarks, fatal });
    }
    findings
}

/// Meshes a chunk of a stream and returns the faults. Our meshers must give the same triangles for all sample
/// formats, and marching cubes may have open edges only on the chunk's faces.
pub fn chunk(contenders: &mut [Box<dyn Contender>], chunk: &Grid) -> Vec<String> {
    let (mut remarks, mut expected) = (Vec::new(), None);
    for contender in contenders {
        let (name, class) = (contender.name(), contender.class());
        contender.load(chunk);
        contender.mesh(chunk, Part::WithinApron);
        let (mesh, triangles) = (contender.result(), contender.triangles());
        if mesh.indices.len() != triangles * 3 {
            remarks.push(format!("{name}: {triangles} triangles, {} indices", mesh.indices.len()));
        }
        if class.dual {
            continue;
        }
        match open_inside(&mesh, class.sharing, [1.0, (CHUNK_CELLS + 1) as f32]) {
            Ok(0) => {}
            Ok(open) => remarks.push(format!("{name}: {open} open edges inside the chunk")),
            Err(error) => remarks.push(format!("{name}: {error}")),
        }
        if *expected.get_or_insert(triangles) != triangles {
            remarks.push(format!("{name}: {triangles} triangles, not {expected:?}"));
        }
        if !mesh.normals.iter().all(|&normal| is_unit(normal)) {
            remarks.push(format!("{name}: normals that are not of unit length"));
        }
    }
    remarks
}

fn is_unit([x, y, z]: [f32; 3]) -> bool {
    let length = (x * x + y * y + z * z).sqrt();
    (length - 1.0).abs() < 1e-3
}

/// Formats the findings on one grid: the first contender's mesh, how many agree, and a line for each that does not.
pub fn describe(findings: &[Finding]) -> String {
    let Some(first) = findings.first() else { return String::new() };
    let shape = first.topology.map_or_else(
        || "no mesh".to_string(),
        |shape| {
            let Topology { triangles, components, euler, .. } = shape;
            format!("{triangles} triangles, {components} pieces, {} handles, Euler {euler}", shape.genus())
        },
    );
    let agreed = findings.iter().filter(|finding| finding.remarks.is_empty()).count();
    let mut text = format!(
        "  {:<8} n = {:<4} {shape}; {agreed} of {} closed and alike\n",
        first.field.name(),
        first.size,
        findings.len()
    );
    for Finding { name, remarks, fatal, .. } in findings.iter().filter(|finding| !finding.remarks.is_empty())
    {
        let mark = if *fatal { "WRONG " } else { "" };
        let _ = writeln!(text, "      {mark}{name}: {}", remarks.join("; "));
    }
    text
}
