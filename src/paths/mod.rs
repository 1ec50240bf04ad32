//! Navigation meshes of terrains for [`bevy_landmass`]: a path through a tunnel exists in the frame after the commit
//! that opened it.
//!
//! Spawn a [`Navigation`] for each kind of agent, and add the [`NavigationPlugin`] as well as
//! [`Landmass3dPlugin`](bevy_landmass::Landmass3dPlugin). It turns the [walkable](crate::navigation) ground of each
//! tile into an island of landmass, in a task, and replaces the islands of tiles that a commit changes. Works with
//! `MinimalPlugins`.
//!
//! | part | content |
//! | --- | --- |
//! | [`Navigation`] | whose ground, for what agent, in which archipelago, and where |
//! | [`NavigationSource`] | a place around which there are islands |
//! | [`NavigationTiles`] | the loaded tiles |
//! | [`WalkSettings::archipelago_options`] | options for landmass that fit an agent |
//! | [`Navigation::JUMP_DOWN`], [`Navigation::CLIMB_UP`] | kinds of landmass' animation links over ledges |

mod build;
mod choose;
mod follow;
mod ledges;
mod tiles;

pub use bevy_landmass;
pub use tiles::NavigationTiles;

use std::time::Duration;

use bevy::prelude::*;
use bevy_landmass::coords::ThreeD;
use bevy_landmass::{ArchipelagoOptions, LandmassSystems, PointSampleDistance3d};

use crate::navigation::WalkSettings;
use crate::plugin::{BurrowSystems, CommitSameFrame, FollowCommits};

/// Keeps islands of landmass up to date with terrains, for each [`Navigation`].
#[derive(Clone, Copy, Debug)]
pub struct NavigationPlugin {
    /// The longest that a frame waits for tiles that the commit of the last frame changed. They are built while the
    /// last frame ends, so it seldom waits at all; tiles that take longer are replaced when they are done.
    pub wait: Duration,
}

impl Default for NavigationPlugin {
    fn default() -> Self {
        Self { wait: Duration::from_millis(10) }
    }
}

/// The systems of the [`NavigationPlugin`]: in `PreUpdate`, where tiles that are done become islands; in `Update`,
/// within [`BurrowSystems::Commit`]; and in `PostUpdate`, for commits in the frame of the click.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct NavigationSystems;

impl Plugin for NavigationPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(build::Wait(self.wait))
            .add_observer(tiles::remove_islands)
            .add_observer(tiles::disable)
            .configure_sets(Update, NavigationSystems.in_set(FollowCommits))
            .configure_sets(PostUpdate, NavigationSystems.after(CommitSameFrame))
            // Before landmass moves agents, in whichever schedule it does.
            .configure_sets(PreUpdate, NavigationSystems.before(LandmassSystems::SyncExistence))
            .add_systems(
                PreUpdate,
                (build::replace_islands, ledges::move_links).chain().in_set(NavigationSystems),
            )
            .add_systems(
                Update,
                (
                    choose::choose_tiles.after(BurrowSystems::Load).before(BurrowSystems::Commit),
                    follow::follow_commits.in_set(NavigationSystems),
                ),
            )
            .add_systems(PostUpdate, follow::follow_commits.in_set(NavigationSystems));
    }
}

/// The ground of a terrain that agents of one kind walk on. It may be on the entity of the terrain or of the
/// archipelago, or on a separate one. Each kind of agent needs its own, with its own archipelago.
///
/// If the settings are invalid, there are no islands, and the error is logged.
#[derive(Component, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component)]
#[require(NavigationTiles)]
pub struct Navigation {
    /// The terrain.
    pub terrain: Entity,
    /// The entity of the [`Archipelago3d`](bevy_landmass::Archipelago3d) that islands are added to. Several terrains
    /// may share one.
    pub archipelago: Entity,
    /// The agent, in metres.
    pub agent: WalkSettings,
    /// Where there are islands.
    pub area: NavigationArea,
}

/// Where there are islands.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NavigationArea {
    /// Around [`NavigationSource`]s.
    #[default]
    NearSources,
    /// On the whole terrain: for worlds of up to a square kilometre or so, as landmass looks at each island in each
    /// frame.
    Everywhere,
}

/// A place around which agents find paths, on each terrain with a [`Navigation`] near
/// [sources](NavigationArea::NearSources).
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component)]
#[require(Transform)]
pub struct NavigationSource {
    /// Metres, along x and z. More than 65536 voxels count as 65536, also an infinite radius, and a negative one as 0.
    pub radius: f32,
}

impl WalkSettings {
    /// Options of an archipelago for agents with these settings, which are in metres, on ground with voxels of this
    /// size.
    ///
    /// Agents are found on the ground within a step above and below, and within two voxels to its side: they may be
    /// pushed where the mesh, which keeps whole cells from walls, does not reach.
    pub fn archipelago_options(&self, voxel_size: f32) -> ArchipelagoOptions<ThreeD> {
        let vertical = self.step + 2.0 * self.precision + 0.5 * voxel_size;
        ArchipelagoOptions {
            point_sample_distance: PointSampleDistance3d {
                horizontal_distance: 2.0 * voxel_size,
                distance_above: vertical,
                distance_below: vertical.max(0.5 * self.height),
                vertical_preference_ratio: 2.0,
                animation_link_max_vertical_distance: vertical,
            },
            ..bevy_landmass::FromAgentRadius::from_agent_radius(self.radius.max(0.01))
        }
    }
}
