//! What a terrain that loads waits for.

use std::sync::Arc;

use bevy::camera::primitives::Aabb;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use super::companion::Fresh;
use super::threads::ThreadTask;
use crate::terrain::{Drawn, Terrain, World};

/// Meshes on their way to the frame in which they are shown, all made from one snapshot.
#[derive(Component)]
pub(super) struct Loading {
    pub world: Arc<World>,
    pub task: Option<ThreadTask<Vec<Fresh>>>,
    pub waiting: Vec<Fresh>,
    pub ready: HashMap<Drawn, Loaded>,
}

impl Loading {
    /// Are these meshes of this terrain, whatever the game did to it since?
    pub fn is_of(&self, terrain: &Terrain) -> bool {
        self.world.version().is_same_world(terrain.world().version())
    }
}

/// A part whose mesh, if it has one, is with the renderer.
pub(super) struct Loaded {
    pub mesh: Option<(Handle<Mesh>, Aabb)>,
    pub fresh: Fresh,
}
