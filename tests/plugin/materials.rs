//! Any material on a terrain's entity is propagated to its tiles and chunks.

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::render::render_resource::AsBindGroup;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level, random_brushes, steep};

/// A material of the game's own.
#[derive(Asset, TypePath, AsBindGroup, Clone, Debug, Default)]
struct Glow {}

impl Material for Glow {}

/// A stage with the standard material and one of the game's own.
fn stage() -> Stage {
    let glow = TerrainMaterialPlugin::<Glow>::default();
    let mut stage = Stage::with((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin, glow));
    stage.app.init_asset::<StandardMaterial>().init_asset::<Glow>();
    stage
}

/// Whether all tiles and chunks of a terrain have this material and no other.
fn all_have_material<M: Material>(stage: &mut Stage, terrain: Entity, material: &Handle<M>) -> bool {
    let world = stage.app.world_mut();
    let mut drawn =
        world.query_filtered::<(Option<&MeshMaterial3d<M>>, &ChildOf), Or<(With<Tile>, With<Chunk>)>>();
    let mut all = drawn.iter(world).filter(|(_, parent)| parent.parent() == terrain);
    all.all(|(found, _)| found.is_some_and(|found| found.0 == *material))
}

fn has_no_material<M: Material>(stage: &mut Stage) -> bool {
    let world = stage.app.world_mut();
    let mut found = world.query_filtered::<&MeshMaterial3d<M>, Or<(With<Tile>, With<Chunk>)>>();
    found.iter(world).count() == 0
}

fn add<M: Material>(stage: &mut Stage, material: M) -> Handle<M> {
    stage.app.world_mut().resource_mut::<Assets<M>>().add(material)
}

/// Checks that hold for every type of material.
fn is_propagated<M: Material + Default>(mut stage: Stage) {
    let (first, second) = (add(&mut stage, M::default()), add(&mut stage, M::default()));
    let mut model = steep();
    model.apply(random_brushes(19, 10));
    let terrain = stage.spawn(model);
    stage.app.world_mut().entity_mut(terrain).insert(MeshMaterial3d(first.clone()));
    stage.frames_until("the terrain is shown", |stage| stage.count::<Mesh3d>() > 0);
    assert!(all_have_material(&mut stage, terrain, &first), "in the first frame that shows it");

    let chunks = stage.count::<Chunk>();
    for brush in random_brushes(20, 20) {
        stage.send(brush);
        stage.frame();
        assert!(all_have_material(&mut stage, terrain, &first), "in every frame, new chunks too");
    }
    stage.settle();
    assert!(stage.count::<Chunk>() > chunks && all_have_material(&mut stage, terrain, &first));

    stage.app.world_mut().get_mut::<MeshMaterial3d<M>>(terrain).expect("a material").0 = second.clone();
    stage.frame();
    assert!(all_have_material(&mut stage, terrain, &second), "in the frame after a change");
    stage.send(dig(30.0, -20.0, 30.0, 6.0));
    stage.settle();
    assert!(all_have_material(&mut stage, terrain, &second));

    // A terrain may get its material late, and another terrain has its own.
    let other = stage.spawn_at(level(1.0), Vec3::new(200.0, 0.0, 0.0));
    stage.settle();
    assert!(!all_have_material(&mut stage, other, &first) && all_have_material(&mut stage, terrain, &second));
    stage.app.world_mut().entity_mut(other).insert(MeshMaterial3d(first.clone()));
    stage.frame();
    assert!(all_have_material(&mut stage, other, &first) && all_have_material(&mut stage, terrain, &second));
}

#[test]
fn the_standard_material_is_propagated() {
    is_propagated::<StandardMaterial>(stage());
}

#[test]
fn a_material_of_the_games_own_is_propagated() {
    is_propagated::<Glow>(stage());
}

#[test]
fn a_material_removed_from_a_terrain_is_removed_from_its_tiles() {
    let mut stage = stage();
    let terrain = stage.show(level(1.0));
    let standard = add(&mut stage, StandardMaterial::default());
    let glow = add(&mut stage, Glow::default());
    stage.app.world_mut().entity_mut(terrain).insert(MeshMaterial3d(standard.clone()));
    stage.frame();
    assert!(all_have_material(&mut stage, terrain, &standard));
    // With both materials, tiles would be drawn twice.
    exchange(&mut stage, terrain, &glow);
    assert!(all_have_material(&mut stage, terrain, &glow));
    assert!(has_no_material::<StandardMaterial>(&mut stage), "tiles still have the standard material");
}

/// Replaces a terrain's standard material by the game's own.
fn exchange(stage: &mut Stage, terrain: Entity, glow: &Handle<Glow>) {
    let mut terrain = stage.app.world_mut().entity_mut(terrain);
    terrain.remove::<MeshMaterial3d<StandardMaterial>>().insert(MeshMaterial3d(glow.clone()));
    stage.frame();
}

/// The materials of a piece: the standard material, and the game's own.
fn materials_of(stage: &Stage, piece: Entity) -> (Option<Handle<StandardMaterial>>, Option<Handle<Glow>>) {
    let piece = stage.app.world().entity(piece);
    let standard = piece.get::<MeshMaterial3d<StandardMaterial>>();
    let glow = piece.get::<MeshMaterial3d<Glow>>();
    (standard.map(|found| found.0.clone()), glow.map(|found| found.0.clone()))
}

#[test]
fn pieces_have_the_material_of_their_terrain() {
    let mut stage = stage();
    let terrain = stage.show(level(1.0));
    let [first, second] = [(); 2].map(|()| add(&mut stage, StandardMaterial::default()));
    let glow = add(&mut stage, Glow::default());
    let piece = stage.app.world_mut().spawn(GroundPiece { terrain, origin: IVec3::ZERO }).id();
    for material in [first, second] {
        stage.app.world_mut().entity_mut(terrain).insert(MeshMaterial3d(material.clone()));
        stage.frame();
        assert_eq!(materials_of(&stage, piece), (Some(material), None));
    }
    exchange(&mut stage, terrain, &glow);
    assert_eq!(materials_of(&stage, piece), (None, Some(glow)));
}

#[test]
fn a_piece_keeps_its_own_material_until_the_terrains_material_changes() {
    let mut stage = stage();
    let terrain = stage.show(level(1.0));
    let [first, second, own] = [(); 3].map(|()| add(&mut stage, StandardMaterial::default()));
    stage.app.world_mut().entity_mut(terrain).insert(MeshMaterial3d(first));
    stage.frame();
    let piece = GroundPiece { terrain, origin: IVec3::ZERO };
    let piece = stage.app.world_mut().spawn((piece, MeshMaterial3d(own.clone()))).id();
    stage.frame();
    assert_eq!(materials_of(&stage, piece), (Some(own.clone()), None));
    stage.app.world_mut().entity_mut(terrain).remove::<MeshMaterial3d<StandardMaterial>>();
    stage.frame();
    assert_eq!(materials_of(&stage, piece), (Some(own), None), "it did not come from the terrain");
    stage.app.world_mut().entity_mut(terrain).insert(MeshMaterial3d(second.clone()));
    stage.frame();
    assert_eq!(materials_of(&stage, piece), (Some(second), None));
}

#[test]
fn a_piece_spawned_with_its_own_material_keeps_it() {
    let mut stage = stage();
    let terrain = stage.show(level(1.0));
    let [first, own] = [(); 2].map(|()| add(&mut stage, StandardMaterial::default()));
    stage.app.world_mut().entity_mut(terrain).insert(MeshMaterial3d(first));
    let piece = GroundPiece { terrain, origin: IVec3::ZERO };
    let piece = stage.app.world_mut().spawn((piece, MeshMaterial3d(own.clone()))).id();
    stage.frame();
    stage.frame();
    assert_eq!(materials_of(&stage, piece), (Some(own), None));
}

#[test]
fn vertex_colours_are_those_of_the_terrain() {
    let mut stage = Stage::drawing();
    let terrain = stage.spawn(level(1.0));
    let red = LinearRgba::rgb(1.0, 0.0, 0.0);
    let mut colors = vec![LinearRgba::BLACK; 8];
    colors[5] = red;
    stage.app.world_mut().entity_mut(terrain).insert(MaterialColors(colors));
    stage.settle();
    stage.send(Brush::add(Shape::sphere(Vec3::new(24.0, 20.0, 24.0), 5.0), MaterialId(5)));
    stage.settle();
    let world = stage.app.world_mut();
    let mut chunks = world.query_filtered::<&Mesh3d, With<Chunk>>();
    let handles: Vec<_> = chunks.iter(world).map(|mesh| mesh.0.clone()).collect();
    let meshes = world.resource::<Assets<Mesh>>();
    let colors: Vec<[f32; 4]> = handles
        .iter()
        .filter_map(|handle| match meshes.get(handle)?.attribute(Mesh::ATTRIBUTE_COLOR)? {
            bevy::mesh::VertexAttributeValues::Float32x4(colors) => Some(colors.clone()),
            _ => None,
        })
        .flatten()
        .collect();
    assert!(!colors.is_empty() && colors.iter().all(|&color| color == red.to_f32_array()));
}

/// Bytes a vertex of each mesh that is shown takes.
fn vertex_bytes(stage: &mut Stage) -> Vec<u64> {
    let world = stage.app.world_mut();
    let mut drawn = world.query_filtered::<&Mesh3d, Or<(With<Tile>, With<Chunk>)>>();
    let handles: Vec<_> = drawn.iter(world).map(|mesh| mesh.0.clone()).collect();
    let meshes = world.resource::<Assets<Mesh>>();
    handles.iter().map(|handle| meshes.get(handle).expect("it is shown").get_vertex_size()).collect()
}

#[test]
fn a_look_brings_slim_vertices_and_takes_them_away() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(level(1.0));
    let all_have = |stage: &mut Stage, bytes: u64, when: &str| {
        stage.send(dig(30.0, 8.0, 30.0, 4.0));
        stage.settle();
        stage.assert_whole(terrain, when);
        let found = vertex_bytes(stage);
        assert!(found.len() > 1 && found.iter().all(|&own| own == bytes), "{when}: {found:?}");
    };
    all_have(&mut stage, 52, "before");
    stage.app.world_mut().entity_mut(terrain).insert(GroundLook::default());
    all_have(&mut stage, 36, "with a look");
    // One look in place of another one changes nothing.
    stage.app.world_mut().entity_mut(terrain).remove::<GroundLook>().insert(GroundLook::default());
    all_have(&mut stage, 36, "with another look");
    stage.app.world_mut().entity_mut(terrain).insert(SkyLight::OFF);
    all_have(&mut stage, 32, "without sky light");
    stage.app.world_mut().entity_mut(terrain).remove::<GroundLook>();
    all_have(&mut stage, 52, "after");
    // While it loads.
    stage.app.world_mut().entity_mut(terrain).insert(SlimVertices);
    stage.frame();
    stage.app.world_mut().entity_mut(terrain).remove::<SlimVertices>();
    stage.frame();
    stage.app.world_mut().entity_mut(terrain).insert(SlimVertices);
    all_have(&mut stage, 32, "after changes of mind");
}
