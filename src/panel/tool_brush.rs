//! Makes brushes of the current brush's settings.

use bevy::prelude::*;

use super::texts;
use super::tool::{BrushTool, PATH_POINTS, ToolPrefab, ToolShape};
use super::tool_operation::ToolOperation;
use crate::brush::{Brush, Corridor, GridShape, Operation, Paste, PrefabError, Roughness};
use crate::ground::MaterialId;
use crate::lattice::LatticeBox;
use crate::plugin::TerrainHit;
use crate::terrain::Terrain;

impl BrushTool {
    /// The brush for a position on the ground, in world space.
    pub fn brush_at(&self, hit: &TerrainHit) -> Brush {
        let row = self.operation.row();
        let operation = row.operation(self, hit);
        let mut brush = match (&operation, self.fitting_shape()) {
            (Operation::Road, _) => {
                let along = Corridor::new(self.path_to(self.middle(hit)), self.length, self.length);
                Brush::road(along, self.falloff)
            }
            (Operation::Paste { paste }, _) => Brush::paste(paste.clone()),
            (_, ToolShape::Path) => Brush::dig(self.path_to(self.middle(hit))),
            (_, ToolShape::Model) => match self.model_at(hit) {
                Some(model) => Brush::dig(model),
                None => Brush::dig(self.shape_at(hit)),
            },
            _ => Brush::dig(self.shape_at(hit)),
        };
        brush.operation = operation;
        brush.roughness = self.roughness();
        brush.power = self.power;
        if !row.may_fill() {
            return if row.rounds() { brush.with_falloff(self.rounding) } else { brush };
        }
        let brush = if row.rounds() {
            brush.with_falloff(self.rounding)
        } else {
            brush.with_strength(self.strength).with_falloff(self.falloff)
        };
        if self.is_of_material { brush.with_material(self.material_id()) } else { brush }
    }

    /// Its model at a position.
    pub(super) fn model_at(&self, hit: &TerrainHit) -> Option<GridShape> {
        self.model.shape(self.middle(hit), self.rotation(hit), self.radius)
    }

    /// Whether points of a path are set that no edit was made of.
    pub fn has_path(&self) -> bool {
        !self.points.is_empty() && self.fitting_shape() == ToolShape::Path
    }

    /// The brush along the points of its path, which are forgotten. `None` without points.
    pub fn finish_path(&mut self) -> Option<Brush> {
        let hit = hit_at(self.points.pop()?, Vec3::Y);
        // Points are where the middle of the brush is.
        let brush = Self { sink: 0.0, ..self.clone() }.brush_at(&hit);
        self.points.clear();
        Some(brush)
    }

    /// Adds a point to its path, where the middle of a brush would be.
    pub fn add_point(&mut self, hit: &TerrainHit) {
        if self.points.len() < PATH_POINTS {
            self.points.push(self.middle(hit));
        }
    }

    /// What is pasted at a position, with its anchor there: exactly, if it is upright, turned by quarter turns, and
    /// pasted on a terrain with voxels of the same size at whole multiples of it.
    pub(super) fn paste_at(&self, hit: &TerrainHit) -> Option<Paste> {
        let (prefab, voxel) = (self.prefab.prefab()?, self.prefab.voxel_size);
        let place = (hit.position / voxel).round() * voxel;
        Some(Paste {
            scale: voxel,
            mirror: self.is_mirrored,
            edited_only: self.prefab.is_edits_only,
            ..Paste::new(prefab, place).rotated(self.rotation(hit) * self.prefab.rotation)
        })
    }

    /// Copies what lies in its shape, around a position, to be pasted.
    ///
    /// # Errors
    /// As [`World::copy`](crate::terrain::World::copy): when it is too large, or not in the world.
    pub fn copy(
        &mut self,
        terrain: &Terrain,
        place: &GlobalTransform,
        hit: &TerrainHit,
    ) -> Result<(), PrefabError> {
        let to_voxels = place.affine().inverse();
        let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
        self.shape_at(hit).outline(|from, to| {
            for at in [from, to].map(|at| to_voxels.transform_point3(at)) {
                (low, high) = (low.min(at), high.max(at));
            }
        });
        let samples = LatticeBox { min: low.floor().as_ivec3(), max: high.ceil().as_ivec3() };
        let anchor = to_voxels.transform_point3(hit.position).round().as_ivec3();
        let prefab = terrain.world().copy(samples, anchor)?;
        self.prefab = ToolPrefab {
            name: Some(texts::COPIED.into()),
            rotation: place.rotation(),
            is_edits_only: self.prefab.is_edits_only,
            ..ToolPrefab::new(prefab, place.scale().x.abs())
        };
        self.operation = ToolOperation::Paste;
        Ok(())
    }

    /// The material to add or paint.
    pub fn material_id(&self) -> MaterialId {
        MaterialId(self.material)
    }

    /// The roughness of its surface, if any.
    pub fn roughness(&self) -> Option<Roughness> {
        self.is_rough.then(|| Roughness::new(self.bump, self.bump_width, self.seed))
    }
}

/// A hit of no terrain.
fn hit_at(position: Vec3, normal: Vec3) -> TerrainHit {
    TerrainHit {
        terrain: Entity::PLACEHOLDER,
        distance: 0.0,
        position,
        normal,
        material: MaterialId::default(),
        from_inside: false,
    }
}
