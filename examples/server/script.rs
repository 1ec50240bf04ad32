//! The source of brushes: a file, standard input, or none.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use bevy::prelude::*;
use bevy_burrow::plugin::{Redo, Undo};
use bevy_burrow::prelude::*;

use crate::Options;
use crate::brush_lines::{Line, Lines};
use crate::output::complain;
use crate::report::Report;

/// Lines that wait to be sent, at most.
const MAX_WAITING: usize = 1024;

/// How long nothing is done where there is nothing to do.
const REST: Duration = Duration::from_millis(1);

/// A line, or what is wrong with it or with the whole script.
type Entry = Result<Line, String>;

/// Lines still to come.
enum Feed {
    /// Made up, or read from a file, only when their turn comes.
    Ready(Box<dyn Iterator<Item = Entry> + Send + Sync>),
    /// Read by a separate thread, so that the server does not wait for input.
    Coming(Mutex<Receiver<Entry>>),
    /// There are none.
    Over,
}

/// The requests, line by line.
#[derive(Resource)]
pub struct Source {
    feed: Feed,
    /// The line whose turn it is.
    next: Option<Entry>,
    per_tick: u64,
    sent: u64,
}

/// Opens what the options name.
pub fn open(options: &Options) -> Result<Source> {
    let feed = match options.script.as_deref() {
        None => Feed::Ready(Box::new(made_up(options).map(Entry::Ok))),
        Some(path) if path == Path::new("-") => listen(io::stdin(), "standard input".into()),
        Some(path) => {
            let name = path.display().to_string();
            let at = |error: io::Error| format!("{name}: {error}");
            let file = File::open(path).map_err(at)?;
            let kind = file.metadata().map_err(at)?;
            if kind.is_dir() {
                return Err(format!("{name}: is a folder").into());
            }
            // Pipes are files too, and may be silent.
            if kind.is_file() { Feed::Ready(Box::new(entries(file, name))) } else { listen(file, name) }
        }
    };
    Ok(Source { feed, next: None, per_tick: options.per_tick, sent: 0 })
}

/// Lines of a script, read on request.
fn entries(script: impl Read, name: String) -> impl Iterator<Item = Entry> {
    let lines = Lines::new(BufReader::new(script));
    lines.map(move |line| line.map(|(_, line)| line).map_err(|fault| format!("{name}: {fault}")))
}

/// Lines of interactive input, which may pause. Input that arrives faster than it is sent has to wait.
fn listen(script: impl Read + Send + 'static, name: String) -> Feed {
    let (sender, receiver) = sync_channel(MAX_WAITING);
    std::thread::spawn(move || {
        entries(script, name).map_while(|entry| sender.send(entry).ok()).for_each(drop);
    });
    Feed::Coming(Mutex::new(receiver))
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

/// Sends some brushes each tick, and ends the program once none is left and all have receipts.
pub fn add(app: &mut App, source: Source) {
    app.insert_resource(source).add_systems(Update, send.before(BurrowSystems::Collect));
}

fn send(
    mut source: ResMut<Source>,
    terrains: Query<&Terrain>,
    mut report: ResMut<Report>,
    mut brushes: MessageWriter<Brush>,
    mut undos: MessageWriter<Undo>,
    mut redos: MessageWriter<Redo>,
    mut exit: MessageWriter<AppExit>,
) {
    let source = &mut *source;
    // One tick after the other: what waits does not grow, however long the script is.
    let is_idle = terrains.iter().all(|terrain| terrain.queued() == 0 && !terrain.is_busy());
    if !is_idle || report.answered < source.sent {
        return;
    }
    let (before, due) = (source.sent, source.due());
    for _ in 0..due {
        source.look();
        let is_step = matches!(source.next, Some(Ok(Line::Undo | Line::Redo)));
        if is_step && source.sent > before {
            break;
        }
        match source.next.take() {
            Some(Ok(line)) => {
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
            Some(Err(error)) => {
                complain(format_args!("{error}"));
                report.faults += 1;
            }
            None => break,
        }
        if is_step {
            break;
        }
    }
    if source.next.is_some() || source.sent > before {
        return;
    }
    match source.feed {
        Feed::Ready(_) => {}
        // Without a number of ticks to keep to, waiting would take all of a core.
        Feed::Coming(_) => std::thread::sleep(REST),
        Feed::Over if report.is_done => {}
        Feed::Over => {
            report.is_done = true;
            exit.write(if report.faults == 0 { AppExit::Success } else { AppExit::error() });
        }
    }
}

impl Source {
    /// Lines of one tick, at most. Of those that come as somebody says them each is one of its own: how many are there
    /// by now is chance.
    fn due(&self) -> u64 {
        if matches!(self.feed, Feed::Coming(_)) { 1 } else { self.per_tick }
    }

    /// Takes the next line, if none is taken and there is one by now.
    fn look(&mut self) {
        if self.next.is_some() {
            return;
        }
        let (next, is_over) = match &mut self.feed {
            Feed::Ready(lines) => {
                let next = lines.next();
                let is_over = next.is_none();
                (next, is_over)
            }
            Feed::Coming(lines) => {
                let lines = lines.get_mut().unwrap_or_else(PoisonError::into_inner);
                match lines.try_recv() {
                    Ok(line) => (Some(line), false),
                    Err(error) => (None, error == TryRecvError::Disconnected),
                }
            }
            Feed::Over => (None, true),
        };
        self.next = next;
        if is_over {
            self.feed = Feed::Over;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::TrySendError;

    use clap::Parser;

    use super::*;

    #[test]
    fn a_folder_is_refused_by_its_name() {
        let folder = std::env::temp_dir();
        let arguments = ["server".as_ref(), "--script".as_ref(), folder.as_os_str()];
        let Err(error) = open(&Options::parse_from(arguments)) else { panic!("a folder is a script") };
        let error = error.to_string();
        assert!(error.contains(&*folder.to_string_lossy()) && error.contains("folder"), "{error}");
    }

    #[test]
    fn senders_over_the_limit_have_to_wait() {
        let (sender, receiver) = sync_channel(3);
        let feed = Feed::Coming(Mutex::new(receiver));
        let mut source = Source { feed, next: None, per_tick: 1, sent: 0 };
        for _ in 0..3 {
            sender.try_send(Ok(Line::Undo)).expect("room for three");
        }
        // One is taken, however often it looks.
        (0..3).for_each(|_| source.look());
        assert_eq!(source.next, Some(Ok(Line::Undo)));
        assert_eq!(sender.try_send(Ok(Line::Undo)), Ok(()));
        assert_eq!(sender.try_send(Ok(Line::Redo)), Err(TrySendError::Full(Ok(Line::Redo))));
        drop(sender);
        for _ in 0..3 {
            source.next = None;
            source.look();
            assert!(source.next.is_some());
        }
        source.next = None;
        source.look();
        assert!(source.next.is_none() && matches!(source.feed, Feed::Over));
    }

    #[test]
    fn a_fault_names_its_file_and_line_and_later_lines_are_read() {
        let script = "{\"undo\":true}\ndig\n{\"redo\":true}\n";
        let found: Vec<Entry> = entries(script.as_bytes(), "a.jsonl".into()).collect();
        let fault = "a.jsonl: line 2: expected a JSON object in braces";
        assert_eq!(found, [Ok(Line::Undo), Err(fault.into()), Ok(Line::Redo)]);
    }
}
