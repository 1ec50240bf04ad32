//! Meshes on their way from a task to the renderer.

use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;

use super::meshes::MeshFacts;

/// A mesh that is to be shown.
pub(super) struct NewMesh {
    mesh: Upload,
    pub facts: MeshFacts,
    pub triangles: usize,
}

/// Whether the renderer has a mesh already.
enum Upload {
    Waits(Box<Mesh>),
    Began(Handle<Mesh>),
}

impl NewMesh {
    pub fn new((mesh, facts): (Mesh, MeshFacts)) -> Self {
        let triangles = mesh.indices().map_or(0, |indices| indices.len() / 3);
        Self { mesh: Upload::Waits(Box::new(mesh)), facts, triangles }
    }

    /// Passes it to the renderer before it is shown. Returns whether that was still to be done.
    pub fn upload(&mut self, assets: &mut Assets<Mesh>) -> bool {
        match &mut self.mesh {
            Upload::Waits(mesh) => {
                let empty = Mesh::new(PrimitiveTopology::TriangleList, mesh.asset_usage);
                self.mesh = Upload::Began(assets.add(std::mem::replace(&mut **mesh, empty)));
                true
            }
            Upload::Began(_) => false,
        }
    }

    /// The handle under which it is shown: a former one, or one of its own if it was uploaded or there is no former one.
    pub fn show(self, assets: &mut Assets<Mesh>, former: Option<&Handle<Mesh>>) -> Handle<Mesh> {
        match (self.mesh, former) {
            (Upload::Began(handle), _) => handle,
            (Upload::Waits(mesh), None) => assets.add(*mesh),
            (Upload::Waits(mesh), Some(former)) => {
                if let Err(error) = assets.insert(former, *mesh) {
                    warn!("a mesh could not be swapped: {error}");
                }
                former.clone()
            }
        }
    }
}
