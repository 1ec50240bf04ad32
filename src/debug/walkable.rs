//! Where an agent can walk.

use bevy::prelude::*;

use super::lines::LineBuffer;
use super::place::Place;
use super::wires::{around, voxels};
use crate::lattice::{Column, ONE};
use crate::navigation::{NavTilePos, WalkableTile, Walker};
use crate::terrain::World;

const GROUND: LinearRgba = LinearRgba::rgb(0.10, 0.80, 0.25);
const AIR: LinearRgba = LinearRgba::new(0.15, 0.55, 1.0, 0.35);

/// How far above the ground lines on it lie, in voxels.
const LIFT: f32 = 0.08;
/// Columns from one line through the air to the next.
const APART: i32 = 4;
/// Length of such a line below the sky, in voxels.
const SKY: f32 = 2.0;

/// The edges of polygons of the tiles around the place, and lines from floors to their ceilings.
pub fn draw(world: &World, place: Place, out: &mut LineBuffer) {
    let (Some(bounds), Ok(walker)) = (around(place.focus, place.near), Walker::new(&place.agent)) else {
        return;
    };
    let (low, high) = (Column::of(bounds.min), Column::of(bounds.max));
    out.width(2.0);
    let is_near = |at: Vec3| at.with_y(0.0).distance(place.focus.with_y(0.0)) <= place.near;
    // The nearest first, should there not be room for all.
    let mut tiles: Vec<NavTilePos> = NavTilePos::covering(world, low, high).collect();
    tiles.sort_by_cached_key(|tile| {
        let middle = tile.origin().at(0) + NavTilePos::SIZE / 2;
        (middle - place.focus.as_ivec3()).with_y(0).length_squared()
    });
    for pos in tiles {
        if out.is_full() {
            return;
        }
        let tile = WalkableTile::new(world, pos, &walker);
        let polygons = tile.polygons();
        let origin = pos.origin().at(0).as_vec3();
        let corner = |index: u32| {
            let at = polygons.vertices().get(index as usize).copied().unwrap_or_default();
            origin + voxels(at) + Vec3::Y * LIFT
        };
        for polygon in polygons.iter() {
            let next = polygon.iter().cycle().skip(1);
            for (from, to) in polygon.iter().zip(next).map(|(&from, &to)| (corner(from), corner(to))) {
                if is_near(from) || is_near(to) {
                    out.line(from, to, GROUND);
                }
            }
        }
        for (column, floor, ceiling) in tile.spans() {
            let from = column.at(0).as_vec3() + Vec3::Y * floor as f32 / ONE as f32;
            if column.x % APART == 0 && column.z % APART == 0 && is_near(from) {
                let height = ceiling.map_or(SKY, |ceiling| (ceiling - floor) as f32 / ONE as f32);
                out.line(from, from + Vec3::Y * height, AIR);
            }
        }
    }
}
