//! Walkable ground compared with that which `rerecast` finds in the triangles of the same worlds.
//!
//! ```text
//! BURROW_PATH_WORLDS=200 cargo test --release --no-default-features --features navigation --test navigation -- recast --nocapture
//! ```

use std::collections::HashMap;

use bevy_burrow::lattice::{Column, SNAP};
use bevy_burrow::navigation::{WalkSettings, WalkableCell};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::{UVec3, Vec3};
use rerecast::{Aabb3d, AreaType, HeightfieldBuilder, TriMesh};

use crate::{all_cells, random_works, walker, world_count};

/// Voxels in a step of height of its fields.
const STEP: f32 = 0.125;

/// Everything that is drawn of a world.
fn triangles(world: &World) -> TriMesh {
    let mut all = TriMesh::default();
    for (drawn, mesh) in world.drawn() {
        let origin = world.origin(drawn).as_vec3a();
        for triangle in mesh.triangles() {
            let first = all.vertices.len() as u32;
            all.vertices.extend(triangle.map(|vertex| origin + vertex.position.as_vec3a() / SNAP as f32));
            all.indices.push(UVec3::new(first, first + 1, first + 2));
            all.area_types.push(AreaType::NOT_WALKABLE);
        }
    }
    all
}

/// The cells that `rerecast` finds walkable, with their heights in voxels. Its cells are those between columns.
fn walkable(world: &World, settings: &WalkSettings) -> Vec<(Column, f32)> {
    let mut mesh = triangles(world);
    mesh.mark_walkable_triangles(settings.slope.atan());
    let bounds = mesh.compute_aabb().expect("some ground");
    let (width, depth) = (world.ground().width() as f32, world.ground().depth() as f32);
    let aabb = Aabb3d {
        min: Vec3::new(0.0, bounds.min.y.floor() - 1.0, 0.0),
        max: Vec3::new(width, bounds.max.y.ceil() + 1.0, depth),
    };
    let mut field = HeightfieldBuilder { aabb, cell_size: 1.0, cell_height: STEP }.build().expect("a field");
    let climb = (settings.step.max(settings.slope) / STEP).floor() as u16;
    let height = (settings.height / STEP).ceil() as u16;
    field.rasterize_triangles(&mesh, climb).expect("valid triangles");
    field.filter_low_hanging_walkable_obstacles(climb);
    field.filter_ledge_spans(height, climb);
    field.filter_walkable_low_height_spans(height);
    let mut compact = field.into_compact(height, climb).expect("a field");
    compact.erode_walkable_area(settings.radius.ceil() as u16);
    let mut found = Vec::new();
    for z in 0..compact.height {
        for x in 0..compact.width {
            for span in compact.cell_at(x, z).index_range() {
                if compact.areas[span] != AreaType::NOT_WALKABLE {
                    let height = aabb.min.y + f32::from(compact.spans[span].y) * STEP;
                    found.push((Column::new(i32::from(x), i32::from(z)), height));
                }
            }
        }
    }
    found
}

/// Hills that an agent can mostly walk on, with tunnels, pits, walls and bridges.
fn random_hills(rng: &mut Rng) -> Terrain {
    let noise = NoiseHeights {
        seed: rng.u32(..),
        amplitude: 4.0 + 12.0 * rng.f64(),
        scale: 40.0 + 60.0 * rng.f64(),
        base: 20.0,
        ..NoiseHeights::default()
    };
    let ground = Ground::from_noise(rng.u32(64..128), rng.u32(64..128), &noise).expect("a valid ground");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("a valid terrain");
    for _ in 0..rng.usize(5..30) {
        let brush = random_works(rng, terrain.world());
        terrain.apply([brush]);
    }
    terrain
}

/// Both count whole cells. `rerecast` counts those as walkable ground that are so in part, before it takes a rim of whole cells
/// away; here a rim begins where a cell is not wholly walkable. So on small patches of even ground in steep worlds it finds more,
/// up to where an agent of this radius touches the wall.
#[test]
fn nearly_all_that_recast_finds_is_walkable() {
    let (mut both, mut theirs, mut ours) = (0, 0, 0);
    // Of those with ground above: in tunnels and under bridges.
    let (mut both_below, mut theirs_below) = (0, 0);
    let mut worst = (1.0, 0);
    for index in 0..world_count(8) {
        let mut rng = Rng::with_seed(5000 + index);
        let terrain = random_hills(&mut rng);
        let settings = WalkSettings {
            radius: 0.6,
            height: 2.0,
            step: 0.5,
            slope: 1.0,
            precision: 0.5,
            ..WalkSettings::default()
        };
        let mut cells: HashMap<Column, Vec<WalkableCell>> = HashMap::new();
        for cell in all_cells(terrain.world(), &walker(&settings)) {
            cells.entry(cell.cell).or_default().push(cell);
            ours += 1;
        }
        let found = walkable(terrain.world(), &settings);
        // Its heights are those of the highest triangle in a cell.
        let is_near = |cell: &WalkableCell, height: f32| {
            cell.heights.iter().any(|&corner| (corner as f32 / 256.0 - height).abs() <= 1.0)
        };
        let is_ours = |(column, height): &&(Column, f32)| {
            cells.get(column).is_some_and(|cells| cells.iter().any(|cell| is_near(cell, *height)))
        };
        let common = found.iter().filter(is_ours).count();
        let is_below = |(column, height): &&(Column, f32)| {
            let (x, z) = (f64::from(column.x) + 0.5, f64::from(column.z) + 0.5);
            terrain.world().spans(x, z).iter().any(|span| span.floor > f64::from(*height) + 1.0)
        };
        let below: Vec<_> = found.iter().filter(is_below).collect();
        theirs_below += below.len();
        both_below += below.into_iter().filter(is_ours).count();
        let share = common as f64 / found.len().max(1) as f64;
        if share < worst.0 && found.len() > 200 {
            worst = (share, index);
        }
        (both, theirs) = (both + common, theirs + found.len());
    }
    println!(
        "rerecast finds {theirs} cells; {both} of them ({:.2} %) are among our {ours}; at least {:.2} % in world {}; \
         of {theirs_below} with ground above, {both_below} ({:.2} %)",
        100.0 * both as f64 / theirs as f64,
        100.0 * worst.0,
        worst.1,
        100.0 * both_below as f64 / theirs_below as f64
    );
    assert!(theirs_below > 100, "{theirs_below} cells in tunnels and under bridges");
    assert!(theirs > 1000 && both * 100 >= theirs * 97, "{both} of {theirs}");
}
