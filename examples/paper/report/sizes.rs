//! The speedup of an edit over re-meshing everything, by the size of the edit.

use super::markdown::{Table, significant, thousands};
use super::ratios::by_edit;
use crate::backend::Backend;
use crate::edits::Run;
use crate::full::Output;
use crate::measure::Measurements;
use crate::published::CHUNK_SIZES;
use crate::setup::Subject;
use crate::stats;

/// The number of parts into which the edits are divided, from small to large.
const PARTS: usize = 5;

/// Medians of the edits in each part, by CPU time; `None` if one of the tests was not played.
pub fn by_size(measurements: &Measurements) -> Option<Table> {
    let chunk_size = CHUNK_SIZES[0];
    let hybrid = Subject::Hybrid { backend: Backend::Cpu, chunk_size };
    let measured = measurements.get(hybrid, Run::Second)?;
    let times = stats::by_edit(&measured.processor);
    let mut ratios = Vec::new();
    for output in Output::BOTH {
        let [_, by_processor] = by_edit(measurements, Subject::Full(output), hybrid)?;
        ratios.push(by_processor);
    }
    let columns = Output::BOTH.map(|output| format!("full over it, {}", output.title()));
    let header = ["voxels that an edit digs or fills".into(), format!("hybrid {chunk_size}, us")];
    let mut table = Table::new(
        format!("Second run, chunk size {chunk_size}, by the size of an edit"),
        header.into_iter().chain(columns),
    );
    for edits in parts(&measured.voxels) {
        let of = |values: &[f64]| stats::median(edits.iter().map(|&edit| values[edit]));
        let [least, most] = [edits.first(), edits.last()]
            .map(|edit| thousands(edit.map_or(0, |&edit| measured.voxels[edit])));
        let ratios = ratios.iter().map(|ratios| significant(of(ratios)));
        let name = [format!("{least} to {most}"), format!("{:.1}", of(&times) * 1e6)];
        table.row(name.into_iter().chain(ratios));
    }
    table.note = "Medians of a fifth of all edits each, by CPU time.".into();
    Some(table)
}

/// Indices of the edits by number of voxels, from small to large, in parts of equal length or one more.
pub fn parts(voxels: &[u64]) -> Vec<Vec<usize>> {
    let mut edits: Vec<usize> = (0..voxels.len()).collect();
    edits.sort_by_key(|&edit| voxels[edit]);
    let cut = |part: usize| part * edits.len() / PARTS;
    let parts = (0..PARTS).map(|part| edits[cut(part)..cut(part + 1)].to_vec());
    parts.filter(|part| !part.is_empty()).collect()
}
