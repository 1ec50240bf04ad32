//! Islands follow commits: a path through a tunnel exists in the frame after the commit that opened it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::navigation::{NavPolygons, NavTilePos, WalkSettings, WalkableTile, Walker};
use bevy_burrow::paths::bevy_landmass::{
    PermittedAnimationLinks, PointSampleDistance3d, UsingAnimationLink, prelude::*,
};
use bevy_burrow::paths::{Navigation, NavigationArea, NavigationPlugin, NavigationSource, NavigationTiles};
use bevy_burrow::prelude::*;
use fastrand::Rng;

use crate::random_works;

const AGENT: WalkSettings = WalkSettings {
    radius: 0.4,
    height: 1.8,
    step: 0.4,
    slope: 1.0,
    precision: 0.3,
    jump_down: 0.0,
    climb_up: 0.0,
    leap: 1.0,
};

const SOUTH: Vec3 = Vec3::new(48.0, 10.0, 12.0);
const NORTH: Vec3 = Vec3::new(48.0, 10.0, 84.0);

/// A plain with a steep ridge across it.
fn ridge() -> Ground {
    let height = |z: i32| 10.0 + 20.0 * f64::from((8 - (z - 48).abs()).clamp(0, 4)) / 4.0;
    Ground::from_fn(96, 96, |_, z| height(z)).expect("finite")
}

fn terrain() -> Terrain {
    Terrain::new(ridge(), &TerrainSettings { chunk_size: 16, ..default() }).expect("valid")
}

fn empty_app(same_frame: bool) -> (App, Entity) {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin))
        .add_plugins(Landmass3dPlugin::default().in_schedule(PreUpdate))
        .add_plugins((BurrowPlugins, NavigationPlugin { wait: Duration::from_secs(60) }));
    app.finish();
    app.cleanup();
    app.world_mut().resource_mut::<BurrowSettings>().same_frame =
        Duration::from_secs(if same_frame { 60 } else { 0 });
    let archipelago = app.world_mut().spawn(Archipelago3d::new(AGENT.archipelago_options(1.0))).id();
    (app, archipelago)
}

/// An app with a terrain and its navigation, which is loaded: terrain, archipelago, navigation.
fn app(same_frame: bool, agent: WalkSettings) -> (App, [Entity; 3]) {
    let (mut app, archipelago) = empty_app(same_frame);
    let terrain = app.world_mut().spawn(terrain()).id();
    let area = NavigationArea::Everywhere;
    let navigation = app.world_mut().spawn(Navigation { terrain, archipelago, agent, area }).id();
    wait_for_tiles(&mut app, navigation);
    (app, [terrain, archipelago, navigation])
}

fn wait(app: &mut App, is_done: impl Fn(&World) -> bool) {
    let start = Instant::now();
    while !is_done(app.world()) {
        assert!(start.elapsed() < Duration::from_secs(300), "it never came");
        app.update();
        std::thread::sleep(Duration::from_micros(500));
    }
}

fn tiles(world: &World, navigation: Entity) -> &NavigationTiles {
    world.get::<NavigationTiles>(navigation).expect("the state of a navigation")
}

fn wait_for_tiles(app: &mut App, navigation: Entity) {
    app.update();
    wait(app, |world| {
        let tiles = tiles(world, navigation);
        !tiles.is_empty() && !tiles.is_loading() && !tiles.is_building()
    });
    app.update();
}

/// Updates until the commit that changes the ground has been made, and not once more.
fn commit(app: &mut App, terrain: Entity, ask: impl FnOnce(&mut App)) {
    let hash = |app: &App| app.world().get::<Terrain>(terrain).expect("a terrain").world().hash();
    let before = hash(app);
    ask(app);
    let start = Instant::now();
    while hash(app) == before {
        assert!(start.elapsed() < Duration::from_secs(300), "the commit never came");
        app.update();
    }
}

fn has_path(app: &App, archipelago: Entity, from: Vec3, to: Vec3) -> bool {
    let archipelago = app.world().get::<Archipelago3d>(archipelago).expect("an archipelago");
    let near = PointSampleDistance3d {
        horizontal_distance: 1.0,
        distance_above: 2.0,
        distance_below: 2.0,
        vertical_preference_ratio: 2.0,
        animation_link_max_vertical_distance: 1.0,
    };
    let (Ok(from), Ok(to)) = (archipelago.sample_point(from, &near), archipelago.sample_point(to, &near))
    else {
        return false;
    };
    archipelago.find_path(&from, &to, &default(), PermittedAnimationLinks::All).is_ok()
}

fn island_count(app: &mut App) -> usize {
    app.world_mut().query_filtered::<(), (With<Island>, Allow<Disabled>)>().iter(app.world()).count()
}

fn tunnel() -> Brush {
    Brush::dig(Shape::capsule(Vec3::new(48.0, 12.0, 36.0), Vec3::new(48.0, 12.0, 60.0), 3.5))
}

fn send(message: impl Message) -> impl FnOnce(&mut App) {
    move |app: &mut App| {
        app.world_mut().write_message(message).expect("the plugin added it");
    }
}

#[test]
fn agents_jump_into_a_pit_and_climb_out_if_they_can_in_the_frame_after_the_commit() {
    let pit = Brush::dig(Shape::cuboid(Vec3::new(48.0, 10.0, 14.0), Vec3::new(6.0, 4.0, 6.0)));
    let (inside, beside) = (Vec3::new(48.0, 6.0, 14.0), Vec3::new(30.0, 10.0, 14.0));
    for (jump_down, climb_up) in [(0.0, 0.0), (5.0, 0.0), (5.0, 5.0), (3.0, 3.0)] {
        let (mut app, [terrain, archipelago, _]) = app(false, WalkSettings { jump_down, climb_up, ..AGENT });
        for _ in 0..2 {
            commit(&mut app, terrain, send(pit.clone()));
            app.update();
            assert_eq!(has_path(&app, archipelago, beside, inside), jump_down > 4.0, "{jump_down}");
            assert_eq!(has_path(&app, archipelago, inside, beside), climb_up > 4.0, "{climb_up}");
            commit(&mut app, terrain, send(Undo { terrain: Some(terrain) }));
            app.update();
            let links = app.world_mut().query::<&AnimationLink3d>().iter(app.world()).count();
            assert_eq!(links, 0, "none is left once the pit is gone");
        }
    }
}

/// Where an agent lands.
#[derive(Component)]
struct Landing(Vec3);

/// Moves agents over the ground, and over ledges as the guide does.
fn walk(
    mut commands: Commands,
    arrived: Query<(Entity, &ReachedAnimationLink3d), Without<UsingAnimationLink>>,
    mut jumping: Query<(Entity, &Landing, &mut Transform)>,
    mut walking: Query<(&mut Transform, &mut Velocity3d, &AgentDesiredVelocity3d), Without<Landing>>,
    terrains: Terrains,
) {
    for (mut place, mut velocity, wanted) in &mut walking {
        velocity.velocity = wanted.velocity();
        place.translation += wanted.velocity() / 60.0;
        if let Some(hit) = terrains.raycast(Ray3d::new(place.translation + Vec3::Y, Dir3::NEG_Y), 3.0) {
            place.translation = hit.position;
        }
    }
    for (agent, landing, mut place) in &mut jumping {
        place.translation = landing.0;
        commands.entity(agent).remove::<(Landing, UsingAnimationLink)>();
    }
    for (agent, reached) in &arrived {
        commands.entity(agent).insert((Landing(reached.end_point), UsingAnimationLink));
    }
}

#[test]
fn an_agent_jumps_into_a_pit_climbs_out_and_arrives() {
    let agent = WalkSettings { jump_down: 5.0, climb_up: 5.0, ..AGENT };
    let (mut app, [terrain, archipelago, _]) = app(false, agent);
    let pit = Brush::dig(Shape::cuboid(Vec3::new(48.0, 10.0, 14.0), Vec3::new(6.0, 4.0, 40.0)));
    commit(&mut app, terrain, send(pit));
    app.add_systems(Update, walk);
    let agent = Agent3dBundle {
        agent: default(),
        settings: AgentSettings { radius: agent.radius, desired_speed: 5.0, max_speed: 6.0 },
        archipelago_ref: ArchipelagoRef3d::new(archipelago),
    };
    let target = Vec3::new(70.0, 10.0, 14.0);
    let start = Transform::from_xyz(30.0, 10.0, 14.0);
    let agent = app.world_mut().spawn((start, agent, AgentTarget3d::Point(target))).id();
    let mut lowest = f32::MAX;
    for _ in 0..6000 {
        app.update();
        let at = app.world().get::<Transform>(agent).expect("an agent").translation;
        lowest = lowest.min(at.y);
        if at.distance(target) < 1.0 {
            assert!(lowest < 7.0, "{lowest}: it went through the pit");
            return;
        }
    }
    panic!("stuck at {:?}, {:?}", app.world().get::<Transform>(agent), app.world().get::<AgentState>(agent));
}

#[test]
fn a_path_through_a_tunnel_exists_in_the_frame_after_the_commit() {
    for same_frame in [false, true] {
        let (mut app, [terrain, archipelago, _]) = app(same_frame, AGENT);
        assert!(has_path(&app, archipelago, SOUTH, SOUTH + 20.0 * Vec3::X), "along the ridge");
        for _ in 0..3 {
            assert!(!has_path(&app, archipelago, SOUTH, NORTH), "before the tunnel");
            commit(&mut app, terrain, send(tunnel()));
            app.update();
            assert!(has_path(&app, archipelago, SOUTH, NORTH), "through the tunnel");
            commit(&mut app, terrain, send(Undo { terrain: Some(terrain) }));
            app.update();
            assert!(!has_path(&app, archipelago, SOUTH, NORTH), "after undo");
        }
    }
}

#[test]
fn a_path_through_a_tunnel_that_two_commits_of_one_frame_dig_exists_in_the_next_frame() {
    let (mut app, [terrain, archipelago, navigation]) = app(false, AGENT);
    let walker = Walker::new(&AGENT).expect("valid");
    for turn in 0..3 {
        let x = 20.0 + 28.0 * turn as f32;
        let part = |from, to| {
            let ends = [from, to].map(|z| Vec3::new(x, 12.0, z));
            Brush::dig(Shape::capsule(ends[0], ends[1], 3.5))
        };
        let revision = |app: &App| app.world().get::<Terrain>(terrain).expect("it").world().revision();
        let before = revision(&app);
        // The first half is committed in the frame after its own, in which the second one begins and ends.
        for (half, seconds) in [(part(36.0, 48.0), 0), (part(48.0, 60.0), 60)] {
            app.world_mut().resource_mut::<BurrowSettings>().same_frame = Duration::from_secs(seconds);
            send(half)(&mut app);
            app.update();
        }
        wait(&mut app, |world| world.get::<Terrain>(terrain).expect("it").world().revision() > before);
        assert_eq!(revision(&app), before + 2, "both are committed in one frame");
        app.update();
        let [south, north] = [SOUTH, NORTH].map(|at| Vec3 { x, ..at });
        assert!(has_path(&app, archipelago, south, north), "through tunnel {turn}");
        let world = app.world().get::<Terrain>(terrain).expect("a terrain").world();
        for (pos, _, polygons) in tiles(app.world(), navigation).islands() {
            assert_eq!(*polygons, WalkableTile::new(world, pos, &walker).polygons(), "turn {turn}");
        }
        commit(&mut app, terrain, send(Undo { terrain: Some(terrain) }));
        commit(&mut app, terrain, send(Undo { terrain: Some(terrain) }));
        app.update();
        assert!(!has_path(&app, archipelago, south, north), "after undo");
    }
}

#[test]
fn agents_that_do_not_fit_have_no_path() {
    for agent in [WalkSettings { radius: 4.0, ..AGENT }, WalkSettings { height: 9.0, ..AGENT }] {
        let (mut app, [terrain, archipelago, _]) = app(true, agent);
        commit(&mut app, terrain, send(tunnel()));
        app.update();
        assert!(has_path(&app, archipelago, SOUTH, SOUTH + 20.0 * Vec3::X));
        assert!(!has_path(&app, archipelago, SOUTH, NORTH), "{agent:?}");
    }
}

#[test]
fn settings_with_an_error_have_no_islands() {
    let (mut app, archipelago) = empty_app(true);
    let terrain = app.world_mut().spawn(terrain()).id();
    let agent = WalkSettings { radius: f32::NAN, ..AGENT };
    let area = NavigationArea::Everywhere;
    let navigation = app.world_mut().spawn(Navigation { terrain, archipelago, agent, area }).id();
    for _ in 0..50 {
        app.update();
    }
    assert_eq!((island_count(&mut app), tiles(app.world(), navigation).len()), (0, 0));
    app.world_mut().get_mut::<Navigation>(navigation).expect("it").agent = AGENT;
    wait_for_tiles(&mut app, navigation);
    assert_eq!(island_count(&mut app), 9);
}

#[test]
fn nothing_is_left_of_what_is_gone() {
    // The terrain, its component, the navigation, its component, and both.
    for case in 0..5 {
        let (mut app, [terrain, archipelago, navigation]) = app(true, AGENT);
        assert_eq!(island_count(&mut app), 9);
        let world = app.world_mut();
        match case {
            0 => assert!(world.despawn(terrain)),
            1 => assert!(world.entity_mut(terrain).take::<Terrain>().is_some()),
            2 => assert!(world.despawn(navigation)),
            3 => assert!(world.entity_mut(navigation).take::<Navigation>().is_some()),
            _ => assert!(world.despawn(navigation) && world.despawn(terrain)),
        }
        for _ in 0..3 {
            app.update();
        }
        assert_eq!(island_count(&mut app), 0, "case {case}");
        assert!(!has_path(&app, archipelago, SOUTH, SOUTH + Vec3::X), "case {case}");
    }
}

#[test]
fn disabled_terrains_and_navigations_have_no_islands() {
    let (mut app, [terrain, archipelago, navigation]) = app(true, AGENT);
    for entity in [terrain, navigation] {
        app.world_mut().entity_mut(entity).insert(Disabled);
        for _ in 0..3 {
            app.update();
        }
        assert_eq!(island_count(&mut app), 0);
        app.world_mut().entity_mut(entity).remove::<Disabled>();
        wait_for_tiles(&mut app, navigation);
        assert!(has_path(&app, archipelago, SOUTH, SOUTH + 20.0 * Vec3::X));
    }
}

#[test]
fn another_world_has_other_islands() {
    let (mut app, [terrain, archipelago, navigation]) = app(true, AGENT);
    assert!(!has_path(&app, archipelago, SOUTH, NORTH));
    let flat = Ground::flat(96, 96, 10.0).expect("valid");
    let flat = Terrain::new(flat, &TerrainSettings::default()).expect("valid");
    app.world_mut().entity_mut(terrain).insert(flat);
    app.update();
    wait(&mut app, |world| {
        let tiles = tiles(world, navigation);
        tiles.len() == 9 && !tiles.is_loading() && tiles.islands().all(|(.., polygons)| polygons.len() == 1)
    });
    app.update();
    app.update();
    assert!(has_path(&app, archipelago, SOUTH, NORTH));
}

#[test]
fn two_terrains_share_an_archipelago_and_may_be_moved() {
    let (mut app, [first, archipelago, _]) = app(true, AGENT);
    let place = Transform::from_xyz(0.0, 100.0, 300.0).with_rotation(Quat::from_rotation_y(1.0));
    let second = app.world_mut().spawn((terrain(), place)).id();
    let area = NavigationArea::Everywhere;
    let other = Navigation { terrain: second, archipelago, agent: AGENT, area };
    let other = app.world_mut().spawn(other).id();
    wait_for_tiles(&mut app, other);
    let to_second = |place: Transform, at: Vec3| place.transform_point(at);
    assert!(!has_path(&app, archipelago, to_second(place, SOUTH), to_second(place, NORTH)));
    let (from, to) =
        (to_second(place, Vec3::new(48.0, 12.0, 36.0)), to_second(place, Vec3::new(48.0, 12.0, 60.0)));
    commit(&mut app, second, send(Brush::dig(Shape::capsule(from, to, 3.5))));
    app.update();
    assert!(has_path(&app, archipelago, to_second(place, SOUTH), to_second(place, NORTH)));
    assert!(!has_path(&app, archipelago, SOUTH, NORTH), "on the first one");
    let moved = Transform::from_xyz(-500.0, 7.0, 0.0);
    *app.world_mut().get_mut::<Transform>(second).expect("a place") = moved;
    app.update();
    app.update();
    assert!(has_path(&app, archipelago, to_second(moved, SOUTH), to_second(moved, NORTH)));
    assert!(!has_path(&app, archipelago, to_second(place, SOUTH), to_second(place, SOUTH)));
    assert_ne!(first, second);
}

#[test]
fn islands_are_where_sources_are() {
    let (mut app, archipelago) = empty_app(true);
    let ground = Ground::flat(512, 512, 10.0).expect("valid");
    let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    let terrain = app.world_mut().spawn(terrain).id();
    let area = NavigationArea::NearSources;
    let navigation = Navigation { terrain, archipelago, agent: AGENT, area };
    let navigation = app.world_mut().spawn(navigation).id();
    let source = app
        .world_mut()
        .spawn((NavigationSource { radius: 40.0 }, Transform::from_xyz(100.0, 0.0, 100.0)))
        .id();
    wait_for_tiles(&mut app, navigation);
    let near = |app: &App, at: Vec3| has_path(app, archipelago, at, at + Vec3::X);
    let [here, there] = [100.0, 400.0].map(|at| Vec3::new(at, 10.0, at));
    assert!(near(&app, here) && !near(&app, there));
    assert!((5..20).contains(&tiles(app.world(), navigation).len()));
    app.world_mut().get_mut::<Transform>(source).expect("a place").translation = there;
    app.update();
    wait_for_tiles(&mut app, navigation);
    assert!(!near(&app, here) && near(&app, there));
    app.world_mut().despawn(source);
    app.update();
    app.update();
    assert_eq!(island_count(&mut app), 0);
}

#[test]
fn islands_are_those_of_the_ground_after_any_edits() {
    let (mut app, [terrain, _, navigation]) = app(false, AGENT);
    let mut rng = Rng::with_seed(5);
    let walker = Walker::new(&AGENT).expect("valid");
    for step in 0..40 {
        for _ in 0..rng.usize(0..4) {
            match rng.u8(0..5) {
                0 => send(Undo { terrain: Some(terrain) })(&mut app),
                1 => send(Redo { terrain: Some(terrain) })(&mut app),
                _ => {
                    let world = app.world().get::<Terrain>(terrain).expect("a terrain").world().clone();
                    send(random_works(&mut rng, &world))(&mut app);
                }
            }
        }
        app.update();
        if step % 8 != 7 {
            continue;
        }
        for _ in 0..3 {
            wait(&mut app, |world| world.get::<Terrain>(terrain).is_some_and(|terrain| !terrain.is_busy()));
            app.update();
        }
        wait(&mut app, |world| !tiles(world, navigation).is_building());
        let world = app.world().get::<Terrain>(terrain).expect("a terrain").world();
        let mut islands = tiles(app.world(), navigation).islands().collect::<Vec<_>>();
        islands.sort_by_key(|island| island.0);
        let made = NavTilePos::all(world).map(|pos| WalkableTile::new(world, pos, &walker).polygons());
        let mut made: Vec<_> = made.filter(|polygons| !polygons.is_empty()).collect();
        made.sort_by_key(|polygons| polygons.pos());
        assert_eq!(islands.len(), made.len());
        for ((pos, _, polygons), made) in islands.into_iter().zip(&made) {
            assert_eq!((pos, polygons), (made.pos(), made), "step {step}");
        }
    }
}

#[test]
fn all_islands_follow_a_game_that_digs_through_the_model_in_each_frame() {
    let (mut app, archipelago) = empty_app(true);
    let ground = Ground::flat(512, 512, 10.0).expect("valid");
    let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    let terrain = app.world_mut().spawn(terrain).id();
    let area = NavigationArea::Everywhere;
    let navigation = app.world_mut().spawn(Navigation { terrain, archipelago, agent: AGENT, area }).id();
    wait_for_tiles(&mut app, navigation);
    let dig = |app: &mut App, at: Vec3| {
        let mut model = app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain");
        model.apply([Brush::dig(Shape::sphere(at, 3.0))]);
    };
    let polygons_at = |app: &App, at: Vec3| {
        let mut islands = tiles(app.world(), navigation).islands();
        islands
            .find(|(pos, ..)| (pos.x, pos.z) == (at.x as i32 / 32, at.z as i32 / 32))
            .map(|island| island.2.len())
    };
    // A pit in a corner, in the middle and in the last corner, and then others in each frame.
    let pits = [40.0, 250.0, 490.0].map(|at| Vec3::new(at, 10.0, at));
    assert!(pits.iter().all(|&at| polygons_at(&app, at) == Some(1)));
    pits.iter().for_each(|&at| dig(&mut app, at));
    let start = Instant::now();
    let mut frame = 0;
    while pits.iter().any(|&at| polygons_at(&app, at) == Some(1)) {
        assert!(start.elapsed() < Duration::from_secs(300), "islands of dug ground stay");
        frame += 1;
        dig(&mut app, Vec3::new(100.0 + (frame % 50) as f32, 10.0, 300.0));
        app.update();
    }
}

#[test]
fn a_terrain_that_a_parent_mirrors_has_no_islands() {
    let (mut app, [terrain, _, navigation]) = app(true, AGENT);
    let parent = app.world_mut().spawn(Transform::from_scale(Vec3::new(-1.0, 1.0, 1.0))).id();
    app.world_mut().entity_mut(terrain).insert(ChildOf(parent));
    for _ in 0..10 {
        app.update();
    }
    assert_eq!(island_count(&mut app), 0);
    app.world_mut().entity_mut(terrain).remove::<ChildOf>();
    wait_for_tiles(&mut app, navigation);
    assert_eq!(island_count(&mut app), 9);
}

#[test]
fn an_island_has_another_mesh_only_if_its_polygons_are_others() {
    let (mut app, [terrain, _, navigation]) = app(false, AGENT);
    let meshes = |app: &mut App| -> Vec<(NavTilePos, NavPolygons, Arc<ValidNavigationMesh3d>)> {
        let islands = tiles(app.world(), navigation).islands();
        let islands: Vec<_> =
            islands.map(|(pos, island, polygons)| (pos, island, polygons.clone())).collect();
        let all = app.world().resource::<Assets<NavMesh3d>>();
        let mesh = |island: Entity| {
            let handle = app.world().get::<NavMeshHandle3d>(island).expect("an island");
            Arc::clone(&all.get(&handle.0).expect("a mesh").nav_mesh)
        };
        let mut meshes: Vec<_> =
            islands.into_iter().map(|(pos, island, polygons)| (pos, polygons, mesh(island))).collect();
        meshes.sort_by_key(|island| island.0);
        meshes
    };
    let walker = Walker::new(&AGENT).expect("valid");
    let (mut replaced, mut kept) = (0, 0);
    for x in 0..8 {
        // Nearer and nearer to the border of two tiles.
        let at = Vec3::new(41.0 - x as f32, 10.0, 16.0);
        let before = meshes(&mut app);
        commit(&mut app, terrain, send(Brush::dig(Shape::sphere(at, 1.5))));
        app.update();
        let world = app.world().get::<Terrain>(terrain).expect("a terrain").world();
        let samples = LatticeBox { min: (at - 2.0).as_ivec3(), max: (at + 2.0).as_ivec3() };
        let affected: Vec<NavTilePos> = NavTilePos::affected(world, samples, &walker).collect();
        for (before, after) in before.iter().zip(meshes(&mut app)) {
            assert_eq!(before.1 == after.1, Arc::ptr_eq(&before.2, &after.2), "{:?}, dig at {at}", after.0);
            replaced += usize::from(before.1 != after.1);
            kept += usize::from(before.1 == after.1 && affected.contains(&after.0));
        }
    }
    assert!(replaced > 5 && kept > 0, "{replaced} replaced, {kept} of the affected ones kept");
}
