//! The section for the plants of the chosen terrain: how many there are, and how dense each species grows.

use bevy_egui::egui::{RichText, Ui};

use super::texts;
use super::widgets::{count, figure, percent, section, slider};
use crate::plants::ShownPlants;
use crate::scatter::{PlantPatch, ScatterRules};

/// Draws the section.
pub fn show(ui: &mut Ui, rules: &mut ScatterRules, shown: Option<&ShownPlants>) {
    section(ui, texts::PLANTS, false, |ui| {
        let counts = shown.map(counts).unwrap_or_default();
        for (index, species) in rules.species.iter_mut().enumerate() {
            ui.label(RichText::new(&species.name).size(12.0));
            let standing = counts.get(index).copied().unwrap_or_default();
            figure(ui, texts::PLANTS_STANDING, count(standing));
            slider(ui, texts::PLANTS_DENSITY, &mut species.density, 0.0..=1.0, percent);
            let spacing = slider(ui, texts::PLANTS_SPACING, &mut species.spacing, 0.25..=32.0, |slider| {
                slider.logarithmic(true)
            });
            // The distance is bounded by the spacing.
            if spacing.changed() {
                species.distance = species.distance.min(4.0 * species.spacing);
            }
            let most = 4.0 * species.spacing;
            slider(ui, texts::PLANTS_DISTANCE, &mut species.distance, 0.0..=most, |slider| slider);
        }
    });
}

/// Plants of each species that stand in loaded patches.
fn counts(shown: &ShownPlants) -> Vec<usize> {
    let Some(patches) = shown.patches() else { return Vec::new() };
    let mut counts = vec![0; patches.scatter().species().len()];
    let standing = |patch: &PlantPatch| patch.plants().len() - patch.gone_count();
    patches.iter().for_each(|(pos, patch)| counts[usize::from(pos.species)] += standing(patch));
    counts
}
