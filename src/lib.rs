#![deny(unsafe_code)]
#![warn(missing_docs)]
//! # bevy_burrow
//!
//! Ground that players can dig, for [Bevy](https://bevy.org).
//!
//! The world is a heightmap: cheap, huge, and familiar to every artist. Where players dig or build, marching cubes take
//! over, without a visible seam: both sides compute the same bits, so there is no open edge and no jump in shading, on
//! any slope.
//!
//! # Quick start
//!
//! With the feature `free_camera` of Bevy:
//!
//! ```no_run
//! # #[cfg(feature = "examples")] {
//! use bevy::camera_controller::free_camera::{FreeCamera, FreeCameraPlugin};
//! use bevy::prelude::*;
//! use bevy_burrow::prelude::*;
//!
//! fn main() -> AppExit {
//!     App::new().add_plugins((DefaultPlugins, game)).run()
//! }
//!
//! fn game(app: &mut App) {
//!     app.add_plugins((BurrowPlugins, FreeCameraPlugin))
//!         .insert_resource(ClearColor(Color::srgb(0.6, 0.75, 0.95)))
//!         .insert_resource(GlobalAmbientLight { brightness: 600.0, ..default() })
//!         .add_systems(Startup, landscape)
//!         .add_systems(Update, dig.before(BurrowSystems::Collect));
//! }
//!
//! fn landscape(mut commands: Commands) -> Result {
//!     let grass_on_rock = ColumnMaterial { base: MaterialId(0), overlay: MaterialId(1), blend: 255 };
//!     let ground = Ground::from_noise(512, 512, &NoiseHeights { amplitude: 40.0, scale: 300.0, ..default() })?
//!         .with_materials(&MaterialControl::Uniform(grass_on_rock))?;
//!     let terrain = Terrain::new(ground, &TerrainSettings::default())?;
//!     commands.spawn((terrain, GroundLook::default())); // or a MeshMaterial3d of your own
//!     commands.spawn((
//!         DirectionalLight { shadow_maps_enabled: true, ..default() },
//!         Transform::from_xyz(1.0, 0.8, 0.3).looking_at(Vec3::ZERO, Vec3::Y),
//!     ));
//!     commands.spawn((
//!         Camera3d::default(),
//!         // W, A, S, D, Q and E move; the right mouse button, held, looks around.
//!         FreeCamera { walk_speed: 20.0, run_speed: 60.0, ..default() },
//!         Transform::from_xyz(256.0, 40.0, 400.0).looking_at(Vec3::new(256.0, 0.0, 256.0), Vec3::Y),
//!     ));
//!     Ok(())
//! }
//!
//! fn dig(
//!     mouse: Res<ButtonInput<MouseButton>>,
//!     window: Single<&Window>,
//!     camera: Single<(&Camera, &GlobalTransform)>,
//!     terrains: Terrains,
//!     mut brushes: MessageWriter<Brush>,
//! ) {
//!     let (camera, place) = *camera;
//!     if mouse.just_pressed(MouseButton::Left)
//!         && let Some(cursor) = window.cursor_position()
//!         && let Ok(ray) = camera.viewport_to_world(place, cursor)
//!         && let Some(hit) = terrains.raycast(ray, 500.0)
//!     {
//!         brushes.write(Brush::dig(Shape::sphere(hit.position, 6.0)));
//!     }
//! }
//! # }
//! ```
//!
//! # What is where
//!
//! | a game wants | it uses |
//! | --- | --- |
//! | a landscape | [`Ground`](ground::Ground) from an image, noise or a function; [`MaterialControl`](ground::MaterialControl) |
//! | heights from TIFF, EXR, satellites, tiles | [`ElevationGrid`](ground::ElevationGrid) |
//! | materials from splat maps and id maps | [`MaterialMap`](ground::MaterialMap) |
//! | to put it into the world | the [`Terrain`](terrain::Terrain) component; `BurrowPlugins` |
//! | another level | a new [`Terrain`](terrain::Terrain), inserted in place of the old one |
//! | ground to the horizon | `LevelsOfDetail` on the terrain; [`Ground::from_source`](ground::Ground::from_source) |
//! | to save the world | `SavedWorld` on the terrain; `WorldStore` for the game's own data (feature `store`) |
//! | sculpted levels as assets | `BurrowLevel`, `StartLevel` (feature `store`) |
//! | several players | `GroundServer` and `SharedTerrain` (feature `replicon`); `net` for other transports (feature `net`) |
//! | to dig, build, paint | [`Brush`](brush::Brush) messages; [`Shape`](brush::Shape), [`Roughness`](brush::Roughness) |
//! | to sculpt | [`Brush::smooth`](brush::Brush::smooth), `flatten`, `level`, `raise`, `stamp`, `reset`, ...; [`Blend`](brush::Blend) |
//! | to copy a place and paste it | [`World::copy`](terrain::World::copy), [`Paste`](brush::Paste) |
//! | glTF of the surface | [`World::to_glb`](terrain::World::to_glb) |
//! | ground that resists | [`Terrain::set_rules`](terrain::Terrain::set_rules) with [`DiggingRules`](volume::DiggingRules) |
//! | to learn the result | `BrushApplied` messages with a [`Receipt`](terrain::Receipt); entity events of chunks and fields |
//! | to undo it | `Undo` and `Redo` messages, `HistoryMoved`; [`Terrain::history`](terrain::Terrain::history) |
//! | ground that falls when it is cut off | the component [`LooseSettings`](terrain::LooseSettings), `LoosePieceFound` messages, `physics::DebrisPlugin` (feature `avian`) |
//! | to query the ground | the `Terrains` system parameter: ray cast, height, spans, `is_ready` |
//! | ground that looks real | `GroundLook` on the terrain; `GroundTextures` for the game's own textures |
//! | bodies on the ground, a body that walks | `physics` (feature `avian`): `TerrainPhysicsPlugin`, `ColliderSource`, `Character` |
//! | paths over ground that is dug | `Navigation`, `NavigationSource` and the `NavigationPlugin` of `paths` (feature `landmass`) |
//! | plants and stones that disappear and return with the ground | `Plants`, `PlantLooks` and the `plants` plugins (feature `scatter`) |
//! | other cameras, no shadows | `RenderLayers`, `NotShadowCaster`, `NotShadowReceiver` on the terrain |
//! | more from the same surfaces, in the same commit | `SurfaceProcessor`s |
//! | a custom look | any `Material` through `TerrainMaterialPlugin`; `MaterialColors` |
//! | an editor's panel | `BurrowPanelPlugin`, and `BrushTool` for the selected brush (feature `egui`) |
//! | debug views of the model | `BurrowDebugPlugin` and the switches of `BurrowDebug` (feature `debug`) |
//! | proof | [`World::check_seams`](terrain::World::check_seams), [`World::hash`](terrain::World::hash) |
//!
//! # The parts, a few lines each
//!
//! **Sculpting**: edits like digs, with the same closed seams, undone like them.
//!
//! ```
//! # #[cfg(feature = "plugin")] {
//! # use bevy::prelude::*;
//! # use bevy_burrow::prelude::*;
//! fn sculpt(hit: &TerrainHit, hill: GreyImage, brushes: &mut MessageWriter<Brush>) {
//!     let at = Shape::sphere(hit.position, 8.0);
//!     brushes.write(Brush::smooth(at, 0.5));
//!     brushes.write(Brush::flatten(at, hit.position, hit.normal).with_falloff(2.0));
//!     brushes.write(Brush::raise(at, 1.0).with_material(MaterialId(3)));
//!     brushes.write(Brush::stamp(at, Stamp::new(hill, hit.position, Vec2::splat(12.0), 4.0).onto(hit.normal)));
//! }
//! # }
//! ```
//!
//! **Undo and redo**, by stroke or by frame, and to the bit.
//!
//! ```
//! # #[cfg(feature = "plugin")] {
//! # use bevy::prelude::*;
//! # use bevy_burrow::prelude::*;
//! fn keys(keys: Res<ButtonInput<KeyCode>>, mut undo: MessageWriter<Undo>, mut redo: MessageWriter<Redo>) {
//!     if keys.just_pressed(KeyCode::KeyZ) {
//!         undo.write(Undo::default());
//!     }
//!     if keys.just_pressed(KeyCode::KeyY) {
//!         redo.write(Redo::default());
//!     }
//! }
//! # }
//! ```
//!
//! **Digging rules**, and receipts that report what they refused.
//!
//! ```
//! # #[cfg(feature = "plugin")] {
//! # use bevy::prelude::*;
//! # use bevy_burrow::prelude::*;
//! fn toughen(mut terrains: Query<&mut Terrain, Added<Terrain>>) -> Result {
//!     let (granite, adamant) = (MaterialId(2), MaterialId(9));
//!     for mut terrain in &mut terrains {
//!         let rules = DiggingRules::default().with_hardness(granite, 100).with_unbreakable(adamant);
//!         terrain.set_rules(rules.with_bedrock(-20))?;
//!     }
//!     Ok(())
//! }
//!
//! fn drill(at: Vec3, mut brushes: MessageWriter<Brush>) {
//!     brushes.write(Brush::dig(Shape::sphere(at, 2.0)).with_power(75)); // half speed in granite
//! }
//!
//! fn complain(mut answers: MessageReader<BrushApplied>) {
//!     for answer in answers.read() {
//!         if let Ok(applied) = &answer.receipt.outcome
//!             && applied.refused.total() > 0
//!         {
//!             info!("{} voxels would not give way", applied.refused.total());
//!         }
//!     }
//! }
//! # }
//! ```
//!
//! **Loose pieces**: ground that a dig cuts off falls, lies still and crumbles (feature `avian`); without that
//! feature it is reported as a message. `DebrisPlugin` needs the `PhysicsPlugins`, the `TerrainPhysicsPlugin` and a
//! `ColliderSource`, which the next part shows.
//!
//! ```
//! # #[cfg(feature = "avian")] {
//! # use bevy::prelude::*;
//! # use bevy_burrow::physics::DebrisPlugin;
//! # use bevy_burrow::prelude::*;
//! fn loosen(app: &mut App, terrain: Terrain) {
//!     app.add_plugins(DebrisPlugin);
//!     app.world_mut().spawn((terrain, LooseSettings { crumbs: 8, debris: 4096, ..default() }));
//! }
//! # }
//! ```
//!
//! **Physics** (feature `avian`): colliders near `ColliderSource`s, and a body that walks on them.
//!
//! ```
//! # #[cfg(feature = "avian")] {
//! # use avian3d::prelude::*;
//! # use bevy::prelude::*;
//! # use bevy_burrow::physics::{Character, CharacterPlugin, ColliderSource, TerrainPhysicsPlugin};
//! fn embody(app: &mut App) {
//!     app.add_plugins((PhysicsPlugins::default(), TerrainPhysicsPlugin, CharacterPlugin::default()));
//!     let person = Character::default();
//!     let place = person.standing_at(Vec3::new(20.0, 8.0, 20.0));
//!     app.world_mut().spawn((person, place, TransformInterpolation, ColliderSource { radius: 60.0 }));
//! }
//! # }
//! ```
//!
//! **A panel** (feature `egui`) with live figures, the terrain's rules and look, and the selected brush, which games
//! can read; **debug views** of the model (feature `debug`).
//!
//! ```
//! # #[cfg(all(feature = "egui", feature = "debug"))] {
//! # use bevy::input::common_conditions::input_just_pressed;
//! # use bevy::prelude::*;
//! # use bevy_burrow::debug::{BurrowDebug, BurrowDebugPlugin};
//! # use bevy_burrow::panel::{BrushTool, BurrowPanelPlugin, pointer_is_free};
//! # use bevy_burrow::prelude::*;
//! fn edit(app: &mut App) {
//!     let click = pointer_is_free.and_then(input_just_pressed(MouseButton::Left));
//!     app.add_plugins((BurrowPanelPlugin, BurrowDebugPlugin))
//!         .insert_resource(BurrowDebug { mask: true, ..default() })
//!         .add_systems(Update, stroke.before(BurrowSystems::Collect).run_if(click));
//! }
//!
//! fn stroke(tool: Res<BrushTool>, terrains: Terrains, eye: Single<&Transform, With<Camera>>, mut brushes: MessageWriter<Brush>) {
//!     if let Some(hit) = terrains.raycast(Ray3d::new(eye.translation, eye.forward()), 200.0) {
//!         brushes.write(tool.brush_at(&hit));
//!     }
//! }
//! # }
//! ```
//!
//! **A custom look**: any `Material` on the terrain; types other than Bevy's need their `TerrainMaterialPlugin`.
//!
//! ```
//! # #[cfg(feature = "render")] {
//! # use bevy::prelude::*;
//! # use bevy_burrow::prelude::*;
//! fn paint(app: &mut App, terrain: Terrain) {
//!     let clay = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(Color::srgb(0.7, 0.4, 0.3));
//!     app.world_mut().spawn((terrain, MeshMaterial3d(clay)));
//! }
//! # }
//! ```
//!
//! # Modules
//!
//! From the ground up. A lower module never imports a higher one, which `tests/structure.rs` checks.
//!
//! | modules | subject |
//! | --- | --- |
//! | `threads` | thread pools of the plugin |
//! | [`lattice`], `lod`, [`ground`] | coordinates, levels of detail, the pristine world |
//! | [`brush`], [`volume`], `edits` | brushes and edits, stored samples, edits applied to samples |
//! | [`surface`], `dense` | marching cubes, heightmap and their seam; a mesher of plain arrays |
//! | [`backend`] | engines on CPU and GPU |
//! | `world`, `loose`, `redraw` | the world at one revision and queries; loose pieces; which meshes change |
//! | [`terrain`] | orders, transactions, history, the commit log; exports what the three above have for games |
//! | `scatter` | where plants stand, and whether they still do |
//! | `navigation` | where agents can walk |
//! | `format` | worlds and levels as bytes |
//! | `store`, `net` | saved worlds and levels; multiplayer without a transport |
//! | `plugin`, `view`, `saves`, `plugins`, `together`, `physics`, `plants`, `paths`, `debug`, `panel` | everything else that uses Bevy |
//!
//! # How the seam closes
//!
//! 1. **Sentinel samples.** Only edited samples are stored; a pristine one is computed, d = y - h(x, z), and never
//!    rounded: [`SampleView::distance`](volume::SampleView::distance).
//! 2. **The mask follows edits, not boxes.** A cell is drawn by marching cubes when a corner of its *sheet*,
//!    the cubes that the pristine surface crosses over it, is edited. All samples of the sheet outside the
//!    mask are then pristine: `surface::mask`.
//! 3. **The ring is a fan** from the border polyline to the opposite heightmap vertex: `surface::tile::fan`.
//! 4. **One vertex function, keyed by lattice edge,** for cubes and ring, in integers:
//!    `surface::vertex::vertex`.
//! 5. **The y-range covers every sign change** of the footprint, in as many chunks above and below as that takes:
//!    `surface::mask::sheet` returns it.
//! 6. **Brushes are band-limited:** nothing farther than two voxels outside a shape changes:
//!    [`Edit::reach`](brush::Edit::reach).
//!
//! Three more rules close the gaps between levels of detail: a coarse cell fans over the line of its finer
//! neighbours, a coarse vertex of an edit is a vertex of the finest level, and columns beyond the rim equal the rim's
//! (`surface::lod`).
//!
//! Rejected alternatives: *snapping* border vertices to the nearest point of the other surface tears on steep
//! ground; *skirts* hide cracks but not lighting, and break collision; *converting whole boxes* to voxels makes deep
//! caves pay for the meadow above; *transition cells* need a second case table and still leave the heightmap out.
//!
//! The method is that of P. Andersson and S. Johansson, *Rendering with Marching Cubes, looking at Hybrid Solutions*
//! (2012): heightmap, fields in chunks, five scenarios of an edit. Their version had cuts and holes on steep ground and
//! an index buffer that took 15 seconds to rebuild; the six rules and the transaction solve these problems.
//!
//! # An edit is a transaction
//!
//! ```text
//! Brush -> Edit (integers only) -> queue
//!   -> transaction in a task, from a snapshot: bricks, fields, receipts, dirty blocks, meshes
//!   -> commit in one frame, all or nothing: world, meshes, entities, receipts
//! ```
//!
//! Edits apply in the order in which they were sent, those of one frame together, `TargetedBrush`es after the others.
//! Rules and loose settings apply to edits that are sent after them. A [stroke](brush::Brush::stroke), or everything
//! sent in one frame, is a step of undo. A transaction holds as many edits as its [limit](terrain::WorkLimits) of work
//! allows, and more work than may wait is rejected when it is sent; an edit that panics is rejected, and the others are
//! applied without it. Integers decide solidity, and floats are only drawn, so equal edits give an equal
//! [`hash`](terrain::World::hash) on every machine.
//!
//! # What an edit costs
//!
//! The cost depends on the region that its brush reaches, not on the chunk size. Bricks of 8x8x8 samples are copied,
//! changed and shared; each keeps a bit per sample for solid and for edited, so that `surface::block` finds
//! the cubes to draw by a few operations on whole layers and looks at samples only around them. Parts of a chunk's mesh
//! that did not change are copied from its last one, and so are rings of a tile. Nothing is allocated while meshing.
//! Bricks, blocks and chunks of a large transaction are spread over rayon's threads; the result does not depend on how
//! many there are. [`Commit::stages`](terrain::Commit::stages) reports where the time went.
//!
//! # System sets
//!
//! `BurrowSystems`, in `Update`: `Load`, `Collect`, `Commit`, `Begin`, `Propagate`. A brush that is sent before
//! `Collect` starts in the same frame; its receipt comes in `Commit` of the frame in which its meshes are shown.
//!
//! Except for `Commit`, the systems of a set run one after the other within one exclusive system, and so do
//! `SaveSystems`. No system of a game runs between them, and none of its commands are applied there.
//!
//! # Features
//!
//! | feature | what it adds | default |
//! | --- | --- | --- |
//! | `cuda` | transactions on an NVIDIA GPU where one is found, see [`backend`]; compiles everywhere | |
//! | `import` | heights from TIFF and EXR files, see [`ElevationGrid`](ground::ElevationGrid) | |
//! | `plugin` | the Bevy plugin; enough for a dedicated server with `MinimalPlugins` | |
//! | `render` | materials on tiles and chunks | yes |
//! | `avian` | colliders for avian3d, made with the meshes and swapped in the same frame; a walking character; debris | |
//! | `format` | levels and portable worlds as bytes, without files; part of `store` and `net` | |
//! | `store` | worlds on disk: a commit journal, checkpoints, portable files | |
//! | `net` | multiplayer: a server and clients without a transport | |
//! | `picking` | Bevy's pointer events on the ground, with the `TerrainHit` as extra data | |
//! | `replicon` | multiplayer over bevy_replicon | |
//! | `scatter` | plants and stones that disappear and return with the ground they stand on | |
//! | `navigation` | where agents can walk, as polygons of tiles | |
//! | `landmass` | navigation meshes for `bevy_landmass`, replaced with each commit | `navigation`, `plugin` |
//! | `egui` | the panel: brush, settings, live figures | |
//! | `debug` | debug views as gizmos | |
//! | `gamepad` | gamepads for the digger; needs libudev's headers on Linux | |
//! | `sound` | sound for the digger; needs ALSA's headers on Linux | |
//! | `examples`, `example_crates` | what the examples need: window, UI, PNG; its crates alone | |
//! | `tools` | a simulated disk and random cuts for tests; not for games | |
//!
//! Without any feature only the model is built, without Bevy. Where threads are available, transactions, loads and
//! textures use their own threads, regardless of the features of Bevy.
//!
//! # Limits
//!
//! Heights stay within 32768 voxels. A world's sides have up to 16384 cells, or 262144 where its heights come from a
//! [source](ground::HeightSource). All of it is drawn in full detail, or with `LevelsOfDetail` distant ground coarsely.
//! A terrain may be moved by whole voxels and scaled by powers of two, by
//! [`TerrainSettings::voxel_size`](terrain::TerrainSettings::voxel_size) or by a parent: the scale of its own
//! `Transform` is the plugin's. Rotated, stretched or moved by a part of a voxel, its seams lose their equal bits.

// Unit tests share worlds with the integration tests.
#[cfg(test)]
extern crate self as bevy_burrow;

pub mod backend;
pub mod brush;
#[cfg(feature = "debug")]
pub mod debug;
#[doc(hidden)]
pub mod dense;
mod edits;
#[cfg(feature = "format")]
pub mod format;
pub mod ground;
pub mod lattice;
#[doc(hidden)]
pub mod lod;
mod loose;
#[cfg(feature = "navigation")]
pub mod navigation;
#[cfg(feature = "net")]
pub mod net;
#[cfg(feature = "egui")]
pub mod panel;
#[cfg(feature = "landmass")]
pub mod paths;
#[cfg(feature = "avian")]
pub mod physics;
#[cfg(all(feature = "plugin", feature = "scatter"))]
pub mod plants;
#[cfg(feature = "plugin")]
pub mod plugin;
#[cfg(feature = "plugin")]
mod plugins;
#[cfg(feature = "plugin")]
pub use plugins::BurrowPlugins;
mod redraw;
#[cfg(all(feature = "plugin", feature = "store"))]
pub mod saves;
#[cfg(feature = "scatter")]
pub mod scatter;
#[cfg(feature = "store")]
pub mod store;
pub mod surface;
pub mod terrain;
#[cfg(feature = "plugin")]
mod threads;
#[cfg(feature = "replicon")]
pub mod together;
#[cfg(feature = "render")]
pub mod view;
pub mod volume;
mod world;
#[cfg(test)]
#[path = "../tests/worlds/mod.rs"]
mod worlds;

/// What most games import.
pub mod prelude {
    #[cfg(feature = "plugin")]
    pub use crate::BurrowPlugins;
    pub use crate::brush::{
        Blend, Brush, BrushError, BrushPath, Corridor, Edit, GridShape, Operation, Paste, Prefab,
        PrefabError, Roughness, Shape, ShapeGrid, Stamp,
    };
    pub use crate::ground::{
        Bedding, ColumnMaterial, Detail, GreyImage, Ground, HeightSource, ImageLimits, ImageScale, Interval,
        MaterialControl, MaterialId, MaterialRule, NoiseHeights, NoiseKind, Strata, Stratum, StratumBody,
        StratumBounds,
    };
    #[cfg(feature = "plugin")]
    pub use crate::plugin::{
        BrushApplied, BurrowEngine, BurrowFigures, BurrowSettings, BurrowSystems, Chunk, DetailSource, Field,
        GroundPiece, HeightmapImage, HistoryMoved, LevelsOfDetail, LoosePieceFound, LoosePieceReturned,
        MaterialColors, Redo, Redraw, ShownLevels, SkyLight, SlimVertices, TargetedBrush, TerrainHit,
        TerrainPropagatePlugin, TerrainReady, Terrains, Tile, Undo,
    };
    #[cfg(all(feature = "plugin", feature = "store"))]
    pub use crate::saves::{
        BurrowLevel, ClosedBecause, SaveNow, SaveSystems, SavedWorld, StartLevel, StoreWarningFound,
        WorldClosed, WorldOpened, WorldSaved, WorldStore,
    };
    pub use crate::terrain::{
        Applied, History, LoosePiece, LooseSettings, Order, OrderKind, PieceFate, PieceId, Receipt,
        Rejection, ReturnedPiece, ScenarioCounts, Span, Terrain, TerrainSettings,
    };
    #[cfg(feature = "render")]
    pub use crate::view::{
        GroundArrays, GroundLayer, GroundLayerImages, GroundLoading, GroundLook, GroundMaterial,
        GroundQuality, GroundTextures, TerrainMaterialPlugin,
    };
    pub use crate::volume::{DiggingRules, Refused, Scenario};
}

/// The programs of the README and of the guide are compiled as documentation tests.
#[cfg(all(doctest, feature = "examples"))]
mod guide {
    macro_rules! pages {
        ($($name:ident $page:literal)*) => {
            $(#[doc = include_str!(concat!("../", $page))] struct $name;)*
        };
    }

    pages! {
        Readme "README.md"
        GettingStarted "docs/guide/src/getting-started.md"
        Sizes "docs/guide/src/sizes.md"
        Import "docs/guide/src/import.md"
        Levels "docs/guide/src/levels.md"
        Brushes "docs/guide/src/brushes.md"
        Materials "docs/guide/src/materials.md"
        Plants "docs/guide/src/plants.md"
        Paths "docs/guide/src/paths.md"
        Physics "docs/guide/src/physics.md"
        Undo "docs/guide/src/undo.md"
        Events "docs/guide/src/events.md"
        Pausing "docs/guide/src/pausing.md"
        Saving "docs/guide/src/saving.md"
        LevelAssets "docs/guide/src/level-assets.md"
        Determinism "docs/guide/src/determinism.md"
        Servers "docs/guide/src/servers.md"
        Testing "docs/guide/src/testing.md"
        Together "docs/guide/src/together.md"
        WhoMayConnect "docs/guide/src/who-may-connect.md"
        Cuda "docs/guide/src/cuda.md"
        Performance "docs/guide/src/performance.md"
        Heightmaps "docs/guide/src/recipes/heightmaps.md"
        Mining "docs/guide/src/recipes/mining.md"
        Explosions "docs/guide/src/recipes/explosions.md"
        Journal "docs/guide/src/recipes/journal.md"
        Water "docs/guide/src/recipes/water.md"
        Surfaces "docs/guide/src/recipes/surfaces.md"
        Cameras "docs/guide/src/recipes/cameras.md"
        FloatingOrigin "docs/guide/src/recipes/floating-origin.md"
    }
}
