//! Saved worlds: the folder of the world that is played, and what the game keeps beside its ground.
//!
//! The ground saves itself. Inventory, time of day and the player's place are put beside it in the frame in which they change, so
//! that after a crash nothing is there twice, or neither here nor there.

use std::path::{Path, PathBuf};
use std::time::Duration;

use bevy::prelude::*;
use bevy::time::common_conditions::on_timer;
use bevy_burrow::prelude::*;
use bevy_burrow::together::{GroundServer, GroundServerEvent};
use serde::{Deserialize, Serialize};

use crate::player::Player;
use crate::player::body::Body;
use crate::tools::inventory::{self, Inventory};
use crate::ui::hud::Hint;
use crate::world::day::Clock;
use crate::world::landscape::NewGame;

/// The key of the game's data in the saved world.
const KEY: &str = "digger";
/// How often the player's place is saved.
const PLACE_EVERY: Duration = Duration::from_secs(2);
/// Most worlds in the folder of worlds that are listed.
pub const MOST_WORLDS: usize = 6;

/// Saves the game in a folder, or nowhere.
pub struct SavesPlugin(pub Option<PathBuf>);

impl Plugin for SavesPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(PlayedWorld(self.0.clone()))
            .add_observer(|_: On<NewGame>, mut commands: Commands| {
                commands.remove_resource::<SavedPlace>();
                commands.remove_resource::<GameIsRead>();
            })
            .add_systems(
                Update,
                (
                    continue_game,
                    (
                        put_game
                            .after(continue_game)
                            .run_if(resource_exists::<GameIsRead>)
                            .run_if(resource_changed::<Inventory>.or_else(on_timer(PLACE_EVERY))),
                        tell_trouble,
                    )
                        .after(BurrowSystems::Commit)
                        .after(inventory::read_history)
                        .before(SaveSystems),
                ),
            );
    }
}

/// The folder of the world that is played; `None` where nothing is saved.
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub struct PlayedWorld(pub Option<PathBuf>);

impl PlayedWorld {
    /// The component that saves a terrain there.
    pub fn saved(&self) -> Option<SavedWorld> {
        self.0.as_ref().map(SavedWorld::new)
    }

    /// The folder of the world of this name: in the user's folder of data, or where the name is a path.
    pub fn named(name: &str) -> Option<PathBuf> {
        let is_path = name.contains(std::path::is_separator);
        if is_path { Some(name.into()) } else { Some(folder_of_worlds()?.join(name)) }
    }

    /// The world that was played last, or a new one; `None` on machines without a folder for data.
    pub fn latest() -> Option<PathBuf> {
        let latest = worlds().into_iter().next().map(|world| world.folder);
        latest.or_else(new_world)
    }
}

/// A folder for a world that nobody has begun.
pub fn new_world() -> Option<PathBuf> {
    let all = folder_of_worlds()?;
    (1..).map(|number| all.join(format!("world {number}"))).find(|folder| !folder.exists())
}

/// A world in the user's folder.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundWorld {
    pub folder: PathBuf,
    /// When it was saved last.
    pub saved: std::time::SystemTime,
}

impl FoundWorld {
    pub fn name(&self) -> String {
        name(&self.folder)
    }
}

/// The name of a world.
pub fn name(folder: &Path) -> String {
    folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The user's worlds, those saved last first.
pub fn worlds() -> Vec<FoundWorld> {
    let Some(Ok(entries)) = folder_of_worlds().map(std::fs::read_dir) else { return Vec::new() };
    let found = entries.flatten().filter_map(|entry| {
        let folder = entry.path();
        let saved = std::fs::metadata(folder.join("journal")).and_then(|journal| journal.modified()).ok()?;
        Some(FoundWorld { folder, saved })
    });
    let mut worlds: Vec<FoundWorld> = found.collect();
    worlds.sort_by_key(|world| std::cmp::Reverse(world.saved));
    worlds.truncate(MOST_WORLDS);
    worlds
}

fn folder_of_worlds() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).filter(|folder| !folder.is_empty()).map(PathBuf::from);
    let data = if cfg!(windows) {
        folder("APPDATA")
    } else if cfg!(target_os = "macos") {
        folder("HOME").map(|home| home.join("Library/Application Support"))
    } else {
        folder("XDG_DATA_HOME").or_else(|| folder("HOME").map(|home| home.join(".local/share")))
    };
    Some(data?.join("bevy_burrow").join("worlds"))
}

/// Where the player of a saved game stands and looks.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedPlace {
    pub feet: Vec3,
    pub yaw: f32,
    pub pitch: f32,
}

/// The saved game was read, or there is none: from now on it is written.
#[derive(Resource)]
struct GameIsRead;

/// What is saved beside the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct SavedGame {
    inventory: inventory::SavedInventory,
    hour: f32,
    place: Option<SavedPlace>,
}

/// Puts the game beside the ground: the host's, where players share it.
fn put_game(
    inventory: Res<Inventory>,
    clock: Res<Clock>,
    players: Query<(&Player, Body)>,
    mut worlds: Query<&mut WorldStore>,
    mut server: Option<ResMut<GroundServer>>,
) {
    if worlds.is_empty() && server.is_none() {
        return;
    }
    let place = players.iter().next().map(|(player, body)| {
        let Player { yaw, pitch } = *player;
        SavedPlace { feet: body.feet(), yaw, pitch }
    });
    let game = SavedGame { inventory: inventory.saved(), hour: clock.hour, place };
    let Ok(bytes) = serde_json::to_vec(&game) else { return };
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

/// Goes on with the game that was saved.
fn continue_game(
    mut opened: MessageReader<WorldOpened>,
    mut served: MessageReader<GroundServerEvent>,
    mut commands: Commands,
    worlds: Query<&WorldStore>,
    server: Option<Res<GroundServer>>,
    mut inventory: ResMut<Inventory>,
    mut clock: ResMut<Clock>,
    mut hints: MessageWriter<Hint>,
) {
    let mut games = Vec::new();
    for message in opened.read() {
        if let Err(why) = &message.outcome {
            hints.write(Hint(format!("nothing is saved: {why}")));
        }
        games.push(worlds.get(message.terrain).ok().and_then(|world| world.get(KEY)));
    }
    if served.read().any(|event| matches!(event, GroundServerEvent::Opened(Ok(())))) {
        games.push(server.as_deref().and_then(|server| server.get(KEY)));
    }
    if !games.is_empty() {
        commands.insert_resource(GameIsRead);
    }
    for game in games {
        let Some(game) = game.and_then(|bytes| serde_json::from_slice::<SavedGame>(bytes).ok()) else {
            continue;
        };
        inventory.restore(&game.inventory);
        if game.hour.is_finite() {
            clock.hour = game.hour.rem_euclid(24.0);
        }
        if let Some(place) = game.place.filter(|place| place.feet.is_finite()) {
            commands.insert_resource(place);
        }
    }
}

fn tell_trouble(mut troubles: MessageReader<StoreTroubleFound>, mut hints: MessageWriter<Hint>) {
    hints.write_batch(troubles.read().map(|found| Hint(found.trouble.to_string())));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_folder_among_the_worlds_and_a_path_is_itself() {
        assert_eq!(PlayedWorld::named("here/there"), Some("here/there".into()));
        if let Some(folder) = PlayedWorld::named("mine") {
            assert!(folder.ends_with("bevy_burrow/worlds/mine"));
        }
    }

    #[test]
    fn what_is_saved_of_a_game_comes_back() {
        let mut inventory = Inventory::default();
        inventory.gain(MaterialId(6), 41);
        let tag = inventory.next_tag();
        let place = Some(SavedPlace { feet: Vec3::new(1.0, 2.0, 3.0), yaw: 0.5, pitch: -0.25 });
        let game = SavedGame { inventory: inventory.saved(), hour: 7.5, place };
        let read: SavedGame = serde_json::from_slice(&serde_json::to_vec(&game).unwrap()).unwrap();
        assert_eq!(read, game);
        let mut restored = Inventory::default();
        restored.restore(&read.inventory);
        assert_eq!(restored.amount(MaterialId(6)), 41);
        assert!(restored.next_tag() > tag);
    }
}
