//! Drafts a group of edits: all at once, or one by one where each looks for the ground that it cuts off.

use std::collections::BTreeMap;

use crate::brush::{Edit, Operation};
use crate::edits::{Draft, Drafter, MergedBricks};
use crate::loose::{self, Fallen, LoosePiece, LooseSettings};
use crate::terrain::queue::Submission;
use crate::volume::DiggingRules;
use crate::world::World;

/// The result of the search after an edit.
#[derive(Default)]
pub(crate) struct Found {
    pub pieces: Vec<LoosePiece>,
    /// Whether its budget ended it.
    pub has_unsearched: bool,
}

/// The results of searches by the number of the edit before them, without empty ones.
pub(crate) type LoosePieces = BTreeMap<usize, Found>;

/// Drafts a group of edits over the current samples.
pub(crate) fn draft_group(
    world: &World,
    drafter: &mut Drafter,
    group: &[Submission],
) -> (Draft, LoosePieces) {
    let edits: Vec<&Edit> = group.iter().filter_map(|submission| submission.edit()).collect();
    let settings = group.first().map(|first| &first.edit_settings);
    let rules = settings.and_then(|settings| settings.rules.as_deref());
    match settings.and_then(|settings| settings.loose.as_ref()) {
        Some(settings) => one_by_one(world, drafter, &edits, rules, settings),
        None => (drafter.draft(&edits, rules), LoosePieces::new()),
    }
}

/// Returns `true` if the operation can turn solid samples into air.
fn can_remove(edit: &Edit) -> bool {
    !matches!(edit.operation(), Operation::Add { .. } | Operation::Paint { .. } | Operation::Fill)
}

/// Drafts one at a time each edit that can remove ground; pieces that it cuts off fall before the next edit.
fn one_by_one(
    world: &World,
    drafter: &mut Drafter,
    edits: &[&Edit],
    rules: Option<&DiggingRules>,
    settings: &LooseSettings,
) -> (Draft, LoosePieces) {
    let (mut all, mut pieces) = (Draft::default(), LoosePieces::new());
    let mut bricks = MergedBricks::default();
    for group in edits.chunk_by(|a, b| !can_remove(a) && !can_remove(b)) {
        let mut draft = drafter.draft(group, rules);
        let can_cut_off = group.iter().any(|edit| can_remove(edit));
        let seeds = can_cut_off.then(|| loose::seeds(world, drafter.samples(), &draft.bricks));
        drafter.overlay.lay(&draft.bricks);
        if let Some(seeds) = seeds {
            let seeds = (&seeds, draft.bricks.len());
            let Fallen { pieces: found, has_unsearched, removed } =
                loose::fall(world, rules, &drafter.overlay, seeds, settings);
            drafter.extend(&mut draft, removed);
            if has_unsearched || !found.is_empty() {
                pieces.insert(all.effects.len(), Found { pieces: found, has_unsearched });
            }
        }
        all.effects.append(&mut draft.effects);
        bricks.add(draft.bricks);
    }
    (Draft { bricks: bricks.into_list(), hash: drafter.hash, ..all }, pieces)
}
