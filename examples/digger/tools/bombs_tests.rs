//! Tests of bombs.

use std::time::Duration;

use bevy::time::TimeUpdateStrategy;
use bevy_burrow::physics::{ColliderSource, HeldByGround, TerrainPhysicsPlugin};

use super::*;
use crate::test_support::{drain, spawn_flat_terrain, update_until};

/// A flat world, 20 high.
fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PhysicsPlugins::default(), BurrowPlugins, TerrainPhysicsPlugin))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)))
        .init_resource::<Inventory>()
        .init_resource::<PendingHits>()
        .init_resource::<CameraShake>()
        .add_message::<Burst>()
        .add_systems(Update, burn_fuses.before(BurrowSystems::Collect))
        .add_observer(explode)
        .add_observer(push_player);
    spawn_flat_terrain(&mut app);
    app.world_mut().spawn((ColliderSource { radius: 64.0 }, Transform::from_xyz(32.0, 20.0, 32.0)));
    update_until(&mut app, "the terrain has loaded", |app| {
        let is_ready = |terrains: Terrains| terrains.is_ready(Vec3::ZERO, Vec3::splat(64.0));
        app.world_mut().run_system_cached(is_ready).is_ok_and(|ready| ready)
    });
    app
}

fn spawn_bomb(app: &mut App, place: Vec3, velocity: Vec3) -> Entity {
    let bomb = (Bomb { fuse: FUSE }, LinearVelocity(velocity), Transform::from_translation(place));
    app.world_mut().spawn(bomb).id()
}

#[test]
fn bombs_bounce_and_never_fall_through_the_ground() {
    let mut app = app();
    let throws = [Vec3::new(3.0, -20.0, 0.0), Vec3::new(6.0, 4.0, 2.0), Vec3::ZERO];
    let bombs = throws.map(|velocity| spawn_bomb(&mut app, Vec3::new(30.0, 24.0, 30.0), velocity));
    update_until(&mut app, "no bomb waits for colliders", |app| {
        let mut held = app.world_mut().query_filtered::<(), With<HeldByGround>>();
        held.iter(app.world()).next().is_none()
    });
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
fn an_explosion_digs_a_crater_into_the_inventory() {
    let mut app = app();
    app.add_systems(
        Update,
        (|mut receipts: MessageReader<BrushApplied>, mut inventory: ResMut<Inventory>| {
            for receipt in receipts.read() {
                inventory.apply_receipt(&receipt.receipt, true);
            }
        })
        .after(BurrowSystems::Commit),
    );
    let bomb = spawn_bomb(&mut app, Vec3::new(30.0, 20.5, 30.0), Vec3::ZERO);
    let dug = |app: &App| app.world().resource::<Inventory>().amount(MaterialId(0));
    update_until(&mut app, "the bomb exploded", |app| dug(app) > 0);
    assert!(app.world().get_entity(bomb).is_err());
    let height = app.world_mut().run_system_cached(|terrains: Terrains| terrains.height(30.0, 30.0));
    let height = height.ok().flatten().expect("still in the world");
    assert!(height < 17.0, "{height}");
    // About half a ball.
    assert!((150..700).contains(&dug(&app)), "{}", dug(&app));
}

#[test]
fn bombs_set_each_other_off() {
    let mut app = app();
    let [first, second, far] = [Vec3::new(30.0, 21.0, 30.0), Vec3::new(33.0, 21.0, 30.0), Vec3::splat(55.0)]
        .map(|place| spawn_bomb(&mut app, place.with_y(21.0), Vec3::ZERO));
    if let Some(mut bomb) = app.world_mut().get_mut::<Bomb>(first) {
        bomb.fuse = 0.01;
    }
    app.update();
    app.update();
    let fuse = |bomb: Entity| app.world().get::<Bomb>(bomb).map(|bomb| bomb.fuse);
    assert_eq!(fuse(first), None);
    assert!(fuse(second).is_some_and(|fuse| fuse < 0.5));
    assert!(fuse(far).is_some_and(|fuse| fuse > 2.0));
}

#[test]
fn a_thrown_bomb_is_hidden_at_first() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, BombsPlugin))
        .init_resource::<Inventory>()
        .init_resource::<Assets<Mesh>>()
        .init_resource::<Assets<StandardMaterial>>();
    app.update();
    let used = ToolUsed { tool: Tool::Bomb, aim: None, eye: Vec3::ZERO, direction: Vec3::X };
    app.world_mut().trigger(used);
    app.world_mut().flush();
    let mut bombs = app.world_mut().query_filtered::<&Visibility, With<Bomb>>();
    assert_eq!(*bombs.single(app.world()).expect("one bomb"), Visibility::Hidden);
}

#[test]
fn the_crater_has_the_power_of_the_tool() {
    let mut app = App::new();
    app.init_resource::<Inventory>()
        .init_resource::<PendingHits>()
        .add_message::<Brush>()
        .add_message::<Burst>()
        .add_observer(explode);
    app.world_mut().trigger(Explosion { place: Vec3::ZERO });
    let brushes: Vec<Brush> = drain(&mut app);
    assert_eq!(brushes.iter().map(|brush| brush.power).collect::<Vec<_>>(), [Tool::Bomb.power()]);
}
