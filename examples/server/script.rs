//! Where brushes come from: a file, standard input, or nowhere.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};

use bevy::prelude::*;
use bevy_burrow::brush::BrushRecord;
use bevy_burrow::plugin::{Redo, Undo};
use bevy_burrow::prelude::*;
use serde::Deserialize;

use crate::Options;
use crate::ledger::Ledger;

/// Brushes that wait for the ground at most before others are sent.
const MOST_WAITING: usize = 1024;

/// A line of a script.
#[derive(Clone, Debug, PartialEq)]
pub enum Line {
    Brush(Brush),
    Undo,
    Redo,
}

/// A step through history as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Step {
    undo: Option<bool>,
    redo: Option<bool>,
}

/// Lines that were read, and those still to come.
#[derive(Resource)]
pub struct Source {
    ready: VecDeque<Result<Line, String>>,
    /// Read by a thread of its own, so that a silent player holds nobody up.
    coming: Option<Mutex<Receiver<Result<Line, String>>>>,
    /// Made up only when their turn comes.
    made_up: Option<Box<dyn Iterator<Item = Line> + Send + Sync>>,
    per_tick: u64,
    sent: u64,
}

/// Opens what the options name.
pub fn open(options: &Options) -> Result<Source> {
    let mut source =
        Source { ready: VecDeque::new(), coming: None, made_up: None, per_tick: options.per_tick, sent: 0 };
    match options.script.as_deref() {
        None => source.made_up = Some(Box::new(made_up(options))),
        Some(path) if path == Path::new("-") => {
            let (sender, receiver) = sync_channel(1024);
            std::thread::spawn(move || {
                let lines = std::io::stdin().lock().lines().zip(1..);
                let parsed = lines.filter_map(|(line, number)| parse(line, number));
                parsed.map_while(|line| sender.send(line).ok()).for_each(drop);
            });
            source.coming = Some(Mutex::new(receiver));
        }
        Some(path) => {
            let file = File::open(path).map_err(|error| format!("{}: {error}", path.display()))?;
            let lines = BufReader::new(file).lines().zip(1..);
            source.ready = lines.filter_map(|(line, number)| parse(line, number)).collect();
        }
    }
    Ok(source)
}

/// What a line says; nothing on a blank one or a comment.
fn parse(line: std::io::Result<String>, number: usize) -> Option<Result<Line, String>> {
    let at = |error: String| format!("line {number}: {error}");
    let line = match line {
        Ok(line) => line,
        Err(error) => return Some(Err(at(error.to_string()))),
    };
    let text = line.trim();
    if text.is_empty() || text.starts_with('#') {
        return None;
    }
    if let Ok(step) = serde_json::from_str::<Step>(text) {
        return Some(match (step.undo, step.redo) {
            (Some(true), None) => Ok(Line::Undo),
            (None, Some(true)) => Ok(Line::Redo),
            _ => Err(at("either undo or redo is to be true".into())),
        });
    }
    let record = serde_json::from_str::<BrushRecord>(text).map_err(|error| error.to_string());
    let brush = record.and_then(|record| Brush::try_from(record).map_err(|error| error.to_string()));
    Some(brush.map(Line::Brush).map_err(at))
}

/// Digs, hills and paint all over the world, the same each time.
fn made_up(options: &Options) -> impl Iterator<Item = Line> + use<> {
    let (side, count) = (options.side as f32, options.brushes);
    let mut random = fastrand::Rng::with_seed(7);
    (0..count).map(move |_| {
        let place = Vec3::new(random.f32() * side, random.f32() * 60.0 - 30.0, random.f32() * side);
        let shape = Shape::sphere(place, 3.0 + 5.0 * random.f32());
        let material = MaterialId(random.u8(0..8));
        Line::Brush(match random.u8(0..10) {
            0 => Brush::paint(shape, material),
            1 | 2 => Brush::add(shape, material),
            3 => Brush::smooth(shape, 0.8),
            _ => Brush::dig(shape),
        })
    })
}

/// Sends brushes, so many each tick, and ends the program when none is left and all are answered.
pub fn add(app: &mut App, source: Source) {
    app.insert_resource(source).add_systems(Update, send.before(BurrowSystems::Collect));
}

fn send(
    mut source: ResMut<Source>,
    terrains: Query<&Terrain>,
    mut ledger: ResMut<Ledger>,
    mut brushes: MessageWriter<Brush>,
    mut undos: MessageWriter<Undo>,
    mut redos: MessageWriter<Redo>,
    mut exit: MessageWriter<AppExit>,
) {
    let source = &mut *source;
    let is_open = source.receive();
    // Who sends faster than the ground is dug waits, or memory would fill with what waits.
    let is_full = terrains.iter().any(|terrain| terrain.queued() >= MOST_WAITING);
    let due = if is_full { 0 } else { source.per_tick };
    let is_idle = terrains.iter().all(|terrain| terrain.queued() == 0 && !terrain.is_busy());
    for _ in 0..due {
        // A step is no part of a batch: what it undoes should not depend on how fast the server is.
        let is_step = matches!(source.ready.front(), Some(Ok(Line::Undo | Line::Redo)));
        if is_step && !(is_idle && ledger.answered >= source.sent) {
            break;
        }
        let made_up = || source.made_up.as_mut().and_then(Iterator::next).map(Ok);
        let Some(line) = source.ready.pop_front().or_else(made_up) else {
            source.made_up = None;
            break;
        };
        match line {
            Ok(line) => {
                source.sent += 1;
                match line {
                    Line::Brush(brush) => {
                        let tag = if brush.tag == 0 { source.sent } else { brush.tag };
                        brushes.write(brush.with_tag(tag));
                    }
                    Line::Undo => drop(undos.write(Undo::default())),
                    Line::Redo => drop(redos.write(Redo::default())),
                }
            }
            Err(error) => {
                eprintln!("{error}");
                ledger.faults += 1;
            }
        }
        if is_step {
            break;
        }
    }
    let is_over = !is_open && source.ready.is_empty() && source.made_up.is_none();
    if is_over && ledger.answered >= source.sent && is_idle && !ledger.is_done {
        ledger.is_done = true;
        exit.write(if ledger.faults == 0 { AppExit::Success } else { AppExit::error() });
    }
}

impl Source {
    /// Takes in what has come; says whether more may.
    fn receive(&mut self) -> bool {
        let Some(coming) = &mut self.coming else { return false };
        let Ok(coming) = coming.get_mut() else { return false };
        loop {
            match coming.try_recv() {
                Ok(line) => self.ready.push_back(line),
                Err(TryRecvError::Empty) => return true,
                Err(TryRecvError::Disconnected) => break,
            }
        }
        self.coming = None;
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Option<Result<Line, String>> {
        parse(Ok(line.into()), 3)
    }

    #[test]
    fn lines_are_brushes_steps_or_nothing() {
        let brush = Brush::dig(Shape::sphere(Vec3::new(8.0, 0.0, 8.0), 4.0));
        let line = r#"{"shape":"sphere","center":[8,0,8],"radius":4,"op":"dig"}"#;
        assert_eq!(read(line), Some(Ok(Line::Brush(brush))));
        assert_eq!(read(r#"{"undo":true}"#), Some(Ok(Line::Undo)));
        assert_eq!(read(r#" {"redo":true} "#), Some(Ok(Line::Redo)));
        assert_eq!((read("# words"), read("  ")), (None, None));
        for bad in [r#"{"undo":false}"#, r#"{"undo":true,"redo":true}"#, "{}", "dig", r#"{"shape":"ball"}"#] {
            let error = read(bad).expect("a line").expect_err(bad);
            assert!(error.starts_with("line 3: "), "{error}");
        }
    }
}
