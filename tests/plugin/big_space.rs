//! The recipe for `big_space`: a terrain in a grid, far from everything, with a camera that carries the origin from
//! cell to cell.
#![cfg(feature = "examples")]

use bevy::ecs::system::RunSystemOnce;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_burrow::prelude::*;
use big_space::prelude::*;

use crate::stage::Stage;

/// Metres of a cell.
const CELL: f32 = 2000.0;

fn mountains() -> Terrain {
    let noise = NoiseHeights { seed: 9, octaves: 5, scale: 70.0, amplitude: 60.0, base: 0.0, ..default() };
    let ground = Ground::from_noise(320, 270, &noise).expect("valid mountains");
    Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size: 1.0 }).expect("valid")
}

struct Space {
    stage: Stage,
    terrain: Entity,
    camera: Entity,
    cell: CellCoord,
}

impl Space {
    /// A terrain in a cell, with a camera above it.
    fn new(cell: CellCoord) -> Self {
        let before = (MinimalPlugins, AssetPlugin::default(), MeshPlugin, BigSpaceDefaultPlugins);
        let mut stage = Stage::with(before);
        let levels = LevelsOfDetail { cell_pixels: 24.0, error_pixels: 1.0, ..default() };
        let spawn = move |mut commands: Commands| {
            commands.spawn_big_space_default(|root| {
                root.spawn_spatial((mountains(), levels.clone(), cell));
                let camera = (Camera::default(), bevy::camera::Projection::default());
                root.spawn_spatial((camera, FloatingOrigin, cell, Transform::from_xyz(40.0, 90.0, 40.0)));
            });
        };
        stage.app.world_mut().run_system_once(spawn).expect("it can be spawned");
        let one = |all: Vec<Entity>| *all.first().expect("it is there");
        let terrain = one(stage.with_component::<Terrain>());
        let camera = one(stage.with_component::<Camera>());
        stage.settle();
        stage.frames(30);
        Self { stage, terrain, camera, cell }
    }

    /// Where the terrain's corner should be in this frame.
    fn corner(&self) -> Vec3 {
        let world = self.stage.app.world();
        let origin = world.get::<CellCoord>(self.camera).expect("a cell");
        let away = IVec3::new(
            (self.cell.x - origin.x) as i32,
            (self.cell.y - origin.y) as i32,
            (self.cell.z - origin.z) as i32,
        );
        away.as_vec3() * CELL
    }

    /// Digs a ball at a place of the terrain, through the global places of this frame.
    fn dig(&mut self, at: Vec3) {
        self.stage.send(Brush::dig(Shape::sphere(self.corner() + at, 5.0)));
        self.stage.settle();
    }

    fn height(&mut self, x: f32, z: f32) -> f32 {
        let at = self.corner() + Vec3::new(x, 1000.0, z);
        let ray = Ray3d::new(at, Dir3::NEG_Y);
        let ask = move |terrains: Terrains| terrains.raycast(ray, 4000.0);
        let hit = self.stage.app.world_mut().run_system_once(ask).expect("it can be asked");
        let hit = hit.unwrap_or_else(|| panic!("there is ground below {at}"));
        hit.position.y - self.corner().y
    }
}

#[test]
fn brushes_rays_and_levels_work_a_thousand_kilometres_away() {
    let mut space = Space::new(CellCoord::new(400, -20, -300));
    let mut plain = mountains();
    let nodes = |space: &Space| {
        space.stage.app.world().get::<ShownLevels>(space.terrain).expect("levels").nodes.clone()
    };
    let before = nodes(&space);
    assert!(before[0] > 0, "{before:?}: fine ground below the camera");
    for (step, shift) in [IVec3::ZERO, IVec3::X, IVec3::NEG_Z, IVec3::new(-3, 0, 2)].into_iter().enumerate() {
        let mut cell = space.stage.app.world_mut().get_mut::<CellCoord>(space.camera).expect("a cell");
        cell.x += shift.x as GridPrecision;
        cell.z += shift.z as GridPrecision;
        space.stage.frames(3);
        let place = *space.stage.app.world().get::<GlobalTransform>(space.terrain).expect("a place");
        assert_eq!(place, GlobalTransform::from_translation(space.corner()), "step {step}");
        let (x, z) = (60.0 + 40.0 * step as f32, 100.0);
        let height = space.height(x, z);
        let exact = plain.world().height(x.into(), z.into()).expect("there is ground");
        assert!((f64::from(height) - exact).abs() < 0.01, "step {step}: {height}, {exact}");
        let at = Vec3::new(x, height.round(), z);
        space.dig(at);
        plain.apply([Brush::dig(Shape::sphere(at, 5.0))]);
        assert_eq!(space.stage.hash(space.terrain), plain.world().hash(), "step {step}");
    }
    // All drawn parts are where the terrain is.
    let place = *space.stage.app.world().get::<GlobalTransform>(space.terrain).expect("a place");
    let world = space.stage.app.world_mut();
    let mut parts = world.query_filtered::<(&Transform, &GlobalTransform), Or<(With<Tile>, With<Chunk>)>>();
    assert!(parts.iter(world).count() > 0);
    assert!(parts.iter(world).all(|(local, global)| *global == place * *local));
}
