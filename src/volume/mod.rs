//! A world's stored data in addition to its ground: samples in bricks, fields in chunks, rules.
//!
//! Only edited samples are stored (rule 1); the rest of the world is computed from the
//! [`Ground`](crate::ground::Ground) whenever it is asked for. Bricks lie on the world's own grid and hold each sample
//! once, so chunks that share a face read the same numbers there, and the samples of a world do not depend on its chunk
//! size. The module `edits`, above this one, changes bricks.

mod brick;
mod counts;
mod field;
pub(crate) mod layers;
mod rules;
mod view;

pub use brick::{Brick, Sample};
pub(crate) use brick::{
    PRISTINE, UniformBricks, UniformKind, column_hash, pristine_layers, row, solid_layers,
};
pub use counts::MaterialCounts;
pub(crate) use counts::{VoxelOutcome, for_runs};
pub(crate) use field::{Absorbed, NO_FIELDS};
pub use field::{Field, FieldId, Fields, Scenario};
#[doc(hidden)]
pub use layers::Layers;
pub use rules::{DiggingRules, Refused, RulesError};
#[doc(hidden)]
pub use view::Bricks;
pub use view::SampleView;
pub(crate) use view::resolve;
