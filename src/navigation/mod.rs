//! Where agents can walk: floors, caves and bridges, tile by tile.
//!
//! A [`WalkableTile`] is computed from the samples of a world in integers, so it is the same on every machine, for
//! every chunk size and level of detail, and nothing of it is saved or sent. It holds the *cells* (squares between four
//! columns) on which an agent of some [`WalkSettings`] can stand. There may be several above each other.
//!
//! 1. A **floor** is where a column leaves the ground upwards, with air of the agent's height above it.
//! 2. Floors of neighbouring columns are **linked** if the agent can step or walk from one to the other, below both
//!    ceilings.
//! 3. A cell is **passable** if its four corners have floors that are linked all around, and it is not too steep.
//! 4. A cell is **walkable** if all cells that the agent touches while it stands anywhere on it are passable, and
//!    belong to the world.
//!
//! With [`WalkSettings::jump_down`] or [`climb_up`](WalkSettings::climb_up), its [`ledges`](WalkableTile::ledges) lead
//! from walkable cells to lower ones beyond a ledge, and back.
//!
//! Its [`polygons`](WalkableTile::polygons) are convex, share their edges, and meet those of the next tile in the same
//! line.
//!
//! ```
//! use bevy_burrow::navigation::{NavTilePos, WalkSettings, WalkableTile, Walker};
//! use bevy_burrow::prelude::*;
//!
//! let terrain = Terrain::new(Ground::flat(64, 64, 10.0)?, &TerrainSettings::default())?;
//! let walker = Walker::new(&WalkSettings { radius: 0.4, height: 1.8, ..WalkSettings::default() })?;
//! let tile = WalkableTile::new(terrain.world(), NavTilePos { x: 0, z: 0 }, &walker);
//! // The agent keeps its distance from the world's edge on two sides.
//! assert_eq!(tile.cells().count(), 31 * 31);
//! assert_eq!(tile.polygons().len(), 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | file | what it holds |
//! | --- | --- |
//! | `settings` | the size of an agent and what it can climb, also as integers |
//! | `tiles` | squares of 32 x 32 cells, and those that an edit changes |
//! | `floors` | floors and ceilings of columns, from the bits of bricks |
//! | `ledges` | links where agents jump down or climb up |
//! | `links` | which floors are linked, which cells passable |
//! | `walkable` | which cells are walkable |
//! | `border` | the edges that two tiles share |
//! | `polygons` | polygons of walkable cells |

mod border;
mod floors;
mod ledges;
mod links;
mod polygons;
mod settings;
mod tiles;
mod walkable;

pub use ledges::LedgeLink;
pub use polygons::NavPolygons;
pub use settings::{WalkError, WalkSettings, Walker};
pub use tiles::NavTilePos;
pub use walkable::{WalkableCell, WalkableTile};
