//! A terrain seen from bodies above it: whether the ground that they may soon reach has colliders.

use avian3d::prelude::CollisionLayers;
use bevy::math::bounding::{Aabb2d, AabbCast2d};
use bevy::math::{Affine3A, Vec3A};
use bevy::prelude::*;

use super::columns::Columns;
use super::near::{ahead, shortest_side};
use crate::lattice::{Column, TilePos};
use crate::plugin::TerrainEntities;
use crate::terrain::Terrain;

/// How far ahead of a body ground must have colliders, in seconds: longer than any frame.
pub(super) const AHEAD: f32 = 0.25;

/// Bodies at least this far above all ground on their way are not held, in metres.
const CLEARANCE: f32 = 4.0;

/// The distance between height samples on a body's way, in voxels, unless that takes more than [`STOPS`].
const STRIDE: f32 = 2.0;

/// The most height samples on a body's way after the first.
const STOPS: f32 = 16.0;

/// A terrain and the transform from world space to its voxels.
pub(super) struct TerrainFrame<'a> {
    pub terrain: Entity,
    pub model: &'a Terrain,
    /// From world space to voxels.
    pub inverse: Affine3A,
    /// The side of a voxel, in metres.
    pub size: f32,
    /// Whether its tiles and chunks show its current world.
    pub is_shown: bool,
    /// The layers of its ground.
    pub layers: CollisionLayers,
    entities: Option<&'a TerrainEntities>,
}

impl<'a> TerrainFrame<'a> {
    pub fn new(
        terrain: Entity,
        model: &'a Terrain,
        entities: Option<&'a TerrainEntities>,
        place: &GlobalTransform,
        layers: CollisionLayers,
    ) -> Self {
        let is_shown = entities.is_some_and(|entities| entities.show(model.world()));
        let inverse = place.affine().inverse();
        Self { terrain, model, inverse, size: shortest_side(place), is_shown, layers, entities }
    }

    /// The distance from a place to a column along x or z, whichever is larger, in voxels.
    pub fn distance(&self, tile: TilePos, place: Vec2) -> f32 {
        let size = self.model.world().grid().size() as f32;
        let corner = Vec2::new(tile.x as f32, tile.z as f32) * size;
        (place - place.clamp(corner, corner + size)).abs().max_element()
    }

    /// Whether a body whose box is centred at `place` may soon reach ground without a collider.
    pub fn lacks_ground(&self, columns: &Columns, place: Vec3, velocity: Vec3, half: Vec3) -> bool {
        let grid = self.model.world().grid();
        let from = self.inverse.transform_point3(place);
        let way = self.inverse.transform_vector3(velocity * AHEAD);
        if !(from.is_finite() && way.is_finite()) {
            return false;
        }
        let (way, half) = (ahead(way, grid), Vec3::from(self.inverse.matrix3.abs() * Vec3A::from(half)));
        let (low, high) = (from.min(from + way) - half, from.max(from + way) + half);
        let mut missing = self.missing(columns, low, high).peekable();
        if missing.peek().is_none() {
            return false;
        }
        let (body, from, way) = (Aabb2d::new(Vec2::ZERO, half.xz()), from.xz(), way.xz());
        let cast = AabbCast2d::new(body, from, Dir2::new(way).unwrap_or(Dir2::X), way.length());
        let meets = |tile: TilePos| {
            let corner = Vec2::new(tile.x as f32, tile.z as f32) * grid.size() as f32;
            cast.aabb_collision_at(Aabb2d { min: corner, max: corner + grid.size() as f32 }).is_some()
        };
        // The front of the box is ahead of its middle.
        let way = way + way.normalize_or_zero() * half.xz().length();
        missing.any(meets) && self.is_low(from, way, low.y)
    }

    /// The columns below a box that miss colliders.
    fn missing(&self, columns: &Columns, low: Vec3, high: Vec3) -> impl Iterator<Item = TilePos> {
        let grid = self.model.world().grid();
        let (first, last) = (low.floor().as_ivec3(), high.floor().as_ivec3());
        let (first, last) = (
            Column::new(first.x.max(0), first.z.max(0)),
            Column::new(last.x.min(grid.width() - 1), last.z.min(grid.depth() - 1)),
        );
        // Outside the terrain there is nothing to wait for.
        let is_over = first.x <= last.x && first.z <= last.z;
        let tiles = is_over.then(|| (grid.tile_of_cell(first), grid.tile_of_cell(last)));
        let tiles = tiles.into_iter().flat_map(|(first, last)| {
            (first.z..=last.z).flat_map(move |z| (first.x..=last.x).map(move |x| TilePos { x, z }))
        });
        // A column without a tile is loading, has coarser ground drawn over it and no source near, or the game
        // despawned it.
        let lacks = |tile| self.entities.is_some_and(|entities| entities.lack(tile));
        let is_ready =
            move |tile| !lacks(tile) && columns.is_ready((self.terrain, tile)).unwrap_or(self.is_shown);
        tiles.filter(move |&tile| !is_ready(tile))
    }

    /// Whether its lowest point comes near or below the ground somewhere on its way.
    fn is_low(&self, from: Vec2, way: Vec2, low: f32) -> bool {
        let world = self.model.world();
        let end = Vec2::new(world.grid().width() as f32, world.grid().depth() as f32);
        let count = (way.length() / STRIDE).ceil().min(STOPS);
        (0..=count as u32).any(|stop| {
            let place = (from + way * (stop as f32 / count.max(1.0))).clamp(Vec2::ZERO, end).as_dvec2();
            let height = world.height(place.x, place.y);
            height.is_some_and(|height| f64::from(low) < height + f64::from(CLEARANCE / self.size))
        })
    }
}
