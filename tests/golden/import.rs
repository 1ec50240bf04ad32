//! The picture of the guide's page about imported worlds: a survey as ground, with a road, a wall, towers and a model on it.

use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy_burrow::ground::{ElevationGrid, ElevationScale, HeightScale, ImportOptions};
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;

use crate::landscape::materials;
use crate::studio::Studio;

/// Materials of the default layers.
const CONCRETE: MaterialId = MaterialId(5);
const CLAY: MaterialId = MaterialId(4);
const SOIL: MaterialId = MaterialId(8);

/// The survey of the assets: three voxels from sample to sample.
fn survey() -> Ground {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/jacksboro_fault.png");
    let (grid, _) = ElevationGrid::open(path, &ImportOptions::default()).expect("a file of heights");
    let heights = HeightScale::FullScale { low: -32.0, high: 20.0 };
    let scale = ElevationScale { voxels_per_sample: 3, heights, ..default() };
    grid.into_ground(&scale).and_then(|ground| ground.with_materials(&materials())).expect("a valid ground")
}

/// A round tower with battlements, a door and a roof, 32 samples wide and 48 high.
fn tower() -> ShapeGrid {
    let distance = |at: IVec3| {
        let from = at.as_vec3() - Vec3::new(16.0, 0.0, 16.0);
        let (radius, y) = (from.xz().length(), from.y);
        let wall = (radius - 11.0).max(8.0 - radius).max(y - 36.0);
        let battlements = (radius - 13.0).max(9.0 - radius).max(30.0 - y).max(y - 40.0);
        let gap = (3.0 - (from.x.abs().min(from.z.abs()))).min(y - 36.0);
        let door = from.x.abs().max((y - 8.0).abs() * 0.8) - 3.0;
        let roof = (radius - (46.0 - y) * 0.55).max(34.0 - y);
        wall.max(if from.z > 0.0 { -door } else { f32::NEG_INFINITY }).min(battlements.max(gap)).min(roof)
    };
    let grid = ShapeGrid::from_fn(UVec3::new(33, 49, 33), distance).expect("a valid size");
    grid.with_materials(|at| if at.y > 40 { CLAY } else { CONCRETE })
}

/// Shows it all from a hill.
pub fn shoot(studio: &mut Studio, look: GroundLook) {
    studio.terrain(survey(), look);
    let on_ground = |studio: &mut Studio, x: f32, z: f32| Vec3::new(x, studio.height(x, z), z);

    let bends =
        [(430.0, 500.0), (470.0, 470.0), (520.0, 480.0), (570.0, 460.0), (620.0, 480.0), (680.0, 470.0)];
    let road = bends.map(|(x, z)| (on_ground(studio, x, z), 3.5));
    let corridor = Corridor::new(BrushPath::spline(road), 14.0, 14.0);
    let wall = bends.map(|(x, z)| (on_ground(studio, x, z + 22.0) + Vec3::Y * 2.0, 1.6));
    let first = on_ground(studio, 520.0, 510.0);
    studio.apply([
        Brush::road(corridor.clone(), 6.0),
        Brush::paint(corridor, SOIL),
        Brush::fill(BrushPath::polyline(wall), 1.0).with_material(CONCRETE),
        Brush::fill(GridShape::new(tower(), first + Vec3::Y * 21.0), 2.0),
    ]);

    // Two copies of the tower, turned and mirrored.
    let anchor = first.round().as_ivec3();
    let around = LatticeBox { min: anchor - IVec3::new(16, 6, 16), max: anchor + IVec3::new(16, 50, 16) };
    let prefab = studio.one::<Terrain>().world().copy(around, anchor).expect("a small box");
    let prefab = std::sync::Arc::new(prefab);
    let copies = [(450.0, 500.0, 1), (600.0, 505.0, 2)].map(|(x, z, turns)| {
        let place = on_ground(studio, x, z).round();
        Brush::paste(Paste::new(prefab.clone(), place).turned_about_y(turns).mirrored().edited_only())
    });
    studio.apply(copies);

    // A gate from a mesh.
    let ring = Mesh::from(Torus::new(7.0, 11.0));
    let gate =
        ShapeGrid::from_bevy_meshes([(&ring, Affine3A::IDENTITY, CONCRETE)], 64).expect("a closed mesh");
    let place = on_ground(studio, 545.0, 470.0);
    let upright = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    studio.apply([Brush::fill(gate.placed(place, upright, 1.0), 1.0)]);

    let eye = on_ground(studio, 470.0, 600.0) + Vec3::Y * 55.0;
    let target = on_ground(studio, 540.0, 475.0);
    studio.look(eye, target);
}
