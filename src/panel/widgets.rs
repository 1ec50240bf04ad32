//! The panel's own widgets: collapsible sections, tiles with icons, labelled sliders, lines of text.

use std::ops::RangeInclusive;

use bevy::platform::collections::HashMap;
use bevy_egui::egui::collapsing_header::{CollapsingState, paint_default_icon};
use bevy_egui::egui::{
    Align, Align2, Button, Color32, Context, CornerRadius, CursorIcon, FontId, Id, Label, Layout, Pos2, Rect,
    Response, RichText, Sense, Slider, SliderClamping, Stroke, StrokeKind, Ui, Vec2, emath::Numeric,
};

use super::PanelPlaces;
use super::theme::{ACCENT, BRIGHT, COLUMN, FAINT, SLATE, TEXT};

/// Positions of the widgets drawn in this frame.
#[derive(Clone, Default)]
struct Drawn(PanelPlaces);

/// Records the position of a widget if it is visible.
pub fn note(ui: &Ui, name: &str, rect: Rect) {
    if ui.is_rect_visible(rect) {
        note_in(ui.ctx(), name, rect);
    }
}

/// Records the position of something that is drawn outside of a [`Ui`].
pub fn note_in(context: &Context, name: &str, rect: Rect) {
    let corner = |at: Pos2| bevy::math::Vec2::new(at.x, at.y);
    let place = bevy::math::Rect::from_corners(corner(rect.min), corner(rect.max));
    context.data_mut(|data| {
        data.get_temp_mut_or_default::<Drawn>(Id::NULL).0.0.insert(name.into(), place);
    });
}

/// Takes the positions of this frame's widgets.
pub fn places(context: &Context) -> PanelPlaces {
    let Drawn(mut places) =
        context.data_mut(|data| std::mem::take(data.get_temp_mut_or_default::<Drawn>(Id::NULL)));
    let zoom = context.zoom_factor();
    for place in places.0.values_mut() {
        *place = bevy::math::Rect { min: place.min * zoom, max: place.max * zoom };
    }
    places
}

/// The title of a column, and whether it was clicked: that folds the column, or unfolds it.
pub fn title(ui: &mut Ui, name: &str, is_open: bool) -> bool {
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 24.0), Sense::click());
    note(ui, name, rect);
    let response = response.on_hover_cursor(CursorIcon::PointingHand);
    let color = if response.hovered() { ACCENT } else { BRIGHT };
    ui.painter().text(rect.left_center(), Align2::LEFT_CENTER, name, FontId::proportional(18.0), color);
    let mark = if is_open { "-" } else { "+" };
    ui.painter().text(rect.right_center(), Align2::RIGHT_CENTER, mark, FontId::proportional(18.0), color);
    response.clicked()
}

/// A section whose heading opens and closes it.
pub fn section(ui: &mut Ui, name: &str, is_open_at_first: bool, content: impl FnOnce(&mut Ui)) {
    let heading = RichText::new(name.to_uppercase()).color(FAINT).size(11.0);
    let id = Id::new(("burrow section", name));
    let mut state = CollapsingState::load_with_default_open(ui.ctx(), id, is_open_at_first);
    let header = ui.horizontal(|ui| {
        state.show_toggle_button(ui, paint_default_icon);
        ui.add(Label::new(heading).selectable(false).sense(Sense::click()))
    });
    let label = header.inner.on_hover_cursor(CursorIcon::PointingHand);
    if label.clicked() {
        state.toggle(ui);
    }
    note(ui, name, label.rect);
    state.show_body_unindented(ui, content);
}

/// A grid of tiles with `columns` per row; returns which one was clicked. Their help is shown on hover: an error says
/// why a tile can't be chosen.
pub fn tiles(
    ui: &mut Ui,
    columns: usize,
    names: &[&str],
    chosen: usize,
    help: impl Fn(usize) -> Result<&'static str, &'static str>,
    icon: impl Fn(&Ui, usize, Rect, Color32),
) -> Option<usize> {
    let gap = 6.0;
    let width = (ui.available_width() - gap * (columns - 1) as f32) / columns as f32;
    let mut clicked = None;
    for (row, line) in names.chunks(columns).enumerate() {
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = gap;
            for (column, name) in line.iter().enumerate() {
                let at = row * columns + column;
                let help = help(at);
                let is_enabled = help.is_ok();
                let sense = if is_enabled { Sense::click() } else { Sense::hover() };
                let (rect, response) = ui.allocate_exact_size(Vec2::new(width, 48.0), sense);
                note(ui, name, rect);
                let color = frame_tile(ui, rect, &response, at == chosen);
                let color = if is_enabled { color } else { FAINT.gamma_multiply(0.4) };
                let (Ok(help) | Err(help)) = help;
                let response = if help.is_empty() { response } else { response.on_hover_text(help) };
                let area = Rect::from_min_max(
                    rect.min + Vec2::new(10.0, 6.0),
                    Pos2::new(rect.right() - 10.0, rect.bottom() - 19.0),
                );
                icon(ui, at, area, color);
                let foot = Pos2::new(rect.center().x, rect.bottom() - 4.0);
                ui.painter().text(foot, Align2::CENTER_BOTTOM, name, FontId::proportional(11.0), color);
                if response.clicked() {
                    clicked = Some(at);
                }
            }
        });
    }
    clicked
}

/// Draws the background of a tile; returns the colour for its content.
fn frame_tile(ui: &Ui, rect: Rect, response: &Response, is_chosen: bool) -> Color32 {
    let (fill, edge, color) = match (is_chosen, response.hovered()) {
        (true, _) => (ACCENT.gamma_multiply(0.22), ACCENT, BRIGHT),
        (false, true) => (SLATE, FAINT, BRIGHT),
        (false, false) => (SLATE.gamma_multiply(0.7), Color32::TRANSPARENT, TEXT),
    };
    ui.painter().rect(rect, CornerRadius::same(6), fill, Stroke::new(1.0, edge), StrokeKind::Inside);
    color
}

/// A row of text options, one of them chosen; returns which one was clicked.
pub fn choice(ui: &mut Ui, names: &[&str], chosen: usize) -> Option<usize> {
    let width = share(ui, names.len());
    let mut clicked = None;
    ui.horizontal(|ui| {
        for (at, name) in names.iter().enumerate() {
            let option = Button::selectable(at == chosen, RichText::new(*name).size(12.0));
            let response = ui.add_sized([width, 24.0], option.truncate());
            note(ui, name, response.rect);
            if response.clicked() {
                clicked = Some(at);
            }
        }
    });
    clicked
}

/// A grid of coloured squares, one of them chosen; returns which one was clicked. Names are shown on hover.
/// Positions are recorded as `prefix` and name.
pub fn swatches(ui: &mut Ui, prefix: &str, colors: &[(Color32, &str)], chosen: usize) -> Option<usize> {
    const COLUMNS: usize = 8;
    let gap = 5.0;
    let side = (ui.available_width() - gap * (COLUMNS - 1) as f32) / COLUMNS as f32;
    let mut clicked = None;
    for (row, line) in colors.chunks(COLUMNS).enumerate() {
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = gap;
            for (column, (color, name)) in line.iter().enumerate() {
                let at = row * COLUMNS + column;
                let (rect, response) = ui.allocate_exact_size(Vec2::splat(side), Sense::click());
                note(ui, &format!("{prefix}{name}"), rect);
                let edge = match (at == chosen, response.hovered()) {
                    (true, _) => Stroke::new(2.0, BRIGHT),
                    (false, true) => Stroke::new(1.0, FAINT),
                    (false, false) => Stroke::NONE,
                };
                ui.painter().rect(rect, CornerRadius::same(5), *color, edge, StrokeKind::Inside);
                if response.on_hover_text(*name).clicked() {
                    clicked = Some(at);
                }
            }
        });
    }
    clicked
}

/// A labelled slider.
pub fn slider<N: Numeric>(
    ui: &mut Ui,
    name: &str,
    value: &mut N,
    range: RangeInclusive<N>,
    format: impl FnOnce(Slider<'_>) -> Slider<'_>,
) -> Response {
    ui.horizontal(|ui| {
        let (rect, _) = ui.allocate_exact_size(Vec2::new(78.0, 20.0), Sense::hover());
        let font = FontId::proportional(13.0);
        ui.painter().text(rect.left_center(), Align2::LEFT_CENTER, name, font, TEXT);
        ui.spacing_mut().slider_width = (ui.available_width() - 62.0).max(40.0);
        let slider = Slider::new(value, range).clamping(SliderClamping::Edits);
        let rail = Rect::from_min_size(ui.cursor().min, Vec2::new(ui.spacing().slider_width, 20.0));
        note(ui, name, rail);
        ui.add(format(slider))
    })
    .inner
}

/// Formats a slider in metres.
pub fn metres(slider: Slider<'_>) -> Slider<'_> {
    slider.fixed_decimals(1).suffix(" m")
}

/// Formats a slider in percent.
pub fn percent(slider: Slider<'_>) -> Slider<'_> {
    slider
        .custom_formatter(|value, _| format!("{:.0} %", value * 100.0))
        .custom_parser(|text| text.trim().trim_end_matches('%').trim().parse::<f64>().ok().map(|v| v / 100.0))
}

/// A label at the left and a value at the right.
pub fn figure(ui: &mut Ui, name: &str, value: impl Into<String>) {
    figure_in(ui, name, value, BRIGHT);
}

/// A figure in this colour.
pub fn figure_in(ui: &mut Ui, name: &str, value: impl Into<String>, color: Color32) {
    let line = ui.horizontal(|ui| {
        ui.label(RichText::new(name).color(FAINT).size(12.0));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.add(bevy_egui::egui::Label::new(RichText::new(value).color(color).size(12.0)).truncate());
        });
    });
    note(ui, name, line.response.rect);
}

/// A labelled switch.
pub fn switch(ui: &mut Ui, name: &str, is_on: &mut bool) -> Response {
    let response = ui.checkbox(is_on, name);
    note(ui, name, response.rect);
    response
}

/// A button of this width.
pub fn button(ui: &mut Ui, text: &str, width: f32, is_enabled: bool) -> Response {
    let response = ui.add_enabled(is_enabled, Button::new(text).min_size(Vec2::new(width, 26.0)));
    note(ui, text, response.rect);
    response
}

/// A button that shows its help and the game's key for it on hover. Returns whether it was clicked.
pub fn key_button(
    ui: &mut Ui,
    (name, help): (&str, &str),
    keys: &HashMap<String, String>,
    width: f32,
    is_enabled: bool,
) -> bool {
    let key = keys.get(name).map(|key| format!("\n{key}")).unwrap_or_default();
    let response = button(ui, name, width, is_enabled);
    let help = format!("{help}{key}");
    response.on_hover_text(&help).on_disabled_hover_text(&help).clicked()
}

/// Width of one of `count` buttons in a row.
pub fn share(ui: &Ui, count: usize) -> f32 {
    (ui.available_width().min(COLUMN) - ui.spacing().item_spacing.x * (count.max(1) - 1) as f32)
        / count.max(1) as f32
}

/// Formats a size with its unit.
pub fn bytes(count: usize) -> String {
    let count = count as f64;
    match count {
        _ if count < 1e4 => format!("{count:.0} B"),
        _ if count < 1e6 => format!("{:.1} KB", count / 1e3),
        _ if count < 1e9 => format!("{:.2} MB", count / 1e6),
        _ => format!("{:.2} GB", count / 1e9),
    }
}

/// Formats a number with spaces between thousands.
pub fn count(number: usize) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

/// Formats a duration with its unit.
pub fn time(time: Option<std::time::Duration>) -> String {
    match time.map(|time| time.as_secs_f64() * 1e3) {
        None => "-".into(),
        Some(ms) if ms < 1.0 => format!("{:.0} µs", ms * 1e3),
        Some(ms) if ms < 100.0 => format!("{ms:.2} ms"),
        Some(ms) => format!("{ms:.0} ms"),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    #[test]
    fn figures_are_written_short() {
        let bytes = [0, 9_999, 12_345, 3_456_789, 12_345_678_901].map(super::bytes);
        assert_eq!(bytes, ["0 B", "9999 B", "12.3 KB", "3.46 MB", "12.35 GB"]);
        assert_eq!([0, 999, 1000, 1234567].map(super::count), ["0", "999", "1 000", "1 234 567"]);
        let times =
            [None, Some(250), Some(2_500), Some(123_456)].map(|t| super::time(t.map(Duration::from_micros)));
        assert_eq!(times, ["-", "250 µs", "2.50 ms", "123 ms"]);
    }
}
