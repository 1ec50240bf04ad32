//! Probes: what lattice points of the pristine world are made of.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use bevy_burrow::ground::Ground;
use glam::IVec3;
use serde::Serialize;

use crate::ExportError;

/// The answer for a lattice point, before any edit.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub struct Probe {
    /// Whether it is below the surface.
    solid: bool,
    /// The ground's own material there; of points above the surface, the one that ground filled in there would have.
    material: u8,
}

/// Reads lattice points, `[x,y,z]` a line.
pub fn read(path: &Path) -> Result<Vec<IVec3>, ExportError> {
    let file = File::open(path).map_err(|reason| ExportError::Read { path: path.into(), reason })?;
    serde_json::Deserializer::from_reader(BufReader::new(file))
        .into_iter::<[i32; 3]>()
        .map(|point| point.map(IVec3::from_array))
        .collect::<Result<_, _>>()
        .map_err(|reason| ExportError::Json { path: path.into(), reason })
}

/// Answers all probes, in order.
pub fn answer(ground: &Ground, points: &[IVec3]) -> Vec<Probe> {
    let probe =
        |&point: &IVec3| Probe { solid: ground.distance(point) < 0, material: ground.material(point).0 };
    points.iter().map(probe).collect()
}
