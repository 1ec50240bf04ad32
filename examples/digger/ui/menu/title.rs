//! The title: the name of the game and its menu, over a landscape that slowly turns.

use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_burrow::prelude::*;
use bevy_burrow::view::GroundLoading;

use super::go_to;
use crate::film::places::Places;
use crate::player::game_state::{Page, Phase};
use crate::player::{Drone, Player};
use crate::ui::art::Art;
use crate::ui::widgets::{self, Chosen};
use crate::world::landscape::NewGame;
use crate::world::light::Eyes;

/// Seconds for one turn around the landscape.
const TURN: f32 = 150.0;

/// The title's page and its camera.
pub struct TitlePlugin;

impl Plugin for TitlePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Start>()
            .add_systems(OnEnter(Phase::Title), open_menu)
            .add_systems(OnEnter(Page::Menu), open.run_if(in_state(Phase::Title)))
            .add_systems(OnExit(Phase::Title), (land, begin))
            .add_systems(
                Update,
                (
                    fly.run_if(resource_exists::<Places>),
                    (tell_progress, play.run_if(is_there).run_if(is_watched)).chain(),
                )
                    .run_if(in_state(Phase::Title)),
            );
    }
}

/// How far it is with the game.
#[derive(Resource, Clone, Copy, Debug, Default)]
struct Start {
    /// Is there one to go on with?
    has_begun: bool,
    /// Does somebody want to play as soon as there is land?
    is_wanted: bool,
}

/// Tells how far the landscape is; hidden when it is there.
#[derive(Component)]
struct Progress;

/// What it says.
#[derive(Component)]
struct Words;

/// What is filled of its bar.
#[derive(Component)]
struct Filled;

fn open_menu(mut page: ResMut<NextState<Page>>) {
    page.set(Page::Menu);
}

fn open(mut commands: Commands, art: Option<Res<Art>>, game: Res<Start>) {
    let Some(art) = art else { return };
    let left = Node {
        padding: UiRect::left(px(84)),
        flex_direction: FlexDirection::Column,
        justify_content: JustifyContent::Center,
        row_gap: px(6),
        ..widgets::full()
    };
    let shade = LinearGradient::new(
        LinearGradient::TO_RIGHT,
        vec![
            ColorStop::new(Color::srgba(0.0, 0.0, 0.02, 0.78), percent(0)),
            ColorStop::new(Color::srgba(0.0, 0.0, 0.02, 0.45), percent(36)),
            ColorStop::new(Color::srgba(0.0, 0.0, 0.02, 0.0), percent(64)),
        ],
    );
    let page = (DespawnOnExit(Page::Menu), left, BackgroundGradient::from(shade));
    commands.spawn(page).with_children(|left| {
        let logo = Node { width: px(424), height: px(88), margin: UiRect::bottom(px(4)), ..default() };
        left.spawn((ImageNode::new(art.logo.clone()), logo));
        let below = Node { margin: UiRect::bottom(px(34)), ..default() };
        left.spawn((widgets::text("real land, and all of it can be dug", 17.0, widgets::GREY), below));
        let mut orders = 0..;
        let mut button =
            |words: &'static str| widgets::button(orders.next().unwrap_or_default(), words, 260.0);
        left.spawn(button(if game.has_begun { "Go on" } else { "Dig" })).observe(start);
        if game.has_begun {
            left.spawn(button("New game")).observe(start_anew);
        }
        left.spawn(button("Settings")).observe(go_to(Page::Settings));
        left.spawn(button("Controls")).observe(go_to(Page::Controls));
        left.spawn(button("Help")).observe(go_to(Page::Help));
        left.spawn(button("Quit")).observe(quit);
        left.spawn(progress());
    });
}

/// The words over the bar. Hidden, it keeps its place, so that nothing moves below the mouse when the land is there.
fn progress() -> impl Bundle {
    let column = Node {
        margin: UiRect::top(px(26)),
        flex_direction: FlexDirection::Column,
        row_gap: px(8),
        ..default()
    };
    let line = Node { height: px(20), ..default() };
    let words = (Words, widgets::text("", 15.0, widgets::GOLD), line);
    (Progress, column, Visibility::Hidden, children![words, widgets::bar(260.0, Filled)])
}

fn start(_: On<Chosen>, mut game: ResMut<Start>) {
    game.is_wanted = true;
}

/// All that was dug is whole again, and what was dug is lost.
fn start_anew(_: On<Chosen>, mut commands: Commands, mut game: ResMut<Start>) {
    commands.trigger(NewGame);
    game.is_wanted = true;
}

/// Does somebody look at the window? Whoever has turned to another one while the land was made is waited for: the game
/// takes the mouse, and only a window that loses the focus pauses it. Scripts have no window.
fn is_watched(windows: Query<&Window, With<PrimaryWindow>>) -> bool {
    windows.iter().all(|window| window.focused)
}

/// Is there land, and someone to play on it?
fn is_there(players: Query<(), With<Player>>, painting: Res<GroundLoading>) -> bool {
    !players.is_empty() && painting.is_ready()
}

/// Nobody is taken from a page that he has opened meanwhile: the game begins once he is back in the menu.
fn play(game: Res<Start>, page: Res<State<Page>>, mut phase: ResMut<NextState<Phase>>) {
    if game.is_wanted && *page.get() == Page::Menu {
        phase.set(Phase::Playing);
    }
}

fn begin(mut game: ResMut<Start>) {
    *game = Start { has_begun: true, is_wanted: false };
}

fn quit(_: On<Chosen>, mut exit: MessageWriter<AppExit>) {
    exit.write(AppExit::Success);
}

fn tell_progress(
    players: Query<(), With<Player>>,
    painting: Res<GroundLoading>,
    mut shown: Query<&mut Visibility, With<Progress>>,
    mut words: Query<&mut Text, With<Words>>,
    mut bars: Query<&mut Node, With<Filled>>,
) {
    let done = 100.0 * painting.progress();
    let word = word(painting.is_ready(), done, !players.is_empty());
    for mut shown in &mut shown {
        shown.set_if_neq(if word.is_some() { Visibility::Inherited } else { Visibility::Hidden });
    }
    if let Some(word) = &word {
        for mut text in &mut words {
            text.set_if_neq(Text::new(word));
        }
    }
    for mut bar in &mut bars {
        if bar.width != percent(done) {
            bar.width = percent(done);
        }
    }
}

/// What keeps the player waiting, if anything does.
fn word(is_painted: bool, done: f32, has_player: bool) -> Option<String> {
    match (is_painted, has_player) {
        (false, _) => Some(format!("the ground is being painted: {done:.0} %")),
        (true, false) => Some("the land is being surveyed ...".into()),
        (true, true) => None,
    }
}

/// Around the tunnel's hill, over the ridges, while the game's own time may stand still.
fn fly(
    mut commands: Commands,
    time: Res<Time<Real>>,
    places: Res<Places>,
    terrains: Terrains,
    mut eyes: Query<(Entity, &mut Transform), With<Eyes>>,
    mut height: Local<Option<f32>>,
) {
    let centre = places.hillside.mouth + Vec3::Y * 12.0;
    let angle = 0.9 + std::f32::consts::TAU * time.elapsed_secs() / TURN;
    let out = Vec2::from_angle(angle) * 190.0;
    let place = centre + Vec3::new(out.x, 0.0, out.y);
    let Some(ground) = terrains.height(place.x, place.z) else { return };
    let wish = (ground + 34.0).max(centre.y + 30.0);
    let height = height.get_or_insert(wish);
    *height += (wish - *height) * (1.0 - (-0.7 * time.delta_secs()).exp());
    // The hill is seen to the right of the menu.
    let aside = (centre - place).cross(Vec3::Y).normalize() * -55.0;
    for (entity, mut eyes) in &mut eyes {
        *eyes = Transform::from_translation(place.with_y(*height)).looking_at(centre + aside, Vec3::Y);
        commands.entity(entity).insert_if_new(Drone);
    }
}

/// Back into the player's head.
fn land(mut commands: Commands, eyes: Query<Entity, With<Eyes>>) {
    for eyes in &eyes {
        commands.entity(eyes).remove::<Drone>();
    }
}

#[cfg(test)]
mod tests {
    use bevy::ecs::system::RunSystemOnce;

    use super::*;

    #[test]
    fn who_waits_is_told_for_what() {
        for (is_painted, done, has_player, expected) in [
            (false, 0.0, false, Some("the ground is being painted: 0 %")),
            (false, 41.7, true, Some("the ground is being painted: 42 %")),
            (true, 100.0, false, Some("the land is being surveyed ...")),
            (true, 100.0, true, None),
        ] {
            assert_eq!(word(is_painted, done, has_player).as_deref(), expected);
        }
    }

    #[test]
    fn the_game_waits_for_who_has_turned_to_another_window() {
        let mut world = World::new();
        let is_watched = |world: &mut World| world.run_system_once(is_watched).expect("a system that runs");
        assert!(is_watched(&mut world), "scripts have no window");
        let window = world.spawn((PrimaryWindow, Window { focused: false, ..default() })).id();
        assert!(!is_watched(&mut world));
        world.get_mut::<Window>(window).expect("it is open").focused = true;
        assert!(is_watched(&mut world));
    }

    #[test]
    fn nobody_is_taken_from_a_page_into_the_game() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, bevy::state::app::StatesPlugin))
            .init_state::<Phase>()
            .init_state::<Page>()
            .insert_resource(Start { has_begun: false, is_wanted: true })
            .add_systems(Update, play);
        for page in [Page::Settings, Page::Controls, Page::Help, Page::Menu] {
            app.world_mut().resource_mut::<NextState<Page>>().set(page);
            // One more for what was wanted on it.
            app.update();
            app.update();
            let expected = if page == Page::Menu { Phase::Playing } else { Phase::Title };
            assert_eq!(**app.world().resource::<State<Phase>>(), expected, "{page:?}");
        }
    }

    #[test]
    fn the_bar_shows_while_the_ground_is_painted() {
        let mut app = App::new();
        app.init_resource::<GroundLoading>().add_systems(Update, tell_progress);
        let column = app.world_mut().spawn(progress()).id();
        let mut bars = app.world_mut().query_filtered::<&mut Node, With<Filled>>();
        bars.single_mut(app.world_mut()).expect("one bar").width = percent(73);
        assert_eq!(app.world().get::<Visibility>(column), Some(&Visibility::Hidden));
        app.update();
        // Nothing is painted yet.
        assert_eq!(app.world().get::<Visibility>(column), Some(&Visibility::Inherited));
        assert_eq!(bars.single(app.world()).expect("one bar").width, percent(0));
        let mut words = app.world_mut().query_filtered::<&Text, With<Words>>();
        assert_eq!(words.single(app.world()).expect("words").0, "the ground is being painted: 0 %");
    }
}
