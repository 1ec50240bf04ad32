//! Surface processors: their data is swapped in with the mesh, in the same frame, and on servers without meshes.

use bevy::prelude::*;
use bevy_burrow::plugin::{CommitAction, Part, ShownSurface, SurfaceProcessor, SurfaceProcessors};
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::MeshKey;

use crate::stage::{Stage, random_brushes, steep};

/// The number of triangles of a tile or chunk.
#[derive(Component)]
struct Triangles(usize, MeshKey);

struct Counter;

impl SurfaceProcessor for Counter {
    fn build(&self, part: &Part, surface: &SurfaceMesh) -> Option<CommitAction> {
        let count = Triangles(surface.indices.len() / 3, part.drawn);
        Some(Box::new(move |entity| {
            entity.try_insert(count);
        }))
    }
}

/// Checks that every part has the data for the committed world.
fn assert_counted(stage: &mut Stage, terrain: Entity) {
    let world = stage.app.world_mut();
    let counted: Vec<(usize, MeshKey)> =
        world.query::<&Triangles>().iter(world).map(|t| (t.0, t.1)).collect();
    let model = stage.terrain(terrain).world();
    for (drawn, mesh) in model.drawn() {
        assert!(counted.contains(&(mesh.indices.len() / 3, drawn)), "{drawn:?} has stale data");
    }
    let all: usize = counted.iter().map(|(count, _)| count).sum();
    assert_eq!(all, model.drawn().map(|(_, mesh)| mesh.indices.len() / 3).sum::<usize>());
}

#[test]
fn processors_come_with_every_commit() {
    for mut stage in [Stage::drawing(), Stage::server()] {
        stage.app.world_mut().resource_mut::<SurfaceProcessors>().add(Counter);
        let terrain = stage.show(steep());
        assert_counted(&mut stage, terrain);
        let mut revision = stage.terrain(terrain).world().revision();
        for brush in random_brushes(21, 12) {
            let answered = stage.receipts().len();
            stage.send(brush);
            stage.frames_until("a brush is answered", |stage| {
                let now = stage.terrain(terrain).world().revision();
                // Whenever the commit arrives, all of its data arrives in that frame.
                if now != revision {
                    assert_counted(stage, terrain);
                }
                revision = now;
                stage.receipts().len() > answered
            });
        }
        let world = stage.app.world_mut();
        assert!(world.query::<&ShownSurface>().iter(world).any(|shown| shown.revision == revision));
    }
}
