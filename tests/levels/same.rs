//! What stays the same: nodes far from a change of level, and nodes of level 0 far from coarser ones.
