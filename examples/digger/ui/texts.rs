//! Every text that the game shows, except for numbers and errors of the library. Translations start here.

use std::fmt::Display;

/// Defines texts by name.
macro_rules! texts {
    ($($name:ident = $text:literal),* $(,)?) => { $(pub const $name: &str = $text;)* };
}

texts! {
    TAGLINE = "a real landscape that you can dig", PLAY = "Play", CONTINUE = "Continue",
    NEW_WORLD = "New world", WORLDS = "Worlds", MULTIPLAYER = "Multiplayer", SETTINGS = "Settings",
    CONTROLS = "Controls", HELP = "Help", QUIT = "Quit", BACK = "Back", PAUSED = "Paused", RESUME = "Resume",
    MAIN_MENU = "Main menu", SAVE_AND_QUIT = "Save and quit", CREATING_TEXTURES = "Creating textures",
    READING_WORLD = "Reading the world", JOINING = "Joining", LOADING_LANDSCAPE = "Loading the landscape",
    MORE_WORLDS = "More worlds", NO_WORLDS = "There are no saved worlds yet.",
    WORLDS_HELP = "Choose a world to play it. Press > or the right arrow key to rename, duplicate or delete it.",
    WORLD_NAME = "Name", SEED = "Seed",
    SEED_HELP = "The seed decides where hills, layers of rock and ore are. The same seed makes the same world.",
    CREATE = "Create and play", WORLD = "World", PLAY_WORLD = "Play this world", DUPLICATE = "Duplicate",
    DELETE = "Delete", CURRENT = ", open now", OPEN_ELSEWHERE = ", open in another window", COPY = "copy",
    NO_FOLDER = "this machine has no folder for saved data", PLAY_UNSAVED = "Play without saving",
    WAIT = "Please wait ...", NO_ANSWER = "it does not answer", SURE = "Are you sure?", NOT_POSSIBLE = "Not possible", CANCEL = "Cancel",
    RESET = "Reset", RESET_CONTROLS = "All keys and buttons get their default actions.",
    RESET_SETTINGS = "All settings on this page get their default values.",
    NEW_UNSAVED = "Nothing is saved on this machine: the world that you have dug will be lost.",
    YOUR_NAME = "Your name", HOST_ADDRESS = "Host address", HOST = "Host this world",
    STOP_HOSTING = "Stop hosting", LEAVE = "Leave", JOIN = "Join", THIS_MACHINE = "this machine's address",
    NOT_SAVED = ". Nothing is saved.", CHOOSE_ACTION = "Choose an action, then press its new key or button.",
    PRESS_KEY = "press a key ...", ON = "on", OFF = "off",
}
/// The rows of the settings page.
#[rustfmt::skip]
pub const SETTING: [&str; 11] = [
    "Look sensitivity", "Invert look (Y axis)", "Field of view", "View distance", "Quality", "Interface size",
    "Day length", "Brush radius", "Build shape", "Limited materials", "Volume",
];
pub const QUALITY: [&str; 3] = ["low", "medium", "high"];
pub const SHAPES: [&str; 3] = ["sphere", "cube", "beam"];
pub const SETTINGS_NOTES: &str = "View distance: anything farther away fades into the sky. Distant terrain is low-detail, so a \
     long view distance is cheap. Quality: of shadows, textures and distant terrain.";

pub const HELP_SUMMARY: &str = "You can dig every hill, and build with what you have dug.";
pub const HELP_GAMEPAD: &str =
    "A gamepad's left stick walks and selects menu items. Its right stick looks around.";
#[rustfmt::skip]
pub const HELP_KEYS: [&str; 14] = [
    "walk", "run", "jump", "use the tool; hold to repeat", "build with the chosen material", BRUSH_SIZE,
    "choose a material", "build shape", "next tool", "previous tool", "headlamp", "undo, redo",
    "terrain panel", "pause",
];

/// The actions, in the order of `Action`.
#[rustfmt::skip]
pub const ACTIONS: [&str; 29] = [
    "walk forward", "walk back", "walk left", "walk right", "run", "jump", "use tool", "build", "pickaxe",
    "shovel", "drill", "builder", "painter", "bomb", "lamp", "ball", "next tool", "previous tool",
    "next material", "previous material", "larger brush", "smaller brush", "build shape", "headlamp", "undo",
    "redo", "help", "terrain panel", "pause",
];

/// The tools and what they are for, in the order of `Tool`.
pub const TOOLS: [(&str, &str); 8] = [
    ("pickaxe", "breaks the ground, blow by blow"),
    ("shovel", "smooths rough ground"),
    ("drill", "drives a tunnel straight ahead"),
    ("builder", "places what you have dug"),
    ("painter", "repaints the ground"),
    ("bomb", "bounces, and blasts a cave"),
    ("lamp", "stays where you put it"),
    ("ball", "bounces, and rolls downhill"),
];

/// The materials, by id.
pub const MATERIALS: [&str; 11] =
    ["rock", "turf", "sand", "snow", "clay", "concrete", "coal", "gold", "soil", "sandstone", "shale"];
pub const BEDROCK: &str = "bedrock";

/// The directions of the compass, clockwise from north.
pub const COMPASS: [&str; 8] = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];
texts! {
    BRUSH_SIZE = "brush size", CORE_SAMPLE = "Under the crosshair", HEADLAMP_ON = "headlamp", SAVING = "saving", SOMEBODY = "somebody",
    TOO_FAR = "Too far away. Move closer.", UNBREAKABLE = "Bedrock can't be broken.",
    BROUGHT_BACK = "You are back on solid ground.",
    HOST_LOST = "The host can't be reached. What you dig meanwhile is sent later.",
    OTHER_VERSION = "The host has another version of the game.", ARRIVED = "has joined", LEFT = "has left",
}

pub fn continue_world(name: &str) -> String {
    format!("{CONTINUE} {name}")
}

pub fn is_open(name: &str) -> String {
    format!("\"{name}\" is open in another window. Close it there first.")
}

pub fn not_opened(name: &str, why: impl Display) -> String {
    format!("\"{name}\" can't be played: {why}.")
}

pub fn delete_world(name: &str) -> String {
    format!("The world \"{name}\" and everything in it will be deleted. This can't be undone.")
}

pub fn failed(what: &str, why: impl Display) -> String {
    format!("{what} failed: {why}")
}

pub fn join_at(address: impl Display) -> String {
    format!("Others can join at {address}")
}

pub fn would_join_at(address: impl Display) -> String {
    format!("While you host, others can join at {address}")
}

pub fn joined(host: impl Display) -> String {
    format!("You have joined {host}")
}

pub fn keeps_keys(action: &str) -> String {
    format!("\"{action}\" keeps its keys.")
}

pub fn key_without_name(action: &str) -> String {
    format!("This key has no name and can't be saved. {}", keeps_keys(action))
}

pub fn key_moved(key: &str, from: &str, to: &str) -> String {
    format!("{key} is now \"{to}\", and no longer \"{from}\".")
}

pub fn key_bound(key: &str, action: &str) -> String {
    format!("{key} is now \"{action}\".")
}

pub fn not_enough(material: &str) -> String {
    format!("Not enough {material}. Dig some first.")
}

pub fn too_hard(material: &str) -> String {
    format!("This tool is too weak for {material}.")
}

pub fn hard(material: &str) -> String {
    format!("The {material} is hard. Keep digging.")
}

pub fn debt(amount: i64, material: &str) -> String {
    format!("You owe {amount} {material}. Dig more to pay it back.")
}

pub fn lamps_used_up(most: usize) -> String {
    format!("There are only {most} lamps, so the oldest one was moved here.")
}

pub fn nothing_saved(why: impl Display) -> String {
    format!("Nothing is saved: {why}")
}

pub fn nobody_can_join(why: impl Display) -> String {
    format!("Nobody can join: {why}")
}

pub fn unreachable(host: impl Display, why: impl Display) -> String {
    format!("{host} can't be reached: {why}")
}

pub fn removed(why: impl Display) -> String {
    format!("The host removed you: {why}")
}

pub fn other_seed() -> String {
    removed("the world has another seed. Join with the whole address that the host shows.")
}

pub fn players(count: usize) -> String {
    format!("{count} players")
}

/// The direction of view, the height, and how deep below the ground that is.
pub fn place(direction: &str, height: f32, depth: f32) -> String {
    let depth = if depth >= 1.0 { format!(", {depth:.0} m underground") } else { String::new() };
    format!("{direction}   {height:.0} m{depth}")
}

/// How long ago something was, in minutes.
pub fn ago(minutes: u64) -> String {
    match minutes {
        0 => "just now".into(),
        1..60 => format!("{minutes} min ago"),
        60..2880 => format!("{} h ago", minutes / 60),
        _ => format!("{} days ago", minutes / 1440),
    }
}

/// The usual name of a key, from Bevy's: `ShiftLeft` is "Left Shift".
pub fn key(name: &str) -> String {
    let short = match name {
        "Escape" => "Esc",
        "ControlLeft" => "Left Ctrl",
        "ControlRight" => "Right Ctrl",
        "Equal" => "=",
        "Minus" => "-",
        "BracketLeft" => "[",
        "BracketRight" => "]",
        "Backquote" => "`",
        "Comma" => ",",
        "Period" => ".",
        "Slash" => "/",
        "Backslash" => "\\",
        "Semicolon" => ";",
        "Quote" => "'",
        _ => "",
    };
    if !short.is_empty() {
        return short.into();
    }
    for prefix in ["Key", "Digit", "Arrow"] {
        if let Some(rest) = name.strip_prefix(prefix).filter(|rest| !rest.is_empty()) {
            return rest.into();
        }
    }
    for side in ["Left", "Right"] {
        if let Some(rest) = name.strip_suffix(side).filter(|rest| !rest.is_empty()) {
            return format!("{side} {rest}");
        }
    }
    spaced(name)
}

pub fn mouse(button: &str) -> String {
    format!("{} mouse", spaced(button))
}

pub const WHEEL: [&str; 2] = ["Wheel up", "Wheel down"];

/// The usual name of a gamepad button, from Bevy's.
pub fn pad(button: &str) -> String {
    match button {
        "South" => "Pad A",
        "East" => "Pad B",
        "West" => "Pad X",
        "North" => "Pad Y",
        "LeftTrigger" => "LB",
        "RightTrigger" => "RB",
        "LeftTrigger2" => "LT",
        "RightTrigger2" => "RT",
        "LeftThumb" => "Left stick",
        "RightThumb" => "Right stick",
        "DPadUp" => "D-pad up",
        "DPadDown" => "D-pad down",
        "DPadLeft" => "D-pad left",
        "DPadRight" => "D-pad right",
        other => return format!("Pad {}", spaced(other)),
    }
    .into()
}

/// `PageUp` as "Page Up".
fn spaced(name: &str) -> String {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && words.ends_with(|last: char| last.is_lowercase()) {
            words.push(' ');
        }
        words.push(letter);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_have_their_usual_names() {
        let keys =
            ["KeyW", "Digit1", "ShiftLeft", "ControlRight", "ArrowUp", "Escape", "PageUp", "F3", "Space"];
        let names = ["W", "1", "Left Shift", "Right Ctrl", "Up", "Esc", "Page Up", "F3", "Space"];
        assert_eq!(keys.map(key), names);
        assert_eq!([mouse("Left"), pad("RightTrigger2"), pad("DPadUp")], ["Left mouse", "RT", "D-pad up"]);
        assert_eq!([key("ArrowLeft"), key("Left")], ["Left", "Left"]);
    }

    #[test]
    fn times_and_places_are_told_in_words() {
        assert_eq!([0, 59, 180, 5000].map(ago), ["just now", "59 min ago", "3 h ago", "3 days ago"]);
        assert_eq!(place("NE", 63.6, 0.4), "NE   64 m");
        assert_eq!(place("S", -3.0, 12.2), "S   -3 m, 12 m underground");
    }
}
