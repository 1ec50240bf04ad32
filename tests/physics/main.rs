//! Bodies on ground that is dug and built: an app with avian, frame by frame, at a fixed time step.
#![cfg(feature = "avian")]

mod bumps;
mod changes;
mod crowd;
mod debris;
mod edges;
mod holding;
mod layers;
mod lod;
mod matter;
mod placement;
#[cfg(feature = "replicon")]
mod shared;
mod sources;
mod stage;
#[cfg(feature = "scatter")]
mod stems;
mod waiting;
mod walkers;
