//! The title: the logo and its menu, over a landscape that slowly turns.

use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_burrow::prelude::*;
use bevy_burrow::saves::OpeningWorld;
use bevy_burrow::together::{GroundServer, SharedTerrain};
use bevy_burrow::view::GroundLoading;

use super::{question, quit, spawn_common_buttons, worlds};
use crate::film::places::{Places, flat};
use crate::party::connection::Party;
use crate::player::Player;
use crate::player::camera::{DetachedCamera, PlayerCamera};
use crate::player::game_state::{GameState, MenuPage};
use crate::ui::images::Images;
use crate::ui::texts;
use crate::ui::widgets::{self, Activated, GOLD, GREY};
use crate::world::folders::{self, WorldsFolder};
use crate::world::landscape::NewGame;
use crate::world::saves::PlayedWorld;

/// Seconds for one turn around the landscape.
const TURN: f32 = 150.0;
/// Width of the buttons.
const WIDTH: f32 = 260.0;

/// The title page and its camera.
pub struct TitlePlugin;

impl Plugin for TitlePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Start>()
            .add_observer(|_: On<NewGame>, mut game: ResMut<Start>| game.has_begun = false)
            .add_systems(
                OnEnter(GameState::Title),
                // The page that says why the game ended stays.
                (|mut page: ResMut<NextState<MenuPage>>| page.set(MenuPage::Menu))
                    .run_if(not(in_state(MenuPage::Question))),
            )
            .add_systems(OnEnter(MenuPage::Menu), open.run_if(in_state(GameState::Title)))
            .add_systems(OnEnter(GameState::Playing), (attach_camera, note_start))
            .add_systems(
                Update,
                (
                    fly.run_if(resource_exists::<Places>),
                    show_progress,
                    start_game.run_if(is_loaded).run_if(has_focus),
                )
                    .run_if(in_state(GameState::Title)),
            );
    }
}

#[derive(Resource, Clone, Copy, Debug, Default)]
pub struct Start {
    /// Whether there is a game to continue.
    has_begun: bool,
    /// Whether the player wants to start as soon as the landscape has loaded.
    pub is_wanted: bool,
}

/// The progress of loading. It is hidden when everything has loaded.
#[derive(Component)]
struct Progress;

#[derive(Component)]
struct ProgressText;

/// The filled part of the progress bar.
#[derive(Component)]
struct ProgressBar;

fn open(
    mut commands: Commands,
    images: Option<Res<Images>>,
    game: Res<Start>,
    worlds: Res<WorldsFolder>,
    played: Res<PlayedWorld>,
    party: Res<Party>,
) {
    let Some(images) = images else { return };
    let left = Node {
        padding: UiRect::left(px(84)),
        flex_direction: FlexDirection::Column,
        justify_content: JustifyContent::Center,
        row_gap: px(6),
        ..widgets::full()
    };
    let shade = |alpha: f32, at: i32| ColorStop::new(Color::srgba(0.0, 0.0, 0.02, alpha), percent(at));
    let shade =
        LinearGradient::new(LinearGradient::TO_RIGHT, vec![shade(0.78, 0), shade(0.45, 36), shade(0.0, 64)]);
    let page = (DespawnOnExit(MenuPage::Menu), left, BackgroundGradient::from(shade));
    commands.spawn(page).with_children(|left| {
        let logo = Node { width: px(424), height: px(88), margin: UiRect::bottom(px(4)), ..default() };
        left.spawn((ImageNode::new(images.logo.clone()), logo));
        let below = Node { margin: UiRect::bottom(px(34)), ..default() };
        left.spawn((widgets::text(texts::TAGLINE, 17.0, GREY), below));
        let saves_worlds = worlds.0.is_some();
        let first = match played.open(&party) {
            Some(folder) => texts::continue_world(&folders::name(folder)),
            None if game.has_begun => texts::CONTINUE.into(),
            None => texts::PLAY.into(),
        };
        left.spawn(widgets::button(0, &first, WIDTH)).observe(start);
        if saves_worlds {
            for (at, (words, page)) in
                [(texts::NEW_WORLD, MenuPage::NewWorld), (texts::WORLDS, MenuPage::Worlds)]
                    .into_iter()
                    .enumerate()
            {
                left.spawn(widgets::button(1 + at, words, WIDTH)).observe(super::go_to(page));
            }
        } else {
            left.spawn(widgets::button(1, texts::NEW_WORLD, WIDTH)).observe(ask_for_new_game);
        }
        let next = if saves_worlds { 3 } else { 2 };
        left.spawn(widgets::button(next, texts::MULTIPLAYER, WIDTH))
            .observe(super::go_to(MenuPage::Together));
        spawn_common_buttons(left, next + 1, WIDTH);
        left.spawn(widgets::button(next + 4, texts::QUIT, WIDTH)).observe(quit);
        left.spawn(progress());
    });
}

/// A text over a bar. While it is hidden it keeps its place, so that the buttons do not move.
fn progress() -> impl Bundle {
    let column = Node { margin: UiRect::top(px(26)), ..widgets::column(px(8)) };
    let line = Node { height: px(20), ..default() };
    let words = (ProgressText, widgets::text("", 15.0, GOLD), line);
    (Progress, column, Visibility::Hidden, children![words, widgets::bar(WIDTH, ProgressBar)])
}

/// Starts the game. The first world is made now, so that none is there that nobody played.
fn start(
    _: On<Activated>,
    mut commands: Commands,
    mut game: ResMut<Start>,
    played: Res<PlayedWorld>,
    party: Res<Party>,
) {
    if game.has_begun || played.0.is_some() || matches!(*party, Party::Guest(..)) {
        game.is_wanted = true;
    } else {
        worlds::begin(&mut commands, Party::clone(&party));
    }
}

/// Where nothing is saved, a new game loses the old one.
fn ask_for_new_game(_: On<Activated>, mut commands: Commands) {
    let begin = |commands: &mut Commands| worlds::begin_as_is(commands, Party::Alone);
    question::ask(&mut commands, MenuPage::Menu, texts::NEW_UNSAVED, texts::NEW_WORLD, begin);
}

/// Whether the window has the focus. The game captures the mouse, so it must not start while the player uses another
/// window. Scripts have no window.
fn has_focus(windows: Query<&Window, With<PrimaryWindow>>) -> bool {
    windows.iter().all(|window| window.focused)
}

fn is_loaded(players: Query<(), With<Player>>, textures: Res<GroundLoading>) -> bool {
    !players.is_empty() && textures.is_ready()
}

/// Starts the game if the player wants to and is on the menu page. On other pages it waits.
fn start_game(game: Res<Start>, page: Res<State<MenuPage>>, mut state: ResMut<NextState<GameState>>) {
    if game.is_wanted && *page.get() == MenuPage::Menu {
        state.set(GameState::Playing);
    }
}

fn note_start(mut game: ResMut<Start>) {
    *game = Start { has_begun: true, is_wanted: false };
}

fn show_progress(
    players: Query<(), With<Player>>,
    textures: Res<GroundLoading>,
    opening: Query<&OpeningWorld>,
    server: Option<Res<GroundServer>>,
    shared: Query<&SharedTerrain>,
    mut shown: Query<&mut Visibility, With<Progress>>,
    mut texts: Query<&mut Text, With<ProgressText>>,
    mut bars: Query<&mut Node, With<ProgressBar>>,
) {
    let saved = opening.iter().map(OpeningWorld::progress).next();
    let saved = saved.or_else(|| server.and_then(|server| server.opening()));
    let is_absent = shared.iter().any(|shared| !shared.is_playable());
    let (words, share) = match (textures.is_ready(), saved) {
        (false, _) => (Some(texts::CREATING_TEXTURES), textures.progress()),
        (true, Some(share)) => (Some(texts::READING_WORLD), share),
        (true, None) if is_absent => (Some(texts::JOINING), 1.0),
        (true, None) if players.is_empty() => (Some(texts::LOADING_LANDSCAPE), 1.0),
        (true, None) => (None, 1.0),
    };
    let done = 100.0 * share;
    let words = words.map(|words| progress_text(words, share));
    for mut shown in &mut shown {
        shown.set_if_neq(if words.is_some() { Visibility::Inherited } else { Visibility::Hidden });
    }
    for mut text in &mut texts {
        text.set_if_neq(Text::new(words.clone().unwrap_or_default()));
    }
    for mut bar in &mut bars {
        if bar.width != percent(done) {
            bar.width = percent(done);
        }
    }
}

/// The text of a running task, with its progress if that is known.
fn progress_text(words: &str, share: f32) -> String {
    if share < 1.0 { format!("{words}: {:.0} %", 100.0 * share) } else { format!("{words} ...") }
}

/// Moves the camera around the tunnel's hill. It uses real time, because the game may be paused.
fn fly(
    mut commands: Commands,
    time: Res<Time<Real>>,
    places: Res<Places>,
    terrains: Terrains,
    mut cameras: Query<(Entity, &mut Transform), With<PlayerCamera>>,
    mut height: Local<Option<f32>>,
) {
    let centre = places.hillside.mouth + Vec3::Y * 12.0;
    let angle = 0.9 + std::f32::consts::TAU * time.elapsed_secs() / TURN;
    let place = centre + flat(Vec2::from_angle(angle) * 190.0);
    let Some(ground) = terrains.height(place.x, place.z) else { return };
    let target = (ground + 34.0).max(centre.y + 30.0);
    let height = height.get_or_insert(target);
    *height += (target - *height) * (1.0 - (-0.7 * time.delta_secs()).exp());
    // The hill is to the right of the menu.
    let aside = (centre - place).cross(Vec3::Y).normalize() * -55.0;
    for (entity, mut camera) in &mut cameras {
        *camera = Transform::from_translation(place.with_y(*height)).looking_at(centre + aside, Vec3::Y);
        commands.entity(entity).insert_if_new(DetachedCamera);
    }
}

fn attach_camera(mut commands: Commands, camera: Query<Entity, With<PlayerCamera>>) {
    for camera in &camera {
        commands.entity(camera).remove::<DetachedCamera>();
    }
}

#[cfg(test)]
mod tests {
    use bevy::ecs::system::RunSystemOnce;

    use super::*;
    use crate::test_support::go_to;

    #[test]
    fn the_progress_text_says_what_is_loading() {
        assert_eq!(progress_text("reading the world", 0.417), "reading the world: 42 %");
        assert_eq!(progress_text("joining", 1.0), "joining ...");
    }

    #[test]
    fn the_game_does_not_start_while_another_window_has_the_focus() {
        let mut world = World::new();
        let has_focus = |world: &mut World| world.run_system_once(has_focus).expect("a system that runs");
        assert!(has_focus(&mut world), "scripts have no window");
        let window = world.spawn((PrimaryWindow, Window { focused: false, ..default() })).id();
        assert!(!has_focus(&mut world));
        world.get_mut::<Window>(window).expect("it is open").focused = true;
        assert!(has_focus(&mut world));
    }

    #[test]
    fn the_game_starts_from_the_menu_page_only() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, bevy::state::app::StatesPlugin))
            .init_state::<GameState>()
            .init_state::<MenuPage>()
            .insert_resource(Start { has_begun: false, is_wanted: true })
            .add_systems(Update, start_game);
        for page in [MenuPage::Settings, MenuPage::Controls, MenuPage::Help, MenuPage::Menu] {
            go_to(&mut app, page);
            let expected = if page == MenuPage::Menu { GameState::Playing } else { GameState::Title };
            assert_eq!(**app.world().resource::<State<GameState>>(), expected, "{page:?}");
        }
    }

    #[test]
    fn the_progress_is_shown_while_something_loads() {
        let mut app = App::new();
        app.init_resource::<GroundLoading>().add_systems(Update, show_progress);
        let column = app.world_mut().spawn(progress()).id();
        assert_eq!(app.world().get::<Visibility>(column), Some(&Visibility::Hidden));
        app.update();
        assert_eq!(app.world().get::<Visibility>(column), Some(&Visibility::Inherited));
        let mut texts = app.world_mut().query_filtered::<&Text, With<ProgressText>>();
        assert_eq!(texts.single(app.world()).expect("a text").0, "Creating textures: 0 %");
    }
}
