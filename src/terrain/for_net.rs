//! What a client's replica needs of a terrain, in addition to the public interface.

use std::sync::Arc;

use super::model::Terrain;
use crate::lattice::BrickPos;
use crate::volume::Brick;
use crate::world::{TerrainError, TerrainSettings};

impl Terrain {
    /// A terrain with the same world, rules and settings, in which nothing waits. Both share the world until one of
    /// them changes.
    ///
    /// # Errors
    /// Never, as this one has the same settings.
    pub(crate) fn fork(&self) -> Result<Self, TerrainError> {
        let chunk_size = self.world.grid().size() as u32;
        let settings = TerrainSettings { chunk_size, voxel_size: self.voxel_size() };
        let mut fork = Self::new(self.world.shared_ground(), &settings)?;
        fork.world = Arc::clone(&self.world);
        fork.edit_settings = self.edit_settings.clone();
        Ok(fork)
    }

    /// Stores these bricks in place of equal ones, so that worlds that hold the same share them. Others are left as
    /// they are.
    pub(crate) fn share_bricks<'a>(&mut self, bricks: impl IntoIterator<Item = (BrickPos, &'a Arc<Brick>)>) {
        for (pos, brick) in bricks {
            let Some(own) = self.world.bricks.get(&pos) else { continue };
            if !Arc::ptr_eq(own, brick) && Brick::is_same(Some(own), Some(brick)) {
                Arc::make_mut(&mut self.world).bricks.insert(pos, Arc::clone(brick));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::Ground;

    #[test]
    fn equal_bricks_are_shared_and_others_stay() {
        let new = || Terrain::new(Ground::flat(64, 64, 20.0).expect("valid"), &TerrainSettings::default());
        let (mut a, mut b) = (new().expect("valid"), new().expect("valid"));
        let dig = |x: f32, z: f32| Brush::dig(Shape::sphere(Vec3::new(x, 20.0, z), 6.0));
        for own in [&mut a, &mut b] {
            own.apply([dig(20.0, 20.0), dig(44.0, 40.0), dig(20.0, 44.0)]);
        }
        b.apply([dig(44.0, 20.0)]);
        let hash = a.world().hash();
        let parts = b.parts();
        a.share_bricks(parts.change.bricks.iter().filter_map(|(pos, brick)| Some((*pos, brick.as_ref()?))));
        assert_eq!(a.world().hash(), hash);
        let is_shared = |pos| {
            let [own, other] = [&a, &b].map(|terrain| terrain.world().brick(pos));
            own.zip(other).is_some_and(|(own, other)| Arc::ptr_eq(own, other))
        };
        let shared = a.world().bricks().filter(|(pos, _)| is_shared(*pos));
        let (shared, all) = (shared.count(), a.world().bricks().count());
        assert!(shared > all / 2, "{shared} of {all}");
    }
}
