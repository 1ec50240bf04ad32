//! Small plots: a line chart of the latest values, and a stacked bar.

use std::collections::VecDeque;

use bevy_egui::egui::{Color32, CornerRadius, Pos2, Rect, Sense, Ui, Vec2};
use egui_plot::Plot;

use super::theme::SLATE;
use super::widgets::figure;

/// Number of values in a line chart.
const KEPT: usize = 180;

/// The latest values of a line chart, one per frame or event.
#[derive(Clone, Debug, Default)]
pub struct Line(VecDeque<f32>);

impl Line {
    pub fn push(&mut self, value: f32) {
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        self.0.push_back(value);
    }

    pub fn iter(&self) -> impl ExactSizeIterator<Item = f32> {
        self.0.iter().copied()
    }
}

/// Draws a line chart over the full width, the newest value at the right, below a line with `label` and `now`. The
/// vertical range is from 0 to the largest value or `least_top`.
pub fn line(
    ui: &mut Ui,
    values: impl ExactSizeIterator<Item = f32>,
    least_top: f32,
    color: Color32,
    label: &str,
    now: &str,
) {
    figure(ui, label, now);
    let first = KEPT - values.len().min(KEPT);
    let height = |value: f32| if value.is_finite() { f64::from(value.max(0.0)) } else { 0.0 };
    let points: Vec<[f64; 2]> =
        values.enumerate().map(|(at, value)| [(first + at) as f64, height(value)]).collect();
    Plot::new(label)
        .height(28.0)
        .include_x(0.0)
        .include_x((KEPT - 1) as f64)
        .include_y(0.0)
        .include_y(least_top)
        .set_margin_fraction(Vec2::ZERO)
        .show_axes(false)
        .show_grid(false)
        .show_x(false)
        .show_y(false)
        .sense(Sense::hover())
        .allow_zoom(false)
        .allow_scroll(false)
        .show(ui, |plot| {
            plot.line(egui_plot::Line::new(label, points).color(color).width(1.5).fill(0.0).fill_alpha(0.16));
        });
}

/// Draws a stacked bar.
pub fn parts(ui: &mut Ui, parts: &[(usize, Color32)]) {
    let (rect, _) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 8.0), Sense::hover());
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, CornerRadius::same(4), SLATE);
    let whole = parts.iter().map(|part| part.0).sum::<usize>().max(1) as f32;
    let mut left = rect.left();
    for &(part, color) in parts {
        let right = left + rect.width() * part as f32 / whole;
        let area = Rect::from_min_max(Pos2::new(left, rect.top()), Pos2::new(right, rect.bottom()));
        painter.rect_filled(area, CornerRadius::ZERO, color);
        left = right;
    }
}
