//! Tests of the pages of saved worlds.

use bevy::time::TimeUpdateStrategy;

use super::*;
use crate::test_support::{go_to, tap_key, update_until};
use crate::ui::images::Images;
use crate::ui::menu::pause::PausePlugin;
use crate::ui::menu::title::TitlePlugin;
use crate::ui::menu::{app_with, click, words};

/// A folder for worlds, which is removed with it.
struct TestFolder(PathBuf);

impl TestFolder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("digger_worlds_{name}_{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        Self(folder)
    }

    /// Makes a world that was played.
    fn world(&self, name: &str) -> PathBuf {
        let folder = WorldsFolder(Some(self.0.clone())).create(name, 0).expect("a world");
        std::fs::create_dir_all(folder.join("journal")).expect("a folder");
        folder
    }
}

impl Drop for TestFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Locks a world, as another window that has it open.
fn lock(folder: &std::path::Path) -> std::fs::File {
    let lock = std::fs::File::create(folder.join("lock")).expect("a file");
    lock.try_lock().expect("free");
    lock
}

fn app(page: MenuPage) -> App {
    let plugin = |app: &mut App| {
        app.init_resource::<Assets<Image>>()
            .init_resource::<bevy_burrow::view::GroundLoading>()
            .init_resource::<PlayedWorld>()
            .init_resource::<WorldsFolder>()
            .init_resource::<Party>()
            .init_resource::<NewGames>()
            .add_observer(|_: On<NewGame>, mut games: ResMut<NewGames>| games.0 += 1)
            .add_message::<Hint>()
            .add_plugins((WorldsPlugin, TitlePlugin, PausePlugin));
    };
    app_with(plugin, page)
}

/// How often a new game has begun.
#[derive(Resource, Default)]
struct NewGames(usize);

fn page(app: &App) -> MenuPage {
    **app.world().resource::<State<MenuPage>>()
}

/// An app whose player plays a world of the folder, on the page of that world.
fn app_in(all: &TestFolder, folder: &std::path::Path, party: Party) -> App {
    let mut app = app(MenuPage::Menu);
    app.insert_resource(WorldsFolder(Some(all.0.clone())))
        .insert_resource(PlayedWorld(Some(folder.into())))
        .insert_resource(Chosen(folder.into()))
        .insert_resource(party);
    go_to(&mut app, MenuPage::World);
    app
}

const COPY: usize = 2;
const DELETE: usize = 3;

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
    let _lock = lock(&folder);
    let text = texts::is_open(&folders::name(&folder));
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
    assert_ne!(folders::name(&folder), "mine");

    go_to(&mut app, MenuPage::Worlds);
    app.insert_resource(Change { folder: folder.clone(), ..default() });
    (0..20).for_each(|_| app.update());
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
    go_to(&mut app, MenuPage::World);
    click(&mut app, DELETE);
    assert_eq!(page(&app), MenuPage::Question);
    assert!(words(&mut app).iter().any(|text| text.contains("digger_delete")));
    click(&mut app, 0);
    assert_eq!((page(&app), folder.exists()), (MenuPage::World, true), "cancelled");
    let lock = lock(&folder);
    click(&mut app, DELETE);
    click(&mut app, 1);
    assert!(folder.exists(), "it is open");
    drop(lock);
    update_until(&mut app, "the list", |app| page(app) == MenuPage::Worlds);
    assert!(!folder.exists());
}

#[test]
fn the_second_click_of_a_double_click_answers_no_question() {
    let all = TestFolder::new("double");
    let folder = all.world("Hill");
    let mut app = app_in(&all, &folder, Party::Alone);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(100)));
    click(&mut app, DELETE);
    for expected in [MenuPage::Question, MenuPage::World] {
        click(&mut app, 1);
        assert_eq!(page(&app), expected);
        (0..4).for_each(|_| app.update());
    }
}

fn guest() -> Party {
    Party::Guest(([10, 0, 0, 3], 5100).into(), 0)
}

#[test]
fn the_world_that_is_played_is_copied_under_its_new_name_and_played_on() {
    for party in [Party::Alone, Party::Host(5100), guest()] {
        let all = TestFolder::new("copy");
        let folder = all.world("Hill");
        let mut app = app_in(&all, &folder, party.clone());
        app.world_mut().resource_mut::<Draft>().name = "Mound".into();
        click(&mut app, COPY);
        update_until(&mut app, "the list", |app| page(app) == MenuPage::Worlds);
        assert_eq!(folders::name(&folder), "Mound");
        assert_eq!(folders::name(&all.0.join("Mound copy")), "Mound copy");
        assert_eq!(app.world().resource::<PlayedWorld>().0.as_ref(), Some(&folder));
        // A guest's own world is closed, and its host's continues.
        let (after, games) = if party == guest() { (guest(), 0) } else { (Party::Alone, 2) };
        assert_eq!(*app.world().resource::<Party>(), after);
        assert_eq!(app.world().resource::<NewGames>().0, games, "{party:?}");
        assert!(!app.world().contains_resource::<MenuInputDisabled>());
    }
}

#[test]
fn when_the_world_that_is_played_is_deleted_the_latest_one_is_played() {
    for party in [Party::Alone, Party::Host(5100), guest()] {
        let all = TestFolder::new("end");
        let (folder, other) = (all.world("Hill"), all.world("Mound"));
        let mut app = app_in(&all, &folder, party.clone());
        click(&mut app, DELETE);
        click(&mut app, 1);
        update_until(&mut app, "the list", |app| page(app) == MenuPage::Worlds);
        assert!(!folder.exists());
        assert_eq!(app.world().resource::<PlayedWorld>().0.as_ref(), Some(&other));
        assert_eq!(*app.world().resource::<Party>() == party, party != Party::Host(5100));
        assert_eq!(app.world().resource::<NewGames>().0, if party == guest() { 0 } else { 2 });
    }
}

#[test]
fn the_page_of_a_world_stays_while_the_world_is_changed() {
    let all = TestFolder::new("wait");
    let folder = all.world("Hill");
    let _lock = lock(&folder);
    let mut app = app_in(&all, &folder, Party::Alone);
    app.insert_resource(PlayedWorld(None));
    click(&mut app, COPY);
    for _ in 0..2 {
        tap_key(&mut app, KeyCode::Escape);
        assert_eq!(page(&app), MenuPage::World);
    }
    assert!(words(&mut app).contains(&texts::WAIT.into()));
    update_until(&mut app, "a question", |app| page(app) == MenuPage::Question);
    tap_key(&mut app, KeyCode::Escape);
    assert_eq!(page(&app), MenuPage::Worlds);
}

#[test]
fn the_own_world_of_a_guest_is_not_open() {
    for (party, is_open) in [(Party::Alone, true), (guest(), false)] {
        let all = TestFolder::new("guest");
        let folder = all.world("Hill");
        let mut app = app_in(&all, &folder, party);
        go_to(&mut app, MenuPage::Worlds);
        let lines = words(&mut app);
        assert_eq!(lines.iter().any(|line| line.ends_with(texts::CURRENT)), is_open, "{lines:?}");
    }
}

#[test]
fn a_connection_that_fails_leads_to_the_title_and_is_told() {
    let mut app = app(MenuPage::None);
    go_to(&mut app, GameState::Playing);
    app.insert_resource(guest());
    app.world_mut().resource_mut::<Start>().is_wanted = true;
    app.world_mut().trigger(ConnectionFailed("the host has gone".into()));
    (0..4).for_each(|_| app.update());
    assert_eq!(
        (page(&app), **app.world().resource::<State<GameState>>()),
        (MenuPage::Question, GameState::Title)
    );
    assert!(words(&mut app).contains(&"the host has gone".into()));
    assert_eq!(*app.world().resource::<Party>(), Party::Alone);
    assert!(!app.world().resource::<Start>().is_wanted, "nothing starts without the player");
    assert_eq!(app.world().resource::<NewGames>().0, 1);
}

#[test]
fn a_world_that_cannot_be_saved_is_played_after_a_question_and_not_lost() {
    let mut app = app(MenuPage::Settings);
    app.init_resource::<Images>();
    go_to(&mut app, MenuPage::Menu);
    assert!(words(&mut app).contains(&texts::PLAY.into()));
    click(&mut app, 0);
    assert!(words(&mut app).contains(&texts::nothing_saved(texts::NO_FOLDER)));
    assert!(!app.world().resource::<Start>().is_wanted);
    click(&mut app, 1);
    assert!(app.world().resource::<Start>().is_wanted);
    go_to(&mut app, GameState::Playing);
    go_to(&mut app, GameState::Title);
    assert!(words(&mut app).contains(&texts::CONTINUE.into()));
    click(&mut app, 0);
    assert!(app.world().resource::<Start>().is_wanted);
    assert_eq!(app.world().resource::<NewGames>().0, 1, "it is the same game");
}
