//! The pages of saved worlds: the list, in which each continues where it was left, one world, and a new one.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use bevy::prelude::*;
use bevy::tasks::{IoTaskPool, Task, futures::check_ready};
use bevy::window::PrimaryWindow;

use super::fields::{Draft, Field, spawn_field};
use super::question;
use super::title::Start;
use super::{spawn_back, spawn_page};
use crate::party::connection::{ConnectionFailed, Party};
use crate::player::game_state::{GameState, MenuPage};
use crate::ui::hud::Hint;
use crate::ui::texts;
use crate::ui::widgets::{self, Activated, Adjusted, Arrow, GREY, MenuInputDisabled, WHITE};
use crate::world::folders::{self, FoundWorld, WorldsFolder};
use crate::world::landscape::NewGame;
use crate::world::saves::{NotOpened, PlayedWorld};
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
            .add_observer(|failed: On<ConnectionFailed>, mut commands: Commands| {
                give_up(&mut commands, failed.0.clone());
            })
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

/// A world that is copied or deleted as soon as it is closed. Menus ignore input until then.
#[derive(Resource, Default)]
struct Change {
    folder: PathBuf,
    /// The name that the copy gets; `None` if the world is deleted.
    copy: Option<String>,
    /// Whether it is the world that is played.
    is_played: bool,
    waited: Duration,
    task: Option<Task<io::Result<()>>>,
}

/// A text while a world is changed.
#[derive(Component)]
struct Wait;

/// Plays no world that can't be saved, and says why. A script, which nobody watches, continues
/// without saving.
fn refuse(
    not_opened: On<NotOpened>,
    mut commands: Commands,
    mut played: ResMut<PlayedWorld>,
    mut hints: MessageWriter<Hint>,
    windows: Query<(), With<PrimaryWindow>>,
) {
    let why = &not_opened.0;
    let Some(folder) = played.0.clone().filter(|_| !windows.is_empty()) else {
        hints.write(Hint(texts::nothing_saved(why)));
        return;
    };
    played.0 = None;
    let text = match folders::is_closed(&folder) {
        true => texts::not_opened(&folders::name(&folder), why),
        false => texts::is_open(&folders::name(&folder)),
    };
    give_up(&mut commands, text);
}

/// Leads to the title, where the player reads why, and plays alone again.
fn give_up(commands: &mut Commands, why: String) {
    commands.insert_resource(Party::Alone);
    commands.queue(|world: &mut World| world.resource_mut::<Start>().is_wanted = false);
    commands.trigger(NewGame);
    commands.set_state_if_neq(GameState::Title);
    question::tell(commands, MenuPage::Menu, why);
}

fn open(
    mut commands: Commands,
    folder: Res<WorldsFolder>,
    played: Res<PlayedWorld>,
    party: Res<Party>,
    mut first: ResMut<FirstShown>,
    mut images: ResMut<Assets<Image>>,
) {
    let worlds = folder.worlds();
    let (played, all) = (played.open(&party).cloned(), worlds.len());
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
        false if folders::is_closed(&world.folder) => "",
        false => texts::OPEN_ELSEWHERE,
    };
    let saved = format!("{}{open}", texts::ago(minutes));
    let words = (
        Node { flex_grow: 1.0, overflow: Overflow::clip(), ..widgets::column(px(2)) },
        children![widgets::text(folders::name(&world.folder), 20.0, WHITE), widgets::text(saved, 14.0, GREY)],
    );
    let around =
        Node { padding: UiRect::axes(px(12), px(8)), border_radius: BorderRadius::all(px(4)), ..default() };
    let fill = BackgroundColor(Color::srgba(1.0, 1.0, 1.0, 0.08));
    let arrow = (Arrow(1), around, fill, children![widgets::text(">", 18.0, WHITE)]);
    (widgets::item(at, node), children![(picture, frame), words, arrow])
}

/// The page of one world. Its name is typed, and kept when the page is left.
fn open_world(mut commands: Commands, chosen: Res<Chosen>, mut draft: ResMut<Draft>) {
    draft.name = folders::name(&chosen.0);
    spawn_page(&mut commands, MenuPage::World, texts::WORLD, WIDTH + 54.0, |column| {
        spawn_field(column, 0, texts::WORLD_NAME, Field::WorldName, WIDTH);
        let folder = chosen.0.clone();
        column
            .spawn(widgets::button(1, texts::PLAY_WORLD, WIDTH))
            .observe(move |_: On<Activated>, mut commands: Commands| play(&mut commands, folder.clone()));
        let folder = chosen.0.clone();
        column.spawn(widgets::button(2, texts::DUPLICATE, WIDTH)).observe(
            move |_: On<Activated>, mut commands: Commands, draft: Res<Draft>| {
                let copy = Some(draft.name.clone());
                commands.insert_resource(Change { folder: folder.clone(), copy, ..default() });
            },
        );
        let folder = chosen.0.clone();
        column.spawn(widgets::button(3, texts::DELETE, WIDTH)).observe(
            move |_: On<Activated>, mut commands: Commands, draft: Res<Draft>| {
                let folder = folder.clone();
                let delete = move |commands: &mut Commands| {
                    commands.insert_resource(Change { folder: folder.clone(), ..default() });
                };
                let text = texts::delete_world(&draft.name);
                question::ask(&mut commands, MenuPage::World, text, texts::DELETE, delete);
            },
        );
        spawn_back(column, 4, WIDTH, MenuPage::World);
        let line = Node { margin: UiRect::axes(px(14), px(4)), ..default() };
        column.spawn((Wait, widgets::text("", 14.0, GREY), line));
    });
}

fn rename(
    chosen: Option<Res<Chosen>>,
    draft: Res<Draft>,
    played: Res<PlayedWorld>,
    party: Res<Party>,
    mut commands: Commands,
) {
    let Some(folder) = chosen.map(|chosen| chosen.0.clone()).filter(|folder| folder.exists()) else { return };
    let name = folders::name(&folder);
    if draft.name == name {
        return;
    }
    if played.open(&party) != Some(&folder) && !folders::is_closed(&folder) {
        question::tell(&mut commands, MenuPage::Worlds, texts::is_open(&name));
    } else if let Err(why) = folders::rename(&folder, &draft.name) {
        question::tell(&mut commands, MenuPage::Worlds, texts::failed(texts::WORLD_NAME, why));
    }
}

/// Closes the world if it is open, and changes it once that is done. One that stays open is somebody else's. If it was
/// played, it is played on, or the latest one if it is gone.
fn change(
    mut commands: Commands,
    change: ResMut<Change>,
    time: Res<Time<Real>>,
    worlds: Res<WorldsFolder>,
    mut played: ResMut<PlayedWorld>,
    mut party: ResMut<Party>,
    mut notes: Query<&mut Text, With<Wait>>,
) {
    let is_new = change.is_added();
    let change = change.into_inner();
    let is_open = played.open(&party) == Some(&change.folder);
    if is_new {
        commands.insert_resource(MenuInputDisabled);
        change.is_played = played.0.as_ref() == Some(&change.folder);
    }
    if is_open {
        (played.0, *party) = (None, Party::Alone);
        commands.trigger(NewGame);
        return;
    }
    for mut note in &mut notes {
        note.set_if_neq(Text::new(texts::WAIT));
    }
    let done = match &mut change.task {
        Some(task) => match check_ready(task) {
            Some(done) => done.map_err(|why| texts::failed(&change.folder.display().to_string(), why)),
            None => return,
        },
        None if folders::is_closed(&change.folder) => {
            let (folder, copy) = (change.folder.clone(), change.copy.clone());
            change.task = Some(IoTaskPool::get().spawn(async move {
                match copy {
                    Some(name) => folders::duplicate(&folder, &name),
                    None => std::fs::remove_dir_all(&folder),
                }
            }));
            return;
        }
        None if change.waited < CLOSING => {
            change.waited += time.delta();
            return;
        }
        None => Err(texts::is_open(&folders::name(&change.folder))),
    };
    commands.remove_resource::<Change>();
    commands.remove_resource::<MenuInputDisabled>();
    if change.is_played {
        let kept = Some(change.folder.clone()).filter(|folder| folder.exists());
        played.0 = kept.or_else(|| worlds.latest());
        if played.open(&party).is_some() {
            commands.trigger(NewGame);
        }
    }
    match done {
        Ok(()) => commands.set_state(MenuPage::Worlds),
        Err(why) => question::tell(&mut commands, MenuPage::Worlds, why),
    }
}

fn open_new(mut commands: Commands, worlds: Res<WorldsFolder>, mut draft: ResMut<Draft>) {
    *draft =
        Draft { name: worlds.new_name().unwrap_or_default(), seed: fastrand::u32(1..1_000_000).to_string() };
    spawn_page(&mut commands, MenuPage::NewWorld, texts::NEW_WORLD, WIDTH + 54.0, |column| {
        spawn_field(column, 0, texts::WORLD_NAME, Field::WorldName, WIDTH);
        spawn_field(column, 1, texts::SEED, Field::Seed, WIDTH);
        let line = Node { width: px(WIDTH - 28.0), margin: UiRect::axes(px(14), px(4)), ..default() };
        column.spawn((widgets::paragraph(texts::SEED_HELP, 14.0, GREY), line));
        column.spawn(widgets::button(2, texts::CREATE, WIDTH)).observe(create);
        spawn_back(column, 3, WIDTH, MenuPage::NewWorld);
    });
}

fn create(_: On<Activated>, mut commands: Commands, worlds: Res<WorldsFolder>, draft: Res<Draft>) {
    match worlds.create(&draft.name, draft.seed.parse().unwrap_or_default()) {
        Ok(folder) => play(&mut commands, folder),
        Err(why) => {
            question::tell(&mut commands, MenuPage::NewWorld, texts::failed(texts::CREATE, why));
        }
    }
}

/// Plays a saved world alone.
fn play(commands: &mut Commands, folder: PathBuf) {
    commands.insert_resource(PlayedWorld(Some(folder)));
    begin(commands, Party::Alone);
}

/// Plays the world that is set, with this party. Where none is set, a new one is made, so that all that is played is
/// saved; if that fails, the player is asked.
pub fn begin(commands: &mut Commands, party: Party) {
    commands.queue(move |world: &mut World| {
        let mut made = Ok(());
        if world.resource::<PlayedWorld>().0.is_none() && !matches!(party, Party::Guest(..)) {
            let new = world.resource::<WorldsFolder>().create_next();
            made = new.map(|folder| world.resource_mut::<PlayedWorld>().0 = Some(folder));
        }
        let page = **world.resource::<State<MenuPage>>();
        let mut commands = world.commands();
        match made {
            Ok(()) => begin_as_is(&mut commands, party),
            Err(why) => {
                let begin = move |commands: &mut Commands| begin_as_is(commands, party.clone());
                let text = texts::nothing_saved(why);
                question::ask(&mut commands, page, text, texts::PLAY_UNSAVED, begin);
            }
        }
    });
}

/// Plays what is set, saved or not, as soon as it has loaded.
pub fn begin_as_is(commands: &mut Commands, party: Party) {
    commands.insert_resource(party);
    commands.queue(|world: &mut World| world.resource_mut::<Start>().is_wanted = true);
    commands.set_state_if_neq(GameState::Title);
    commands.set_state(MenuPage::Menu);
    // Last, because hosting may fail at once.
    commands.trigger(NewGame);
}

#[cfg(test)]
#[path = "worlds_tests.rs"]
mod tests;
