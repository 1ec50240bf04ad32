//! The light of the sky in meshes: in the commit of a dig, near and far, and equal wherever meshes meet.

use std::collections::{HashMap, HashSet};

use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level, random_brushes, steep};

/// The light of all corners of triangles by their places in 1/4096 voxel; `None` if some mesh has none. Panics where vertices at
/// one place differ.
fn lights(stage: &mut Stage) -> Option<HashMap<IVec3, [u8; 4]>> {
    let world = stage.app.world_mut();
    let mut drawn = world.query_filtered::<(&Mesh3d, &Transform), Or<(With<Tile>, With<Chunk>)>>();
    let drawn: Vec<_> = drawn.iter(world).map(|(mesh, place)| (mesh.0.clone(), place.translation)).collect();
    let meshes = world.resource::<Assets<Mesh>>();
    let mut found = HashMap::new();
    for (handle, origin) in drawn {
        let mesh = meshes.get(&handle).expect("it is shown");
        let Some(VertexAttributeValues::Unorm8x4(own)) = mesh.attribute(Terrain::ATTRIBUTE_SKY_LIGHT) else {
            return None;
        };
        let places = mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(VertexAttributeValues::as_float3);
        let places = places.expect("each mesh has positions");
        assert_eq!(own.len(), places.len());
        // Tiles keep vertices of ground that was dug, which no triangle uses.
        let used: HashSet<usize> = mesh.indices().expect("it has indices").iter().collect();
        for at in used {
            let own = own[at];
            let place = ((Vec3::from(places[at]) + origin) * 4096.0).round().as_ivec3();
            let first = *found.entry(place).or_insert(own);
            assert_eq!(first, own, "at {:?}", place.as_vec3() / 4096.0);
        }
    }
    Some(found)
}

/// All drawn light is that of the world; returns how many places are darker than the open.
fn assert_lit(stage: &mut Stage, terrain: Entity, when: &str) -> usize {
    let lights = lights(stage).expect("all meshes have light");
    let world = stage.terrain(terrain).world();
    // Where a place lies over one column, the world can be asked for it.
    let over_columns = lights
        .iter()
        .map(|(place, [light, ..])| (place, light))
        .filter(|(place, _)| (place.x | place.z) & 4095 == 0);
    let mut compared = 0;
    for (place, &light) in over_columns {
        let place = place.as_dvec3() / 4096.0;
        assert_eq!((world.sky_light(place) * 255.0).round() as u8, light, "{when}: at {place}");
        compared += 1;
    }
    assert!(compared > 100, "{when}: {compared}");
    lights.values().filter(|[light, ..]| *light < 200).count()
}

#[test]
fn a_dig_lights_all_ground_near_in_its_frame() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(steep());
    stage.app.world_mut().entity_mut(terrain).insert((SlimVertices, SkyLight::default()));
    // A brush waits for the meshes with light.
    stage.send(dig(30.0, 30.0, 30.0, 2.0));
    stage.settle_shown();
    let before = assert_lit(&mut stage, terrain, "before");
    for (number, brush) in random_brushes(3, 40).into_iter().enumerate() {
        let answered = stage.receipts().len();
        stage.send(brush);
        stage.frames_until("it is answered", |stage| stage.receipts().len() > answered);
        assert_lit(&mut stage, terrain, &format!("in the frame of brush {number}"));
        if number % 8 == 7 {
            stage
                .app
                .world_mut()
                .write_message(Undo { terrain: Some(terrain) })
                .expect("the plugin added the message");
            stage.settle_shown();
            assert_lit(&mut stage, terrain, &format!("after a step back from brush {number}"));
        }
    }
    assert!(assert_lit(&mut stage, terrain, "after") != before);
    // What the game applies itself is lit too.
    let mut model = stage.app.world_mut().get_mut::<Terrain>(terrain).expect("it is there");
    model.apply([dig(30.0, 10.0, 31.0, 6.0)]);
    stage.settle_shown();
    assert_lit(&mut stage, terrain, "after a dig by the game");
}

#[test]
fn light_is_drawn_only_where_it_is_wanted() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(level(1.0));
    let is_lit = |stage: &mut Stage| {
        stage.settle_shown();
        stage.send(dig(30.0, 8.0, 30.0, 4.0));
        stage.settle_shown();
        lights(stage).is_some()
    };
    assert!(!is_lit(&mut stage), "without the component");
    stage.app.world_mut().entity_mut(terrain).insert(SkyLight::default());
    assert!(is_lit(&mut stage));
    stage.app.world_mut().entity_mut(terrain).insert(SkyLight::OFF);
    assert!(!is_lit(&mut stage), "switched off");
    stage.app.world_mut().entity_mut(terrain).remove::<SkyLight>().insert(GroundLook::default());
    assert!(is_lit(&mut stage), "with a look");
    stage.app.world_mut().entity_mut(terrain).insert(SkyLight::OFF);
    assert!(!is_lit(&mut stage), "with a look, switched off");
    stage.app.world_mut().entity_mut(terrain).insert(SkyLight::default());
    assert!(is_lit(&mut stage), "switched on again");
    stage.app.world_mut().entity_mut(terrain).remove::<GroundLook>();
    assert!(!is_lit(&mut stage), "the look is gone");
}

#[test]
fn levels_of_detail_are_lit_alike_where_they_meet() {
    let mut stage = Stage::drawing();
    let noise = NoiseHeights { seed: 9, octaves: 5, scale: 70.0, amplitude: 60.0, base: 0.0, ..default() };
    let ground = Ground::from_noise(320, 270, &noise).expect("valid mountains");
    let model =
        Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size: 1.0 }).expect("valid settings");
    let eye = DetailSource { picture_height: 400.0, ..default() };
    stage.app.world_mut().spawn((eye, Transform::from_xyz(20.0, 70.0, 30.0)));
    let levels = LevelsOfDetail { cell_pixels: 24.0, error_pixels: 1.0, ..default() };
    let terrain = stage.app.world_mut().spawn((model, levels, SkyLight::default())).id();
    stage.settle();
    assert_lit(&mut stage, terrain, "before");
    for (x, z) in [(30.0, 40.0), (120.0, 90.0), (250.0, 200.0), (255.0, 196.0), (31.0, 44.0)] {
        let height = stage.terrain(terrain).world().height(x, z).expect("inside") as f32;
        let answered = stage.receipts().len();
        stage.send(dig(x as f32, height, z as f32, 6.0));
        stage.frames_until("it is answered", |stage| stage.receipts().len() > answered);
        assert_lit(&mut stage, terrain, &format!("in the frame of a dig at ({x}, {z})"));
    }
}
