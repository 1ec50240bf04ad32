//! Every text of the panel, except for numbers and errors of the library. Translations start here.

pub const BRUSH: &str = "Brush";
pub const WORLD: &str = "World";

// The left column.
/// Defines texts by name.
macro_rules! texts {
    ($($name:ident = $text:literal),* $(,)?) => { $(pub const $name: &str = $text;)* };
}

texts! {
    OPERATION = "Operation", SHAPE = "Shape", MATERIAL = "Material", FILL = "Fill",
    FILL_MATERIAL = "Fill material", SURFACE = "Surface", STROKE = "Stroke", REJECTED = "Rejected",
    POINTER = "Under the pointer", RATE = "Rate",
    RATE_HELP = "Brushes per second while the button is held. One held stroke is one undo step.",
    POWER = "Power",
    POWER_HELP = "How hard a material this brush can dig, where the terrain has digging rules",
    IMAGE = "Image", RIDGE = "Ridge", STRENGTH = "Strength", FALLOFF = "Falloff",
    FALLOFF_HELP = "Width over which the effect fades in, from the border inwards", AMOUNT = "Amount",
    HEIGHT = "Height", STEP = "Step",
}
pub const HALF_SIZES: [&str; 3] = ["Half width", "Half height", "Half depth"];
texts! {
    TURN = "Turn", RADIUS = "Radius", TUBE = "Tube", LENGTH = "Length", SINK = "Sink",
    SINK_HELP = "How deep the brush is placed: at -100 % it rests on the ground, at 0 % it is half in the ground, at 100 % just below",
}
pub const ALIGN: [&str; 2] = ["Upright", "Along the surface"];
texts! {
    ROUGH = "Rough", BUMPS = "Bumps", WIDTH = "Width", PATTERN = "Pattern",
    FITS_NOT = "This operation can't have this shape", HUT = "Hut", COPIED = "Copy", PREFAB = "Copy",
    COPY_HELP = "The last copy, or a prefab file dropped on the window", MIRRORED = "Mirrored",
    ROUNDING = "Rounding", MODEL = "Model", BOULDER = "Boulder", MODEL_HELP = "The closed meshes of a glTF file dropped on the window",
    EDITS_ONLY = "Edits only", SMOOTH_PATH = "Curved", PATH_POINTS = "Points",
    PATH_HELP = "Each click sets a point. Apply makes the path, as one edit and one undo step; Release drops the points.",
}

// A placed brush.
texts! {
    PLACE = "Place", PLACE_HELP = "Puts the brush in the middle of the view, with handles to move, turn and scale it",
    APPLY = "Apply", APPLY_HELP = "Applies the placed brush or the path. Each time is one undo step.",
    SNAP = "Snap", SNAP_HELP = "Moves the placed brush up or down to the nearest ground",
    RELEASE = "Release", RELEASE_HELP = "Lets the brush follow the mouse again, or drops the points of the path",
    NO_GROUND = "There is no ground to place the brush on", MOVE_OVER_GROUND = "Move over the ground",
    MOVE = "Move along", TURN_ABOUT = "Turn about", SCALE = "Scale along",
}
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// The operations and what they do, in the order of `ToolOperation`.
pub const OPERATIONS: [(&str, &str); 17] = [
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
    ("Road", "Levels the ground along a path, with shoulders as wide as the falloff"),
    ("Paste", "Puts down what was copied"),
    ("Reset", "Returns the ground, and what grew on it, to what it was at first"),
    ("Clear", "Removes plants and paint; Reset brings plants back"),
    ("Merge", "Builds the shape with a rounded foot"),
    ("Carve", "Digs the shape with a rounded rim"),
];
/// The shapes, in the order of `ToolShape`.
pub const SHAPES: [&str; 8] = ["Sphere", "Box", "Cylinder", "Capsule", "Cone", "Torus", "Path", "Model"];

// The plants of a terrain.
texts! {
    PLANTS = "Plants", PLANTS_STANDING = "Standing nearby", PLANTS_DENSITY = "Density",
    PLANTS_SPACING = "Spacing", PLANTS_DISTANCE = "Distance",
}

// Files, and questions about them.
texts! {
    NEW = "New", NEW_HELP = "Starts again from the ground without any edits", OPEN = "Open",
    OPEN_HELP = "Opens a level from this folder or packed file. It must have been made on the same ground.",
    SAVE = "Save", SAVE_HELP = "Saves the level: one file for each region, for version control",
    SAVE_AS = "Save as", SAVE_AS_HELP = "Saves the level in the folder that is typed above",
    FOLDER = "Level folder", UNSAVED = "unsaved changes",
    UNSAVED_QUIT = "There are unsaved changes. They will be lost if you quit without saving them.",
    UNSAVED_OPEN = "There are unsaved changes. They will be lost if another level is opened and they are not saved.",
    UNSAVED_NEW = "There are unsaved changes. They will be lost if you start a new level without saving them.",
    NO_FOLDER = "Type the level's folder first",
    PACKED_FILE = "That is a packed level. Type the folder to save in.",
    SAVE_ELSEWHERE = "The changes are not saved: that folder holds the level to open. Save them in another folder first.",
    OTHER_GROUND = "The level was made on another ground, so it can't be opened here", MESSAGE = "Message",
    SAVE_CHANGES = "Save changes", DISCARD = "Discard changes", CANCEL = "Cancel", REPLACE = "Replace",
    SAVING = "Saving the level ...", OPENING = "Opening the level ...", STARTED_ANEW = "Started a new level",
    STILL_BUSY = "A level is still being saved or opened. Try again in a moment.",
}

// The right column.
texts! {
    UNDO = "Undo", REDO = "Redo", HISTORY_STEPS = "Steps", CHECK_SEAMS = "Check seams",
    CHECK_SEAMS_HELP = "Checks every triangle of the terrain", CHECKING = "Checking every seam ...",
    SAVE_PICTURE = "Save picture", TAKING_PICTURE = "Taking a picture ...",
    NO_PICTURE = "The picture could not be taken", NO_PICTURE_HERE = "No picture can be taken of this camera",
    TERRAIN = "Terrain", NO_TERRAIN = "There is no terrain.", SIZE = "Size", VOXEL = "Voxel size",
    CHUNK = "Chunk size", REVISION = "Revision", RULES = "Digging rules", BEDROCK = "Bedrock",
    BELOW = "Below", BELOW_HELP = "Nothing below this height can be dug", RULE_OF = "Rule of ",
    HARDNESS = "Hardness",
    HARDNESS_HELP = "A brush of this power or more digs at full speed; with half of it or less, it does not dig",
    UNBREAKABLE = "Unbreakable", PROTECTED = "Protected boxes", LOOSE = "Loose pieces",
    LOOSE_FIND = "Find after digs",
}
pub const LOOSE_SIZES: [(&str, &str); 3] = [
    ("Remove up to", "Pieces of up to this many voxels vanish"),
    ("Detach up to", "Larger pieces of up to this many voxels break off and fall"),
    ("Search up to", "Anything larger than this many voxels counts as part of the ground"),
];
pub const VOXELS: &str = " voxels";
pub const LOOK: &str = "Look";
pub const QUALITY: [&str; 2] = ["Plain", "Fine"];
/// Sizes of the panel, and their names.
pub const UI_SCALES: [(f32, &str); 5] =
    [(0.75, "75"), (1.0, "100"), (1.25, "125"), (1.5, "150"), (2.0, "200")];
texts! {
    VARIETY = "Variety", VARIETY_HELP = "How much colours vary from place to place",
    SCALE_STARTS = "Scale from", SCALE_ENDS = "Scale to",
    SCALE_HELP = "Distances at which textures start to grow, and where they are six times as large",
    SETTINGS = "Settings", UI_SCALE = "Size of the panel in percent", UI_SCALE_HELP = "Also Ctrl with + and -", UNDO_MEMORY = "History",
    UNDO_MEMORY_HELP = "Memory that the undo history of this terrain may use", SWAPS = "Swaps",
    SWAPS_HELP = "Meshes that are replaced per frame, at most, after edits. Fewer make frames smoother.",
    LOADS = "Loads",
    LOADS_HELP = "Meshes that are uploaded per frame, at most, while a terrain loads. Fewer make loading slower.",
    DEBUG = "Debug views", REACH = "Reach", NEAR = "Near", NEAR_HELP = "How far normals, wires and walkable ground reach",
}

// Diagnostics.
texts! {
    DIAGNOSTICS = "Diagnostics", TRANSACTION = "transaction", PERCENTILES = "p50, p95, p99",
    SWAPPED = "meshes swapped per frame", FRAME = "frame", MAIN_THREAD = "main-thread time", QUEUE = "Queue",
    BRUSHES = "Brushes", COMMITS = "Commits", LEVELS = "Nodes by level of detail",
}
#[rustfmt::skip]
pub const MEMORY: [&str; 6] = [
    "Ground", "Samples", "Materials", "Meshes", "Parts", "Index",
];
texts! {
    ALL_MEMORY = "All memory", EDITS_MEMORY = "Of edits", GPU_MESHES = "Meshes on the GPU", FIELDS = "Fields",
    CHUNKS = "Chunks", BRICKS = "Bricks", MASK_CELLS = "Mask cells", HASH = "Hash", BACKEND = "Backend",
    CPU = "CPU", CPU_UNOPENED = "CPU (CUDA not opened yet)", CPU_OPENING = "CPU (opening CUDA)",
    CPU_ONLY = "CPU (no CUDA device)",
}
pub const STAGES: [&str; 2] = ["CPU stages", "CUDA stages"];
texts! {
    LAST = "Last stage", EDITED = "bricks edited", MESHED = "blocks meshed",
}
pub const EXPECTED: [&str; 2] = ["CPU estimate", "CUDA estimate"];

/// Names of the materials of the plugin's default ground look, by id.
#[rustfmt::skip]
pub const MATERIALS: [&str; 12] = [
    "Rock", "Grass", "Sand", "Snow", "Clay", "Concrete", "Coal", "Gold", "Soil", "Sandstone", "Shale",
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
