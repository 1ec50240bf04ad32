//! Copies a box of the world, to be pasted elsewhere.

use glam::{I64Vec3, IVec3};
use rayon::prelude::*;

use super::state::World;
use crate::brush::{BrushError, Prefab, PrefabError, PrefabSample, ShapeGrid, ground_level};
use crate::ground::MaterialId;
use crate::lattice::{Column, LIMIT, LatticeBox, ONE};
use crate::volume::{Sample, resolve};

impl World {
    /// Copies all samples of a box, edited or not, with their materials. `anchor` is the point of the world that is
    /// placed where the prefab is pasted; it may lie outside the box. Large boxes take seconds: copy them from a
    /// [snapshot](crate::terrain::Terrain::snapshot), on another thread.
    ///
    /// ```
    /// use bevy_burrow::lattice::LatticeBox;
    /// use bevy_burrow::prelude::*;
    /// use glam::{IVec3, Vec3};
    ///
    /// let mut terrain = Terrain::new(Ground::flat(64, 64, 10.0)?, &TerrainSettings::default())?;
    /// terrain.apply([Brush::dig(Shape::sphere(Vec3::new(16.0, 8.0, 16.0), 5.0))]);
    ///
    /// // The pit and a voxel around it, by the point of the ground above its middle.
    /// let pit = LatticeBox { min: IVec3::new(9, 1, 9), max: IVec3::new(23, 15, 23) };
    /// let prefab = terrain.world().copy(pit, IVec3::new(16, 10, 16))?;
    /// let paste = Paste::new(prefab, Vec3::new(40.0, 10.0, 40.0)).turned_about_y(1);
    /// terrain.apply([Brush::paste(paste)]);
    /// assert!(!terrain.world().is_solid(Vec3::new(40.0, 8.0, 40.0).as_dvec3()));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`PrefabError::Size`] for more than 8 million samples, or more than 1024 along a side;
    /// [`PrefabError::OutsideWorld`] for a box that the world does not hold; [`PrefabError::Anchor`] for an anchor far
    /// away from the box.
    pub fn copy(&self, samples: LatticeBox, anchor: IVec3) -> Result<Prefab, PrefabError> {
        let LatticeBox { min, max } = samples;
        let size = max.as_i64vec3() - min.as_i64vec3() + 1;
        let [width, height, depth] = size.to_array();
        if size.max_element() > i64::from(i32::MAX) || size.min_element() < 1 {
            return Err(PrefabError::Size { width, height, depth });
        }
        let (size, from_min) = (size.as_ivec3(), anchor.saturating_sub(min));
        Prefab::check(size, from_min)?;
        let world = LatticeBox {
            min: IVec3::new(0, -LIMIT, 0),
            max: IVec3::new(self.ground().width(), LIMIT, self.ground().depth()),
        };
        if !world.encloses(samples) {
            return Err(PrefabError::OutsideWorld { min, max, world_min: world.min, world_max: world.max });
        }
        let (view, ground) = (self.samples(), self.ground());
        let sample = |point: IVec3| {
            let (raw, density) = (view.sample(point), view.distance(point));
            let (is_edited, is_solid) = (raw != Sample::PRISTINE, density < 0);
            let stored = if is_edited { view.stored_material(point) } else { MaterialId::GROUND };
            PrefabSample {
                density: Sample::edited(density).bits(),
                material: if is_solid { resolve(ground, point, stored) } else { MaterialId::GROUND },
                is_edited,
                has_stored_material: is_solid && stored != MaterialId::GROUND,
            }
        };
        let layer = |y: i32| {
            let rows = (min.z..=max.z).flat_map(|z| (min.x..=max.x).map(move |x| IVec3::new(x, y, z)));
            rows.map(sample).collect::<Vec<_>>()
        };
        let layers: Vec<Vec<PrefabSample>> = (min.y..=max.y).into_par_iter().map(layer).collect();
        let above_ground = anchor.y.saturating_sub(ground_level(ground, Column::of(anchor)));
        Prefab::new(size, from_min, above_ground, layers.into_iter().flatten())
    }

    /// A piece of the world as a shape with its materials: a [fill](crate::brush::Brush::fill) builds it again, with
    /// any rotation and scale and with a rounded edge if wanted, and a dig cuts its form out of the ground. A box has 3
    /// to 128 samples along each side; the outermost count as air. Beyond the world's rim everything continues as at
    /// the rim.
    ///
    /// Where a piece has to be the same to the bit, air included, [copy](Self::copy) it.
    ///
    /// ```
    /// use bevy_burrow::lattice::LatticeBox;
    /// use bevy_burrow::prelude::*;
    /// use glam::{IVec3, Vec3};
    ///
    /// let mut terrain = Terrain::new(Ground::flat(64, 64, 10.0)?, &TerrainSettings::default())?;
    /// terrain.apply([Brush::add(Shape::sphere(Vec3::new(16.0, 16.0, 16.0), 4.0), MaterialId(3))]);
    /// let rock = LatticeBox { min: IVec3::splat(11), max: IVec3::splat(21) };
    /// let rock = terrain.world().shape_grid(rock)?;
    /// let place = Vec3::new(44.0, 13.0, 40.0);
    /// terrain.apply([Brush::fill(GridShape::new(rock, place).with_scale(1.5), 2.0)]);
    /// assert_eq!(terrain.world().samples().material(place.as_ivec3()), MaterialId(3));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`BrushError::GridSize`].
    pub fn shape_grid(&self, samples: LatticeBox) -> Result<ShapeGrid, BrushError> {
        let size = (samples.max.as_i64vec3() - samples.min.as_i64vec3() + 1)
            .clamp(I64Vec3::ZERO, I64Vec3::splat(1 << 20));
        let (view, rim) = (self.samples(), IVec3::new(self.ground().width(), LIMIT, self.ground().depth()));
        let point = |at: IVec3| (samples.min + at).clamp(IVec3::new(0, -LIMIT, 0), rim);
        let distance = |at: IVec3| view.distance(point(at)) as f32 / ONE as f32;
        Ok(ShapeGrid::from_fn(size.as_uvec3(), distance)?.with_materials(|at| view.material(point(at))))
    }
}
