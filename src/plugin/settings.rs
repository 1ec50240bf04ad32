//! Settings, as resources.

use std::time::Duration;

use bevy::asset::RenderAssetUsages;
use bevy::prelude::*;

use crate::backend::{Backend, Engine};

/// The engine of terrains without their own engine. [`Backend::Auto`] unless the game inserts
/// another one, best before the plugins; [`Engine::state`] and [`Engine::figures`] show what it does.
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

/// How much the plugin does in a frame, and how it builds meshes.
#[derive(Resource, Reflect, Clone, Debug, PartialEq, Eq)]
#[reflect(Resource, Default)]
pub struct BurrowSettings {
    /// Meshes swapped per frame. A commit is never split: a larger one is shown whole, and others wait for the next
    /// frame. A commit with more than 64 meshes is uploaded at 64 a frame and then shown at once; later edits of that
    /// terrain wait meanwhile. By default 256; with 0, one commit a frame.
    pub swaps_per_frame: usize,
    /// Meshes of tiles and chunks passed to the renderer per frame while a terrain loads. They are shown once all are
    /// there. By default 256; 0 counts as 1.
    pub loads_per_frame: usize,
    /// Where the meshes of tiles and chunks are kept. In the render world only, unless set otherwise: that saves memory
    /// and a copy of each mesh, but Bevy's `Mesh` methods panic once such a mesh was extracted. Crates that read the
    /// meshes of a game, for colliders, navigation or mesh picking, need `RenderAssetUsages::default()`, which keeps
    /// them in both worlds.
    ///
    /// A change applies to meshes that are built afterwards; see [`Redraw`](super::Redraw).
    pub mesh_usages: RenderAssetUsages,
    /// How long a frame waits, in `PostUpdate`, for small transactions that began in it, so that a brush is seen in the
    /// frame in which it was sent. What takes longer is seen in a later frame, and where the latest transactions all
    /// took longer, the frame does not wait. 0.3 ms; 0 never waits. An app without `Assets<Mesh>`, such as a server,
    /// never waits.
    ///
    /// Order and content of edits are the same in any case.
    pub same_frame: Duration,
}

impl Default for BurrowSettings {
    fn default() -> Self {
        Self {
            swaps_per_frame: 256,
            loads_per_frame: 256,
            mesh_usages: RenderAssetUsages::RENDER_WORLD,
            same_frame: Duration::from_micros(300),
        }
    }
}
