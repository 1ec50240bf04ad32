//! Reads edits, one JSON object a line.

use std::fmt;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use bevy_burrow::brush::{Brush, BrushRecord, Edit};

use crate::ExportError;

/// An edit and the line it stands on, from 1.
#[derive(Debug)]
pub struct ScriptedEdit {
    pub line: usize,
    pub edit: Edit,
}

/// Every bad line of a script; shown one a line, as compilers do.
#[derive(Debug)]
pub struct BadLines {
    path: PathBuf,
    lines: Vec<(usize, String)>,
}

/// How many bad lines are shown.
const SHOWN: usize = 20;

impl std::error::Error for BadLines {}

impl fmt::Display for BadLines {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.path.display();
        for (i, (line, reason)) in self.lines.iter().take(SHOWN).enumerate() {
            let line_end = if i == 0 { "" } else { "\n" };
            write!(f, "{line_end}{path}: line {line}: {reason}")?;
        }
        match self.lines.len().saturating_sub(SHOWN) {
            0 => Ok(()),
            more => write!(f, "\n{path}: {more} more bad lines"),
        }
    }
}

/// Reads a script whole, or says what is wrong with each bad line.
pub fn read(path: &Path) -> Result<Vec<ScriptedEdit>, ExportError> {
    let failed = |reason| ExportError::Read { path: path.into(), reason };
    let mut reader = BufReader::new(File::open(path).map_err(failed)?);
    let (mut edits, mut bad) = (Vec::new(), Vec::new());
    let mut bytes = Vec::new();
    for line in 1.. {
        bytes.clear();
        if reader.read_until(b'\n', &mut bytes).map_err(failed)? == 0 {
            break;
        }
        match parse(&bytes) {
            Ok(Some(edit)) => edits.push(ScriptedEdit { line, edit }),
            Ok(None) => {}
            Err(reason) => bad.push((line, reason)),
        }
    }
    if bad.is_empty() { Ok(edits) } else { Err(BadLines { path: path.into(), lines: bad }.into()) }
}

/// The edit on a line; none on a blank line or a comment.
fn parse(line: &[u8]) -> Result<Option<Edit>, String> {
    let text = std::str::from_utf8(line).map_err(|_| "the line is not UTF-8".to_string())?.trim();
    if text.is_empty() || text.starts_with('#') {
        return Ok(None);
    }
    let record: BrushRecord = serde_json::from_str(text).map_err(|error| {
        let reason = error.to_string();
        // The record is all on one line, whose number the caller knows better.
        let reason = reason.rsplit_once(" at line ").map_or(reason.as_str(), |(reason, _)| reason);
        format!("column {}: {reason}", error.column())
    })?;
    let brush = Brush::try_from(record).map_err(|error| error.to_string())?;
    Edit::quantize(&brush).map(Some).map_err(|error| error.to_string())
}
