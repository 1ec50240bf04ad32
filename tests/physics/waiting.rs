//! Colliders and debris do not wait for work that takes long.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use bevy::prelude::*;
use bevy_burrow::lattice::TilePos;
use bevy_burrow::physics::{ColliderSource, Debris, GroundBody};
use bevy_burrow::plugin::{CommitAction, Part, SurfaceProcessor, SurfaceProcessors};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::MeshKey;

use crate::stage::{Stage, level};

/// Work on the surfaces of one terrain that continues until the gate opens.
struct Slow {
    terrain: Entity,
    gate: Arc<Gate>,
}

#[derive(Default)]
struct Gate {
    begun: AtomicUsize,
    is_open: AtomicBool,
}

/// Opens the gate, however the test ends.
struct Opens(Arc<Gate>);

impl Drop for Opens {
    fn drop(&mut self) {
        self.0.is_open.store(true, Ordering::Relaxed);
    }
}

impl SurfaceProcessor for Slow {
    fn wants(&self, part: &Part) -> bool {
        part.terrain == self.terrain
    }

    fn build(&self, _: &Part, _: &SurfaceMesh) -> Option<CommitAction> {
        self.gate.begun.fetch_add(1, Ordering::Relaxed);
        while !self.gate.is_open.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(1));
        }
        None
    }
}

#[test]
fn colliders_and_debris_come_while_another_terrain_loads() {
    let mut stage = Stage::new();
    let other = stage.app.world_mut().spawn_empty().id();
    let gate = Arc::<Gate>::default();
    let opens = Opens(Arc::clone(&gate));
    let slow = Slow { terrain: other, gate: Arc::clone(&gate) };
    stage.app.world_mut().resource_mut::<SurfaceProcessors>().add(slow);
    let mut terrain = level(128, 1.0);
    terrain.apply([Brush::add(
        Shape::cuboid(Vec3::new(8.0, 14.0, 8.0), Vec3::new(1.2, 8.0, 1.2)),
        MaterialId(2),
    )]);
    let loose = LooseSettings { debris: 4096, ..default() };
    let world = stage.app.world_mut();
    let terrain = world.spawn((terrain, loose)).id();
    let source = world.spawn((Transform::from_xyz(8.0, 8.0, 8.0), ColliderSource { radius: 8.0 })).id();
    stage.settle();
    // An island comes into the world, and takes all the time of the threads for loads.
    let island = (level(256, 1.0), Transform::from_xyz(10_000.0, 0.0, 0.0));
    stage.app.world_mut().entity_mut(other).insert(island);
    stage.frames_until("it loads", |_| gate.begun.load(Ordering::Relaxed) > 0);
    stage.frames(50);
    stage.send(Brush::dig(Shape::cuboid(Vec3::new(8.0, 14.0, 8.0), Vec3::new(3.0, 1.2, 3.0))));
    stage.frames_until("debris falls", |stage| {
        let world = stage.app.world_mut();
        world.query::<&Debris>().iter(world).len() == 1
    });
    stage.app.world_mut().get_mut::<Transform>(source).expect("a place").translation =
        Vec3::new(120.0, 8.0, 120.0);
    let here = MeshKey::Tile(TilePos { x: 7, z: 7 });
    stage.frames_until("there is ground where the source is", |stage| {
        let world = stage.app.world_mut();
        let mut bodies = world.query::<&GroundBody>();
        bodies.iter(world).any(|body| body.terrain == terrain && body.drawn == here)
    });
    assert!(!gate.is_open.load(Ordering::Relaxed), "the island still loads");
    drop(opens);
}
