//! The look of the panel: colours, spacing, text. It only applies to the panel's own widgets; a game's egui style
//! is unchanged.

use std::sync::Arc;

use bevy_egui::egui::{
    Color32, CornerRadius, FontFamily, FontId, Frame, Margin, Shadow, Stroke, Style, TextStyle, Vec2,
    style::HandleShape,
};

/// Width of a column.
pub const COLUMN: f32 = 272.0;
/// Width of a folded column.
pub const FOLDED: f32 = 64.0;
/// Width of the view that is left between two columns at least.
pub const LEAST_VIEW: f32 = 200.0;
/// Width that is left free for the scroll bar.
pub const SCROLL_BAR: f32 = 10.0;
/// Distance from the window's border to a column.
pub const GAP: f32 = 12.0;

pub const NIGHT: Color32 = Color32::from_rgb(23, 26, 31);
pub const SLATE: Color32 = Color32::from_rgb(38, 43, 51);
const SLATE_LIGHT: Color32 = Color32::from_rgb(52, 59, 70);
const EDGE: Color32 = Color32::from_rgb(58, 65, 76);
pub const TEXT: Color32 = Color32::from_rgb(216, 220, 226);
pub const FAINT: Color32 = Color32::from_rgb(134, 143, 156);
pub const BRIGHT: Color32 = Color32::from_rgb(250, 251, 252);
/// Ochre, for the chosen option.
pub const ACCENT: Color32 = Color32::from_rgb(232, 163, 61);
pub const GOOD: Color32 = Color32::from_rgb(118, 196, 122);
pub const BAD: Color32 = Color32::from_rgb(232, 100, 88);
pub const BLUE: Color32 = Color32::from_rgb(92, 160, 224);
/// Colours of the parts of a stacked bar, in order.
pub const PARTS: [Color32; 6] = [
    Color32::from_rgb(126, 104, 84),
    Color32::from_rgb(232, 163, 61),
    Color32::from_rgb(118, 196, 122),
    Color32::from_rgb(92, 160, 224),
    Color32::from_rgb(172, 128, 214),
    Color32::from_rgb(224, 122, 140),
];

/// Colours of further materials that the terrain does not define: soil, sandstone, shale, gravel.
pub const MORE_MATERIALS: [Color32; 4] = [
    Color32::from_rgb(96, 70, 48),
    Color32::from_rgb(178, 134, 92),
    Color32::from_rgb(84, 88, 96),
    Color32::from_rgb(128, 122, 114),
];

/// The frame around a column.
pub fn card() -> Frame {
    Frame::new()
        .fill(NIGHT.gamma_multiply(0.94))
        .stroke(Stroke::new(1.0, EDGE))
        .corner_radius(CornerRadius::same(10))
        .inner_margin(Margin::symmetric(14, 12))
        .shadow(Shadow { offset: [0, 4], blur: 16, spread: 0, color: Color32::from_black_alpha(90) })
}

/// The style of all widgets in a column.
pub fn style() -> Arc<Style> {
    let mut style = Style::default();
    let font = |size| FontId::new(size, FontFamily::Proportional);
    style.text_styles = [
        (TextStyle::Heading, font(18.0)),
        (TextStyle::Body, font(13.0)),
        (TextStyle::Button, font(13.0)),
        (TextStyle::Small, font(11.0)),
        (TextStyle::Monospace, FontId::new(12.0, FontFamily::Monospace)),
    ]
    .into();
    style.spacing.item_spacing = Vec2::new(6.0, 5.0);
    style.spacing.button_padding = Vec2::new(8.0, 4.0);
    style.spacing.interact_size = Vec2::new(36.0, 20.0);
    style.spacing.slider_rail_height = 4.0;
    style.spacing.scroll.floating = true;

    let visuals = &mut style.visuals;
    visuals.override_text_color = None;
    visuals.slider_trailing_fill = true;
    visuals.handle_shape = HandleShape::Circle;
    visuals.extreme_bg_color = Color32::from_rgb(16, 18, 22);
    visuals.selection.bg_fill = ACCENT;
    visuals.selection.stroke = Stroke::new(1.0, NIGHT);
    visuals.striped = false;
    let widgets = &mut visuals.widgets;
    let looks = [
        (&mut widgets.noninteractive, NIGHT, EDGE, TEXT),
        (&mut widgets.inactive, SLATE, EDGE, TEXT),
        (&mut widgets.hovered, SLATE_LIGHT, FAINT, BRIGHT),
        (&mut widgets.active, SLATE_LIGHT, ACCENT, BRIGHT),
        (&mut widgets.open, SLATE, EDGE, TEXT),
    ];
    for (look, fill, edge, text) in looks {
        look.bg_fill = fill;
        look.weak_bg_fill = fill;
        look.bg_stroke = Stroke::new(1.0, edge);
        look.fg_stroke = Stroke::new(1.0, text);
        look.corner_radius = CornerRadius::same(5);
        look.expansion = 0.0;
    }
    widgets.inactive.bg_stroke = Stroke::NONE;
    // Of check boxes and the rails of sliders, which stand out from the column behind them.
    widgets.inactive.bg_fill = SLATE_LIGHT;
    Arc::new(style)
}
