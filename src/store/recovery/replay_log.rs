//! Replays the frames of a journal on a world, and compares each commit with its hash.

use std::sync::Arc;

use super::found::Contents;
use crate::ground::Ground;
use crate::store::base_level::BaseLevel;
use crate::store::error::StoreError;
use crate::store::journal::FoundContents;
use crate::store::journal::segment::Frame;
use crate::store::progress::{Progress, Work};
use crate::store::store_thread::{GameData, apply_game};
use crate::terrain::{
    CommitRecord, Meshing, Order, OrderKind, Patch, ReplayError, Terrain, TerrainSettings, WorkLimits,
    WorldParts,
};

/// The share of opening after which a world is recovered that has to be saved whole.
pub(super) const RECOVERED_ANEW: f32 = 0.75;

/// The work of replaying a byte of a commit; decoding a byte of a region is 1.
pub(super) const REPLAY: u64 = 32;

/// The result of a replay: the world, the game's data, and the reason why the next frame was refused.
pub(super) struct Replayed {
    pub terrain: Terrain,
    pub game: GameData,
    pub records: Vec<CommitRecord>,
    pub frame: u64,
    pub commits: u64,
    pub refused: Option<String>,
}

/// Replays the whole log from the first commit on, and verifies it.
pub(in crate::store) fn replay_all(
    contents: &Contents,
    ground: &Arc<Ground>,
    settings: TerrainSettings,
    level: Option<&BaseLevel>,
) -> Result<Terrain, StoreError> {
    let whole = contents.frames_from(1);
    let last = contents.choose_checkpoint().map_or(0, |checkpoint| checkpoint.frame);
    if whole.last().map_or(0, |last| last.number) < contents.greatest_frame().max(last) {
        return Err(StoreError::LogNotWhole);
    }
    let empty = BaseLevel::first(level, ground, &settings)?;
    let replayed = replay(empty, GameData::new(), &whole, &contents.named, true, &Work::until(None, 1.0, 0))?;
    match replayed.refused {
        Some(why) => Err(StoreError::LogRefused(why)),
        None => Ok(replayed.terrain),
    }
}

/// The work of replaying a log, after which the world has to be saved.
pub(super) fn replaying<'a>(progress: Option<&'a Progress>, frames: &[&Frame]) -> Work<'a> {
    Work::until(progress, RECOVERED_ANEW, REPLAY * bytes_of(frames))
}

/// The bytes of frames.
pub(super) fn bytes_of(frames: &[&Frame]) -> u64 {
    frames.iter().map(|frame| frame.bytes() as u64).sum()
}

/// Replays frames up to the first that does not fit, from the world that `begin` makes, and again without it: a world
/// that was given a part of it can't be used.
pub(super) fn replay_good(
    mut begin: impl FnMut() -> Result<Terrain, StoreError>,
    game: &GameData,
    frames: &[&Frame],
    contents: &FoundContents,
    is_checked: bool,
    work: &Work,
) -> Result<Replayed, StoreError> {
    let replayed = replay(begin()?, game.clone(), frames, contents, is_checked, work)?;
    if replayed.refused.is_none() {
        return Ok(replayed);
    }
    let good: Vec<&Frame> = frames.iter().copied().filter(|frame| frame.number <= replayed.frame).collect();
    let again = replay(begin()?, game.clone(), &good, contents, is_checked, work)?;
    Ok(Replayed { refused: replayed.refused, ..again })
}

/// Replays frames, and compares the world with each commit if `is_checked`. Stops before the first frame that does not
/// fit.
fn replay(
    mut terrain: Terrain,
    mut game: GameData,
    frames: &[&Frame],
    contents: &FoundContents,
    is_checked: bool,
    work: &Work,
) -> Result<Replayed, StoreError> {
    terrain.set_meshing(Meshing::Never);
    terrain.keep_log(Some(usize::MAX));
    drop(terrain.take_log());
    let (mut records, mut commits, mut refused, mut last, mut revision) = (Vec::new(), 0, None, 0, None);
    let limits = terrain.work_limits();
    terrain.set_work_limits(WorkLimits::UNBOUNDED);
    for frame in frames {
        let batch = frame.batch(terrain.world().ground(), contents);
        let batch = match batch {
            Ok(batch) => batch,
            Err(why) => {
                refused = Some(why.to_string());
                break;
            }
        };
        let cost = REPLAY * frame.bytes() as u64 / batch.commits.len().max(1) as u64;
        let replayed = batch.commits.iter().try_for_each(|record| {
            match is_checked {
                true => drop(terrain.replay(record)?),
                false => replay_unchecked(&mut terrain, record)?,
            }
            work.advance(cost);
            Ok::<(), ReplayError>(())
        });
        if let Err(why) = replayed {
            refused = Some(why.to_string());
            break;
        }
        commits += batch.commits.len() as u64;
        revision = batch.commits.last().map(|record| record.revision).or(revision);
        records.append(&mut terrain.take_log());
        apply_game(&mut game, &batch.game);
        last = frame.number;
    }
    terrain.clear_history();
    terrain.set_work_limits(limits);
    terrain.set_meshing(Meshing::All);
    terrain.keep_log(None);
    if !is_checked && let Some(revision) = revision {
        // Other transactions than those of the records may have led here, and bricks have come and gone without fields.
        let (ground, mut parts) = (terrain.world().shared_ground(), terrain.parts());
        let has_changed = parts.change.fit_fields(terrain.world().grid());
        if has_changed || revision != parts.revision {
            let settings = TerrainSettings { chunk_size: parts.chunk_size, voxel_size: terrain.voxel_size() };
            terrain = Terrain::restore(ground, &settings, WorldParts { revision, ..parts })?;
        }
    }
    Ok(Replayed { terrain, game, records, frame: last, commits, refused })
}

/// Replays a record on a world that differs from the one it was made on. Edits that this world rejects are left out.
fn replay_unchecked(terrain: &mut Terrain, record: &CommitRecord) -> Result<(), ReplayError> {
    let orders = record.orders.iter().map(|order| match order {
        // Its fields are those of the other world.
        Order::Parts { change, .. } => {
            let bricks = change.bricks.clone();
            Order::Parts { change: Arc::new(Patch { bricks, ..Patch::default() }), hash: None }
        }
        order => order.clone(),
    });
    // Without an order, all of its edits were rejected.
    if !record.orders.is_empty() {
        let receipts = terrain.apply(orders);
        let mut others = receipts.iter().filter(|receipt| receipt.kind != OrderKind::Edit);
        if let Some(why) = others.find_map(|receipt| receipt.outcome.as_ref().err()) {
            return Err(ReplayError::of(why, record.revision));
        }
    }
    Ok(())
}
