//! Meshes on their way from a task to the renderer.

use bevy::prelude::*;

use super::builder::MeshFacts;

/// A mesh that is to be shown.
pub(in crate::plugin) struct PendingMesh {
    mesh: Stage,
    pub facts: MeshFacts,
    pub triangles: usize,
}

enum Stage {
    Built(Box<Mesh>),
    /// The renderer has it already.
    Uploaded(Handle<Mesh>),
}

impl PendingMesh {
    pub fn new((mesh, facts): (Mesh, MeshFacts)) -> Self {
        let triangles = mesh.indices().map_or(0, |indices| indices.len() / 3);
        Self { mesh: Stage::Built(Box::new(mesh)), facts, triangles }
    }

    /// Adds the mesh to the assets before it is shown, if that is left of a budget. Returns whether it is there.
    pub fn upload(&mut self, assets: &mut Assets<Mesh>, budget: &mut usize) -> bool {
        if let Stage::Built(mesh) = &mut self.mesh {
            let Some(rest) = budget.checked_sub(1) else { return false };
            *budget = rest;
            let empty = Mesh::new(mesh.primitive_topology(), mesh.asset_usage);
            self.mesh = Stage::Uploaded(assets.add(std::mem::replace(&mut **mesh, empty)));
        }
        true
    }

    /// The handle under which it is shown: a former one, or one of its own if it was uploaded or there is no former
    /// one.
    pub fn show(self, assets: &mut Assets<Mesh>, former: Option<&Handle<Mesh>>) -> Handle<Mesh> {
        match (self.mesh, former) {
            (Stage::Uploaded(handle), _) => handle,
            (Stage::Built(mesh), None) => assets.add(*mesh),
            (Stage::Built(mesh), Some(former)) => {
                if let Err(error) = assets.insert(former, *mesh) {
                    warn!("a mesh could not be swapped: {error}");
                }
                former.clone()
            }
        }
    }
}
