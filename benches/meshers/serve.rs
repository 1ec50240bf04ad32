//! Meshes on request, so that another program can time its mesher and ours in turns.
//!
//! A request is a line `FIELD SIZE cut|closed CONTENDER`, where the contender's name extends to the end of the line.
//! The answer is a line of JSON: the nanoseconds of one call, after an untimed one; for closed grids also the
//! topology.

use std::io::{self, BufRead, Write};

use clap::ValueEnum;
use serde::Serialize;

use crate::contender::Part;
use crate::fields::{Border, Field, Grid};
use crate::topology::Topology;
use crate::{registry, timing};

#[derive(Serialize)]
struct Answer {
    nanoseconds: f64,
    triangles: usize,
    topology: Option<Topology>,
}

struct Request<'a> {
    field: Field,
    size: usize,
    border: Border,
    contender: &'a str,
}

impl<'a> Request<'a> {
    fn parse(line: &'a str) -> Option<Self> {
        let mut words = line.trim_end().splitn(4, ' ');
        let field = Field::from_str(words.next()?, false).ok()?;
        let size = words.next()?.parse().ok()?;
        let border = match words.next()? {
            "cut" => Border::Cut,
            "closed" => Border::Closed,
            _ => return None,
        };
        Some(Self { field, size, border, contender: words.next()? })
    }
}

/// Answers requests until the input ends.
pub fn run() -> io::Result<()> {
    let mut contenders = registry::all();
    let mut held: Option<(Field, usize, Border, Grid)> = None;
    let mut output = io::stdout().lock();
    for line in io::stdin().lock().lines() {
        let line = line?;
        let unknown = || io::Error::new(io::ErrorKind::InvalidData, format!("no such request: {line}"));
        let Request { field, size, border, contender } = Request::parse(&line).ok_or_else(unknown)?;
        let named = contenders.iter_mut().find(|candidate| candidate.name() == contender);
        let contender = named.ok_or_else(unknown)?;
        let held_now = held.take().filter(|(f, s, b, _)| (*f, *s, *b) == (field, size, border));
        let (.., grid) =
            held.insert(held_now.unwrap_or_else(|| (field, size, border, field.grid(size, border))));
        contender.load(grid);
        contender.mesh(grid, Part::Whole);
        let nanoseconds = timing::once(&mut **contender, grid, Part::Whole);
        let topology = match border {
            Border::Cut => None,
            Border::Closed => Topology::of(&contender.result(), contender.class().sharing).ok(),
        };
        let answer = Answer { nanoseconds, triangles: contender.triangles(), topology };
        serde_json::to_writer(&mut output, &answer)?;
        writeln!(output)?;
        output.flush()?;
    }
    Ok(())
}
