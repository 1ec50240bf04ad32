//! Headless mode: a script sculpts, and the camera renders into an image, panel included.

use std::path::PathBuf;
use std::time::Duration;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::debug::BurrowDebug;
use bevy_burrow::panel::{BrushTool, PanelAction, ToolAlign, ToolOperation, ToolShape};
use bevy_burrow::prelude::*;

use crate::photo::{Photographer, wait_until};
use crate::scene::ScenePlugin;
use crate::stroke::Aim;
use crate::{Options, offscreen, stamps};

const FRAME: Duration = Duration::from_nanos(1_000_000_000 / 60);

struct Stage {
    app: App,
    camera: Entity,
    photographer: Photographer,
    folder: PathBuf,
    strokes: u64,
}

/// Plays the script.
pub fn play(options: &Options) -> Result {
    if let Some(file) = &options.model {
        return Err(format!("{}: a model needs a window, as the script builds none", file.display()).into());
    }
    let stamp = stamps::read_or_crater(options.stamp.as_deref())?;
    std::fs::create_dir_all(&options.out).map_err(|error| format!("{}: {error}", options.out.display()))?;
    let mut stage = Stage::open(options)?;
    stage.wait_until(|world| {
        let mut dressed = world.query_filtered::<(), (With<Tile>, With<MeshMaterial3d<GroundMaterial>>)>();
        // Coarse textures are shown until then.
        dressed.iter(world).next().is_some() && world.resource::<GroundLoading>().is_ready()
    })?;

    // Dig, build and paint.
    for x in [-9.0, -3.0, 3.0, 9.0] {
        stage.stroke(Vec2::new(x, 4.0))?;
    }
    stage.take(ToolOperation::Add, ToolShape::Cylinder, |tool| {
        (tool.radius, tool.length, tool.material, tool.sink) = (3.0, 10.0, 5, -0.6);
    });
    for x in [-14.0, 14.0] {
        stage.stroke(Vec2::new(x, -8.0))?;
    }
    stage.take(ToolOperation::Paint, ToolShape::Sphere, |tool| {
        (tool.radius, tool.material, tool.is_rough, tool.bump) = (6.0, 7, true, 1.5);
    });
    stage.stroke(Vec2::new(0.0, -10.0))?;
    stage.take(ToolOperation::Dig, ToolShape::Box, |tool| {
        (tool.half, tool.turn, tool.align) = (Vec3::new(5.0, 3.0, 4.0), 30.0, ToolAlign::Surface);
    });
    stage.stroke(Vec2::new(22.0, 6.0))?;
    stage.act(PanelAction::CheckSeams);
    stage.aim(Vec2::new(-20.0, 8.0));
    stage.frames(40);
    stage.shoot("1_dug_and_built")?;

    // Sculpt: each operation at its own place, and finally the stamp from a file.
    let before = stage.strokes;
    let soft = |tool: &mut BrushTool| (tool.radius, tool.falloff, tool.strength) = (9.0, 6.0, 1.0);
    for (operation, place, strokes) in [
        (ToolOperation::Raise, Vec2::new(-34.0, -14.0), 4),
        (ToolOperation::Lower, Vec2::new(32.0, -18.0), 3),
        (ToolOperation::Smooth, Vec2::new(3.0, 4.0), 4),
        (ToolOperation::Sharpen, Vec2::new(-9.0, 4.0), 3),
        (ToolOperation::Flatten, Vec2::new(-18.0, 22.0), 2),
        (ToolOperation::Level, Vec2::new(22.0, 24.0), 2),
        (ToolOperation::Stamp, Vec2::new(2.0, -34.0), 1),
        (ToolOperation::Terrace, Vec2::new(-30.0, 8.0), 3),
    ] {
        let ground = stage.aim(place).map_or(0.0, |hit| hit.position.y);
        stage.take(operation, ToolShape::Sphere, |tool| {
            soft(tool);
            (tool.level, tool.step, tool.amount) = (ground + 2.0, 3.0, 2.0);
            if operation == ToolOperation::Stamp {
                (tool.radius, tool.amount, tool.falloff) = (16.0, 11.0, 1.0);
            }
        });
        for _ in 0..strokes {
            stage.stroke(place)?;
        }
    }
    stage.take(ToolOperation::Stamp, ToolShape::Sphere, |tool| {
        (tool.radius, tool.amount, tool.falloff, tool.strength) = (8.0, 4.0, 1.0, 1.0);
        (tool.align, tool.stamp) = (ToolAlign::Surface, stamp);
    });
    stage.stroke(Vec2::new(-2.0, 24.0))?;
    let sculpted = stage.strokes - before;
    stage.frames(40);
    stage.shoot("2_sculpted")?;

    // Undo all sculpting, and redo it.
    for _ in 0..sculpted {
        stage.step(PanelAction::Undo)?;
    }
    stage.frames(40);
    stage.shoot("3_undone")?;
    for _ in 0..sculpted {
        stage.step(PanelAction::Redo)?;
    }

    // The debug views.
    let debug = BurrowDebug { chunks: true, fields: true, mask: true, rings: true, ..default() };
    stage.app.world_mut().insert_resource(debug);
    stage.frames(40);
    stage.shoot("4_debug_views")?;
    stage.app.world_mut().insert_resource(BurrowDebug::default());
    stage.resize(1920, 1080);
    stage.frames(40);
    stage.shoot("5_large")
}

impl Stage {
    fn open(options: &Options) -> Result<Self> {
        let renderer = offscreen::find_renderer().ok_or("there is no graphics adapter, and so no picture")?;
        let mut app = offscreen::build(Some(renderer), |app| {
            app.insert_resource(TimeUpdateStrategy::ManualDuration(FRAME));
            crate::editor(app, options);
        });
        app.update();
        let camera = app.world_mut().query_filtered::<Entity, With<Camera3d>>().single(app.world())?;
        let middle = ScenePlugin(options.cells).middle();
        let place = middle + Vec3::new(-26.0, 62.0, 58.0);
        let place = Transform::from_translation(place).looking_at(middle + Vec3::Y * 4.0, Vec3::Y);
        app.world_mut().entity_mut(camera).insert(place);
        let photographer = Photographer::new(&mut app, camera, (options.width, options.height));
        Ok(Self { app, camera, photographer, folder: options.out.clone(), strokes: 0 })
    }

    /// Changes the size of the pictures.
    fn resize(&mut self, width: u32, height: u32) {
        self.photographer = Photographer::new(&mut self.app, self.camera, (width, height));
    }

    fn frames(&mut self, count: usize) {
        (0..count).for_each(|_| self.app.update());
    }

    fn wait_until(&mut self, mut is_so: impl FnMut(&mut World) -> bool) -> Result {
        wait_until(&mut self.app, |app| {
            app.update();
            is_so(app.world_mut())
        })
    }

    /// Selects a fresh tool, and configures it.
    fn take(&mut self, operation: ToolOperation, shape: ToolShape, set_up: impl FnOnce(&mut BrushTool)) {
        let mut tool = BrushTool { operation, shape, ..default() };
        set_up(&mut tool);
        self.app.world_mut().insert_resource(tool);
    }

    /// Takes a history step, and draws frames until it is done.
    fn step(&mut self, action: PanelAction) -> Result {
        let redos = |world: &mut World| {
            let mut terrains = world.query::<&Terrain>();
            terrains.iter(world).map(|terrain| terrain.history().redos).sum::<usize>()
        };
        let before = redos(self.app.world_mut());
        self.act(action);
        self.wait_until(|world| redos(world) != before)
    }

    fn act(&mut self, action: PanelAction) {
        self.app.world_mut().write_message(action);
    }

    /// Aims at the ground at an offset from the middle.
    fn aim(&mut self, offset: Vec2) -> Option<TerrainHit> {
        let world = self.app.world_mut();
        let mut terrains = world.query::<(Entity, &Terrain)>();
        let (entity, terrain) = terrains.iter(world).next()?;
        let place = world.resource::<ScenePlugin>().middle() + Vec3::new(offset.x, 500.0, offset.y);
        let hit = terrain.world().raycast(place.as_dvec3(), bevy::math::DVec3::NEG_Y, 1000.0)?;
        let aim = TerrainHit {
            terrain: entity,
            distance: hit.distance as f32,
            position: hit.position.as_vec3(),
            normal: hit.normal,
            material: hit.material,
            from_inside: hit.from_inside,
        };
        world.resource_mut::<Aim>().0 = Some(aim);
        Some(aim)
    }

    /// Applies one stroke, and draws frames until its receipt arrives.
    fn stroke(&mut self, offset: Vec2) -> Result {
        let hit = self.aim(offset).ok_or("the script works outside the landscape")?;
        self.strokes += 1;
        let brush = self.app.world().resource::<BrushTool>().brush_at(&hit).with_tag(self.strokes);
        self.app.world_mut().write_message(brush);
        let strokes = self.strokes;
        self.wait_until(|world| world.resource::<BurrowFigures>().brushes >= strokes)
    }

    fn shoot(&mut self, name: &str) -> Result {
        self.photographer.shoot(&mut self.app, &self.folder.join(name).with_extension("png"))
    }
}
