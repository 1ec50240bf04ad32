//! Facts about whose the keys are.

use bevy::input::InputPlugin as DevicePlugin;
use bevy::state::app::StatesPlugin;
use bevy::window::WindowFocused;
use bevy_burrow::physics::CharacterSteering;

use super::*;
use crate::player::game_state::{Page, PhasePlugin};
use crate::player::input::InputPlugin;
use crate::player::{Player, PlayerPlugin};
use crate::tools::{Swing, Tool};
use crate::ui::settings::Settings;

#[test]
fn while_the_panel_is_open_nobody_walks_swings_or_asks_for_help() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, StatesPlugin, DevicePlugin, InputPlugin, PhasePlugin, PlayerPlugin))
        .add_message::<WindowFocused>()
        .init_resource::<Settings>()
        .init_resource::<Swing>()
        .init_resource::<BurrowPanel>();
    app.world_mut().resource_mut::<BurrowPanel>().is_open = false;
    share_input(&mut app);
    app.world_mut().resource_mut::<NextState<Phase>>().set(Phase::Playing);
    app.update();
    app.update();
    let player = app.world_mut().spawn((Player::default(), CharacterSteering::default())).id();
    let frame = |app: &mut App, held: &[Action]| {
        app.world_mut().resource_mut::<Actions>().puppet = held.to_vec();
        app.update();
        let way = app.world().get::<CharacterSteering>(player).expect("a player").direction;
        (way != Vec2::ZERO, app.world().resource::<Swing>().phase().is_some())
    };
    app.world_mut().resource_mut::<Swing>().advance(Some(Tool::Drill), 0.1);
    assert_eq!(frame(&mut app, &[Action::Forward]), (true, true));
    assert_eq!(frame(&mut app, &[Action::Forward, Action::Panel]), (false, false));
    assert!(app.world().resource::<BurrowPanel>().is_open);
    assert_eq!(frame(&mut app, &[Action::Forward]), (false, false));
    assert_eq!(frame(&mut app, &[Action::Help]), (false, false));
    app.update();
    assert_eq!(**app.world().resource::<State<Page>>(), Page::None);
    // Closed, it gives the keys back, but not those that were held meanwhile.
    frame(&mut app, &[]);
    assert_eq!(frame(&mut app, &[Action::Panel]), (false, false));
    assert!(!app.world().resource::<BurrowPanel>().is_open);
    frame(&mut app, &[]);
    assert_eq!(frame(&mut app, &[Action::Forward]), (true, false));
}
