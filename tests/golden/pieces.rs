//! Loose pieces look as they did in the ground, and keep their look when they move.

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use image::RgbImage;
use image::imageops::crop_imm;

use crate::album::{Album, flip, keep};
use crate::studio::Studio;

/// Mean FLIP between a block in the ground and the same block cut off, whose normals come from its own samples. It is
/// less than when the camera moves by a quarter of a pixel, and a quarter of what shifted textures give.
const CUT_OFF: f32 = 0.024;
/// Mean FLIP between a piece at its origin and a moved piece, under the same light.
const MOVED: f32 = 0.004;

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    let noise = NoiseHeights { seed: 8, scale: 40.0, amplitude: 2.0, octaves: 3, base: 20.0, ..default() };
    let skin = ColumnMaterial { base: MaterialId(0), overlay: MaterialId(1), blend: 200 };
    let ground = Ground::from_noise(96, 96, &noise)
        .and_then(|ground| ground.with_materials(&MaterialControl::Uniform(skin)))
        .expect("valid ground");
    studio.terrain(ground, GroundLook::default());
    let world = studio.app.world_mut();
    let terrain = world.query_filtered::<Entity, With<Terrain>>().single(world).expect("one terrain");
    world.entity_mut(terrain).insert(LooseSettings { debris: 100_000, largest: 100_000, ..default() });
    // A trench around the block, with a vein in its inner wall, and then a cut below it from side to side.
    let middle = Vec3::new(48.0, 20.0, 48.0);
    let trench = |aside: Vec3, half: Vec3| Brush::dig(Shape::cuboid(middle + aside, half));
    studio.apply([
        Brush::paint(Shape::sphere(middle + Vec3::new(8.0, -2.0, 2.0), 4.0), MaterialId(7)),
        trench(Vec3::X * 14.0, Vec3::new(6.0, 9.0, 20.0)),
        trench(Vec3::NEG_X * 14.0, Vec3::new(6.0, 9.0, 20.0)),
        trench(Vec3::Z * 14.0, Vec3::new(20.0, 9.0, 6.0)),
        trench(Vec3::NEG_Z * 14.0, Vec3::new(20.0, 9.0, 6.0)),
    ]);
    let eye = Transform::from_translation(middle + Vec3::new(13.0, 11.0, 9.0)).looking_at(middle, Vec3::Y);
    let sun = Vec3::new(1.0, 0.9, 0.4);
    studio.app.world_mut().entity_mut(studio.camera).insert(eye);
    studio.sun(sun);
    let whole = studio.picture();

    studio.apply([trench(Vec3::NEG_Y * 8.0, Vec3::new(12.0, 1.0, 12.0))]);
    let world = studio.app.world_mut();
    let found: Vec<_> = world.resource_mut::<Messages<LoosePieceFound>>().drain().collect();
    let [found] = &found[..] else { panic!("{} pieces broke off", found.len()) };
    let (model, colors) = world.query::<(&Terrain, &MaterialColors)>().single(world).expect("one terrain");
    let mesh = found.mesh(model, colors).expect("a piece that broke off");
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
    let part = GroundPiece { terrain, origin: found.piece.bounds.min };
    let here = Transform::from_translation(found.origin());
    let piece = world.spawn((part, Mesh3d(mesh), here)).id();
    studio.until("the piece's material", |app| {
        app.world().entity(piece).contains::<MeshMaterial3d<GroundMaterial>>()
    });
    let material =
        |of: Entity| studio.app.world().entity(of).get::<MeshMaterial3d<GroundMaterial>>().cloned();
    album.check(material(piece) != material(terrain), || "a piece shares its terrain's material".into());
    let cut = studio.picture();
    album.compare("piece", &cut);
    // The cut itself is visible at the bottom of the picture.
    let above = |picture: &RgbImage| crop_imm(picture, 0, 0, picture.width(), 190).to_image();
    let (apart, _) = flip(&above(&whole), &above(&cut));
    println!("a block cut off below: FLIP {apart:.5}");
    keep("piece", "in_the_ground", &whole);
    album.check(apart < CUT_OFF, || format!("a block looks different once it is cut off: FLIP {apart:.5}"));

    // The piece alone, then far away and turned, with camera and sun turned along.
    let shared = studio.app.world().entity(terrain).get::<MeshMaterial3d<GroundMaterial>>().cloned();
    studio.close_terrain();
    let alone = studio.picture();
    let step = Transform::from_xyz(3.7, 11.3, -5.1)
        .with_rotation(Quat::from_axis_angle(Vec3::new(0.4, 1.0, -0.3).normalize(), 1.1));
    let world = studio.app.world_mut();
    world.entity_mut(piece).insert(step * here);
    world.entity_mut(studio.camera).insert(step * eye);
    studio.sun(step.rotation * sun);
    let (moved, _) = flip(&alone, &studio.picture());
    studio.app.world_mut().entity_mut(piece).insert(shared.expect("a terrain with a material"));
    let (swims, _) = flip(&alone, &studio.picture());
    println!("a piece that moved: FLIP {moved:.5}; with textures that stay in the world: {swims:.5}");
    album.check(moved < MOVED, || format!("a piece looks different once it has moved: FLIP {moved:.5}"));
    album.check(swims > 4.0 * MOVED, || format!("the measure is too coarse: FLIP {swims:.5}"));
    assert!(studio.app.world_mut().despawn(piece));
    studio.sun(sun);
}
