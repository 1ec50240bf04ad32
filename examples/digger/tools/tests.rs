//! Tests of choosing, aiming and using tools.

use std::time::Duration;

use bevy::time::TimeUpdateStrategy;

use super::*;
use crate::test_support::{app_with_input, hold, spawn_flat_terrain};

#[test]
fn a_held_button_hits_at_the_same_rate_at_any_frame_rate() {
    for tool in [Tool::Pickaxe, Tool::Builder, Tool::Drill] {
        for fps in [30, 60, 144] {
            let mut swing = Swing::default();
            let hits = (0..10 * fps).filter(|_| swing.advance(Some(tool), 1.0 / fps as f32)).count();
            let expected = 10.0 / tool.stats().period;
            assert!((hits as f32 - expected).abs() <= 2.0, "{tool:?} at {fps}: {hits}, not {expected}");
        }
    }
}

#[test]
fn a_click_hits_once() {
    let mut swing = Swing::default();
    let hits = (0..200).filter(|i| swing.advance((*i == 0).then_some(Tool::Pickaxe), 0.01)).count();
    assert_eq!((hits, swing.phase()), (1, None));
}

#[test]
fn a_changed_setting_is_applied_at_once_and_others_leave_the_hand_alone() {
    let settings = Settings::default();
    let mut app = App::new();
    app.insert_resource(Hand::new(&settings)).insert_resource(settings).add_systems(Update, apply_settings);
    app.update();
    app.world_mut().resource_mut::<Hand>().set_radius(Tool::Builder, 5.0);
    app.world_mut().resource_mut::<Settings>().invert_y = true;
    app.update();
    assert_eq!(app.world().resource::<Hand>().radius(Tool::Builder), 5.0);
    app.world_mut().resource_mut::<Settings>().radius = 2.5;
    app.world_mut().resource_mut::<Settings>().shape = BuildShape::Cube;
    app.update();
    let hand = app.world().resource::<Hand>();
    assert_eq!((hand.radius(Tool::Builder), hand.radius(Tool::Pickaxe)), (2.5, 2.5));
    assert_eq!(hand.shape, BuildShape::Cube);
}

/// What the camera looks at, 20 m away.
const TARGET: Vec3 = Vec3::new(24.0, 20.0, 32.0);

/// The tools that were used, and where they hit.
#[derive(Resource, Default)]
struct Uses(Vec<(Tool, Option<Vec3>)>);

/// A flat world, 20 high, with a camera in it.
fn app() -> App {
    let mut app = app_with_input();
    app.add_plugins(BurrowPlugins)
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)))
        .init_resource::<Uses>()
        .insert_state(GameState::Playing)
        .add_plugins(ToolsPlugin)
        .add_observer(|used: On<ToolUsed>, mut uses: ResMut<Uses>| {
            uses.0.push((used.tool, used.aim.map(|aim| aim.point)));
        });
    spawn_flat_terrain(&mut app);
    app.world_mut().spawn((PlayerCamera, Transform::from_xyz(5.0, 26.0, 32.0).looking_at(TARGET, Vec3::Y)));
    app
}

/// Taps actions one after another, waits for the swing to end, and returns what was used.
fn tap(app: &mut App, actions: &[Action]) -> Vec<(Tool, Option<Vec3>)> {
    for &action in actions {
        hold(app, &[action]);
    }
    for _ in 0..21 {
        hold(app, &[]);
    }
    std::mem::take(&mut app.world_mut().resource_mut::<Uses>().0)
}

fn is_built_at_target(uses: &[(Tool, Option<Vec3>)]) -> bool {
    matches!(uses, [(Tool::Builder, Some(point))] if point.distance(TARGET) < 0.1)
}

#[test]
fn a_swing_keeps_its_tools_reach_when_another_tool_is_chosen() {
    let mut app = app();
    assert_eq!(tap(&mut app, &[Action::Use, Action::Slot4]), [(Tool::Pickaxe, None)]);
    assert_eq!(app.world().resource::<Hand>().tool, Tool::Builder);
    let uses = tap(&mut app, &[Action::Use, Action::Slot1]);
    assert!(is_built_at_target(&uses), "{uses:?}");
}

#[test]
fn the_build_button_reaches_as_far_with_any_tool() {
    let mut app = app();
    for tool in Tool::ALL {
        let uses = tap(&mut app, &[tool.slot(), Action::Build]);
        assert!(is_built_at_target(&uses), "{tool:?}: {uses:?}");
    }
}
