//! Settings of a new terrain, and their errors.

/// Settings of a terrain: chunk size and voxel size.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TerrainSettings {
    /// Cells along a chunk's side, 8..=128. Small chunks are rebuilt faster, large ones need fewer draw calls.
    pub chunk_size: u32,
    /// Metres along a voxel's side: a power of two from 1/8 to 8, so that scaling loses no bits. The model itself
    /// counts in voxels.
    pub voxel_size: f32,
}

impl Default for TerrainSettings {
    fn default() -> Self {
        Self { chunk_size: 32, voxel_size: 1.0 }
    }
}

impl TerrainSettings {
    pub(crate) fn check(&self) -> Result<(), TerrainError> {
        if !(8..=128).contains(&self.chunk_size) {
            return Err(TerrainError::ChunkSize(self.chunk_size));
        }
        if !(-3..=3).any(|power| self.voxel_size == 2f32.powi(power)) {
            return Err(TerrainError::VoxelSize(self.voxel_size));
        }
        Ok(())
    }
}

/// An error of making a terrain.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TerrainError {
    /// The chunk size is out of range.
    #[error("chunk size {0} is not in 8..=128")]
    ChunkSize(u32),
    /// The voxel size is not a power of two from 1/8 to 8.
    #[error("voxel size {0} is not one of 1/8, 1/4, 1/2, 1, 2, 4, 8")]
    VoxelSize(f32),
}
