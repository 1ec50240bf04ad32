//! Reads edits, one JSON object per line.

use std::fmt;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use bevy_burrow::brush::Edit;

use crate::ExportError;
use crate::brush_lines::{Fault, Line, Lines};

/// An edit and its line number, from 1.
#[derive(Debug)]
pub struct ScriptedEdit {
    pub line: usize,
    pub edit: Edit,
}

/// Every bad line of a script; displayed one per line, like compiler errors.
#[derive(Debug)]
pub struct BadLines {
    path: PathBuf,
    lines: Vec<(usize, String)>,
}

/// The largest number of bad lines that are displayed.
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

/// Reads a whole script, or returns the faults of all bad lines.
pub fn read(path: &Path) -> Result<Vec<ScriptedEdit>, ExportError> {
    let failed = |reason| ExportError::Read { path: path.into(), reason };
    let script = BufReader::new(File::open(path).map_err(failed)?);
    let (mut edits, mut bad) = (Vec::new(), Vec::new());
    for line in Lines::new(script) {
        match line {
            Ok((line, said)) => match edit(&said) {
                Ok(edit) => edits.push(ScriptedEdit { line, edit }),
                Err(reason) => bad.push((line, reason)),
            },
            Err(Fault::Line { number, reason }) => bad.push((number, reason)),
            Err(Fault::End(reason)) => return Err(failed(reason)),
        }
    }
    if bad.is_empty() { Ok(edits) } else { Err(BadLines { path: path.into(), lines: bad }.into()) }
}

/// The edit on a line.
fn edit(line: &Line) -> Result<Edit, String> {
    match line {
        Line::Brush(brush) => Edit::quantize(brush).map_err(|error| error.to_string()),
        Line::Undo | Line::Redo => Err("there are no steps through history here, only edits".into()),
    }
}
