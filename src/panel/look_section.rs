//! The look of the chosen terrain, if it has a `GroundLook`.

use bevy_egui::egui::Ui;

use super::widgets::{choice, metres, percent, section, slider};
use crate::view::{GroundLook, GroundQuality};

/// Draws the section.
pub fn show(ui: &mut Ui, look: &mut GroundLook) {
    section(ui, "Look", false, |ui| {
        let qualities = [GroundQuality::Low, GroundQuality::High];
        let chosen = qualities.iter().position(|quality| *quality == look.quality).unwrap_or_default();
        if let Some(quality) = choice(ui, &["Plain", "Fine"], chosen).and_then(|at| qualities.get(at)) {
            look.quality = *quality;
        }
        slider(ui, "Variety", &mut look.variety, 0.0..=1.0, percent)
            .on_hover_text("How much tints differ from place to place");
        let far = "Metres from the camera at which textures begin to grow, and from where on they are six times as large";
        let (begin, end) = &mut look.distance;
        slider(ui, "Near", begin, 1.0..=500.0, |slider| metres(slider).logarithmic(true)).on_hover_text(far);
        slider(ui, "Far", end, 1.0..=500.0, |slider| metres(slider).logarithmic(true)).on_hover_text(far);
    });
}
