//! Scripts of brushes, one JSON object per line. Shared by examples, which include this file by path.
//!
//! A line is a [`Brush`] in voxels, or a history step: `{"undo":true}` or `{"redo":true}`. Blank lines and lines that
//! start with `#` are skipped.

use std::fmt;
use std::io::{self, BufRead, Read};

use bevy_burrow::brush::Brush;
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

/// Longest line in bytes; the largest stamp takes half a million. Longer lines would only fill memory.
const LONGEST: u64 = 1 << 24;

/// The content of a line.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "nearly all lines are brushes")]
pub enum Line {
    Brush(Brush),
    Undo,
    Redo,
}

/// Errors of a script.
#[derive(Debug)]
pub enum Fault {
    /// A line is invalid. Others may follow.
    Line { number: usize, reason: String },
    /// The script cannot be read. Nothing follows.
    End(io::Error),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line { number, reason } => write!(f, "line {number}: {reason}"),
            Self::End(error) => write!(f, "{error}"),
        }
    }
}

/// The non-empty lines of a script, with their numbers from 1; each is read when it is requested.
pub struct Lines<R> {
    reader: R,
    /// The most recently read line.
    number: usize,
    bytes: Vec<u8>,
    is_over: bool,
}

impl<R: BufRead> Lines<R> {
    pub fn new(reader: R) -> Self {
        Self { reader, number: 0, bytes: Vec::new(), is_over: false }
    }

    /// Reads a line; false at the end.
    fn read(&mut self) -> io::Result<bool> {
        self.bytes.clear();
        self.number += 1;
        let read = self.reader.by_ref().take(LONGEST).read_until(b'\n', &mut self.bytes)?;
        if read as u64 == LONGEST {
            let reason = format!("line {} is too long", self.number);
            return Err(io::Error::new(io::ErrorKind::InvalidData, reason));
        }
        Ok(read > 0)
    }
}

impl<R: BufRead> Iterator for Lines<R> {
    type Item = Result<(usize, Line), Fault>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.is_over {
            match self.read() {
                Ok(true) => {}
                Ok(false) => break,
                // Reading would fail again, for ever.
                Err(error) => {
                    self.is_over = true;
                    return Some(Err(Fault::End(error)));
                }
            }
            let number = self.number;
            match parse(&self.bytes) {
                Ok(Some(line)) => return Some(Ok((number, line))),
                Ok(None) => {}
                Err(reason) => return Some(Err(Fault::Line { number, reason })),
            }
        }
        self.is_over = true;
        None
    }
}

/// Whether a line has the fields of a history step. Parsed first, so that errors refer to the right kind of line.
#[derive(Deserialize)]
struct Kind {
    undo: Option<IgnoredAny>,
    redo: Option<IgnoredAny>,
}

/// A history step in JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Step {
    undo: Option<bool>,
    redo: Option<bool>,
}

/// Parses a line; `None` for a blank line or a comment.
fn parse(line: &[u8]) -> Result<Option<Line>, String> {
    let text = std::str::from_utf8(line).map_err(|_| "the line is not UTF-8")?;
    // Some editors begin a file with a byte order mark.
    let text = text.trim_start_matches('\u{feff}').trim_end();
    let start = text.trim_start();
    if start.is_empty() || start.starts_with('#') {
        return Ok(None);
    }
    // Serde would accept an array of the fields in order.
    if !start.starts_with('{') {
        return Err("expected a JSON object in braces".into());
    }
    let is_step = |kind: Kind| kind.undo.is_some() || kind.redo.is_some();
    if serde_json::from_str(text).is_ok_and(is_step) {
        return match read::<Step>(text)? {
            Step { undo: Some(true), redo: None } => Ok(Some(Line::Undo)),
            Step { undo: None, redo: Some(true) } => Ok(Some(Line::Redo)),
            _ => Err("either `undo` or `redo` is to be true".into()),
        };
    }
    Ok(Some(Line::Brush(read(text)?)))
}

/// Parses a JSON object; the caller adds the line number to errors.
fn read<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|error| {
        let reason = error.to_string();
        let reason = reason.rsplit_once(" at line ").map_or(reason.as_str(), |(reason, _)| reason);
        format!("column {}: {reason}", error.column())
    })
}

#[cfg(test)]
mod tests {
    use std::io::{BufReader, Cursor};

    use bevy_burrow::brush::Shape;
    use glam::Vec3;

    use super::*;

    const DIG: &str = r#"{"shape":"sphere","center":[8,0,8],"radius":4,"op":"dig"}"#;

    fn dig() -> Line {
        Line::Brush(Brush::dig(Shape::sphere(Vec3::new(8.0, 0.0, 8.0), 4.0)))
    }

    fn fault(line: &str) -> String {
        parse(line.as_bytes()).expect_err(line)
    }

    #[test]
    fn lines_are_brushes_steps_or_nothing() {
        let said = |line: &str| parse(line.as_bytes()).expect(line);
        assert_eq!(said(DIG), Some(dig()));
        assert_eq!(said(r#"{"undo":true}"#), Some(Line::Undo));
        assert_eq!(said(" {\"redo\":true} \r\n"), Some(Line::Redo));
        assert_eq!([said("# words"), said("  \r\n"), said("")], [None, None, None]);
    }

    #[test]
    fn a_byte_order_mark_is_skipped() {
        let script = format!("\u{feff}{DIG}\n\u{feff}# words\n");
        let lines: Vec<_> = Lines::new(script.as_bytes()).map(|line| line.expect("a good line")).collect();
        assert_eq!(lines, [(1, dig())]);
    }

    #[test]
    fn faults_say_what_is_wrong_and_in_which_column() {
        for (line, reason) in [
            ("[true,null]", "expected a JSON object in braces"),
            ("[]", "expected a JSON object in braces"),
            ("dig", "expected a JSON object in braces"),
            ("{}", "column 2: missing field `shape`"),
            (r#"{"undo":false}"#, "either `undo` or `redo` is to be true"),
            (r#"{"undo":true,"redo":true}"#, "either `undo` or `redo` is to be true"),
            (r#"{"undo":1}"#, "column 9: invalid type: integer `1`, expected a boolean"),
            (r#"{"shape":"ball"}"#, "column 16: unknown variant `ball`"),
            (r#"  {"shape":"ball"}"#, "column 18: unknown variant `ball`"),
            ("{", "column 1: EOF while parsing"),
        ] {
            let found = fault(line);
            assert!(found.starts_with(reason) && !found.contains("at line"), "{line}: {found}");
        }
        assert!(fault(r#"{"undo":true,"by":2}"#).contains("unknown field `by`"));
        assert_eq!(parse(b"\xff\xfe{"), Err("the line is not UTF-8".into()));
    }

    #[test]
    fn lines_are_read_only_as_they_are_asked_for() {
        let mut script = Cursor::new(format!("# words\n{DIG}\n{{\n{DIG}\n"));
        let mut lines = Lines::new(&mut script);
        assert!(matches!(lines.next(), Some(Ok((2, Line::Brush(_))))));
        assert!(matches!(lines.next(), Some(Err(Fault::Line { number: 3, .. }))));
        assert_eq!(script.position(), ("# words\n{\n".len() + DIG.len() + 1) as u64);
    }

    /// A reader that fails, like that of a folder.
    struct Folder;

    impl Read for Folder {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(io::ErrorKind::IsADirectory.into())
        }
    }

    #[test]
    fn a_read_error_ends_the_script() {
        let mut lines = Lines::new(BufReader::new(Folder));
        assert!(matches!(lines.next(), Some(Err(Fault::End(_)))));
        assert!(lines.next().is_none());
        let mut endless = Lines::new(BufReader::new(io::repeat(b' ')));
        let Some(Err(fault)) = endless.next() else { panic!("a line without an end") };
        assert_eq!(fault.to_string(), "line 1 is too long");
        assert!(endless.next().is_none());
    }
}
