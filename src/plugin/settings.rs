//! Settings, as resources and components.

use bevy::prelude::*;

use crate::backend::{Backend, Engine};
use crate::terrain::LooseSettings;

/// What terrains without an engine of their own run their transactions on. [`Backend::Auto`] unless the game inserts
/// another one, best before the plugins; [`Engine::state`] and [`Engine::figures`] tell what it does.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::backend::{Backend, Engine};
/// # use bevy_burrow::prelude::*;
/// App::new().insert_resource(BurrowEngine(Engine::new(Backend::Cpu)));
/// ```
#[derive(Resource, Clone, Debug, Deref)]
pub struct BurrowEngine(pub Engine);

impl Default for BurrowEngine {
    fn default() -> Self {
        Self(Engine::new(Backend::Auto))
    }
}

/// How the plugin spends its frames.
#[derive(Resource, Reflect, Clone, Debug, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct BurrowSettings {
    /// Meshes swapped per frame. A commit is never cut: one that is larger goes in whole, and others wait for the next
    /// frame.
    pub swaps_per_frame: usize,
    /// Meshes of tiles and chunks handed to the renderer per frame while a terrain loads. They show only when all are there.
    pub loads_per_frame: usize,
}

impl Default for BurrowSettings {
    fn default() -> Self {
        Self { swaps_per_frame: 256, loads_per_frame: 256 }
    }
}

/// Put on a terrain's entity, brushes look for pieces of ground that they cut off, and [`LoosePieceFound`] tells of each;
/// take it off, and they stop. What a game [applies](crate::terrain::Terrain::apply) by itself looks for them too; its
/// receipts list them, no message tells of them, and none falls as debris. A terrain
/// that is not spawned yet knows nothing of this: before a journal is replayed on it,
/// `terrain.set_loose(Some(loose.into()))` has to tell it.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// # fn system(mut commands: Commands, terrain: Terrain) {
/// // Crumbs vanish, larger pieces break off, and what has more than 4096 voxels hangs on.
/// commands.spawn((terrain, LooseGround { crumbs: 8, debris: 4096, ..default() }));
/// # }
/// ```
///
/// [`LoosePieceFound`]: super::LoosePieceFound
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component, Default)]
pub struct LooseGround {
    /// The largest piece to look for, in voxels; whatever is larger counts as tied. Bounds the time of a search.
    pub largest: u32,
    /// Pieces up to so many voxels vanish.
    pub crumbs: u32,
    /// Larger ones, up to so many voxels, are taken out of the ground and come with a closed mesh. Others stay.
    pub debris: u32,
}

impl Default for LooseGround {
    /// Pieces are told of, and stay.
    fn default() -> Self {
        let LooseSettings { largest, crumbs, debris } = LooseSettings::default();
        Self { largest, crumbs, debris }
    }
}

impl From<LooseGround> for LooseSettings {
    fn from(LooseGround { largest, crumbs, debris }: LooseGround) -> Self {
        Self { largest, crumbs, debris }
    }
}
