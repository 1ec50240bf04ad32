//! Saved worlds: the folder of the world that is played, and the game's data that is saved with its ground.
//!
//! The plugin saves the ground. Inventory, time of day and the player's place are stored with it in the frame in which
//! they change, so that after a crash nothing is duplicated or lost.

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::time::common_conditions::on_timer;
use bevy_burrow::prelude::*;
use bevy_burrow::together::{GroundServer, GroundServerEvent};
use serde::{Deserialize, Serialize};

use crate::party::connection::Party;
use crate::player::Player;
use crate::player::body::Body;
use crate::player::game_state::GameState;
use crate::player::headlamp::HeadlampSwitch;
use crate::tools::inventory::{self, Inventory};
use crate::tools::lamps::{SavedLamp, SavedLamps};
use crate::tools::{Hand, SavedHand};
use crate::ui::hud::Hint;
use crate::ui::texts;
use crate::world::day::Clock;
use crate::world::landscape::NewGame;

/// The key of the game's data in the saved world.
const KEY: &str = "digger";
/// How often the player's place is saved.
const PLACE_EVERY: Duration = Duration::from_secs(2);
/// The files in a world's folder with its name, and which is locked while it is open.
const INFO: &str = "world.json";
const LOCK: &str = "lock";

/// Saves the game in a folder, or nowhere.
pub struct SavesPlugin(pub Option<PathBuf>);

impl Plugin for SavesPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(PlayedWorld(self.0.clone()))
            .insert_resource(WorldsFolder::of_user())
            .add_observer(|_: On<NewGame>, mut commands: Commands| {
                commands.remove_resource::<SavedPlace>();
                commands.remove_resource::<GameIsRead>();
            })
            .add_systems(
                Update,
                (
                    continue_game,
                    (
                        put_game.after(continue_game).run_if(resource_exists::<GameIsRead>).run_if(
                            resource_changed::<Inventory>
                                .or_else(on_timer(PLACE_EVERY))
                                .or_else(on_message::<AppExit>)
                                .or_else(state_changed::<GameState>),
                        ),
                        tell_warning,
                    )
                        .after(BurrowSystems::Commit)
                        .after(inventory::read_history)
                        .before(SaveSystems),
                ),
            );
    }
}

/// The folder of the world that is played; `None` where nothing is saved, or nothing was played yet.
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub struct PlayedWorld(pub Option<PathBuf>);

impl PlayedWorld {
    /// The component that saves a terrain there.
    pub fn saved(&self) -> Option<SavedWorld> {
        self.0.as_ref().map(SavedWorld::new)
    }

    /// The folder that this program has open. A guest's own world is closed.
    pub fn open(&self, party: &Party) -> Option<&PathBuf> {
        self.0.as_ref().filter(|_| !matches!(party, Party::Guest(..)))
    }
}

/// The folder with the user's worlds; `None` on machines without a folder for data.
#[derive(Resource, Clone, Debug, Default)]
pub struct WorldsFolder(pub Option<PathBuf>);

impl WorldsFolder {
    /// The one in the user's folder of data.
    pub fn of_user() -> Self {
        let folder =
            |name: &str| std::env::var_os(name).filter(|folder| !folder.is_empty()).map(PathBuf::from);
        let data = if cfg!(windows) {
            folder("APPDATA")
        } else if cfg!(target_os = "macos") {
            folder("HOME").map(|home| home.join("Library/Application Support"))
        } else {
            folder("XDG_DATA_HOME").or_else(|| folder("HOME").map(|home| home.join(".local/share")))
        };
        Self(data.map(|data| data.join("bevy_burrow").join("worlds")))
    }

    /// The folder of the world of this name; where the name is a path, that.
    pub fn named(&self, name: &str) -> Option<PathBuf> {
        let is_path = name.contains(std::path::is_separator);
        if is_path { Some(name.into()) } else { Some(self.0.as_ref()?.join(name)) }
    }

    /// The worlds in it, those saved last first.
    pub fn worlds(&self) -> Vec<FoundWorld> {
        let Some(Ok(entries)) = self.0.as_ref().map(std::fs::read_dir) else { return Vec::new() };
        let found = entries.flatten().filter_map(|entry| {
            let folder = entry.path();
            let saved =
                std::fs::metadata(folder.join("journal")).and_then(|journal| journal.modified()).ok()?;
            Some(FoundWorld { folder, saved })
        });
        let mut worlds: Vec<FoundWorld> = found.collect();
        worlds.sort_by_key(|world| std::cmp::Reverse(world.saved));
        worlds
    }

    /// The world that was played last, of those that are closed.
    pub fn latest(&self) -> Option<PathBuf> {
        self.worlds().into_iter().map(|world| world.folder).find(|folder| is_closed(folder))
    }

    /// The name of a world that nobody has begun.
    pub fn new_name(&self) -> Option<String> {
        let all = self.0.as_ref()?;
        (1..).map(|number| format!("world {number}")).find(|name| !all.join(name).exists())
    }

    /// Makes a folder for a new world, with a number where others have its name.
    ///
    /// # Errors
    /// If the folder can't be written.
    pub fn create(&self, name: &str, seed: u32) -> io::Result<PathBuf> {
        let no_folder = || io::Error::new(io::ErrorKind::NotFound, texts::NO_FOLDER);
        create(self.0.as_ref().ok_or_else(no_folder)?, name, seed)
    }

    /// Makes a folder for a new world with a new name.
    ///
    /// # Errors
    /// If the folder can't be written.
    pub fn create_next(&self) -> io::Result<PathBuf> {
        self.create(&self.new_name().unwrap_or_default(), 0)
    }
}

fn create(all: &Path, name: &str, seed: u32) -> io::Result<PathBuf> {
    let safe: String =
        name.trim().chars().map(|c| if c.is_alphanumeric() || " -_".contains(c) { c } else { '_' }).collect();
    let safe = if safe.is_empty() { "world".into() } else { safe };
    let mut folders = numbered(&safe).map(|folder| all.join(folder));
    let folder = folders.find(|folder| !folder.exists()).ok_or(io::ErrorKind::AlreadyExists)?;
    std::fs::create_dir_all(&folder)?;
    WorldInfo { name: None, seed }.write(&folder)?;
    rename(&folder, name)?;
    Ok(folder)
}

/// `hill`, `hill 2`, `hill 3` and so on.
fn numbered(name: &str) -> impl Iterator<Item = String> {
    std::iter::once(String::from(name)).chain((2..).map(move |number| format!("{name} {number}")))
}

/// What is known of a world without opening it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
struct WorldInfo {
    /// The folder's name without one.
    name: Option<String>,
    seed: u32,
}

impl WorldInfo {
    fn read(folder: &Path) -> Self {
        let text = std::fs::read(folder.join(INFO)).unwrap_or_default();
        serde_json::from_slice(&text).unwrap_or_default()
    }

    fn write(&self, folder: &Path) -> io::Result<()> {
        let draft = folder.join("world.draft.json");
        std::fs::write(&draft, serde_json::to_vec_pretty(self)?)?;
        std::fs::rename(draft, folder.join(INFO))
    }
}

/// The seed of the world that is played: the host's, where it is another machine's.
pub fn seed(played: &PlayedWorld, party: &Party) -> u32 {
    match (party, &played.0) {
        (Party::Guest(_, seed), _) => *seed,
        (_, Some(folder)) => WorldInfo::read(folder).seed,
        (_, None) => 0,
    }
}

/// A world in the user's folder.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundWorld {
    pub folder: PathBuf,
    /// When it was saved last.
    pub saved: SystemTime,
}

/// The name of a world.
pub fn name(folder: &Path) -> String {
    WorldInfo::read(folder).name.unwrap_or_else(|| name_of_folder(folder))
}

fn name_of_folder(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into()
}

/// Gives a world another name, with a number where another world beside it has that. Its folder stays where it is.
///
/// # Errors
/// If the folder can't be written.
pub fn rename(folder: &Path, name: &str) -> io::Result<()> {
    let beside = folder.parent().and_then(|all| std::fs::read_dir(all).ok());
    let beside = beside.into_iter().flatten().flatten().map(|entry| entry.path());
    let others: Vec<String> =
        beside.filter(|other| other != folder).map(|other| self::name(&other)).collect();
    let name = if name.trim().is_empty() { name_of_folder(folder) } else { name.trim().into() };
    let name = numbered(&name).find(|name| !others.contains(name));
    WorldInfo { name, ..WorldInfo::read(folder) }.write(folder)
}

/// Copies a world that is closed, and names the copy after it. A copy that fails leaves nothing.
///
/// # Errors
/// If its files can't be read, or the copy can't be written.
pub fn duplicate(folder: &Path, name: &str) -> io::Result<()> {
    let all = folder.parent().ok_or(io::ErrorKind::NotFound)?;
    let copy = create(all, &format!("{name} {}", texts::COPY), WorldInfo::read(folder).seed)?;
    let copied = copy_files(folder, &copy);
    if copied.is_err() {
        std::fs::remove_dir_all(&copy)?;
    }
    copied
}

/// Copies all but the name, which the copy has already, and the lock.
fn copy_files(from: &Path, to: &Path) -> io::Result<()> {
    std::fs::create_dir_all(to)?;
    for entry in std::fs::read_dir(from)? {
        let entry = entry?;
        let copy = to.join(entry.file_name());
        match entry.file_type()?.is_dir() {
            true => copy_files(&entry.path(), &copy)?,
            false if entry.file_name() == LOCK || entry.file_name() == INFO => {}
            false => drop(std::fs::copy(entry.path(), copy)?),
        }
    }
    Ok(())
}

/// Whether nobody has this world open.
pub fn is_closed(folder: &Path) -> bool {
    let lock = std::fs::File::open(folder.join(LOCK));
    lock.map_or(true, |lock| lock.try_lock_shared().is_ok())
}

/// Where painted textures are kept from one start to the next.
pub fn folder_of_textures() -> Option<PathBuf> {
    Some(WorldsFolder::of_user().0?.with_file_name("textures"))
}

/// Where the player of a saved game stands and looks.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedPlace {
    pub feet: Vec3,
    pub yaw: f32,
    pub pitch: f32,
}

/// A saved world can't be opened, so that nothing that is dug would be kept.
#[derive(Event, Clone, Debug)]
pub struct NotOpened(pub String);

/// The saved game was read, or there is none: from now on it is written.
#[derive(Resource)]
struct GameIsRead;

/// The data that is saved with the ground: everything that the player has, holds and has placed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct SavedGame {
    inventory: inventory::SavedInventory,
    hour: f32,
    place: Option<SavedPlace>,
    #[serde(default)]
    hand: Option<SavedHand>,
    #[serde(default)]
    has_headlamp: bool,
    #[serde(default)]
    lamps: Vec<SavedLamp>,
}

/// What of a game is saved, where it is while it is played.
#[derive(SystemParam)]
struct PlayedGame<'w, 's> {
    inventory: ResMut<'w, Inventory>,
    clock: ResMut<'w, Clock>,
    hand: ResMut<'w, Hand>,
    headlamp: ResMut<'w, HeadlampSwitch>,
    lamps: SavedLamps<'w, 's>,
    players: Query<'w, 's, (&'static Player, Body)>,
    /// The place of a player that is not there yet.
    place: Option<Res<'w, SavedPlace>>,
    commands: Commands<'w, 's>,
}

impl PlayedGame<'_, '_> {
    fn saved(&self) -> SavedGame {
        let place = self.players.iter().next().map(|(player, body)| {
            let Player { yaw, pitch } = *player;
            SavedPlace { feet: body.feet(), yaw, pitch }
        });
        SavedGame {
            inventory: self.inventory.saved(),
            hour: self.clock.hour,
            place: place.or(self.place.as_deref().copied()),
            hand: Some(self.hand.saved()),
            has_headlamp: self.headlamp.0,
            lamps: self.lamps.all(),
        }
    }

    fn restore(&mut self, game: SavedGame) {
        self.inventory.restore(&game.inventory);
        if game.hour.is_finite() {
            self.clock.hour = game.hour.rem_euclid(24.0);
        }
        if let Some(place) = game.place.filter(|place| place.feet.is_finite()) {
            self.commands.insert_resource(place);
        }
        if let Some(hand) = &game.hand {
            self.hand.restore(hand);
        }
        self.headlamp.0 = game.has_headlamp;
        for lamp in game.lamps {
            self.commands.trigger(lamp);
        }
    }
}

/// Stores the game's data with the ground: the host's, if the world is shared.
fn put_game(game: PlayedGame, mut worlds: Query<&mut WorldStore>, mut server: Option<ResMut<GroundServer>>) {
    if worlds.is_empty() && server.is_none() {
        return;
    }
    let Ok(bytes) = serde_json::to_vec(&game.saved()) else { return };
    if let Some(server) = &mut server
        && server.get(KEY) != Some(&bytes[..])
    {
        server.put(KEY, bytes.clone());
    }
    for mut world in &mut worlds {
        if world.get(KEY) != Some(&bytes[..]) {
            world.put(KEY, bytes.clone());
        }
    }
}

/// Continues the saved game.
fn continue_game(
    mut opened: MessageReader<WorldOpened>,
    mut served: MessageReader<GroundServerEvent>,
    mut game: PlayedGame,
    worlds: Query<&WorldStore>,
    server: Option<Res<GroundServer>>,
) {
    let mut games = Vec::new();
    for message in opened.read() {
        if let Err(why) = &message.outcome {
            game.commands.trigger(NotOpened(why.to_string()));
            continue;
        }
        games.push(worlds.get(message.terrain).ok().and_then(|world| world.get(KEY)));
    }
    if served.read().any(|event| matches!(event, GroundServerEvent::Opened(Ok(())))) {
        games.push(server.as_deref().and_then(|server| server.get(KEY)));
    }
    if !games.is_empty() {
        game.commands.insert_resource(GameIsRead);
    }
    for bytes in games.into_iter().flatten() {
        if let Ok(saved) = serde_json::from_slice(bytes) {
            game.restore(saved);
        }
    }
}

fn tell_warning(mut warnings: MessageReader<StoreWarningFound>, mut hints: MessageWriter<Hint>) {
    hints.write_batch(warnings.read().map(|found| Hint(found.warning.to_string())));
}

#[cfg(test)]
mod tests {
    use bevy::ecs::system::RunSystemOnce;

    use super::*;
    use crate::tools::Tool;
    use crate::ui::settings::Settings;

    #[test]
    fn a_name_is_a_folder_among_the_worlds_and_a_path_is_itself() {
        let worlds = WorldsFolder(Some("all".into()));
        assert_eq!(worlds.named("here/there"), Some("here/there".into()));
        assert_eq!(worlds.named("mine"), Some("all/mine".into()));
        assert_eq!(WorldsFolder(None).named("mine"), None);
    }

    /// A game without ground, as it is saved.
    fn app() -> App {
        let settings = Settings::default();
        let mut app = App::new();
        app.init_resource::<Inventory>()
            .init_resource::<Clock>()
            .init_resource::<HeadlampSwitch>()
            .insert_resource(Hand::new(&settings))
            .add_observer(|lamp: On<SavedLamp>, mut placed: ResMut<Placed>| placed.0.push(*lamp.event()))
            .init_resource::<Placed>();
        app
    }

    #[derive(Resource, Default)]
    struct Placed(Vec<SavedLamp>);

    fn saved(app: &mut App) -> SavedGame {
        app.world_mut().run_system_once(|game: PlayedGame| game.saved()).expect("a system")
    }

    #[test]
    fn all_that_is_saved_of_a_game_comes_back() {
        let mut app = app();
        let world = app.world_mut();
        world.resource_mut::<Inventory>().gain(MaterialId(6), 41);
        world.resource_mut::<Clock>().hour = 7.5;
        world.resource_mut::<HeadlampSwitch>().0 = true;
        let mut hand = world.resource_mut::<Hand>();
        (hand.tool, hand.material) = (Tool::Builder, MaterialId(6));
        hand.set_radius(Tool::Builder, 5.5);
        let tag = world.resource_mut::<Inventory>().next_tag();
        let lamp = SavedLamp { foot: Vec3::new(9.0, 8.0, 7.0), normal: Vec3::Y };
        let place = Some(SavedPlace { feet: Vec3::new(1.0, 2.0, 3.0), yaw: 0.5, pitch: -0.25 });
        let game = SavedGame { place, lamps: vec![lamp], ..saved(&mut app) };
        let read: SavedGame = serde_json::from_slice(&serde_json::to_vec(&game).unwrap()).unwrap();
        assert_eq!(read, game);

        let mut restored = self::app();
        let restore = move |mut game: PlayedGame| game.restore(read.clone());
        restored.world_mut().run_system_once(restore).expect("a system");
        assert_eq!(restored.world().resource::<Placed>().0, [lamp]);
        // The player is not there yet: the place must not be forgotten meanwhile.
        assert_eq!(saved(&mut restored), SavedGame { lamps: Vec::new(), ..game });
        assert!(restored.world_mut().resource_mut::<Inventory>().next_tag() > tag);
    }

    #[test]
    fn a_game_that_an_older_version_saved_can_be_read() {
        let old = r#"{"inventory":{"amounts":[1,2],"next_tag":4294967300},"hour":7.5,"place":null}"#;
        let game: SavedGame = serde_json::from_str(old).expect("an older game");
        assert_eq!((game.hand, game.has_headlamp, game.lamps.len()), (None, false, 0));
    }

    #[test]
    fn worlds_are_made_named_copied_and_told_apart() {
        let all = std::env::temp_dir().join(format!("digger_worlds_{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&all);
        let folder = all.join("first");
        std::fs::create_dir_all(folder.join("journal")).expect("a folder");
        std::fs::write(folder.join("journal").join("1"), b"edits").expect("a file");
        std::fs::write(folder.join(LOCK), b"").expect("a file");
        // As an older version left it.
        assert_eq!((name(&folder).as_str(), WorldInfo::read(&folder).seed), ("first", 0));
        WorldInfo { name: None, seed: 7 }.write(&folder).expect("written");
        rename(&folder, " My hill ").expect("written");
        assert_eq!((name(&folder).as_str(), WorldInfo::read(&folder).seed), ("My hill", 7));
        rename(&folder, "").expect("written");
        assert_eq!(name(&folder), "first");
        duplicate(&folder, "first").expect("copied");
        let copy = all.join("first copy");
        assert_eq!(std::fs::read(copy.join("journal").join("1")).expect("copied"), b"edits");
        assert_eq!((name(&copy).as_str(), WorldInfo::read(&copy).seed), ("first copy", 7));
        assert!(!copy.join(LOCK).exists());
        assert!(is_closed(&folder) && is_closed(&copy));
        let lock = std::fs::File::create(folder.join(LOCK)).expect("a file");
        lock.try_lock().expect("free");
        assert!(!is_closed(&folder), "it is open");
        std::fs::remove_dir_all(&all).expect("removed");
    }

    #[test]
    fn no_two_worlds_have_the_same_name() {
        let all = std::env::temp_dir().join(format!("digger_names_{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&all);
        let worlds = WorldsFolder(Some(all.clone()));
        let [first, second, other] =
            ["Hill", "Hill", "Mound"].map(|name| worlds.create(name, 0).expect("a world"));
        assert_eq!([&first, &second].map(|folder| name(folder)), ["Hill", "Hill 2"]);
        rename(&other, "Hill").expect("renamed");
        assert_eq!(name(&other), "Hill 3");
        rename(&other, "Hill 3").expect("renamed");
        assert_eq!(name(&other), "Hill 3", "it has that name itself");
        for expected in ["Hill copy", "Hill copy 2"] {
            duplicate(&first, "Hill").expect("copied");
            assert_eq!(name(&all.join(expected)), expected);
        }
        std::fs::remove_dir_all(&all).expect("removed");
    }

    #[cfg(unix)]
    #[test]
    fn a_copy_that_fails_leaves_no_world() {
        let all = std::env::temp_dir().join(format!("digger_half_{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&all);
        let folder = all.join("first");
        std::fs::create_dir_all(folder.join("journal")).expect("a folder");
        std::os::unix::fs::symlink("nowhere", folder.join("broken")).expect("a link");
        assert!(duplicate(&folder, "first").is_err());
        let left = std::fs::read_dir(&all).expect("a folder").flatten().map(|entry| entry.path());
        assert_eq!(left.collect::<Vec<_>>(), [folder]);
        std::fs::remove_dir_all(&all).expect("removed");
    }
}
