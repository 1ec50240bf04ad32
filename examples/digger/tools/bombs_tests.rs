//! Facts about bombs.

use bevy_burrow::brush::shapes::Sphere;
use std::time::Duration;

use bevy::time::TimeUpdateStrategy;
use bevy_burrow::physics::{ColliderSource, HeldByGround, TerrainPhysicsPlugin};

use super::*;
use crate::tools::Hand;
use crate::ui::settings::Settings;

/// A flat world, 64 wide and 20 high, with bombs in it and nobody to throw them.
fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PhysicsPlugins::default(), BurrowPlugins, TerrainPhysicsPlugin))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)))
        .init_resource::<Inventory>()
        .init_resource::<Blows>()
        .init_resource::<Tremor>()
        .add_message::<Burst>()
        .add_systems(Update, burn_fuses.before(BurrowSystems::Collect))
        .add_observer(explode)
        .add_observer(shake);
    app.finish();
    app.cleanup();
    let ground = Ground::from_fn(64, 64, |_, _| 20.0).expect("a small world");
    app.world_mut().spawn(Terrain::new(ground, &TerrainSettings::default()).expect("default settings"));
    app.world_mut().spawn((ColliderSource { radius: 64.0 }, Transform::from_xyz(32.0, 20.0, 32.0)));
    for _ in 0..30_000 {
        app.update();
        if ground_is_there(&mut app) {
            return app;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("the world did not load");
}

fn ground_is_there(app: &mut App) -> bool {
    let whole = |terrains: Terrains| terrains.is_ready(Vec3::ZERO, Vec3::splat(64.0));
    app.world_mut().run_system_cached(whole).is_ok_and(|ready| ready)
}

/// A bomb on its way; where there are no colliders yet, the ground holds it back.
fn throw_from(app: &mut App, place: Vec3, velocity: Vec3) -> Entity {
    let bomb = (Bomb { fuse: FUSE }, LinearVelocity(velocity), Transform::from_translation(place));
    app.world_mut().spawn(bomb).id()
}

/// Lets frames pass until nothing waits for colliders.
fn let_go(app: &mut App) {
    for _ in 0..30_000 {
        app.update();
        let mut held = app.world_mut().query_filtered::<(), With<HeldByGround>>();
        if held.iter(app.world()).next().is_none() {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("the ground has no colliders");
}

#[test]
fn a_bomb_bounces_and_never_falls_through_the_ground() {
    let mut app = app();
    let throws = [Vec3::new(3.0, -20.0, 0.0), Vec3::new(6.0, 4.0, 2.0), Vec3::ZERO];
    let bombs = throws.map(|velocity| throw_from(&mut app, Vec3::new(30.0, 24.0, 30.0), velocity));
    let_go(&mut app);
    let mut bounced = false;
    for _ in 0..90 {
        app.update();
        for bomb in bombs {
            let place = app.world().get::<Transform>(bomb).map(|place| place.translation);
            let velocity = app.world().get::<LinearVelocity>(bomb).map(|velocity| velocity.0);
            let (Some(place), Some(velocity)) = (place, velocity) else { continue };
            assert!(place.y > 20.0, "{place}");
            bounced |= velocity.y > 1.0 && place.y < 21.5;
        }
    }
    assert!(bounced);
}

#[test]
fn a_blast_takes_a_hole_and_what_it_took_is_in_the_inventory() {
    let mut app = app();
    app.add_systems(
        Update,
        (|mut receipts: MessageReader<BrushApplied>, mut inventory: ResMut<Inventory>| {
            for receipt in receipts.read() {
                inventory.enter(&receipt.receipt, true);
            }
        })
        .after(BurrowSystems::Commit),
    );
    let bomb = throw_from(&mut app, Vec3::new(30.0, 20.5, 30.0), Vec3::ZERO);
    for _ in 0..60_000 {
        app.update();
        if app.world().resource::<Inventory>().stock(MaterialId(0)) > 0 {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(app.world().get_entity(bomb).is_err(), "it went off");
    let height = app.world_mut().run_system_cached(|terrains: Terrains| terrains.height(30.0, 30.0));
    let height = height.ok().flatten().expect("still in the world");
    assert!(height < 17.0, "{height}");
    // Half a ball, more or less.
    let dug = app.world().resource::<Inventory>().stock(MaterialId(0));
    assert!((150..700).contains(&dug), "{dug}");
}

#[test]
fn bombs_set_each_other_off() {
    let mut app = app();
    let first = throw_from(&mut app, Vec3::new(30.0, 21.0, 30.0), Vec3::ZERO);
    let second = throw_from(&mut app, Vec3::new(33.0, 21.0, 30.0), Vec3::ZERO);
    let far = throw_from(&mut app, Vec3::new(55.0, 21.0, 55.0), Vec3::ZERO);
    let fuse = |app: &mut App, bomb: Entity| app.world_mut().get_mut::<Bomb>(bomb).map(|bomb| bomb.fuse);
    if let Some(mut bomb) = app.world_mut().get_mut::<Bomb>(first) {
        bomb.fuse = 0.01;
    }
    app.update();
    app.update();
    assert!(app.world().get_entity(first).is_err());
    assert!(fuse(&mut app, second).is_some_and(|fuse| fuse < 0.5));
    assert!(fuse(&mut app, far).is_some_and(|fuse| fuse > 2.0));
}

#[test]
fn a_blast_is_as_large_and_as_strong_as_the_tool_in_hand() {
    let mut app = App::new();
    app.init_resource::<Inventory>()
        .init_resource::<Blows>()
        .add_message::<Brush>()
        .add_message::<Burst>()
        .add_observer(explode);
    app.world_mut().trigger(Blast { place: Vec3::ZERO });
    let brushes: Vec<Brush> = app.world_mut().resource_mut::<Messages<Brush>>().drain().collect();
    let [Brush { shape: Shape::Sphere(Sphere { radius, .. }), power, .. }] = brushes[..] else {
        panic!("{brushes:?}");
    };
    assert_eq!((radius, power), (Hand::new(&Settings::default()).radius(Tool::Bomb), Tool::Bomb.power()));
}

#[test]
fn a_bomb_that_leaves_the_hand_is_not_seen_yet() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, BombsPlugin))
        .init_resource::<Assets<Mesh>>()
        .init_resource::<Assets<StandardMaterial>>();
    app.update();
    app.world_mut().trigger(Strike { tool: Tool::Bomb, aim: None, eye: Vec3::ZERO, along: Vec3::X });
    app.world_mut().flush();
    let mut bombs = app.world_mut().query_filtered::<&Visibility, With<Bomb>>();
    assert_eq!(*bombs.single(app.world()).expect("one bomb"), Visibility::Hidden);
}
