//! Saved games: the world that is played, and the game's data that is saved with its ground.
//!
//! The plugin saves the ground. Inventory, time of day and the player's place are stored with it in the frame in which
//! they change, so that after a crash nothing is duplicated or lost.

use std::path::PathBuf;
use std::time::Duration;

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
use crate::world::day::Clock;
use crate::world::folders::{self, WorldsFolder};
use crate::world::landscape::NewGame;

/// The key of the game's data in the saved world.
const KEY: &str = "digger";
/// How often the player's place is saved.
const PLACE_EVERY: Duration = Duration::from_secs(2);

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

/// The seed of the world that is played: the host's, where it is another machine's.
pub fn seed(played: &PlayedWorld, party: &Party) -> u32 {
    match (party, &played.0) {
        (Party::Guest(_, seed), _) => *seed,
        (_, Some(folder)) => folders::seed(folder),
        (_, None) => 0,
    }
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
}
