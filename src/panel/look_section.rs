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
        let slope = "Rise over run at which grass and snow begin to give way, and at which none is left";
        let (begin, end) = &mut look.cliffs;
        slider(ui, "Cliff", begin, 0.0..=4.0, |slider| slider.fixed_decimals(2)).on_hover_text(slope);
        slider(ui, "Bare", end, 0.0..=4.0, |slider| slider.fixed_decimals(2)).on_hover_text(slope);
        slider(ui, "Beds", &mut look.strata.height, 0.5..=64.0, |slider| metres(slider).logarithmic(true))
            .on_hover_text("How high strata are, from one to the same again");
    });
}
