//! Sections for the chosen terrain's digging rules and loose pieces.

use bevy_egui::egui::{Color32, RichText, Ui};

use super::terrain_controls::TerrainControls;
use super::texts;
use super::widgets::{count, figure, metres, section, slider, swatches, switch};
use crate::ground::MaterialId;
use crate::terrain::LooseSettings;
use crate::volume::DiggingRules;

/// Draws both sections. `material` is the index of the material whose rules are shown.
pub fn show(
    ui: &mut Ui,
    controls: &mut TerrainControls,
    material: &mut usize,
    materials: &[(Color32, String)],
    voxel: f32,
) {
    section(ui, texts::RULES, false, |ui| rules(ui, &mut controls.rules, material, materials, voxel));
    section(ui, texts::LOOSE, false, |ui| loose(ui, &mut controls.loose));
}

fn rules(
    ui: &mut Ui,
    rules: &mut DiggingRules,
    material: &mut usize,
    materials: &[(Color32, String)],
    voxel: f32,
) {
    let mut has_bedrock = rules.bedrock.is_some();
    if switch(ui, texts::BEDROCK, &mut has_bedrock).changed() {
        rules.bedrock = has_bedrock.then_some(0);
    }
    if let Some(bedrock) = &mut rules.bedrock {
        let mut height = *bedrock as f32 * voxel;
        let below = slider(ui, texts::BELOW, &mut height, -128.0..=256.0, metres);
        // Write only on change, as not every height survives the conversion to metres.
        if below.on_hover_text(texts::BELOW_HELP).changed() {
            *bedrock = (height / voxel).round() as i32;
        }
    }
    let colors: Vec<(Color32, &str)> =
        materials.iter().map(|(color, name)| (*color, name.as_str())).collect();
    if let Some(at) = swatches(ui, texts::RULE_OF, &colors, *material) {
        *material = at;
    }
    if let (Some((_, name)), Ok(id)) = (materials.get(*material), u8::try_from(*material)) {
        ui.label(RichText::new(name).size(12.0));
        let id = MaterialId(id);
        let mut hardness = rules.hardness.get(&id).copied().unwrap_or_default();
        if slider(ui, texts::HARDNESS, &mut hardness, 0..=u8::MAX, |slider| slider)
            .on_hover_text(texts::HARDNESS_HELP)
            .changed()
        {
            rules.hardness.insert(id, hardness);
            rules.hardness.retain(|_, hardness| *hardness > 0);
        }
        let mut is_unbreakable = rules.unbreakable.contains(&id);
        if switch(ui, texts::UNBREAKABLE, &mut is_unbreakable).changed() {
            match is_unbreakable {
                true => rules.unbreakable.insert(id),
                false => rules.unbreakable.remove(&id),
            };
        }
    }
    if !rules.protected.is_empty() {
        figure(ui, texts::PROTECTED, count(rules.protected.len()));
    }
}

fn loose(ui: &mut Ui, loose: &mut Option<LooseSettings>) {
    let mut is_on = loose.is_some();
    if switch(ui, texts::LOOSE_FIND, &mut is_on).changed() {
        *loose = is_on.then(LooseSettings::default);
    }
    let Some(loose) = loose else { return };
    let sizes = [&mut loose.crumbs, &mut loose.debris, &mut loose.largest];
    for ((name, help), size) in texts::LOOSE_SIZES.into_iter().zip(sizes) {
        slider(ui, name, size, 0..=1 << 16, |slider| slider.logarithmic(true)).on_hover_text(help);
    }
}
