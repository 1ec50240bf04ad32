//! What the renderer is given: assets that are touched only when they change, one material for each part, one
//! visibility class.

use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::VisibilityClass;
use bevy::pbr::wireframe::Wireframe;
use bevy::prelude::*;
use bevy::render::render_resource::AsBindGroup;
use bevy_burrow::plugin::MeshBytes;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level, steep};

/// How often a ground material was touched.
#[derive(Resource, Default)]
struct Touched(usize);

fn count_touched(mut events: MessageReader<AssetEvent<GroundMaterial>>, mut touched: ResMut<Touched>) {
    touched.0 += events.read().filter(|event| matches!(event, AssetEvent::Modified { .. })).count();
}

fn stage() -> Stage {
    stage_with(())
}

fn stage_with<M>(plugins: impl bevy::app::Plugins<M>) -> Stage {
    let mut stage = Stage::windowless_with(plugins);
    stage
        .app
        .insert_resource(GroundTextures::Baked { side: 16, anisotropy: 1 })
        .init_resource::<Touched>()
        .add_systems(Last, count_touched);
    stage
}

fn tiles_with<C: Component>(stage: &mut Stage) -> usize {
    let world = stage.app.world_mut();
    world.query_filtered::<(), (With<Tile>, With<C>)>().iter(world).count()
}

type Ground = MeshMaterial3d<GroundMaterial>;
type Plain = MeshMaterial3d<StandardMaterial>;

/// A terrain that has its look, in an app in which nothing has happened for a while.
fn dressed() -> (Stage, Entity) {
    let mut stage = stage();
    let terrain = stage.app.world_mut().spawn((level(1.0), GroundLook::default())).id();
    stage.frames_until("the ground is dressed", |stage| {
        tiles_with::<Ground>(stage) == 16 && stage.app.world().resource::<GroundLoading>().is_ready()
    });
    stage.frames(8);
    touched(&mut stage);
    stage.frames(8);
    assert_eq!(touched(&mut stage), 0, "nothing happens");
    (stage, terrain)
}

fn touched(stage: &mut Stage) -> usize {
    std::mem::take(&mut stage.app.world_mut().resource_mut::<Touched>().0)
}

#[test]
fn digs_and_what_moves_below_a_terrain_leave_its_material_alone() {
    let (mut stage, terrain) = dressed();
    stage.send(dig(30.0, 8.0, 30.0, 6.0));
    stage.settle();
    stage.frames(4);
    assert_eq!(touched(&mut stage), 0, "a dig spawns chunks and fields");
    let cart = (Transform::default(), Visibility::default(), ChildOf(terrain));
    let cart = stage.app.world_mut().spawn(cart).id();
    let piece = stage.app.world_mut().spawn(GroundPiece { terrain, origin: IVec3::ONE }).id();
    stage.frames(4);
    touched(&mut stage);
    for step in 0..20 {
        for entity in [cart, piece] {
            stage.app.world_mut().get_mut::<Transform>(entity).expect("a place").translation.x = step as f32;
        }
        stage.frame();
    }
    assert_eq!(touched(&mut stage), 0, "in 20 frames of a cart that rolls");
    stage.app.world_mut().get_mut::<Transform>(terrain).expect("a place").set_changed();
    stage.app.world_mut().get_mut::<GroundLook>(terrain).expect("a look").set_changed();
    stage.frames(2);
    assert_eq!(touched(&mut stage), 0, "nothing differs");
    stage.app.world_mut().get_mut::<GroundLook>(terrain).expect("a look").variety = 0.9;
    stage.frames(2);
    assert!(touched(&mut stage) > 0, "it follows its look");
    stage.app.world_mut().get_mut::<Transform>(terrain).expect("a place").translation.x = 32.0;
    stage.frames(2);
    assert!(touched(&mut stage) > 0, "and its terrain");
}

#[test]
fn a_material_with_colliders_and_levels_around_it_is_left_alone() {
    let mut stage = stage();
    let camera =
        (Camera::default(), bevy::camera::Projection::default(), Transform::from_xyz(9.0, 60.0, 9.0));
    let camera = stage.app.world_mut().spawn(camera).id();
    let noise = NoiseHeights { seed: 9, scale: 70.0, amplitude: 60.0, ..default() };
    let ground = bevy_burrow::prelude::Ground::from_noise(320, 270, &noise).expect("valid mountains");
    let model = Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size: 1.0 }).expect("valid");
    let levels = LevelsOfDetail { cell_pixels: 24.0, error_pixels: 1.0, ..default() };
    stage.app.world_mut().spawn((model, levels, GroundLook::default()));
    stage.settle();
    stage.frames_until("the ground is dressed", |stage| {
        tiles_with::<Ground>(stage) > 0 && stage.app.world().resource::<GroundLoading>().is_ready()
    });
    stage.frames(8);
    touched(&mut stage);
    for step in 0..60 {
        let at = Vec3::new(9.0 + 4.0 * step as f32, 60.0, 9.0 + 3.0 * step as f32);
        stage.app.world_mut().get_mut::<Transform>(camera).expect("a place").translation = at;
        stage.frames(1);
    }
    assert_eq!(touched(&mut stage), 0, "levels changed, and the look did not");
}

/// A material of the game's own.
#[derive(Asset, TypePath, AsBindGroup, Clone, Debug, Default)]
struct Toon {}

impl Material for Toon {}

#[test]
fn no_tile_has_two_materials_whatever_is_put_on_its_terrain() {
    let mut stage = stage_with(TerrainMaterialPlugin::<Toon>::default());
    stage.app.init_asset::<Toon>();
    type Own = MeshMaterial3d<Toon>;
    let world = stage.app.world_mut();
    let plain =
        MeshMaterial3d(world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default()));
    let toon = MeshMaterial3d(world.resource_mut::<Assets<Toon>>().add(Toon {}));
    let terrain = stage.app.world_mut().spawn((level(1.0), plain.clone())).id();
    stage.settle();
    let check = |stage: &mut Stage, expected: [usize; 3], what: &str| {
        stage.frames(2);
        let found = [tiles_with::<Plain>(stage), tiles_with::<Own>(stage), tiles_with::<Ground>(stage)];
        assert_eq!(found, expected, "{what}");
    };
    check(&mut stage, [16, 0, 0], "a plain material");
    stage.app.world_mut().entity_mut(terrain).insert(GroundLook::default());
    stage.frames_until("it is dressed", |stage| tiles_with::<Ground>(stage) == 16);
    stage.settle();
    check(&mut stage, [0, 0, 16], "a look goes before others");
    stage.app.world_mut().entity_mut(terrain).insert(toon);
    check(&mut stage, [0, 0, 16], "a look goes before others");
    stage.send(dig(30.0, 8.0, 30.0, 12.0));
    stage.settle();
    let world = stage.app.world_mut();
    let mut chunks = world.query_filtered::<(Has<Plain>, Has<Own>, Has<Ground>), With<Chunk>>();
    assert!(chunks.iter(world).all(|found| found == (false, false, true)), "new chunks");
    stage.app.world_mut().entity_mut(terrain).remove::<GroundLook>();
    stage.settle();
    check(&mut stage, [0, 16, 0], "the one whose plugin was added last");
    stage.app.world_mut().entity_mut(terrain).remove::<Own>();
    check(&mut stage, [16, 0, 0], "the one that is left");
    stage.app.world_mut().entity_mut(terrain).remove::<Plain>().insert(GroundLook::default());
    stage.frames_until("it is dressed again", |stage| tiles_with::<Ground>(stage) == 16);
    check(&mut stage, [0, 0, 16], "a look alone");
    stage.app.world_mut().entity_mut(terrain).remove::<GroundLook>().insert(plain);
    stage.settle();
    check(&mut stage, [16, 0, 0], "swapped in one frame");
}

#[test]
fn a_chunk_whose_mesh_goes_and_comes_is_seen_once() {
    let mut stage = stage();
    let terrain = stage.show(level(1.0));
    let build = || Brush::add(Shape::sphere(Vec3::new(24.0, 40.0, 24.0), 3.0), MaterialId(5));
    stage.send(build());
    stage.settle();
    let rock = stage.with_component::<Chunk>()[0];
    for round in 0..3 {
        stage.send(dig(24.0, 40.0, 24.0, 5.0));
        stage.settle();
        stage.frame();
        assert!(!stage.app.world().entity(rock).contains::<Mesh3d>(), "it is dug away");
        assert!(!stage.app.world().entity(rock).contains::<VisibilityClass>(), "and in no list");
        stage.send(build());
        stage.settle();
        stage.frame();
        assert!(stage.app.world().entity(rock).contains::<Mesh3d>(), "it is there again");
        let classes = stage.app.world().get::<VisibilityClass>(rock).expect("as every mesh has").len();
        assert_eq!(classes, 1, "after round {round}");
    }
    // Tiles whose ground is dug away whole, too.
    for _ in 0..3 {
        let all = Shape::cuboid(Vec3::new(24.0, 8.0, 24.0), Vec3::new(12.0, 20.0, 12.0));
        stage.send(Brush::dig(all));
        stage.settle();
        stage.app.world_mut().write_message(Undo { terrain: Some(terrain) });
        stage.settle();
    }
    let world = stage.app.world_mut();
    let mut classes =
        world.query_filtered::<&VisibilityClass, (With<Mesh3d>, Or<(With<Tile>, With<Chunk>)>)>();
    assert!(classes.iter(world).all(|classes| classes.len() == 1));
}

#[test]
fn meshes_stay_in_the_main_world_if_asked() {
    let mut stage = Stage::drawing();
    let usages = |stage: &mut Stage| {
        let world = stage.app.world_mut();
        let mut all: Vec<RenderAssetUsages> =
            world.resource::<Assets<Mesh>>().iter().map(|(_, mesh)| mesh.asset_usage).collect();
        all.dedup();
        all
    };
    let terrain = stage.show(steep());
    assert_eq!(usages(&mut stage), [RenderAssetUsages::RENDER_WORLD]);
    stage.app.world_mut().resource_mut::<BurrowSettings>().mesh_usages = RenderAssetUsages::default();
    stage.app.world_mut().trigger(Redraw { terrain: Some(terrain) });
    stage.frames(2);
    stage.settle();
    stage.frames_until("all meshes are rebuilt", |stage| usages(stage) == [RenderAssetUsages::default()]);
    stage.send(dig(30.0, 8.0, 30.0, 6.0));
    stage.settle();
    assert_eq!(usages(&mut stage), [RenderAssetUsages::default()]);
    stage.assert_whole(terrain, "kept");
}

#[test]
fn everything_is_drawn_again_when_asked_and_no_frame_is_without_ground() {
    #[derive(Resource, Default)]
    struct Ready(usize);
    let mut stage = Stage::drawing();
    stage
        .app
        .init_resource::<Ready>()
        .add_observer(|_: On<TerrainReady>, mut ready: ResMut<Ready>| ready.0 += 1);
    let terrain = stage.show(steep());
    stage.send(dig(30.0, 8.0, 30.0, 6.0));
    stage.settle();
    let (hash, meshes) = (stage.hash(terrain), stage.meshes());
    let handles = |stage: &mut Stage| {
        let world = stage.app.world_mut();
        let mut all: Vec<AssetId<Mesh>> =
            world.query_filtered::<&Mesh3d, With<MeshBytes>>().iter(world).map(|mesh| mesh.0.id()).collect();
        all.sort_unstable();
        all
    };
    let before = handles(&mut stage);
    stage.app.world_mut().trigger(Redraw::default());
    // Somebody digs on meanwhile.
    stage.send(dig(10.0, 8.0, 10.0, 4.0).with_tag(9));
    stage.frames_until("all is shown again", |stage| {
        assert!(stage.shown(terrain).is_closed());
        stage.app.world().resource::<Ready>().0 == 2
    });
    stage.settle();
    let after = handles(&mut stage);
    assert!(after.iter().all(|mesh| !before.contains(mesh)), "all meshes are new");
    assert!(stage.tags().contains(&9) && stage.hash(terrain) != hash);
    assert!(stage.meshes() <= meshes + 4, "the old ones are gone");
    stage.assert_whole(terrain, "drawn again");
}

#[test]
fn any_component_goes_to_tiles_chunks_and_pieces() {
    #[derive(Component, Clone, Debug, PartialEq)]
    struct Minimap(u32);
    let mut stage = stage_with((
        TerrainPropagatePlugin::<Minimap>::default(),
        TerrainPropagatePlugin::<Wireframe>::default(),
    ));
    let terrain = stage.app.world_mut().spawn((level(1.0), Minimap(1), Wireframe)).id();
    stage.settle();
    stage.send(dig(30.0, 8.0, 30.0, 6.0));
    stage.settle();
    let piece = stage.app.world_mut().spawn(GroundPiece { terrain, origin: IVec3::ZERO }).id();
    let own = stage.app.world_mut().spawn((GroundPiece { terrain, origin: IVec3::ZERO }, Minimap(7))).id();
    stage.frames(2);
    let parts = 2 + stage.count::<Tile>() + stage.count::<Chunk>();
    assert_eq!((stage.count::<Minimap>(), stage.count::<Wireframe>()), (1 + parts, 1 + parts));
    assert_eq!(stage.app.world().get(piece), Some(&Minimap(1)));
    assert_eq!(stage.app.world().get(own), Some(&Minimap(7)));
    *stage.app.world_mut().get_mut::<Minimap>(terrain).expect("it is there") = Minimap(2);
    stage.frames(1);
    let world = stage.app.world_mut();
    assert!(world.query::<&Minimap>().iter(world).all(|map| *map == Minimap(2)));
    stage.app.world_mut().entity_mut(terrain).remove::<(Minimap, Wireframe)>();
    stage.frames(1);
    assert_eq!((stage.count::<Minimap>(), stage.count::<Wireframe>()), (0, 0));
}
