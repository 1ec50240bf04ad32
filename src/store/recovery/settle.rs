//! Prepares a journal to continue after the last frame that is part of the world.

use std::collections::BTreeMap;
use std::io;

use super::found::Contents;
use super::recover::Recovered;
use crate::lattice::RegionPos;
use crate::store::error::StoreWarning;
use crate::store::files::{Files, Opening, quarantine, read_file};
use crate::store::journal::segment::{self, Found};
use crate::store::journal::{Segment, unsaved};
use crate::store::regions::database::UNFINISHED;
use crate::store::regions::keys;

/// A journal that can continue.
pub(in crate::store) struct Settled {
    pub segments: Vec<Segment>,
    pub next_frame: u64,
    /// Something could not be done: only a checkpoint makes the world durable.
    pub is_unfinished: bool,
    /// Where copies of damaged records are.
    pub copies: BTreeMap<RegionPos, String>,
    pub warnings: Vec<StoreWarning>,
}

/// Moves data that is not part of a world to quarantine, and makes the rest durable.
pub(in crate::store) fn settle(files: &dyn Files, contents: &Contents, recovered: &Recovered) -> Settled {
    let mut copies = BTreeMap::<RegionPos, String>::new();
    let (mut failed, mut told) = (None, Vec::new());
    for at in &recovered.findings.damaged {
        let Some(record) = contents.invalid.get(at) else { continue };
        let name = format!("region.{}.record", keys::name(*at).replace(' ', "."));
        match quarantine::copy(files, &name, record) {
            Ok(path) => drop(copies.insert(*at, path)),
            Err(error) => failed = Some(error),
        }
    }
    if contents.damaged.is_none() {
        // What an interrupted replacement left is older than the file in place.
        let left = files
            .exists(UNFINISHED)
            .and_then(|is_left| if is_left { files.remove(UNFINISHED) } else { Ok(()) });
        failed = failed.or(left.err());
    }
    if contents.has_lost_journal {
        told.push(StoreWarning::LogMissing { revision: recovered.mirror.revision });
        // It was reported.
        drop(unsaved::clear(files));
    }
    let mut segments = Vec::new();
    let cut = cut_journal(files, contents, recovered, &mut told, &mut segments);
    if let Err(error) = cut.and_then(|()| sync_tail(files, &segments, recovered.checkpoint)) {
        failed = Some(error);
    }
    let next_frame = match &failed {
        None => recovered.frame + 1,
        // Frames that are not part of the world may still be there.
        Some(error) => {
            told.push(StoreWarning::NotSaved(error.to_string()));
            recovered.frame.max(contents.greatest_frame()) + 2
        }
    };
    Settled { segments, next_frame, is_unfinished: failed.is_some(), copies, warnings: told }
}

/// Copies or moves aside all that lies behind the last frame.
fn cut_journal(
    files: &dyn Files,
    contents: &Contents,
    recovered: &Recovered,
    told: &mut Vec<StoreWarning>,
    segments: &mut Vec<Segment>,
) -> io::Result<()> {
    let is_kept = |found: &&Found| found.frames.iter().any(|frame| frame.number <= recovered.frame);
    let last_kept = contents.segments.iter().filter(is_kept).map(|found| found.number).max().unwrap_or(0);
    // Content is kept aside before the frames that name it.
    let [others, needed] = [contents.names(recovered.frame + 1..), contents.names(..=recovered.frame)];
    contents.named.keep_aside(files, &others, &needed)?;
    let (mut bytes, mut place) = (0, None);
    let mut moved = Vec::new();
    // Parts that were not written completely, and were written again elsewhere, do not matter.
    let is_harmless = |found: &Found| {
        let mut frames = found.frames.iter().map(|frame| frame.number);
        let is_harmless = |bad| contents.is_harmless(found.number, bad, recovered.frame);
        frames.all(|number| number <= recovered.frame) && found.bad.iter().all(is_harmless)
    };
    for found in &contents.segments {
        let kept = found.frames.iter().filter(|frame| frame.number <= recovered.frame);
        let (last_frame, end) = kept.fold((0, 0), |(last, end): (u64, usize), frame| {
            (last.max(frame.number), end.max(frame.range.end))
        });
        let (all, names) = (found.length as u64, found.names(..=recovered.frame));
        if found.number < last_kept {
            // What is bad there did not matter, since later frames follow.
            segments.push(Segment { number: found.number, last_frame, bytes: all, names });
        } else if found.number == last_kept {
            segments.push(Segment { number: found.number, last_frame, bytes: end as u64, names });
            if end < found.length {
                let path = segment::path(found.number);
                let rest = read_file(files, &path)?.bytes.split_off(end);
                let name = path.rsplit('/').next().unwrap_or_default();
                let copy = quarantine::copy(files, name, &rest)?;
                if !is_harmless(found) {
                    bytes += rest.len() as u64;
                    place = Some(copy);
                }
                let file = files.open(&path, Opening::Existing)?;
                file.set_length(end as u64)?;
                file.sync()?;
            }
        } else if found.length == 0 && found.error.is_none() {
            // It belongs to no world, whatever its name is.
        } else if found.frames.is_empty() && found.bad.is_empty() {
            segments.push(Segment { number: found.number, last_frame: 0, bytes: all, names });
        } else {
            moved.push(found);
        }
    }
    for found in moved {
        let copy = quarantine::file(files, &segment::path(found.number))?;
        if !is_harmless(found) {
            bytes += found.length as u64;
            place = Some(copy);
        }
    }
    let (Some(quarantine), revision) = (place, recovered.mirror.revision) else { return Ok(()) };
    told.push(match &recovered.refused {
        Some(why) => StoreWarning::LogRefused { revision, why: why.clone(), quarantine },
        None => StoreWarning::LogCut { revision, bytes, quarantine },
    });
    Ok(())
}

/// Syncs segments, because data that was read may be in the system's cache only, if the process was killed without a
/// loss of power.
fn sync_tail(files: &dyn Files, segments: &[Segment], checkpoint: u64) -> io::Result<()> {
    for tail in segments.iter().filter(|segment| segment.last_frame > checkpoint) {
        files.open(&segment::path(tail.number), Opening::Existing)?.sync()?;
    }
    if segments.is_empty() { Ok(()) } else { files.sync_folder(segment::FOLDER) }
}
