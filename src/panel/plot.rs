//! Small plots: a line chart of the latest values, and a stacked bar.

use std::collections::VecDeque;

use bevy_egui::egui::{Align2, Color32, CornerRadius, FontId, Pos2, Rect, Sense, Stroke, Ui, Vec2};

use super::theme::{BRIGHT, FAINT, SLATE};
use super::widgets::note;

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

/// Draws a line chart over the full width, the newest value at the right. The vertical range is from 0 to the
/// largest value or `least_top`. Shows `label` at the left and `now` at the right.
pub fn line(
    ui: &mut Ui,
    values: impl ExactSizeIterator<Item = f32>,
    least_top: f32,
    color: Color32,
    label: &str,
    now: &str,
) {
    let (rect, _) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 40.0), Sense::hover());
    note(ui, label, rect);
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, CornerRadius::same(5), SLATE.gamma_multiply(0.7));
    let values: Vec<f32> = values.map(|value| if value.is_finite() { value.max(0.0) } else { 0.0 }).collect();
    let top = values.iter().copied().fold(least_top, f32::max).max(f32::MIN_POSITIVE);
    let inner = rect.shrink2(Vec2::new(2.0, 3.0));
    let step = inner.width() / (KEPT - 1) as f32;
    let start = inner.right() - step * values.len().saturating_sub(1) as f32;
    let points: Vec<Pos2> = values
        .iter()
        .enumerate()
        .map(|(at, value)| {
            Pos2::new(start + step * at as f32, inner.bottom() - inner.height() * 0.52 * value / top)
        })
        .collect();
    // Fill the area below with one thin line per value, since it need not be convex.
    for point in &points {
        painter.vline(
            point.x,
            point.y..=inner.bottom(),
            Stroke::new(step.max(1.0), color.gamma_multiply(0.16)),
        );
    }
    if points.len() > 1 {
        painter.line(points, Stroke::new(1.5, color));
    }
    let small = FontId::proportional(11.0);
    painter.text(rect.min + Vec2::new(7.0, 4.0), Align2::LEFT_TOP, label, small.clone(), FAINT);
    painter.text(Pos2::new(rect.right() - 7.0, rect.top() + 4.0), Align2::RIGHT_TOP, now, small, BRIGHT);
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
