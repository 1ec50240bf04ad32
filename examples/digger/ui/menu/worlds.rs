//! The pages of saved worlds: the list, in which each continues where it was left, one world, and a new one.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use bevy::prelude::*;
use bevy::window::PrimaryWindow;

use super::fields::{Draft, Field, spawn_field};
use super::question;
use super::title::Start;
use super::{spawn_back, spawn_page};
use crate::party::connection::Party;
use crate::player::game_state::{GameState, MenuPage};
use crate::ui::hud::Hint;
use crate::ui::texts;
use crate::ui::widgets::{self, Activated, Adjusted, Arrow, GREY, WHITE};
use crate::world::landscape::NewGame;
use crate::world::saves::{self, FoundWorld, NotOpened, PlayedWorld};
use crate::world::thumbnails;

/// Width of the buttons.
const WIDTH: f32 = 460.0;
/// Size of the pictures.
const PICTURE: Vec2 = Vec2::new(96.0, 54.0);
/// Worlds that the list shows at the same time.
const SHOWN: usize = 6;
/// How long a world may take to be closed before it counts as open in another window.
const CLOSING: Duration = Duration::from_secs(5);

/// The pages of saved worlds.
pub struct WorldsPlugin;

impl Plugin for WorldsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<FirstShown>()
            .add_observer(refuse)
            .add_systems(OnEnter(MenuPage::Worlds), open)
            .add_systems(OnEnter(MenuPage::World), open_world.run_if(resource_exists::<Chosen>))
            .add_systems(OnExit(MenuPage::World), rename)
            .add_systems(OnEnter(MenuPage::NewWorld), open_new)
            .add_systems(Update, change.run_if(resource_exists::<Change>));
    }
}

/// The first world that the list shows.
#[derive(Resource, Default)]
struct FirstShown(usize);

/// The world that the page is about.
#[derive(Resource)]
struct Chosen(PathBuf);

/// The action on a world as soon as it is closed.
#[derive(Resource, Clone, Debug)]
enum Change {
    Delete(PathBuf),
    Duplicate(PathBuf),
}

/// Plays no world that can't be saved, and says why. A script, which nobody watches, continues
/// without saving.
fn refuse(
    not_opened: On<NotOpened>,
    mut commands: Commands,
    mut played: ResMut<PlayedWorld>,
    mut party: ResMut<Party>,
    mut start: ResMut<Start>,
    mut hints: MessageWriter<Hint>,
    windows: Query<(), With<PrimaryWindow>>,
) {
    let why = &not_opened.0;
    let Some(folder) = played.0.clone().filter(|_| !windows.is_empty()) else {
        hints.write(Hint(texts::nothing_saved(why)));
        return;
    };
    (played.0, *party, start.is_wanted) = (None, Party::Alone, false);
    commands.trigger(NewGame);
    let text = match saves::is_closed(&folder) {
        true => texts::not_opened(&saves::name(&folder), why),
        false => texts::is_open(&saves::name(&folder)),
    };
    question::tell(&mut commands, MenuPage::Menu, text);
}

fn open(
    mut commands: Commands,
    played: Res<PlayedWorld>,
    mut first: ResMut<FirstShown>,
    mut images: ResMut<Assets<Image>>,
) {
    let worlds = saves::worlds();
    let (played, all) = (played.0.clone(), worlds.len());
    if first.0 >= all {
        first.0 = 0;
    }
    spawn_page(&mut commands, MenuPage::Worlds, texts::WORLDS, WIDTH + 54.0, |column| {
        let mut items = 0;
        for world in worlds.into_iter().skip(first.0).take(SHOWN) {
            let is_played = played.as_ref() == Some(&world.folder);
            let picture = thumbnails::read(&world.folder).map(|picture| images.add(picture));
            let (folder, chosen) = (world.folder.clone(), world.folder.clone());
            column
                .spawn(slot(items, &world, is_played, picture))
                .observe(move |_: On<Activated>, mut commands: Commands| play(&mut commands, folder.clone()))
                .observe(move |adjusted: On<Adjusted>, mut commands: Commands| {
                    if adjusted.by > 0 {
                        commands.insert_resource(Chosen(chosen.clone()));
                        commands.set_state(MenuPage::World);
                    }
                });
            items += 1;
        }
        let words = if all == 0 { texts::NO_WORLDS } else { texts::WORLDS_HELP };
        let line = Node { width: px(WIDTH - 28.0), margin: UiRect::axes(px(14), px(4)), ..default() };
        column.spawn((widgets::paragraph(words, 14.0, GREY), line));
        if all > SHOWN {
            column.spawn(widgets::button(items, texts::MORE_WORLDS, WIDTH)).observe(
                |_: On<Activated>, mut first: ResMut<FirstShown>, mut page: ResMut<NextState<MenuPage>>| {
                    first.0 += SHOWN;
                    page.set(MenuPage::Worlds);
                },
            );
            items += 1;
        }
        spawn_back(column, items, WIDTH, MenuPage::Worlds);
    });
}

/// An item with a world's picture, its name, when it was saved, and the arrow to its page.
fn slot(at: usize, world: &FoundWorld, is_played: bool, picture: Option<Handle<Image>>) -> impl Bundle {
    let node = Node {
        width: px(WIDTH),
        padding: UiRect::axes(px(12), px(4)),
        column_gap: px(16),
        align_items: AlignItems::Center,
        ..default()
    };
    let frame = Node { width: px(PICTURE.x), height: px(PICTURE.y), ..default() };
    // A world that was left before a picture was taken.
    let picture = picture.map_or(ImageNode::solid_color(Color::srgb(0.16, 0.20, 0.16)), ImageNode::new);
    let minutes = world.saved.elapsed().map_or(0, |passed| passed.as_secs() / 60);
    let open = match is_played {
        true => texts::CURRENT,
        false if saves::is_closed(&world.folder) => "",
        false => texts::OPEN_ELSEWHERE,
    };
    let saved = format!("{}{open}", texts::ago(minutes));
    let words = (
        Node { flex_grow: 1.0, overflow: Overflow::clip(), ..widgets::column(px(2)) },
        children![widgets::text(saves::name(&world.folder), 20.0, WHITE), widgets::text(saved, 14.0, GREY)],
    );
    let around =
        Node { padding: UiRect::axes(px(12), px(8)), border_radius: BorderRadius::all(px(4)), ..default() };
    let fill = BackgroundColor(Color::srgba(1.0, 1.0, 1.0, 0.08));
    let arrow = (Arrow(1), around, fill, children![widgets::text(">", 18.0, WHITE)]);
    (widgets::item(at, node), children![(picture, frame), words, arrow])
}

/// The page of one world. Its name is typed, and kept when the page is left.
fn open_world(mut commands: Commands, chosen: Res<Chosen>, mut draft: ResMut<Draft>) {
    draft.name = saves::name(&chosen.0);
    spawn_page(&mut commands, MenuPage::World, texts::WORLD, WIDTH + 54.0, |column| {
        spawn_field(column, 0, texts::WORLD_NAME, Field::WorldName, WIDTH);
        let folder = chosen.0.clone();
        column
            .spawn(widgets::button(1, texts::PLAY_WORLD, WIDTH))
            .observe(move |_: On<Activated>, mut commands: Commands| play(&mut commands, folder.clone()));
        let folder = chosen.0.clone();
        column.spawn(widgets::button(2, texts::DUPLICATE, WIDTH)).observe(
            move |_: On<Activated>, mut commands: Commands| {
                commands.insert_resource(Change::Duplicate(folder.clone()));
            },
        );
        let folder = chosen.0.clone();
        column.spawn(widgets::button(3, texts::DELETE, WIDTH)).observe(
            move |_: On<Activated>, mut commands: Commands, draft: Res<Draft>| {
                let folder = folder.clone();
                let delete = move |commands: &mut Commands| {
                    commands.insert_resource(Change::Delete(folder.clone()));
                };
                let text = texts::delete_world(&draft.name);
                question::ask(&mut commands, MenuPage::World, text, texts::DELETE, delete);
            },
        );
        spawn_back(column, 4, WIDTH, MenuPage::World);
    });
}

fn rename(chosen: Option<Res<Chosen>>, draft: Res<Draft>, played: Res<PlayedWorld>, mut commands: Commands) {
    let Some(folder) = chosen.map(|chosen| chosen.0.clone()).filter(|folder| folder.exists()) else { return };
    let name = saves::name(&folder);
    if draft.name == name {
        return;
    }
    if played.0.as_ref() != Some(&folder) && !saves::is_closed(&folder) {
        question::tell(&mut commands, MenuPage::Worlds, texts::is_open(&name));
    } else if let Err(why) = saves::rename(&folder, &draft.name) {
        question::tell(&mut commands, MenuPage::Worlds, texts::failed(texts::WORLD_NAME, why));
    }
}

/// Closes the world if it is open, and changes it once that is done. One that stays open is somebody else's.
fn change(
    mut commands: Commands,
    change: Res<Change>,
    time: Res<Time<Real>>,
    mut waited: Local<Duration>,
    mut played: ResMut<PlayedWorld>,
) {
    let (Change::Delete(folder) | Change::Duplicate(folder)) = &*change;
    if change.is_added() {
        *waited = Duration::ZERO;
    }
    if played.0.as_ref() == Some(folder) {
        played.0 = None;
        commands.trigger(NewGame);
        return;
    }
    if !saves::is_closed(folder) {
        *waited += time.delta();
        if *waited > CLOSING {
            commands.remove_resource::<Change>();
            question::tell(&mut commands, MenuPage::Worlds, texts::is_open(&saves::name(folder)));
        }
        return;
    }
    let done: io::Result<()> = match &*change {
        Change::Delete(folder) => std::fs::remove_dir_all(folder),
        Change::Duplicate(folder) => saves::duplicate(folder),
    };
    commands.remove_resource::<Change>();
    match done {
        Ok(()) => commands.set_state(MenuPage::Worlds),
        Err(why) => {
            let text = texts::failed(&folder.display().to_string(), why);
            question::tell(&mut commands, MenuPage::Worlds, text);
        }
    }
}

fn open_new(mut commands: Commands, mut draft: ResMut<Draft>) {
    *draft =
        Draft { name: saves::new_name().unwrap_or_default(), seed: fastrand::u32(1..1_000_000).to_string() };
    spawn_page(&mut commands, MenuPage::NewWorld, texts::NEW_WORLD, WIDTH + 54.0, |column| {
        spawn_field(column, 0, texts::WORLD_NAME, Field::WorldName, WIDTH);
        spawn_field(column, 1, texts::SEED, Field::Seed, WIDTH);
        let line = Node { width: px(WIDTH - 28.0), margin: UiRect::axes(px(14), px(4)), ..default() };
        column.spawn((widgets::paragraph(texts::SEED_HELP, 14.0, GREY), line));
        column.spawn(widgets::button(2, texts::CREATE, WIDTH)).observe(create);
        spawn_back(column, 3, WIDTH, MenuPage::NewWorld);
    });
}

fn create(_: On<Activated>, mut commands: Commands, draft: Res<Draft>) {
    match saves::create(&draft.name, draft.seed.parse().unwrap_or_default()) {
        Ok(folder) => play(&mut commands, folder),
        Err(why) => {
            question::tell(&mut commands, MenuPage::NewWorld, texts::failed(texts::CREATE, why));
        }
    }
}

/// Plays a saved world alone.
fn play(commands: &mut Commands, folder: PathBuf) {
    commands.insert_resource(PlayedWorld(Some(folder)));
    commands.insert_resource(Party::Alone);
    commands.queue(|world: &mut World| {
        world.resource_scope(|world, mut start: Mut<Start>| begin(&mut world.commands(), &mut start));
    });
}

/// Plays the world that is set now, with the party that is set, as soon as it has loaded.
pub fn begin(commands: &mut Commands, start: &mut Start) {
    commands.trigger(NewGame);
    start.is_wanted = true;
    commands.set_state_if_neq(GameState::Title);
    commands.set_state(MenuPage::Menu);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::go_to;
    use crate::ui::menu::title::TitlePlugin;
    use crate::ui::menu::{app_with, item_at, words};

    fn app(page: MenuPage) -> App {
        let plugin = |app: &mut App| {
            app.init_resource::<Assets<Image>>()
                .init_resource::<bevy_burrow::view::GroundLoading>()
                .init_resource::<PlayedWorld>()
                .init_resource::<Party>()
                .add_message::<Hint>()
                .add_plugins((WorldsPlugin, TitlePlugin));
        };
        app_with(plugin, page)
    }

    #[test]
    fn a_world_that_was_chosen_starts_from_the_title_and_from_the_pause() {
        for state in [GameState::Title, GameState::Paused] {
            let mut app = app(MenuPage::Menu);
            go_to(&mut app, state);
            let folder = PathBuf::from("no such world");
            play(&mut app.world_mut().commands(), folder.clone());
            app.world_mut().flush();
            app.update();
            app.update();
            assert!(app.world().resource::<Start>().is_wanted, "from {state:?}");
            assert_eq!(app.world().resource::<PlayedWorld>().0, Some(folder));
            assert_eq!(**app.world().resource::<State<MenuPage>>(), MenuPage::Menu);
            assert_eq!(**app.world().resource::<State<GameState>>(), GameState::Title);
        }
    }

    #[test]
    fn a_world_that_is_open_in_another_window_is_neither_played_renamed_nor_deleted() {
        let folder = std::env::temp_dir().join(format!("digger_elsewhere_{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let lock = std::fs::File::create(folder.join("lock")).expect("a file");
        lock.try_lock().expect("free");
        let text = texts::is_open(&saves::name(&folder));
        let mut app = app(MenuPage::Menu);
        app.world_mut().spawn((Window::default(), PrimaryWindow));
        app.insert_resource(Chosen(folder.clone()));
        let is_told = |app: &mut App| {
            app.update();
            app.update();
            assert_eq!(**app.world().resource::<State<MenuPage>>(), MenuPage::Question);
            assert!(words(app).contains(&text), "{:?}", words(app));
        };

        play(&mut app.world_mut().commands(), folder.clone());
        app.update();
        app.world_mut().trigger(NotOpened("it is open".into()));
        is_told(&mut app);
        assert_eq!(*app.world().resource::<PlayedWorld>(), PlayedWorld(None), "nothing is written to it");
        assert!(!app.world().resource::<Start>().is_wanted);

        go_to(&mut app, MenuPage::World);
        app.world_mut().resource_mut::<Draft>().name = "mine".into();
        go_to(&mut app, MenuPage::Worlds);
        is_told(&mut app);
        assert_ne!(saves::name(&folder), "mine");

        go_to(&mut app, MenuPage::Worlds);
        app.insert_resource(Change::Delete(folder.clone()));
        app.update();
        app.world_mut().resource_mut::<Time<Real>>().advance_by(CLOSING * 2);
        app.world_mut().run_system_cached(change).expect("it runs");
        is_told(&mut app);
        assert!(folder.exists() && !app.world().contains_resource::<Change>());
        std::fs::remove_dir_all(&folder).expect("removed");
    }

    #[test]
    fn a_world_is_deleted_only_after_the_answer_and_once_it_is_closed() {
        let folder = std::env::temp_dir().join(format!("digger_delete_{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let mut app = app(MenuPage::Worlds);
        app.insert_resource(Chosen(folder.clone()));
        let activate = |app: &mut App, at: usize| {
            let entity = item_at(app, at);
            app.world_mut().trigger(Activated { entity });
            app.update();
            app.update();
        };
        let page = |app: &App| **app.world().resource::<State<MenuPage>>();
        go_to(&mut app, MenuPage::World);
        activate(&mut app, 3);
        assert_eq!(page(&app), MenuPage::Question);
        assert!(words(&mut app).iter().any(|text| text.contains("digger_delete")));
        activate(&mut app, 0);
        assert_eq!((page(&app), folder.exists()), (MenuPage::World, true), "cancelled");
        let lock = std::fs::File::create(folder.join("lock")).expect("a file");
        lock.try_lock().expect("free");
        activate(&mut app, 3);
        activate(&mut app, 1);
        assert!(folder.exists(), "it is open");
        drop(lock);
        app.update();
        app.update();
        assert_eq!((page(&app), folder.exists()), (MenuPage::Worlds, false));
    }
}
