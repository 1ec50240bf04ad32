//! The ground has no holes, whatever a camera's prepasses, antialiasing and shadows, a terrain's material, level of
//! detail, rotation and scale.
//!
//! What lies behind the ground is magenta, which no ground is. Cameras with a depth prepass draw only what has exactly
//! the depth of the prepass: if the two passes place a vertex differently, if only by rounding, ground is missing.
//! Software renderers seldom differ. `BURROW_COMBINATIONS=all` looks at all combinations, for a machine with a GPU.

use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass, MotionVectorPrepass, NormalPrepass};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::material::OpaqueRendererMethod;
use bevy::prelude::*;
use bevy_burrow::plugin::SlimVertices;
use bevy_burrow::prelude::*;
use image::Rgb;

use crate::album::{Album, keep};
use crate::holes::{self, Holes};
use crate::landscape::hills;
use crate::lod::{mountains, settle, watch_levels};
use crate::map::MapMaterial;
use crate::studio::Studio;

const PREPASSES: [&str; 5] =
    ["no prepass", "depth", "depth and normals", "depth, normals and motion", "deferred"];

/// How the ground is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Dress {
    Look(GroundQuality),
    /// Bevy's own material on the vertices of a look.
    Plain,
    /// A material with a vertex shader of its own.
    Map,
}

const DRESSES: [Dress; 4] =
    [Dress::Look(GroundQuality::High), Dress::Look(GroundQuality::Low), Dress::Plain, Dress::Map];

/// How far ground counts, in metres.
const REACH: f32 = 1500.0;

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    let is_all = std::env::var("BURROW_COMBINATIONS").is_ok_and(|value| value == "all");
    studio.app.world_mut().resource_mut::<ClearColor>().0 = Color::linear_rgb(1.0, 0.0, 1.0);
    let (mut pictures, mut ground, mut control) = (0, 0, None);
    for has_lod in [false, true] {
        if has_lod && !is_all {
            continue;
        }
        for dress in DRESSES.into_iter().filter(|&dress| is_all || dress != Dress::Look(GroundQuality::Low)) {
            set_up(studio, dress, has_lod);
            for (prepass, name) in PREPASSES.into_iter().enumerate() {
                for (msaa, has_shadows) in
                    [(Msaa::Off, true), (Msaa::Off, false), (Msaa::Sample4, true), (Msaa::Sample4, false)]
                {
                    // Deferred rendering has no antialiasing by samples, and the map is drawn forward only.
                    let is_possible = prepass < 4 || msaa == Msaa::Off && dress != Dress::Map;
                    if !is_possible || !is_all && (msaa == Msaa::Sample4 || !has_shadows) {
                        continue;
                    }
                    set_camera(studio, prepass, msaa);
                    studio.one::<DirectionalLight>().shadow_maps_enabled = has_shadows;
                    let what =
                        format!("{dress:?}, {name}, {msaa:?}, shadows {has_shadows}, levels {has_lod}");
                    let found = look(studio, &what);
                    pictures += 1;
                    ground += found.ground;
                    album.check(found.holes == 0 && found.ground > 60_000, || format!("{what}: {found:?}"));
                }
            }
            // Two shaders that do not agree: how many holes would there be on this renderer?
            if control.is_none() {
                set_camera(studio, 1, Msaa::Off);
                control = Some(with_bevys_prepass(studio));
            }
        }
    }
    println!(
        "{pictures} pictures with {ground} pixels of ground; with a prepass of Bevy's own shader {control:?}"
    );
    close(studio);
}

/// A terrain that is dug, one that is small, turned and of small voxels, and a loose piece.
fn set_up(studio: &mut Studio, dress: Dress, has_lod: bool) {
    close(studio);
    let ground = if has_lod { mountains() } else { hills(256) };
    let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let terrain = spawn(studio, terrain, dress);
    let middle = if has_lod { 2048.0 } else { 128.0 };
    if has_lod {
        watch_levels(studio, 4000.0);
    }
    let place = |studio: &mut Studio, dx: f32, dz: f32, up: f32| {
        let (x, z) = (middle + dx, middle + dz);
        Vec3::new(x, studio.height(x, z) + up, z)
    };
    // The other terrain comes later: the studio asks the only one for heights.
    let pit = place(studio, 0.0, 0.0, 0.0);
    let eye = place(studio, 20.0, -64.0, 22.0);
    studio.look(eye, pit);
    if has_lod {
        studio.until("levels", |app| {
            let world = app.world_mut();
            world.query::<&ShownLevels>().iter(world).any(|shown| shown.progress() > 0.0)
        });
        settle(studio);
    }
    studio.apply([
        Brush::dig(Shape::sphere(pit, 11.0)),
        Brush::dig(Shape::capsule(pit - Vec3::Y * 4.0, pit + Vec3::new(-30.0, -6.0, 20.0), 4.0)),
        Brush::add(Shape::sphere(pit + Vec3::new(15.0, 1.0, 4.0), 4.0), MaterialId(11)),
    ]);
    // The other terrain hangs in the air, turned about all axes.
    let small = Ground::flat(32, 32, 8.0).expect("valid");
    let settings = TerrainSettings { chunk_size: 16, voxel_size: 0.5 };
    let mut small = Terrain::new(small, &settings).expect("valid settings");
    small.apply([Brush::dig(Shape::sphere(Vec3::new(8.0, 4.0, 8.0), 3.0))]);
    let turned = Transform::from_translation(eye.lerp(pit, 0.6) + Vec3::new(-12.0, 4.0, 0.0))
        .with_rotation(Quat::from_euler(EulerRot::XYZ, 0.7, 0.4, 0.2));
    let small = spawn(studio, small, dress);
    let world = studio.app.world_mut();
    world.entity_mut(small).insert((turned, Extra));
    // The map wants attributes that a block lacks.
    if dress == Dress::Map {
        return studio.app.update();
    }
    // A block as a piece of the large terrain.
    let mesh = Mesh::from(Cuboid::new(5.0, 5.0, 5.0));
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
    let at = Transform::from_translation(eye.lerp(pit, 0.5) + Vec3::new(8.0, -2.0, 0.0))
        .with_rotation(Quat::from_rotation_y(0.6));
    world.spawn((GroundPiece { terrain, origin: IVec3::ZERO }, Mesh3d(mesh), at, Extra));
    studio.app.update();
}

/// Spawns a terrain that is drawn in this way, and waits until it is shown.
fn spawn(studio: &mut Studio, terrain: Terrain, dress: Dress) -> Entity {
    let world = studio.app.world_mut();
    let plain = StandardMaterial::from(Color::srgb(0.3, 0.5, 0.2));
    let plain = world.resource_mut::<Assets<StandardMaterial>>().add(plain);
    let map = world.resource_mut::<Assets<MapMaterial>>().add(MapMaterial::default());
    let mut entity = world.spawn(terrain);
    match dress {
        Dress::Look(quality) => entity.insert(GroundLook { quality, ..default() }),
        Dress::Plain => entity.insert((MeshMaterial3d(plain), SlimVertices)),
        Dress::Map => entity.insert(MeshMaterial3d(map)),
    };
    let entity = entity.id();
    type IsDrawn = Or<(
        With<MeshMaterial3d<GroundMaterial>>,
        With<MeshMaterial3d<StandardMaterial>>,
        With<MeshMaterial3d<MapMaterial>>,
    )>;
    studio.until("tiles", |app| {
        let mut tiles = app.world_mut().query_filtered::<&ChildOf, (With<Tile>, With<Mesh3d>, IsDrawn)>();
        tiles.iter(app.world()).any(|tile| tile.parent() == entity)
    });
    entity
}

/// What is there besides the studio's terrain.
#[derive(Component)]
struct Extra;

fn close(studio: &mut Studio) {
    let world = studio.app.world_mut();
    let extra: Vec<Entity> = world.query_filtered::<Entity, With<Extra>>().iter(world).collect();
    extra.into_iter().for_each(|entity| assert!(world.despawn(entity)));
    studio.close_terrain();
}

/// Has a new camera take the pictures: one whose prepasses are removed keeps what its renderer made for them.
fn set_camera(studio: &mut Studio, prepass: usize, msaa: Msaa) {
    studio.renew_camera((msaa, Tonemapping::None));
    let method = if prepass == 4 { OpaqueRendererMethod::Deferred } else { OpaqueRendererMethod::Forward };
    let camera = studio.camera;
    let world = studio.app.world_mut();
    let mut camera = world.entity_mut(camera);
    match prepass {
        0 => &mut camera,
        1 => camera.insert(DepthPrepass),
        2 => camera.insert((DepthPrepass, NormalPrepass)),
        3 => camera.insert((DepthPrepass, NormalPrepass, MotionVectorPrepass)),
        _ => camera.insert((DepthPrepass, DeferredPrepass)),
    };
    let mut grounds = world.resource_mut::<Assets<GroundMaterial>>();
    grounds.iter_mut().for_each(|(_, material)| material.base.opaque_render_method = method);
    let mut plains = world.resource_mut::<Assets<StandardMaterial>>();
    plains.iter_mut().for_each(|(_, material)| material.opaque_render_method = method);
}

/// Takes a picture and counts its holes.
fn look(studio: &mut Studio, what: &str) -> Holes {
    let picture = studio.picture();
    let found = holes::count(&studio.app, studio.camera, &picture, REACH, |_, _, pixel| is_magenta(pixel));
    if found.holes > 0 {
        keep(&what.replace([' ', ',', '(', ')'], "_"), "holes", &picture);
        println!("{what}: {found:?}");
    }
    found
}

/// Also of a pixel that is magenta only in part.
fn is_magenta(&Rgb([red, green, blue]): &Rgb<u8>) -> bool {
    i32::from(red.min(blue)) - i32::from(green) > 40
}

/// Holes if the depth prepass were Bevy's own, which knows nothing of the ground's vertex shader.
fn with_bevys_prepass(studio: &mut Studio) -> Holes {
    let assets = studio.app.world().resource::<AssetServer>().clone();
    let [own, bevys] = ["bevy_burrow/view/prepass.wgsl", "bevy_pbr/prepass/prepass.wgsl"]
        .map(|path| assets.load::<Shader>(format!("embedded://{path}")));
    let mut shaders = studio.app.world_mut().resource_mut::<Assets<Shader>>();
    let [ours, other] = [&own, &bevys].map(|shader| shaders.get(shader).cloned().expect("a loaded shader"));
    let swapped = Shader { import_path: ours.import_path.clone(), ..other };
    shaders.insert(&own, swapped).expect("it is there");
    let found = look(studio, "control");
    let mut shaders = studio.app.world_mut().resource_mut::<Assets<Shader>>();
    shaders.insert(&own, ours).expect("it is there");
    studio.app.update();
    found
}
