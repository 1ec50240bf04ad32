//! Facts about the tools in the hand.

use std::time::Duration;

use bevy::input::InputPlugin as DevicePlugin;
use bevy::state::app::StatesPlugin;
use bevy::time::TimeUpdateStrategy;

use super::*;
use crate::player::input::InputPlugin;

#[test]
fn a_held_button_hits_in_rhythm_whatever_the_frame_rate() {
    for tool in [Tool::Pickaxe, Tool::Builder, Tool::Drill] {
        for fps in [30, 60, 144] {
            let mut swing = Swing::default();
            let hits = (0..10 * fps).filter(|_| swing.advance(Some(tool), 1.0 / fps as f32)).count();
            let due = 10.0 / tool.manner().period;
            assert!((hits as f32 - due).abs() <= 2.0, "{tool:?} at {fps}: {hits} of {due}");
        }
    }
}

#[test]
fn what_is_set_is_in_the_hand_at_once_and_the_wheel_is_left_alone() {
    let settings = Settings::default();
    let mut app = App::new();
    app.insert_resource(Hand::new(&settings)).insert_resource(settings).add_systems(Update, follow_settings);
    app.update();
    app.world_mut().resource_mut::<Hand>().set_radius(Tool::Builder, 5.0);
    app.world_mut().resource_mut::<Settings>().invert_y = true;
    app.update();
    assert_eq!(app.world().resource::<Hand>().radius(Tool::Builder), 5.0);
    app.world_mut().resource_mut::<Settings>().radius = 2.5;
    app.world_mut().resource_mut::<Settings>().form = Form::Cube;
    app.update();
    let hand = app.world().resource::<Hand>();
    assert_eq!((hand.radius(Tool::Builder), hand.radius(Tool::Pickaxe), hand.form), (2.5, 2.5, Form::Cube));
}

#[test]
fn a_click_hits_once_and_comes_to_rest() {
    let mut swing = Swing::default();
    let hits = (0..200).filter(|i| swing.advance((*i == 0).then_some(Tool::Pickaxe), 0.01)).count();
    assert_eq!((hits, swing.phase()), (1, None));
}

/// What the eyes look at, 20 m away.
const SEEN: Vec3 = Vec3::new(24.0, 20.0, 32.0);

/// Tools that struck, and where.
#[derive(Resource, Default)]
struct Struck(Vec<(Tool, Option<Vec3>)>);

/// A flat world, 20 high, with eyes in it.
fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, StatesPlugin, DevicePlugin, InputPlugin, BurrowPlugins))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)))
        .init_resource::<Settings>()
        .init_resource::<Struck>()
        .insert_state(Phase::Playing)
        .add_plugins(ToolsPlugin)
        .add_observer(|strike: On<Strike>, mut struck: ResMut<Struck>| {
            struck.0.push((strike.tool, strike.aim.map(|aim| aim.place)));
        });
    app.finish();
    app.cleanup();
    let ground = Ground::from_fn(64, 64, |_, _| 20.0).expect("a small world");
    app.world_mut().spawn(Terrain::new(ground, &TerrainSettings::default()).expect("default settings"));
    app.world_mut().spawn((Eyes, Transform::from_xyz(5.0, 26.0, 32.0).looking_at(SEEN, Vec3::Y)));
    app
}

/// Taps keys, one after the other, and waits until the hand rests; says what it hit meanwhile.
fn tap(app: &mut App, keys: &[Action]) -> Vec<(Tool, Option<Vec3>)> {
    for &key in keys {
        app.world_mut().resource_mut::<Actions>().puppet = vec![key];
        app.update();
    }
    app.world_mut().resource_mut::<Actions>().puppet.clear();
    for _ in 0..20 {
        app.update();
    }
    std::mem::take(&mut app.world_mut().resource_mut::<Struck>().0)
}

#[test]
fn who_takes_another_tool_reaches_no_farther_with_the_one_that_swings() {
    let mut app = app();
    assert_eq!(tap(&mut app, &[Action::Use, Action::Slot4]), [(Tool::Pickaxe, None)]);
    assert_eq!(app.world().resource::<Hand>().tool, Tool::Builder);
    let struck = tap(&mut app, &[Action::Use, Action::Slot1]);
    assert!(matches!(struck[..], [(Tool::Builder, Some(place))] if place.distance(SEEN) < 0.1), "{struck:?}");
}

#[test]
fn what_is_built_is_built_as_far_away_whatever_is_in_hand() {
    let mut app = app();
    for tool in Tool::ALL {
        let struck = tap(&mut app, &[tool.slot(), Action::Build]);
        assert!(
            matches!(struck[..], [(Tool::Builder, Some(place))] if place.distance(SEEN) < 0.1),
            "{tool:?}: {struck:?}"
        );
    }
}
