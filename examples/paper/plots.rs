//! Plots as SVG: the paper's figures and ours.

use std::ops::Range;
use std::path::Path;

use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::backend::Backend;
use crate::edits::Run;
use crate::error::PaperError;
use crate::full::Output;
use crate::measure::{Measured, Measurements};
use crate::published::{self, CHUNK_SIZES};
use crate::setup::Subject;
use crate::stats::{self, Statistics};

/// Every plot: its file and what it shows.
pub const PLOTS: [(&str, &str); 6] = [
    ("first_run.svg", "First run: total time of all edits, seconds"),
    ("second_run.svg", "Second run: total time of all edits, seconds"),
    ("growth.svg", "Second run: average time over that of chunk size 25"),
    ("full.svg", "Second run: hybrid with chunk size 25 and full fields, total seconds"),
    ("edits.svg", "Second run: CPU milliseconds of each edit, in order"),
    ("sorted.svg", "Second run: CPU milliseconds of an edit, sorted"),
];

const SIZE: (u32, u32) = (820, 460);

/// Colours of the paper's CPU and GPU, then ours.
const WHO: [RGBColor; 4] =
    [RGBColor(165, 165, 165), RGBColor(100, 100, 100), RGBColor(31, 119, 180), RGBColor(44, 160, 44)];
/// Colours of the full fields, then of the hybrid's chunk sizes.
const FULL: [RGBColor; 2] = [RGBColor(60, 60, 60), RGBColor(160, 160, 160)];
const CHUNKS: [RGBColor; 4] =
    [RGBColor(31, 119, 180), RGBColor(44, 160, 44), RGBColor(255, 127, 14), RGBColor(148, 103, 189)];

/// A named row of values; missing ones are not drawn.
#[derive(Clone)]
struct Row {
    name: String,
    color: RGBColor,
    values: Vec<Option<f64>>,
}

/// Draws all plots into a folder.
pub fn draw(measurements: &Measurements, folder: &Path) -> Result<(), PaperError> {
    let [first, second, growth, full, edits, sorted] = PLOTS.map(|(file, title)| (folder.join(file), title));
    let sizes = CHUNK_SIZES.map(|size| format!("chunk size {size}"));
    let draw = || -> Result<(), Box<dyn std::error::Error>> {
        bars(&first, &sizes, &totals(measurements, Run::First))?;
        bars(&second, &sizes, &totals(measurements, Run::Second))?;
        bars(&growth, &sizes, &growths(measurements))?;
        let full_fields = Output::BOTH.map(|output| Subject::Full(output).title());
        let groups = [&["hybrid, chunk size 25".to_owned()][..], &full_fields].concat();
        bars(&full, &groups, &chunked_and_full(measurements))?;
        let latencies = latencies(measurements);
        lines(&edits, "edit", &latencies)?;
        let mut in_order = latencies;
        for row in &mut in_order {
            row.values.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        }
        lines(&sorted, "edits that took no longer", &in_order)?;
        Ok(())
    };
    draw().map_err(|reason| PaperError::Plot(reason.to_string()))
}

fn total(measured: &Measured) -> f64 {
    Statistics::of(&measured.repeats).total
}

/// For both backends the paper's values of each chunk size, and ours where available.
fn rows(
    measurements: &Measurements,
    run: Run,
    paper: impl Fn(&published::Column) -> f64,
    here: impl Fn(&Measured) -> f64,
) -> Vec<Row> {
    let with_color = |first: usize| Backend::ALL.into_iter().zip(WHO.into_iter().skip(first));
    let published = with_color(0).map(|(backend, color)| Row {
        name: format!("paper, {}", backend.title()),
        color,
        values: published::hybrid(backend, run).iter().map(|column| Some(paper(column))).collect(),
    });
    let ours = with_color(2).map(|(backend, color)| Row {
        name: format!("here, {}", backend.title()),
        color,
        values: measurements.hybrid(backend, run).into_iter().map(|measured| Some(here(measured))).collect(),
    });
    published.chain(ours).filter(|row| !row.values.is_empty()).collect()
}

fn totals(measurements: &Measurements, run: Run) -> Vec<Row> {
    rows(measurements, run, |column| column.total, total)
}

fn growths(measurements: &Measurements) -> Vec<Row> {
    let mut rows = totals(measurements, Run::Second);
    for row in &mut rows {
        let smallest = row.values.first().copied().flatten();
        for value in &mut row.values {
            *value = value.zip(smallest).map(|(value, smallest)| value / smallest);
        }
    }
    rows
}

fn chunked_and_full(measurements: &Measurements) -> Vec<Row> {
    let run = Run::Second;
    let hybrid = Subject::Hybrid { backend: Backend::Cpu, chunk_size: CHUNK_SIZES[0] };
    let subjects = [&[hybrid][..], &Output::BOTH.map(Subject::Full)].concat();
    let here = subjects.into_iter().map(|subject| measurements.get(subject, run).map(total));
    let paper = [published::hybrid(Backend::Cpu, run)[0].total, published::full(run).total];
    vec![
        Row { name: "paper, CPU".into(), color: WHO[0], values: paper.map(Some).into() },
        Row { name: "here, CPU".into(), color: WHO[2], values: here.collect() },
    ]
}

/// Each edit's median over the repeats, in milliseconds of CPU time.
fn latencies(measurements: &Measurements) -> Vec<Row> {
    let second = measurements.measured.iter().filter(|measured| measured.run == Run::Second);
    let mut chunk_colors = CHUNKS.into_iter().cycle();
    let mut full_colors = FULL.into_iter().cycle();
    let mut row = |measured: &Measured| {
        let (name, color) = match measured.subject {
            Subject::Hybrid { backend, chunk_size } => {
                (format!("{}, chunk size {chunk_size}", backend.title()), chunk_colors.next())
            }
            Subject::Full(_) => (measured.subject.title(), full_colors.next()),
        };
        let values = stats::by_edit(&measured.processor).into_iter().map(|seconds| Some(seconds * 1e3));
        Row { name, color: color.unwrap_or_default(), values: values.collect() }
    };
    second.map(&mut row).collect()
}

/// The range of all values, with room for the legend above, for a logarithmic axis.
fn range(rows: &[Row]) -> Range<f64> {
    let values = || rows.iter().flat_map(|row| &row.values).flatten().filter(|value| **value > 0.0);
    let low = values().copied().fold(f64::INFINITY, f64::min);
    let high = values().copied().fold(0.0, f64::max);
    if high > 0.0 { low / 2.0..high * 2.0 * (high / low).powf(0.3) } else { 0.1..1.0 }
}

type MeshKey = Result<(), Box<dyn std::error::Error>>;

/// Groups of bars over a logarithmic axis, each with its value on top.
fn bars((path, title): &(impl AsRef<Path>, &str), groups: &[String], rows: &[Row]) -> MeshKey {
    let area = SVGBackend::new(path, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let range = range(rows);
    let bottom = range.start;
    let mut chart = ChartBuilder::on(&area)
        .caption(title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(28)
        .y_label_area_size(64)
        .build_cartesian_2d(Groups(groups.to_vec()), range.log_scale())?;
    chart.configure_mesh().disable_x_mesh().light_line_style(WHITE).y_label_formatter(&label).draw()?;
    let width = 0.8 / rows.len().max(1) as f64;
    for (number, row) in rows.iter().enumerate() {
        let color = row.color;
        let left = |group: usize| group as f64 - 0.4 + width * number as f64;
        let values = || row.values.iter().enumerate().filter_map(|(group, value)| Some((group, (*value)?)));
        chart
            .draw_series(values().map(|(group, value)| {
                Rectangle::new([(left(group), bottom), (left(group) + width * 0.92, value)], color.filled())
            }))?
            .label(row.name.as_str())
            .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 12, y + 5)], color.filled()));
        chart.draw_series(values().map(|(group, value)| {
            EmptyElement::at((left(group), value)) + Text::new(label(&value), (2, -14), ("sans-serif", 11))
        }))?;
    }
    legend(&mut chart)?;
    area.present()?;
    Ok(())
}

/// Lines over a logarithmic axis.
fn lines((path, title): &(impl AsRef<Path>, &str), along: &str, rows: &[Row]) -> MeshKey {
    let area = SVGBackend::new(path, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let longest = rows.iter().map(|row| row.values.len()).max().unwrap_or(0).max(2);
    let mut chart = ChartBuilder::on(&area)
        .caption(title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(1.0..longest as f64, range(rows).log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_desc(along)
        .y_label_formatter(&label)
        .x_label_formatter(&|x| format!("{x:.0}"))
        .draw()?;
    for row in rows {
        let color = row.color;
        let points =
            row.values.iter().enumerate().filter_map(|(at, value)| Some((at as f64 + 1.0, (*value)?)));
        chart
            .draw_series(LineSeries::new(points, color.stroke_width(2)))?
            .label(row.name.as_str())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 12, y)], color.stroke_width(2)));
    }
    legend(&mut chart)?;
    area.present()?;
    Ok(())
}

fn legend<'a, DB, CT>(chart: &mut ChartContext<'a, DB, CT>) -> Result<(), Box<dyn std::error::Error>>
where
    DB: DrawingBackend + 'a,
    DB::ErrorType: 'static,
    CT: CoordTranslate,
{
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .label_font(("sans-serif", 12))
        .draw()?;
    Ok(())
}

/// A value in about two significant digits.
fn label(value: &f64) -> String {
    match *value {
        high if high >= 10.0 => format!("{high:.0}"),
        one if one >= 1.0 => format!("{one:.1}"),
        low if low >= 0.095 => format!("{low:.2}"),
        low if low >= 0.0095 => format!("{low:.3}"),
        tiny => format!("{tiny:.4}"),
    }
}

/// An axis with a name at each whole number.
struct Groups(Vec<String>);

impl Groups {
    fn axis(&self) -> RangedCoordf64 {
        (-0.5..self.0.len() as f64 - 0.5).into()
    }
}

impl Ranged for Groups {
    type FormatOption = plotters::coord::ranged1d::NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.axis().map(value, limit)
    }

    fn key_points<Hint: plotters::coord::ranged1d::KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        (0..self.0.len()).map(|group| group as f64).collect()
    }

    fn range(&self) -> Range<f64> {
        self.axis().range()
    }
}

impl ValueFormatter<f64> for Groups {
    fn format_ext(&self, value: &f64) -> String {
        self.0.get(value.round() as usize).cloned().unwrap_or_default()
    }
}
