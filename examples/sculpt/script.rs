//! Without a window: a script sculpts, and the camera draws into an image, the panel included.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use bevy::app::PluginsState;
use bevy::camera::RenderTarget;
use bevy::log::{Level, LogPlugin};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::TextureFormat;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::time::TimeUpdateStrategy;
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_burrow::panel::{BrushTool, PanelAction, ToolAlign, ToolOperation, ToolShape};
use bevy_burrow::prelude::*;

use crate::Options;
use crate::scene::MIDDLE;
use crate::stroke::Aim;

const FRAME: Duration = Duration::from_nanos(1_000_000_000 / 60);
/// Longest wait for anything.
const PATIENCE: Duration = Duration::from_secs(300);

/// Pictures that lie on the disk.
#[derive(Resource, Default)]
struct Developed(usize);

struct Stage {
    app: App,
    camera: Entity,
    folder: PathBuf,
    strokes: u64,
    pictures: usize,
}

/// Plays the script.
pub fn play(options: &Options) -> Result {
    std::fs::create_dir_all(&options.out)?;
    let mut stage = Stage::open(options)?;
    stage.wait_until(|world| world.query::<&Tile>().iter(world).next().is_some())?;

    for x in [-9.0, -3.0, 3.0, 9.0] {
        stage.stroke(Vec2::new(x, 4.0))?;
    }
    let changed = |tool: &mut BrushTool, operation, shape| (tool.operation, tool.shape) = (operation, shape);
    stage.tool(|tool| {
        changed(tool, ToolOperation::Add, ToolShape::Cylinder);
        (tool.radius, tool.length, tool.material, tool.sink) = (3.0, 10.0, 5, -0.6);
    });
    for x in [-14.0, 14.0] {
        stage.stroke(Vec2::new(x, -8.0))?;
    }
    stage.tool(|tool| {
        changed(tool, ToolOperation::Paint, ToolShape::Sphere);
        (tool.radius, tool.material, tool.is_rough, tool.bump) = (6.0, 7, true, 1.5);
    });
    stage.stroke(Vec2::new(0.0, -10.0))?;
    stage.tool(|tool| {
        changed(tool, ToolOperation::Dig, ToolShape::Box);
        (tool.half, tool.turn, tool.align, tool.sink) =
            (Vec3::new(5.0, 3.0, 4.0), 30.0, ToolAlign::Surface, 0.3);
    });
    stage.stroke(Vec2::new(22.0, 6.0))?;
    stage.aim(Some(Vec2::new(-20.0, 8.0)));
    stage.act(PanelAction::CheckSeams);
    stage.frames(40);
    stage.shoot("1_panel")?;
    stage.resize(1920, 1080);
    stage.frames(4);
    stage.shoot("2_large")
}

impl Stage {
    fn open(options: &Options) -> Result<Self> {
        let mut app = App::new();
        app.add_plugins(
            DefaultPlugins
                .set(WindowPlugin {
                    primary_window: None,
                    exit_condition: ExitCondition::DontExit,
                    ..default()
                })
                .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
                .set(LogPlugin { level: Level::WARN, ..default() })
                .disable::<WinitPlugin>()
                .disable::<PipelinedRenderingPlugin>(),
        )
        .insert_resource(TimeUpdateStrategy::ManualDuration(FRAME))
        .init_resource::<Developed>();
        crate::editor(&mut app, options);
        while app.plugins_state() == PluginsState::Adding {
            bevy::tasks::tick_global_task_pools_on_main_thread();
        }
        app.finish();
        app.cleanup();
        app.update();
        let camera = app.world_mut().query_filtered::<Entity, With<Camera3d>>().single(app.world())?;
        let mut stage = Self { app, camera, folder: options.out.clone(), strokes: 0, pictures: 0 };
        stage.film_runs(false);
        stage.resize(options.width, options.height);
        Ok(stage)
    }

    /// From now on the camera draws into an image of this size.
    fn resize(&mut self, width: u32, height: u32) {
        let image = Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None);
        let image = self.app.world_mut().resource_mut::<Assets<Image>>().add(image);
        self.app.world_mut().entity_mut(self.camera).insert(RenderTarget::from(image));
    }

    /// Only pictures are drawn: in software a frame takes long.
    fn film_runs(&mut self, runs: bool) {
        if let Some(mut camera) = self.app.world_mut().get_mut::<Camera>(self.camera) {
            camera.is_active = runs;
        }
    }

    fn frames(&mut self, count: usize) {
        (0..count).for_each(|_| self.app.update());
    }

    fn wait_until(&mut self, mut is_so: impl FnMut(&mut World) -> bool) -> Result {
        let start = Instant::now();
        while !is_so(self.app.world_mut()) {
            if start.elapsed() > PATIENCE {
                return Err("waited in vain".into());
            }
            self.app.update();
        }
        Ok(())
    }

    fn tool(&mut self, change: impl FnOnce(&mut BrushTool)) {
        change(&mut self.app.world_mut().resource_mut::<BrushTool>());
    }

    fn act(&mut self, action: PanelAction) {
        self.app.world_mut().write_message(action);
    }

    /// Points at the ground at an offset from the middle.
    fn aim(&mut self, offset: Option<Vec2>) -> Option<TerrainHit> {
        let world = self.app.world_mut();
        let mut terrains = world.query::<(Entity, &Terrain)>();
        let (entity, terrain) = terrains.iter(world).next()?;
        let place = MIDDLE + Vec3::new(offset?.x, 500.0, offset?.y);
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

    /// One stroke, and the frames until its receipt is there.
    fn stroke(&mut self, offset: Vec2) -> Result {
        let hit = self.aim(Some(offset)).ok_or("the script works outside the landscape")?;
        self.strokes += 1;
        let brush = self.app.world().resource::<BrushTool>().brush_at(&hit).with_tag(self.strokes);
        self.app.world_mut().write_message(brush);
        let strokes = self.strokes;
        self.wait_until(|world| world.resource::<BurrowFigures>().brushes >= strokes)
    }

    fn shoot(&mut self, name: &str) -> Result {
        let path = self.folder.join(format!("{name}.png"));
        let target = self.app.world().get::<RenderTarget>(self.camera);
        let Some(RenderTarget::Image(image)) = target.cloned() else {
            return Err("the camera draws nowhere".into());
        };
        let screenshot = Screenshot::image(image.handle.clone());
        self.film_runs(true);
        self.frames(2);
        self.app
            .world_mut()
            .spawn(screenshot)
            .observe(save_to_disk(path.clone()))
            .observe(|_: On<ScreenshotCaptured>, mut developed: ResMut<Developed>| developed.0 += 1);
        self.pictures += 1;
        let pictures = self.pictures;
        self.wait_until(|world| world.resource::<Developed>().0 >= pictures)?;
        self.film_runs(false);
        println!("picture {}", path.display());
        Ok(())
    }
}
