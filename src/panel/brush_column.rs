//! The left column: operation, shape, size, material and roughness of the brush.

use bevy::math::{EulerRot, Quat, Vec3};
use bevy_egui::egui::{self, Align2, Color32, FontId, Pos2, Rect, Shape, Stroke, Ui, Vec2};

use super::lengths::{AMOUNT, BUMP, BUMP_WIDTH, FALLOFF, LENGTH, ROAD_HEIGHT, ROUNDING, STEP, TUBE};
use super::operations::{Need, OPERATIONS};
use super::theme::{ACCENT, BAD, FAINT};
use super::widgets::{
    choice, figure, key_button, metres, note, percent, section, share, slider, swatches, switch, tiles,
};
use super::{BrushTool, BurrowPanel, PanelAction, ToolAlign, ToolOperation, ToolShape, texts};

/// Draws the part that is always in sight: the buttons of a placed brush, and the pointer's position.
pub fn head(
    ui: &mut Ui,
    panel: &BurrowPanel,
    tool: &BrushTool,
    has_terrain: bool,
    actions: &mut Vec<PanelAction>,
) {
    let width = share(ui, 4);
    let is_placed = tool.placed.is_some();
    let is_held = is_placed || tool.has_path();
    ui.horizontal(|ui| {
        for (name, help, action, is_enabled) in [
            (texts::PLACE, texts::PLACE_HELP, PanelAction::PlaceBrush, has_terrain && tool.can_be_placed()),
            (texts::APPLY, texts::APPLY_HELP, PanelAction::ApplyBrush, has_terrain && is_held),
            (texts::SNAP, texts::SNAP_HELP, PanelAction::SnapBrush, has_terrain && is_placed),
            (texts::RELEASE, texts::RELEASE_HELP, PanelAction::ReleaseBrush, is_held),
        ] {
            if key_button(ui, (name, help), &panel.keys, width, is_enabled) {
                actions.push(action);
            }
        }
    });
    if let Some(Vec3 { x, y, z }) = panel.pointer {
        figure(ui, texts::POINTER, format!("{x:.1}  {y:.1}  {z:.1} m"));
    }
}

/// Draws the column for a terrain whose voxels are `voxel` metres wide.
pub fn show(
    ui: &mut Ui,
    tool: &mut BrushTool,
    materials: &[(Color32, String)],
    voxel: f32,
    panel: &BurrowPanel,
) {
    if let Some(why) = panel.rejection.as_deref() {
        let line = ui.label(egui::RichText::new(texts::rejected(why)).color(BAD).size(12.0));
        note(ui, texts::REJECTED, line.rect);
    }
    section(ui, texts::OPERATION, true, |ui| operations(ui, tool, voxel, panel));
    section(ui, texts::SHAPE, true, |ui| shape(ui, tool, voxel));
    let row = tool.operation.row();
    if row.needs.contains(&Need::Material) {
        section(ui, texts::MATERIAL, true, |ui| material(ui, tool, materials));
    } else if row.may_fill() {
        section(ui, texts::FILL, false, |ui| {
            switch(ui, texts::FILL_MATERIAL, &mut tool.is_of_material);
            if tool.is_of_material {
                material(ui, tool, materials);
            }
        });
    }
    section(ui, texts::SURFACE, true, |ui| surface(ui, tool, voxel));
    section(ui, texts::STROKE, true, |ui| {
        slider(ui, texts::RATE, &mut tool.rate, 1.0..=30.0, |slider| slider.max_decimals(0).suffix(" /s"))
            .on_hover_text(texts::RATE_HELP);
        slider(ui, texts::POWER, &mut tool.power, 0..=u8::MAX, |slider| slider)
            .on_hover_text(texts::POWER_HELP);
    });
}

fn operations(ui: &mut Ui, tool: &mut BrushTool, voxel: f32, panel: &BurrowPanel) {
    let (names, help): (Vec<&str>, Vec<&str>) = OPERATIONS.iter().map(|row| (row.name(), row.help())).unzip();
    let chosen = OPERATIONS.iter().position(|row| row.tool == tool.operation).unwrap_or_default();
    let clicked = tiles(
        ui,
        5,
        &names,
        chosen,
        |at| Ok(help.get(at).copied().unwrap_or_default()),
        |ui, at, rect, color| {
            let Some(row) = OPERATIONS.get(at) else { return };
            let place =
                |x: f32, y: f32| Pos2::new(rect.left() + rect.width() * x, rect.bottom() - rect.height() * y);
            if let Some(key) = panel.keys.get(row.name()) {
                let corner = rect.right_top() + Vec2::new(6.0, -3.0);
                ui.painter().text(corner, Align2::RIGHT_TOP, key, FontId::proportional(9.0), FAINT);
            }
            let steps = (0..=32).map(|step| step as f32 / 32.0);
            let (before, after): (Vec<Pos2>, Vec<Pos2>) = steps
                .map(|x| {
                    let (before, after) = (row.profile)(x);
                    (place(x, before), place(x, after))
                })
                .unzip();
            ui.painter().extend(Shape::dashed_line(&before, Stroke::new(1.0, FAINT), 2.0, 2.0));
            ui.painter().line(after, Stroke::new(2.0, if at == chosen { ACCENT } else { color }));
        },
    );
    if let Some(row) = clicked.and_then(|at| OPERATIONS.get(at)) {
        tool.operation = row.tool;
    }
    let row = tool.operation.row();
    ui.label(egui::RichText::new(row.help()).color(FAINT).size(11.0));
    if tool.operation == ToolOperation::Stamp {
        figure(ui, texts::IMAGE, tool.stamp.label());
    }
    if tool.operation == ToolOperation::Paste {
        ui.label(egui::RichText::new(texts::COPY_HELP).color(FAINT).size(11.0));
        figure(ui, texts::PREFAB, tool.prefab.label());
        switch(ui, texts::MIRRORED, &mut tool.is_mirrored);
        switch(ui, texts::EDITS_ONLY, &mut tool.prefab.is_edits_only);
    }
    for need in row.needs {
        match need {
            Need::Material => continue,
            Need::Strength => slider(ui, texts::STRENGTH, &mut tool.strength, 0.0..=1.0, percent),
            Need::Falloff => slider(ui, texts::FALLOFF, &mut tool.falloff, FALLOFF.range(voxel), metres)
                .on_hover_text(texts::FALLOFF_HELP),
            Need::Amount => slider(ui, texts::AMOUNT, &mut tool.amount, AMOUNT.range(voxel), metres),
            Need::Level => slider(ui, texts::HEIGHT, &mut tool.level, -128.0..=256.0, metres),
            Need::Step => slider(ui, texts::STEP, &mut tool.step, STEP.range(voxel), metres),
            Need::Rounding => slider(ui, texts::ROUNDING, &mut tool.rounding, ROUNDING.range(voxel), metres),
            Need::Height => slider(ui, texts::HEIGHT, &mut tool.length, ROAD_HEIGHT.range(voxel), metres),
        };
    }
}

fn shape(ui: &mut Ui, tool: &mut BrushTool, voxel: f32) {
    let now = tool.fitting_shape();
    let chosen = ToolShape::ALL.iter().position(|&shape| shape == now).unwrap_or_default();
    let help = |at: usize| match ToolShape::ALL.get(at) {
        Some(&shape) if tool.operation.fits(shape) => Ok(""),
        _ => Err(texts::FITS_NOT),
    };
    let clicked = tiles(ui, 4, &texts::SHAPES, chosen, help, |ui, at, rect, color| {
        let color = if at == chosen { ACCENT } else { color };
        if let Some(&shape) = ToolShape::ALL.get(at) {
            draw_shape(ui, shape, rect, Stroke::new(1.5, color));
        }
    });
    if let Some(&shape) = clicked.and_then(|at| ToolShape::ALL.get(at)) {
        tool.shape = shape;
    }
    let now = tool.fitting_shape();
    let radii = tool.radii(voxel);
    let turn = |ui: &mut Ui, turn: &mut f32| {
        slider(ui, texts::TURN, turn, -180.0..=180.0, |slider| {
            slider.step_by(15.0).max_decimals(0).suffix("°")
        });
    };
    if tool.operation == ToolOperation::Paste {
        turn(ui, &mut tool.turn);
        align(ui, tool);
        return;
    }
    if now == ToolShape::Box {
        slider(ui, texts::HALF_SIZES[0], &mut tool.half.x, radii.clone(), length);
        slider(ui, texts::HALF_SIZES[1], &mut tool.half.y, radii.clone(), length);
        slider(ui, texts::HALF_SIZES[2], &mut tool.half.z, radii, length);
        turn(ui, &mut tool.turn);
    } else {
        slider(ui, texts::RADIUS, &mut tool.radius, radii, length);
    }
    if now == ToolShape::Model {
        turn(ui, &mut tool.turn);
        figure(ui, texts::MODEL, tool.model.label());
        ui.label(egui::RichText::new(texts::MODEL_HELP).color(FAINT).size(11.0));
    }
    if now == ToolShape::Torus {
        slider(ui, texts::TUBE, &mut tool.tube, TUBE.range(voxel), length);
    }
    if now == ToolShape::Path {
        switch(ui, texts::SMOOTH_PATH, &mut tool.is_smooth);
        figure(ui, texts::PATH_POINTS, tool.points.len().to_string());
        ui.label(egui::RichText::new(texts::PATH_HELP).color(FAINT).size(11.0));
    }
    if now.is_long() {
        slider(ui, texts::LENGTH, &mut tool.length, LENGTH.range(voxel), length);
    }
    slider(ui, texts::SINK, &mut tool.sink, -1.0..=1.0, percent).on_hover_text(texts::SINK_HELP);
    if now != ToolShape::Sphere || tool.operation == ToolOperation::Stamp {
        align(ui, tool);
    }
}

fn align(ui: &mut Ui, tool: &mut BrushTool) {
    let aligns = [ToolAlign::Upright, ToolAlign::Surface];
    let chosen = usize::from(tool.align == ToolAlign::Surface);
    if let Some(&align) = choice(ui, &texts::ALIGN, chosen).and_then(|at| aligns.get(at)) {
        tool.align = align;
    }
}

fn length(slider: egui::Slider<'_>) -> egui::Slider<'_> {
    slider.logarithmic(true).fixed_decimals(1).suffix(" m")
}

fn material(ui: &mut Ui, tool: &mut BrushTool, materials: &[(Color32, String)]) {
    let all: Vec<(Color32, &str)> = materials.iter().map(|(color, name)| (*color, name.as_str())).collect();
    if let Some(at) = swatches(ui, "", &all, usize::from(tool.material)) {
        tool.material = u8::try_from(at).unwrap_or(u8::MAX);
    }
    let name = materials.get(usize::from(tool.material)).map_or("?", |(_, name)| name);
    ui.label(egui::RichText::new(name).size(12.0));
}

fn surface(ui: &mut Ui, tool: &mut BrushTool, voxel: f32) {
    switch(ui, texts::ROUGH, &mut tool.is_rough);
    if tool.is_rough {
        let bumps = BUMP.range(voxel);
        slider(ui, texts::BUMPS, &mut tool.bump, bumps, |slider| slider.fixed_decimals(2).suffix(" m"));
        slider(ui, texts::WIDTH, &mut tool.bump_width, BUMP_WIDTH.range(voxel), length);
        slider(ui, texts::PATTERN, &mut tool.seed, 0..=99, |slider| slider);
    }
}

/// Draws the outline of a shape in the middle of a rectangle, seen from the front and slightly above.
fn draw_shape(ui: &Ui, shape: ToolShape, rect: Rect, stroke: Stroke) {
    let tool = BrushTool {
        shape,
        radius: 0.8,
        half: Vec3::splat(0.7),
        length: 1.6,
        tube: 0.3,
        ..BrushTool::default()
    };
    let tool =
        if shape == ToolShape::Capsule { BrushTool { radius: 0.5, length: 0.9, ..tool } } else { tool };
    let tilt = Quat::from_euler(EulerRot::XYZ, 0.4, 0.5, 0.0);
    let at = |point: Vec3| {
        let Vec3 { x, y, .. } = tilt * point;
        rect.center() + Vec2::new(x, -y) * rect.height() / 2.0
    };
    let outline = |from, to| {
        ui.painter().line_segment([at(from), at(to)], stroke);
    };
    if shape == ToolShape::Model {
        // A star with seven points.
        let corner = |step: i32| {
            let (sin, cos) = (step as f32 * std::f32::consts::TAU / 14.0).sin_cos();
            Vec3::new(sin, cos, 0.0) * if step % 2 == 0 { 1.0 } else { 0.6 }
        };
        (0..14).for_each(|step| outline(corner(step), corner(step + 1)));
        return;
    }
    if shape == ToolShape::Path {
        let at = |step: i32| {
            let along = step as f32 / 8.0;
            Vec3::new(2.4 * along - 1.2, 0.6 * (4.0 * along).sin() - 0.1, 0.0)
        };
        (0..8).for_each(|step| outline(at(step), at(step + 1)));
        return;
    }
    tool.shape_around(Vec3::ZERO, Vec3::Y).outline(outline);
}
