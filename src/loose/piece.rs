//! Loose pieces as receipts list them, and their names.

use std::sync::Arc;

use glam::IVec3;
use serde::{Deserialize, Serialize};

use super::LooseSettings;
use super::search::{self, Component};
use crate::lattice::{LatticeBox, hash};
use crate::surface::SurfaceMesh;
use crate::volume::{MaterialCounts, SampleView};

/// What happened to a loose piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum PieceFate {
    /// The piece stays where it is. So does every piece of which the terrain's
    /// [`DiggingRules`](crate::volume::DiggingRules) protect a part.
    Left,
    /// The piece was taken out of the ground.
    Removed,
    /// The piece was taken out of the ground, and its mesh is there to make a body of.
    BrokeOff,
}

/// Identifies a loose piece.
///
/// The id is a hash of the piece's samples and materials. These depend only on the edit that cuts the piece off and on
/// the ground that it changes, so the pieces of an edit have the same ids on every machine: in a client's prediction,
/// on the server, and when it is redone.
///
/// Two pieces have the same id only if they consisted of exactly the same samples and materials: for example if a game
/// builds the same wall again and cuts it off once more. An undo then returns the later one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct PieceId(pub u64);

impl PieceId {
    fn of(runs: &[Run], materials: &MaterialCounts) -> Self {
        let pair = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
        let runs = runs.iter().flat_map(|&Run { start, len }| {
            [pair(start.x as u32, start.y as u32), pair(start.z as u32, len)]
        });
        let materials = materials.iter().flat_map(|(material, voxels)| [u64::from(material.0), voxels]);
        Self(runs.chain(materials).fold(0, |all, word| hash::mix(all ^ word)))
    }
}

/// Solid samples in a row along x.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Run {
    /// The first of them.
    pub start: IVec3,
    /// How many.
    pub len: u32,
}

/// A piece of ground that is not connected to the world. It can be saved as it is, with its mesh: pieces that broke off
/// are the game's, not the terrain's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "Plain", into = "Plain")]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(opaque, Clone, Debug, PartialEq))]
pub struct LoosePiece {
    /// The piece's id. A saved piece does not store it, because it follows from `runs` and `materials`.
    pub id: PieceId,
    /// What happened to the piece.
    pub fate: PieceFate,
    /// Box around the piece's samples.
    pub bounds: LatticeBox,
    /// Number of samples.
    pub voxels: u64,
    /// Voxels by material: multiplied by density and volume of a voxel, they give the mass.
    pub materials: MaterialCounts,
    /// The piece's samples, by y, then z, then x.
    pub runs: Arc<[Run]>,
    /// The closed surface, as marching cubes draws it, with positions counted from the lowest corner of `bounds`; only
    /// for pieces that broke off.
    pub mesh: Option<Arc<SurfaceMesh>>,
}

/// A piece that came back: what an undo restored as ground.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReturnedPiece {
    /// The id that the piece had when it was cut off.
    pub id: PieceId,
    /// The tag of the brush that had cut it off; 0 where players share the terrain.
    pub tag: u64,
    /// What happened to the piece when it was cut off: [`PieceFate::Removed`] or [`PieceFate::BrokeOff`].
    pub fate: PieceFate,
    /// The piece's voxels by material.
    pub materials: MaterialCounts,
}

impl LoosePiece {
    /// Describes a piece; the settings decide what becomes of it.
    pub(super) fn new(samples: SampleView, piece: &Component, settings: &LooseSettings) -> Self {
        let (mut runs, mut voxels): (Vec<Run>, u64) = Default::default();
        for (pos, layers) in search::bricks(piece) {
            for (layer, y) in layers.iter().zip(0..).filter(|(layer, _)| **layer != 0) {
                for (mut row, z) in layer.to_le_bytes().into_iter().zip(0..) {
                    while row != 0 {
                        let x = row.trailing_zeros();
                        let len = (row >> x).trailing_ones();
                        runs.push(Run { start: pos.origin() + IVec3::new(x as i32, y, z), len });
                        voxels += u64::from(len);
                        row &= u8::MAX.checked_shl(x + len).unwrap_or(0);
                    }
                }
            }
        }
        runs.sort_unstable_by_key(|run| [run.start.y, run.start.z, run.start.x]);
        runs.dedup_by(|next, run| {
            let goes_on = next.start == run.start + IVec3::X * run.len as i32;
            run.len += if goes_on { next.len } else { 0 };
            goes_on
        });
        let (mut bounds, mut materials) = (None::<LatticeBox>, MaterialCounts::default());
        for run in &runs {
            let end = run.start + IVec3::X * (run.len as i32 - 1);
            LatticeBox::include(&mut bounds, LatticeBox { min: run.start, max: end });
            materials.count_each((0..run.len as i32).map(|x| samples.material(run.start + IVec3::X * x)));
        }
        let bounds = bounds.unwrap_or(LatticeBox::point(IVec3::ZERO));
        let id = PieceId::of(&runs, &materials);
        Self { id, fate: settings.fate(voxels), bounds, voxels, materials, runs: runs.into(), mesh: None }
    }

    /// Whether it was taken out of the ground.
    pub fn is_gone(&self) -> bool {
        self.fate != PieceFate::Left
    }

    /// Bytes of its lists and of its mesh, as if nothing else held them.
    pub(crate) fn bytes(&self) -> usize {
        // The counters of an `Arc`.
        let counters = 2 * size_of::<usize>();
        let mesh = self.mesh.as_ref().map_or(0, |mesh| counters + size_of::<SurfaceMesh>() + mesh.bytes());
        size_of::<Self>() + self.materials.bytes() + counters + size_of_val(&self.runs[..]) + mesh
    }
}

impl ReturnedPiece {
    /// A piece that comes back, which a brush with this tag had cut off.
    pub fn new(tag: u64, piece: &LoosePiece) -> Self {
        Self { id: piece.id, tag, fate: piece.fate, materials: piece.materials.clone() }
    }
}

/// A piece without shared parts, as it is saved.
#[derive(Serialize, Deserialize)]
#[serde(rename = "LoosePiece")]
struct Plain {
    fate: PieceFate,
    bounds: LatticeBox,
    voxels: u64,
    materials: MaterialCounts,
    runs: Vec<Run>,
    mesh: Option<SurfaceMesh>,
}

impl From<LoosePiece> for Plain {
    fn from(piece: LoosePiece) -> Self {
        let LoosePiece { id: _, fate, bounds, voxels, materials, runs, mesh } = piece;
        let mesh = mesh.map(Arc::unwrap_or_clone);
        Self { fate, bounds, voxels, materials, runs: runs.to_vec(), mesh }
    }
}

impl From<Plain> for LoosePiece {
    fn from(of: Plain) -> Self {
        let Plain { fate, bounds, voxels, materials, runs, mesh } = of;
        let id = PieceId::of(&runs, &materials);
        Self { id, fate, bounds, voxels, materials, runs: runs.into(), mesh: mesh.map(Arc::new) }
    }
}
