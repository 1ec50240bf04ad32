//! Walls: triangles in the plane between a coarse cell and finer ones, where edits keep a fan from closing it.
//!
//! An undisturbed interval needs one where its coarse cell is volumetric: a zipper between the lines of both sides. A
//! disturbed one, and whatever edits made off the sheet, is closed square by square.

use glam::IVec3;

use super::Fault;
use super::builder::Number;
use super::drawing::Drawing;
use super::edge::Edge;
use super::sides::{Cell, Interval};

/// A segment of an outline, from vertex to vertex.
type Segment = (Number, Number);

impl Drawing<'_> {
    /// Closes a side of a cell towards finer cells.
    pub(super) fn close_side(&mut self, cell: Cell, interval: Interval) {
        let (coarse, fine, columns) = (interval.coarse(), interval.fine(), interval.columns());
        let mut rows = Vec::new();
        columns.iter().for_each(|&column| self.finer_rows(column, fine, &mut rows));
        // Squares that touch an edited sample.
        let mut squares: Vec<i32> =
            rows.into_iter().flat_map(|y| [y, y - 1].map(|y| y.div_euclid(coarse) * coarse)).collect();
        let sheet = self.view.sheet(&columns, coarse);
        if self.volumetric.is_interval_disturbed(interval) {
            squares.extend(sheet.step_by(coarse as usize));
        } else {
            if self.volumetric.contains(cell) && !self.view.has(Fault::NoZipper) {
                let [low, high] = [false, true].map(|is_above| self.border(interval, is_above));
                self.zipper(interval, &low, &high);
            }
            squares.retain(|y| !sheet.contains(y));
        }
        squares.sort_unstable();
        squares.dedup();
        if !self.view.has(Fault::NoSquares) {
            squares.into_iter().for_each(|y| self.wall_square(interval, y));
        }
    }

    /// Fills between two lines with the same ends: always advances the one whose next vertex comes first.
    fn zipper(&mut self, interval: Interval, low: &[Number], high: &[Number]) {
        let along = interval.along();
        let at = |drawing: &Self, number: Number| drawing.builder.position(number)[along];
        let (mut i, mut j) = (0, 0);
        while i + 1 < low.len() || j + 1 < high.len() {
            let is_low =
                i + 1 < low.len() && (j + 1 == high.len() || at(self, low[i + 1]) <= at(self, high[j + 1]));
            let mut triangle =
                if is_low { [high[j], low[i + 1], low[i]] } else { [high[j], high[j + 1], low[i]] };
            (i, j) = if is_low { (i + 1, j) } else { (i, j + 1) };
            // Triangles are wound for a plane across z; on one across x the axes turn the other way.
            if interval.axis == 0 {
                triangle.reverse();
            }
            self.builder.emit(triangle);
        }
    }

    /// Where edits show: what the cubes below the plane draw, less what those above it draw, closed by links, bounds
    /// loops to fill.
    fn wall_square(&mut self, interval: Interval, y: i32) {
        let mut segments = self.outline(interval, y, interval.stride(false));
        let high = self.outline(interval, y, interval.stride(true));
        segments.extend(high.into_iter().map(|(from, to)| (to, from)));
        if interval.axis == 0 {
            segments.iter_mut().for_each(|segment| *segment = (segment.1, segment.0));
        }
        let (start, coarse, fine) = (interval.start, interval.coarse(), interval.fine());
        let edges = [0, fine, coarse].map(|step| {
            [
                interval.point(start + step, y),
                interval.point(start + coarse, y + step),
                interval.point(start + step, y + coarse),
                interval.point(start, y + step),
            ]
        });
        let mut links = Vec::new();
        for edge in 0..4 {
            self.link(edges.map(|points| points[edge]), &mut links);
        }
        direct(&mut segments, &links);
        for turns in loops(&remaining(&segments)) {
            self.fill(interval, &turns);
        }
    }

    /// The segments that cubes of this stride draw in a square of the interval, solid on their left.
    fn outline(&mut self, interval: Interval, y: i32, stride: i32) -> Vec<Segment> {
        let (coarse, mut segments) = (interval.coarse(), Vec::new());
        let steps = || (0..coarse).step_by(stride as usize);
        for (along, up) in steps().flat_map(|along| steps().map(move |up| (along, up))) {
            let corner =
                |dx: i32, dy: i32| interval.point(interval.start + along + dx * stride, y + up + dy * stride);
            self.square([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)], &mut segments);
        }
        segments
    }

    /// The rule of the case table for a face: where it is ambiguous, a solid corner is cut off separately.
    fn square(&mut self, corners: [IVec3; 4], segments: &mut Vec<Segment>) {
        let solid = corners.map(|corner| self.view.is_solid(corner));
        let count = solid.iter().filter(|&&is| is).count();
        let is_ambiguous = count == 2 && solid[0] == solid[2];
        let enters = (0..4).filter(|&i| !solid[(i + 3) % 4] && solid[i]);
        for i in enters {
            // From the edge where solid ends to that where it begins.
            let leaves = (i..i + 4).find(|&j| is_ambiguous || !solid[(j + 1) % 4]).unwrap_or(i) % 4;
            let [from, to] = [leaves, (i + 3) % 4]
                .map(|edge| self.wall_number(Edge::between(corners[edge], corners[(edge + 1) % 4])));
            segments.push((from, to));
        }
    }

    fn wall_number(&mut self, edge: Edge) -> Number {
        if self.view.has(Fault::LinearWalls) {
            let vertex = edge.linear_vertex(&self.view, self.origin());
            return self.builder.number(vertex);
        }
        self.edge_number(edge)
    }

    /// On an edge of a square, alike from both squares that have it: the last fine crossing joins the coarse one,
    /// others pair up.
    fn link(&mut self, [low, middle, high]: [IVec3; 3], links: &mut Vec<Segment>) {
        let mut crossings = |line: &[IVec3]| -> Vec<Number> {
            let crossed =
                line.windows(2).filter(|ends| self.view.is_solid(ends[0]) != self.view.is_solid(ends[1]));
            let edges: Vec<Edge> = crossed.map(|ends| Edge::between(ends[0], ends[1])).collect();
            edges.into_iter().map(|edge| self.wall_number(edge)).collect()
        };
        let (fine, coarse) = (crossings(&[low, middle, high]), crossings(&[low, high]));
        links.extend(fine.last().copied().zip(coarse.first().copied()));
        links.extend(fine.chunks_exact(2).map(|pair| (pair[0], pair[1])));
    }

    /// Fills a loop with its fan of least total area: one that does not fold over, where there is such a fan.
    fn fill(&mut self, interval: Interval, turns: &[Number]) {
        let places: Vec<(i64, i64)> = turns
            .iter()
            .map(|&number| {
                let position = self.builder.position(number);
                (i64::from(position[interval.along()]), i64::from(position.y))
            })
            .collect();
        let count = turns.len();
        let area = |first: usize| {
            let from = |at: usize| {
                let (place, apex) = (places[(first + at) % count], places[first]);
                (i128::from(place.0 - apex.0), i128::from(place.1 - apex.1))
            };
            let twice = |at: usize| {
                let (a, b) = (from(at), from(at + 1));
                (a.0 * b.1 - b.0 * a.1).abs()
            };
            (1..count.saturating_sub(1)).map(twice).sum::<i128>()
        };
        let Some(first) = (0..count).min_by_key(|&first| area(first)) else { return };
        let at = |step: usize| turns[(first + step) % count];
        let fan: Vec<[Number; 3]> =
            (1..count.saturating_sub(1)).map(|step| [at(0), at(step), at(step + 1)]).collect();
        fan.iter().for_each(|&triangle| self.builder.emit(triangle));
        if self.view.has(Fault::ThreeCoats) {
            fan.iter().for_each(|&triangle| self.builder.emit(triangle));
            fan.iter().for_each(|&[a, b, c]| self.builder.emit([c, b, a]));
        }
    }
}

/// Adds links, each the way that gives its vertices as many segments in as out.
fn direct(segments: &mut Vec<Segment>, links: &[Segment]) {
    let balance = |segments: &[Segment], vertex: Number| {
        let out = segments.iter().filter(|segment| segment.0 == vertex).count();
        let into = segments.iter().filter(|segment| segment.1 == vertex).count();
        out.cmp(&into)
    };
    for &(a, b) in links.iter().filter(|(a, b)| a != b) {
        let is_reversed = balance(segments, a).is_gt() || balance(segments, b).is_lt();
        segments.push(if is_reversed { (b, a) } else { (a, b) });
    }
}

/// A segment and its reverse enclose nothing: both go, and so do segments without length.
fn remaining(segments: &[Segment]) -> Vec<Segment> {
    let mut left: Vec<Segment> = Vec::with_capacity(segments.len());
    for &(from, to) in segments.iter().filter(|(from, to)| from != to) {
        match left.iter().rposition(|&other| other == (to, from)) {
            Some(at) => drop(left.remove(at)),
            None => left.push((from, to)),
        }
    }
    left
}

/// Splits balanced segments into loops that visit no vertex twice.
fn loops(segments: &[Segment]) -> Vec<Vec<Number>> {
    let mut follow: Vec<(Number, Vec<Number>)> = Vec::new();
    for &(from, to) in segments {
        match follow.iter_mut().find(|own| own.0 == from) {
            Some(own) => own.1.push(to),
            None => follow.push((from, vec![to])),
        }
    }
    let mut found = Vec::new();
    for first in 0..follow.len() {
        while !follow[first].1.is_empty() {
            let mut path = vec![follow[first].0];
            while let Some(&end) = path.last() {
                let next = follow.iter_mut().find(|own| own.0 == end).and_then(|own| own.1.pop());
                let Some(next) = next else { break };
                match path.iter().position(|&vertex| vertex == next) {
                    Some(at) => {
                        found.push(path[at..].to_vec());
                        path.truncate(if at > 0 { at + 1 } else { 0 });
                    }
                    None => path.push(next),
                }
            }
        }
    }
    found
}
