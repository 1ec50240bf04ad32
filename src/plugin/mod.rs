//! The Bevy plugin: turns brush messages into meshes and receipts.
//!
//! Put a [`Terrain`] on an entity. The plugin spawns one child for each [`Tile`], and one for each [`Chunk`] that
//! digging touches, with a [`Field`] below it for each region of edits. [`Brush`] messages, in world space, become
//! transactions that run on the plugin's own threads; a finished one is committed in a single frame: meshes, entities,
//! [`BrushApplied`] receipts and entity events. A server with `MinimalPlugins` has no `Assets<Mesh>`: it gets
//! everything but the meshes.
//!
//! [`Undo`] and [`Redo`] messages work by whole strokes, and are answered by [`HistoryMoved`]. On terrains with
//! [`LooseSettings`](crate::terrain::LooseSettings), a [`LoosePieceFound`] is sent for each piece that a brush cuts
//! off, and a [`LoosePieceReturned`] for each that an undo brings back.
//!
//! Tiles, chunks and [`GroundPiece`]s inherit components of the terrain's entity: a `MeshMaterial3d`, [`RenderLayers`],
//! and, with the feature `render`, `NotShadowCaster` and `NotShadowReceiver`. They follow when such a component is
//! inserted, changed or removed. An entity that is spawned with its own, of the same type, keeps it until the terrain's
//! changes.
//!
//! [`RenderLayers`]: bevy::camera::visibility::RenderLayers
//! [`Terrain`]: crate::terrain::Terrain
//!
//! A [`SurfaceProcessor`] builds extra data for each surface off-thread, and swaps it in with the mesh. Figures are in
//! [`BurrowFigures`], and in Bevy's diagnostics; transactions, edits, meshes, commits and loads have tracing spans.

// Files with reflected types, assets and loaders stay in this folder: scenes and `.meta` files name those by the path
// of their module.
mod components;
mod diagnostics;
mod entities;
mod figures;
#[cfg(feature = "format")]
mod ground_file;
pub mod heightmap;
mod lod_state;
mod meshes;
pub mod messages;
#[cfg(feature = "picking")]
mod picking;
mod query;
mod reports;
mod schedule;
mod settings;
#[cfg(all(test, any(feature = "scatter", feature = "landmass")))]
pub(crate) mod test_app;
mod times;

pub use components::{
    Chunk, EditOutbox, Field, GroundPiece, Held, MaterialColors, SkyLight, SlimVertices, Tile,
};
#[doc(hidden)]
pub use components::{GroundPieces, MeshBytes, ShownSurface};
#[cfg(any(feature = "avian", feature = "scatter", feature = "landmass"))]
pub(crate) use entities::TerrainEntities;
#[cfg(feature = "render")]
pub(crate) use entities::materials::{propagate_look, propagate_material, warn_of_textures, warn_of_undrawn};
#[cfg(any(feature = "avian", feature = "scatter", feature = "landmass"))]
pub(crate) use entities::places::Places;
#[cfg(any(feature = "scatter", feature = "landmass", feature = "debug", feature = "egui"))]
pub(crate) use entities::places::voxel_metres;
pub use entities::propagate::TerrainPropagatePlugin;
#[cfg(feature = "render")]
pub(crate) use entities::propagate::{Inherited, remove_inherited};
#[cfg(feature = "avian")]
pub(crate) use entities::squares::squares_within;
#[cfg(any(feature = "scatter", feature = "landmass"))]
pub(crate) use entities::squares::{Squares, are_same, position_on};
#[cfg(feature = "avian")]
pub(crate) use entities::trigger_if_alive;
pub use figures::BurrowFigures;
#[cfg(feature = "format")]
#[doc(hidden)]
pub use ground_file::GroundFilePlugin;
#[cfg(feature = "format")]
#[doc(hidden)]
pub use ground_file::GroundLoader;
#[cfg(feature = "format")]
pub use ground_file::{
    GroundAsset, GroundDescription, GroundFileError, GroundFileRead, GroundFrom, MaterialFiles,
};
#[doc(hidden)]
pub use heightmap::{HeightmapError, HeightmapImage, HeightmapSettings, RawHeightmap};
#[doc(hidden)]
pub use heightmap::{HeightmapLoader, HeightmapPlugin};
#[cfg(feature = "store")]
pub(crate) use heightmap::{read_limited, register_loader};
pub(crate) use lod_state::WantedTiles;
pub use lod_state::{DetailSource, LevelsOfDetail, ShownLevels};
#[doc(hidden)]
pub use meshes::CUT_VOXELS;
pub use meshes::{CommitAction, Part, SurfaceProcessor, SurfaceProcessors};
#[doc(hidden)]
pub use messages::{
    BrushApplied, ChunkChanged, ChunkCreated, FieldChanged, FieldCreated, FieldMerged, HistoryMoved,
    LoosePieceFound, LoosePieceReturned, Redo, TargetedBrush, TerrainReady, Undo,
};
#[cfg(feature = "picking")]
#[doc(hidden)]
pub use picking::TerrainPickingPlugin;
pub use query::{TerrainHit, Terrains};
#[cfg(any(feature = "scatter", feature = "landmass"))]
pub(crate) use schedule::commit::GroundChanged;
pub(crate) use schedule::phases::Phase;
pub use schedule::redraw::Redraw;
pub(crate) use schedule::same_frame::CommitSameFrame;
pub use settings::{BurrowEngine, BurrowSettings};
#[doc(hidden)]
pub use times::Times;

use bevy::ecs::reflect::ReflectMessage;
use bevy::prelude::*;

use self::entities::{places, propagate};
use self::schedule::{collect, commit, engine, inbox, load, lod, outdated, redraw, same_frame, task};
use crate::brush::Brush;
pub use crate::threads::ThreadSettings;

/// The plugin's system sets in `Update`, in this order.
///
/// A game may run them in certain states only. Nothing is lost in the meantime: brushes, undos and redos are kept and
/// answered afterwards, and changes of a terrain's components take effect then. Despawned terrains answer at once.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// # #[derive(Resource, PartialEq)] struct Playing(bool);
/// # let mut app = App::new();
/// app.configure_sets(
///     Update,
///     (
///         BurrowSystems::Load,
///         BurrowSystems::Collect,
///         BurrowSystems::Commit,
///         BurrowSystems::Begin,
///         BurrowSystems::Propagate,
///     )
///         .run_if(resource_equals(Playing(true))),
/// );
/// ```
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BurrowSystems {
    /// New terrains are loaded; their tiles appear all at once when all meshes are built.
    Load,
    /// Brush, undo and redo messages are checked and queued. Send them before this set to have them in this frame's
    /// transaction.
    Collect,
    /// Finished transactions are committed: meshes, entities, receipts, events. Small ones that begin in this frame are
    /// committed in `PostUpdate`, if this set runs: see [`BurrowSettings::same_frame`]. Systems in `Update` read their
    /// messages in the next frame, before anything of it is saved.
    Commit,
    /// Queued brushes start as transactions.
    Begin,
    /// Tiles, chunks and pieces inherit their terrain's material, layers and shadows.
    Propagate,
}

/// Systems before [`BurrowSystems::Load`], which run in every frame: of [`Update`], and of [`Phase::Worlds`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(not(all(feature = "store", feature = "avian")), allow(dead_code, reason = "one for each feature"))]
pub(crate) enum BeforeLoad {
    /// Saved worlds are put in the place of their terrains.
    Worlds,
    /// Bodies near which colliders are wanted are found.
    Sources,
}

/// Systems that look at what was just committed, still in [`BurrowSystems::Commit`].
#[cfg(any(feature = "replicon", feature = "scatter", feature = "landmass"))]
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct FollowCommits;

/// Transactions, entities and messages; works in `MinimalPlugins`.
#[doc(hidden)]
#[derive(Default)]
pub struct TerrainPlugin;

impl Plugin for TerrainPlugin {
    fn build(&self, app: &mut App) {
        add_resources(app);
        add_messages(app);
        add_observers(app);
        add_update_systems(app);
        #[cfg(any(feature = "scatter", feature = "landmass"))]
        app.add_message::<GroundChanged>();
        #[cfg(any(feature = "replicon", feature = "scatter", feature = "landmass"))]
        app.configure_sets(
            Update,
            FollowCommits.in_set(BurrowSystems::Commit).after(commit::commit_transactions),
        );
        app.add_systems(
            First,
            crate::threads::resize_pools
                .run_if(resource_exists_and_changed::<ThreadSettings>)
                .after(bevy::ecs::message::MessageUpdateSystems),
        );
        // In every frame, whatever the game gates.
        app.add_systems(Last, (inbox::keep_requests.run_if(inbox::has_unread), places::find_external_places))
            // They read terrains, which systems in `Update` and `Last` change.
            .add_systems(
                PostUpdate,
                (diagnostics::measure_frame, engine::trim_engines.run_if(engine::is_time_to_trim))
                    .after(CommitSameFrame),
            )
            // Terrains that were spawned before the plugin was added.
            .add_systems(PreStartup, (places::scale_terrains, places::place_terrains).chain());
        same_frame::add(app);
        app.add_systems(PostUpdate, commit::commit_begun.in_set(CommitSameFrame));
        diagnostics::register(app);
        propagate::add(app);
    }

    #[cfg(feature = "render")]
    fn finish(&self, app: &mut App) {
        engine::suggest_renderers_gpu(app.world());
    }
}

/// Adds the resources.
fn add_resources(app: &mut App) {
    app.init_resource::<BurrowSettings>()
        .init_resource::<BurrowFigures>()
        .init_resource::<BurrowEngine>()
        .init_resource::<ThreadSettings>()
        .init_resource::<task::TaskCounter>()
        .init_resource::<SurfaceProcessors>()
        .init_resource::<inbox::Inbox>()
        .init_resource::<reports::Reported>()
        .init_resource::<same_frame::SameFrame>()
        .init_resource::<WantedTiles>();
}

/// Adds the messages that games send and receive.
fn add_messages(app: &mut App) {
    app.add_message::<Brush>()
        .register_type::<Brush>()
        .register_type_data::<Brush, ReflectMessage>()
        .add_message::<TargetedBrush>()
        .add_message::<BrushApplied>()
        .add_message::<Undo>()
        .add_message::<Redo>()
        .add_message::<HistoryMoved>()
        .add_message::<LoosePieceFound>()
        .add_message::<LoosePieceReturned>();
}

/// Adds the observers of components that games insert and remove.
fn add_observers(app: &mut App) {
    app.add_observer(outdated::prepare_new)
        .add_observer(collect::free_history)
        .add_observer(collect::answer_removed)
        .add_observer(collect::enable_loose_search)
        .add_observer(collect::disable_loose_search)
        .add_observer(outdated::remove_with_terrain)
        .add_observer(outdated::drop_other_vertices)
        .add_observer(outdated::drop_slim_vertices)
        .add_observer(redraw::redraw)
        .add_observer(reports::forget_reports);
}

/// Orders the sets in `Update`, and adds their systems.
fn add_update_systems(app: &mut App) {
    let phases = (
        Phase::Worlds.system(app).in_set(BeforeLoad::Worlds),
        Phase::Load.system(app).in_set(BurrowSystems::Load),
        Phase::Collect.system(app).in_set(BurrowSystems::Collect),
        Phase::Begin.system(app).in_set(BurrowSystems::Begin),
        Phase::Propagate.system(app).in_set(BurrowSystems::Propagate),
    );
    app.configure_sets(
        Update,
        (
            BeforeLoad::Worlds,
            BeforeLoad::Sources,
            BurrowSystems::Load,
            BurrowSystems::Collect,
            BurrowSystems::Commit,
            BurrowSystems::Begin,
            BurrowSystems::Propagate,
        )
            .chain(),
    )
    .add_systems(Update, (phases, commit::commit_transactions.in_set(BurrowSystems::Commit)))
    .add_systems(
        Phase::Load,
        (
            places::scale_terrains,
            outdated::drop_stray_tasks,
            outdated::drop_replaced,
            load::start_loading,
            places::place_terrains,
            lod::find_eyes,
            load::finish_loading,
            lod::keep_wanted_tiles,
        )
            .chain(),
    )
    .add_systems(Phase::Collect, (collect::collect_brushes, collect::collect_steps).chain())
    .add_systems(Phase::Begin, (lod::begin_lod_changes, commit::begin_transactions).chain());
}
