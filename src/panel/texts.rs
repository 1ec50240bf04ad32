//! Every text of the panel, except for numbers and errors of the library. Translations start here.

pub const BRUSH: &str = "Brush";
pub const WORLD: &str = "World";

// The left column.
pub const OPERATION: &str = "Operation";
pub const SHAPE: &str = "Shape";
pub const MATERIAL: &str = "Material";
pub const FILL: &str = "Fill";
pub const FILL_MATERIAL: &str = "Fill material";
pub const SURFACE: &str = "Surface";
pub const STROKE: &str = "Stroke";
pub const REJECTED: &str = "Rejected";
pub const POINTER: &str = "Under the pointer";
pub const RATE: &str = "Rate";
pub const RATE_HELP: &str = "Brushes per second while the button is held. One held stroke is one undo step.";
pub const POWER: &str = "Power";
pub const POWER_HELP: &str = "How hard a material this brush can dig, where the terrain has digging rules";
pub const IMAGE: &str = "Image";
pub const RIDGE: &str = "Ridge";
pub const STRENGTH: &str = "Strength";
pub const FALLOFF: &str = "Falloff";
pub const FALLOFF_HELP: &str = "Over this width the effect fades out, from the border inwards";
pub const AMOUNT: &str = "Amount";
pub const HEIGHT: &str = "Height";
pub const STEP: &str = "Step";
pub const HALF_SIZES: [&str; 3] = ["Half width", "Half height", "Half depth"];
pub const TURN: &str = "Turn";
pub const RADIUS: &str = "Radius";
pub const TUBE: &str = "Tube";
pub const LENGTH: &str = "Length";
pub const SINK: &str = "Sink";
pub const SINK_HELP: &str = "How deep the brush is placed: at -100 % it rests on the ground, at 0 % it is half in the ground, at 100 % just below";
pub const ALIGN: [&str; 2] = ["Upright", "Along the surface"];
pub const ROUGH: &str = "Rough";
pub const BUMPS: &str = "Bumps";
pub const WIDTH: &str = "Width";
pub const PATTERN: &str = "Pattern";
pub const TORUS_STAMP: &str = "A stamp can't have this shape";
/// The operations and what they do, in the order of `ToolOperation`.
pub const OPERATIONS: [(&str, &str); 11] = [
    ("Dig", "Removes ground"),
    ("Build", "Fills the shape with ground"),
    ("Paint", "Changes the material of the ground"),
    ("Smooth", "Evens out bumps and edges"),
    ("Sharpen", "Accentuates bumps and edges"),
    ("Flatten", "Flattens along the slope"),
    ("Level", "Levels the ground to a set height"),
    ("Raise", "Raises the surface"),
    ("Lower", "Lowers the surface"),
    ("Stamp", "Presses an image onto the ground"),
    ("Terrace", "Cuts slopes into steps"),
];
/// The shapes, in the order of `ToolShape`.
pub const SHAPES: [&str; 6] = ["Sphere", "Box", "Cylinder", "Capsule", "Cone", "Torus"];

// Files, and questions about them.
pub const NEW: &str = "New";
pub const NEW_HELP: &str = "Starts again from the ground without any edits";
pub const OPEN: &str = "Open";
pub const OPEN_HELP: &str =
    "Opens a level from this folder or packed file. It must have been made on the same ground.";
pub const SAVE: &str = "Save";
pub const SAVE_HELP: &str = "Saves the level: one file for each region, for version control";
pub const SAVE_AS: &str = "Save as";
pub const SAVE_AS_HELP: &str = "Saves the level in the folder that is typed above";
pub const FOLDER: &str = "Level folder";
pub const UNSAVED: &str = "unsaved changes";
pub const UNSAVED_QUESTION: &str = "There are unsaved changes. They will be lost unless you save them.";
pub const SAVE_CHANGES: &str = "Save changes";
pub const DISCARD: &str = "Discard changes";
pub const CANCEL: &str = "Cancel";
pub const REPLACE: &str = "Replace";
pub const SAVING: &str = "Saving the level ...";
pub const OPENING: &str = "Opening the level ...";
pub const STARTED_ANEW: &str = "Started a new level";

// The right column.
pub const UNDO: &str = "Undo";
pub const REDO: &str = "Redo";
pub const HISTORY_STEPS: &str = "Steps";
pub const CHECK_SEAMS: &str = "Check seams";
pub const CHECK_SEAMS_HELP: &str = "Checks every triangle of the terrain";
pub const CHECKING: &str = "Checking every seam ...";
pub const SAVE_PICTURE: &str = "Save picture";
pub const TAKING_PICTURE: &str = "Taking a picture ...";
pub const NO_PICTURE: &str = "The picture could not be taken";
pub const NO_PICTURE_HERE: &str = "No picture can be taken of this camera";
pub const TERRAIN: &str = "Terrain";
pub const NO_TERRAIN: &str = "There is no terrain.";
pub const SIZE: &str = "Size";
pub const VOXEL: &str = "Voxel size";
pub const CHUNK: &str = "Chunk size";
pub const REVISION: &str = "Revision";
pub const RULES: &str = "Digging rules";
pub const BEDROCK: &str = "Bedrock";
pub const BELOW: &str = "Below";
pub const BELOW_HELP: &str = "Nothing below this height can be dug";
pub const RULE_OF: &str = "Rule of ";
pub const HARDNESS: &str = "Hardness";
pub const HARDNESS_HELP: &str =
    "A brush of this power or more digs at full speed; with half of it or less, it does not dig";
pub const UNBREAKABLE: &str = "Unbreakable";
pub const PROTECTED: &str = "Protected boxes";
pub const LOOSE: &str = "Loose pieces";
pub const LOOSE_FIND: &str = "Find after digs";
pub const LOOSE_SIZES: [(&str, &str); 3] = [
    ("Remove up to", "Pieces of up to this many voxels vanish"),
    ("Detach up to", "Larger pieces of up to this many voxels break off and fall"),
    ("Search up to", "Anything larger than this many voxels counts as part of the ground"),
];
pub const VOXELS: &str = " voxels";
pub const LOOK: &str = "Look";
pub const QUALITY: [&str; 2] = ["Plain", "Fine"];
pub const VARIETY: &str = "Variety";
pub const VARIETY_HELP: &str = "How much colours vary from place to place";
pub const SCALE_STARTS: &str = "Scale from";
pub const SCALE_ENDS: &str = "Scale to";
pub const SCALE_HELP: &str =
    "Distances at which textures start to grow, and where they are six times as large";
pub const SETTINGS: &str = "Settings";
pub const UNDO_MEMORY: &str = "History";
pub const UNDO_MEMORY_HELP: &str = "Memory that the undo history of this terrain may use";
pub const SWAPS: &str = "Swaps";
pub const SWAPS_HELP: &str =
    "Meshes that are replaced per frame, at most, after edits. Fewer make frames smoother.";
pub const LOADS: &str = "Loads";
pub const LOADS_HELP: &str =
    "Meshes that are uploaded per frame, at most, while a terrain loads. Fewer make loading slower.";
pub const DEBUG: &str = "Debug views";
pub const REACH: &str = "Reach";
pub const NEAR: &str = "Near";
pub const NEAR_HELP: &str = "How far normals and wires reach";

// Diagnostics.
pub const DIAGNOSTICS: &str = "Diagnostics";
pub const TRANSACTION: &str = "transaction";
pub const PERCENTILES: &str = "p50, p95, p99";
pub const SWAPPED: &str = "meshes swapped per frame";
pub const FRAME: &str = "frame";
pub const MAIN_THREAD: &str = "main-thread time";
pub const QUEUE: &str = "Queue";
pub const BRUSHES: &str = "Brushes";
pub const COMMITS: &str = "Commits";
pub const LEVELS: &str = "Squares by level";
pub const MEMORY: [&str; 6] = ["Ground", "Samples", "Materials", "Meshes", "Parts", "Index"];
pub const ALL_MEMORY: &str = "All memory";
pub const EDITS_MEMORY: &str = "Of edits";
pub const GPU_MESHES: &str = "Meshes on the GPU";
pub const FIELDS: &str = "Fields";
pub const CHUNKS: &str = "Chunks";
pub const BRICKS: &str = "Bricks";
pub const MASK_CELLS: &str = "Mask cells";
pub const HASH: &str = "Hash";
pub const BACKEND: &str = "Backend";
pub const CPU: &str = "CPU";
pub const CPU_UNOPENED: &str = "CPU (CUDA not opened yet)";
pub const CPU_OPENING: &str = "CPU (opening CUDA)";
pub const CPU_ONLY: &str = "CPU (no CUDA device)";
pub const STAGES: [&str; 2] = ["CPU stages", "CUDA stages"];
pub const LAST: &str = "Last stage";
pub const EDITED: &str = "bricks edited";
pub const MESHED: &str = "blocks meshed";
pub const EXPECTED: [&str; 2] = ["CPU estimate", "CUDA estimate"];

/// Names of the materials of the plugin's default ground look, by id.
pub const MATERIALS: [&str; 12] = [
    "Rock",
    "Grass",
    "Sand",
    "Snow",
    "Clay",
    "Concrete",
    "Coal",
    "Gold",
    "Soil",
    "Sandstone",
    "Shale",
    "Gravel",
];

pub fn rejected(why: &str) -> String {
    format!("{REJECTED}: {why}")
}

pub fn opened(what: impl std::fmt::Display) -> String {
    format!("Opened {what}")
}

pub fn saved(what: impl std::fmt::Display) -> String {
    format!("Saved to {what}")
}

pub fn not_saved_picture(folder: impl std::fmt::Display, why: impl std::fmt::Display) -> String {
    format!("The picture could not be saved in {folder}: {why}")
}

pub fn replace(what: impl std::fmt::Display) -> String {
    format!("{what} exists already. Its content will be replaced.")
}

pub fn steps(undos: usize, redos: usize, bytes: &str) -> String {
    format!("{undos} undo, {redos} redo ({bytes})")
}

pub fn closed(triangles: &str) -> String {
    format!("No open edges ({triangles} triangles)")
}

pub fn at_revision(revision: u64, text: &str) -> String {
    format!("Revision {revision}: {text}")
}
