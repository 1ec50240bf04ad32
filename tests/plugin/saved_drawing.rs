//! A world that is opened again is drawn as before: its ground, the light of the sky, and levels of detail.
#![cfg(feature = "store")]

use std::path::Path;

use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::lod::{levels, mountains};
use crate::saved::{Folder, saved};
use crate::stage::{Stage, dig};

/// The place of a corner in 1/4096 voxel, and its light.
type Corner = ([i32; 3], [u8; 4]);

/// All triangles that are drawn, in an order that does not depend on how their meshes were made.
fn drawn(stage: &mut Stage) -> Vec<[Corner; 3]> {
    let world = stage.app.world_mut();
    let mut parts = world.query_filtered::<(&Mesh3d, &Transform), Or<(With<Tile>, With<Chunk>)>>();
    let meshes = world.resource::<Assets<Mesh>>();
    let mut triangles = Vec::new();
    for (mesh, place) in parts.iter(world) {
        let mesh = meshes.get(&mesh.0).expect("it is shown");
        let places = mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(VertexAttributeValues::as_float3);
        let places = places.expect("each mesh has positions");
        let Some(VertexAttributeValues::Unorm8x4(light)) = mesh.attribute(Terrain::ATTRIBUTE_SKY_LIGHT)
        else {
            panic!("a mesh has no light");
        };
        let corner = |index: usize| -> Corner {
            let at = (Vec3::from(places[index]) + place.translation) * 4096.0;
            (at.round().as_ivec3().to_array(), light[index])
        };
        let indices: Vec<usize> = mesh.indices().expect("it has indices").iter().collect();
        triangles.extend(indices.chunks_exact(3).map(|three| {
            let [a, b, c] = [three[0], three[1], three[2]].map(&corner);
            [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().expect("there are three")
        }));
    }
    triangles.sort_unstable();
    triangles
}

/// Waits until each square is drawn at its level, and returns what is drawn.
fn drawn_at_its_levels(stage: &mut Stage, terrain: Entity) -> Vec<[Corner; 3]> {
    stage.frames_until("all is drawn at its level", |stage| {
        stage.app.world().get::<ShownLevels>(terrain).is_some_and(|shown| shown.waiting == 0)
    });
    drawn(stage)
}

/// A game with the world in a folder, which is drawn.
fn play(folder: &Path, edited_pixels: f32) -> (Stage, Entity) {
    let mut stage = Stage::drawing();
    let eye = DetailSource { picture_height: 400.0, ..default() };
    stage.app.world_mut().spawn((eye, Transform::from_xyz(20.0, 70.0, 30.0)));
    let levels = LevelsOfDetail { edited_pixels, ..levels() };
    let world = (mountains(), levels, SkyLight::default(), saved(folder));
    let terrain = stage.app.world_mut().spawn(world).id();
    stage.settle();
    (stage, terrain)
}

/// Digs at the surface, and waits for the answer.
fn dig_at(stage: &mut Stage, terrain: Entity, x: f32, z: f32, radius: f32) {
    let height = stage.terrain(terrain).world().height(x.into(), z.into()).expect("inside the world");
    let answered = stage.receipts().len();
    stage.send(dig(x, height as f32, z, radius));
    stage.frames_until("it is answered", |stage| stage.receipts().len() > answered);
}

fn undo(stage: &mut Stage, terrain: Entity) {
    stage.write(Undo { terrain: Some(terrain) });
    stage.settle();
}

/// Digs, undoes one dig, ends and opens the world again, and undoes another dig. `drawn` finds what is drawn.
fn assert_drawn_as_before(
    name: &str,
    edited_pixels: f32,
    drawn: impl Fn(&mut Stage, Entity) -> Vec<[Corner; 3]>,
) {
    let folder = Folder::new(name);
    let (mut stage, terrain) = play(&folder.0, edited_pixels);
    let pristine = drawn(&mut stage, terrain);
    for (x, z, radius) in [(30.0, 40.0, 6.0), (120.0, 90.0, 9.0), (255.0, 196.0, 12.0), (31.0, 60.0, 5.0)] {
        dig_at(&mut stage, terrain, x, z, radius);
    }
    undo(&mut stage, terrain);
    let (before, hash) = (drawn(&mut stage, terrain), stage.hash(terrain));
    let shown = stage.app.world().get::<ShownLevels>(terrain).expect("the plugin adds it");
    assert!(shown.nodes.iter().filter(|nodes| **nodes > 0).count() > 1, "{shown:?}");
    assert!(before != pristine && before.iter().flatten().any(|(_, light)| light[0] < 200));
    stage.write(AppExit::Success);
    stage.frame();
    drop(stage);

    let (mut stage, terrain) = play(&folder.0, edited_pixels);
    assert_eq!(stage.hash(terrain), hash);
    let opened = drawn(&mut stage, terrain);
    assert!(opened == before, "opened: {} triangles, and {} before", opened.len(), before.len());
    // Steps are not saved, so there is nothing to undo yet. A new one leads back to what was opened.
    undo(&mut stage, terrain);
    assert_eq!(stage.hash(terrain), hash);
    dig_at(&mut stage, terrain, 33.0, 43.0, 7.0);
    assert_ne!(stage.hash(terrain), hash);
    undo(&mut stage, terrain);
    assert_eq!(stage.hash(terrain), hash);
    let undone = drawn(&mut stage, terrain);
    assert!(undone == before, "undone: {} triangles, and {} before", undone.len(), before.len());
}

#[test]
fn a_world_that_is_opened_again_is_drawn_and_lit_as_its_commits_left_it() {
    // Where levels do not depend on edits, they are those of the ground at any time.
    assert_drawn_as_before("drawn", f32::INFINITY, drawn_at_its_levels);
}

#[test]
fn a_world_that_is_opened_again_has_the_levels_of_one_that_is_drawn_anew() {
    // Otherwise ground that became finer for a dig may stay so after undo.
    assert_drawn_as_before("drawn-anew", levels().edited_pixels, |stage, terrain| {
        stage.app.world_mut().trigger(Redraw { terrain: Some(terrain) });
        stage.settle_shown();
        drawn_at_its_levels(stage, terrain)
    });
}
