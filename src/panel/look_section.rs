//! The look of the chosen terrain, if it has a `GroundLook`.

use bevy_egui::egui::Ui;

use super::texts;
use super::widgets::{choice, metres, percent, section, slider};
use crate::view::{GroundLook, GroundQuality};

/// Draws the section.
pub fn show(ui: &mut Ui, look: &mut GroundLook) {
    section(ui, texts::LOOK, false, |ui| {
        let qualities = [GroundQuality::Low, GroundQuality::High];
        let chosen = qualities.iter().position(|quality| *quality == look.quality).unwrap_or_default();
        if let Some(quality) = choice(ui, &texts::QUALITY, chosen).and_then(|at| qualities.get(at)) {
            look.quality = *quality;
        }
        slider(ui, texts::VARIETY, &mut look.variety, 0.0..=1.0, percent).on_hover_text(texts::VARIETY_HELP);
        let (begin, end) = &mut look.distance;
        slider(ui, texts::SCALE_STARTS, begin, 1.0..=500.0, |slider| metres(slider).logarithmic(true))
            .on_hover_text(texts::SCALE_HELP);
        slider(ui, texts::SCALE_ENDS, end, 1.0..=500.0, |slider| metres(slider).logarithmic(true))
            .on_hover_text(texts::SCALE_HELP);
    });
}
