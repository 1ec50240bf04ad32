//! The most common mistakes of new users: each is logged once, with its remedy.

use std::io::Write;
use std::sync::{Arc, Mutex};

use bevy::ecs::schedule::{ScheduleLabel, SingleThreadedExecutor};
use bevy::log::tracing_subscriber::fmt::Subscriber;
use bevy::log::tracing_subscriber::util::SubscriberInitExt;
use bevy::prelude::*;
use bevy_burrow::plugin::{CommitAction, Part, SurfaceProcessor, SurfaceProcessors};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;

use crate::stage::{Stage, dig, level};

/// What was logged on this thread.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<Vec<u8>>>);

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().expect("nobody panics").extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Log {
    /// Warnings and errors with this text.
    fn count(&self, text: &str) -> usize {
        let log = String::from_utf8_lossy(&self.0.lock().expect("nobody panics")).into_owned();
        let is_loud = |line: &&str| line.contains("WARN") || line.contains("ERROR");
        log.lines().filter(is_loud).filter(|line| line.contains(text)).count()
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.0.lock().expect("nobody panics")).into_owned()
    }
}

/// Runs something, and returns what was logged. Systems run on this thread.
fn logged(mut stage: Stage, run: impl FnOnce(&mut Stage)) -> (Stage, Log) {
    let log = Log::default();
    let writer = log.clone();
    for schedule in [PreStartup.intern(), Update.intern(), PostUpdate.intern(), Last.intern()] {
        stage.app.edit_schedule(schedule, |schedule| {
            schedule.set_executor(SingleThreadedExecutor::new());
        });
    }
    let subscriber = Subscriber::builder().with_writer(move || writer.clone()).with_ansi(false).finish();
    let guard = subscriber.set_default();
    run(&mut stage);
    drop(guard);
    (stage, log)
}

/// Checks that a mistake is logged once for each terrain, with its name, and that the text has what helps.
#[track_caller]
fn assert_logged(log: &Log, terrains: &[Entity], text: &str, help: &str) {
    for terrain in terrains {
        let line = format!("the terrain {terrain}");
        let all = log.text();
        let found = all.lines().filter(|found| found.contains(&line) && found.contains(text)).count();
        assert_eq!(found, 1, "`{text}` of {terrain} in:\n{all}");
    }
    assert!(log.count(help) >= terrains.len(), "`{help}` in:\n{}", log.text());
}

#[test]
fn a_terrain_in_its_place_logs_nothing() {
    let (_, log) = logged(Stage::drawing(), |stage| {
        stage.spawn_at(level(0.5), Vec3::new(64.0, 0.0, -32.0));
        stage.settle();
        stage.send(dig(70.0, 4.0, -20.0, 2.0));
        stage.settle();
        stage.frames(10);
    });
    assert_eq!(log.text(), "");
}

#[test]
fn a_terrain_that_is_rotated_or_moved_by_part_of_a_voxel() {
    let mut terrains = Vec::new();
    let (_, log) = logged(Stage::drawing(), |stage| {
        terrains.push(stage.spawn_at(level(1.0), Vec3::X * 0.3));
        let turned = Transform::from_xyz(0.0, 90.0, 0.0).with_rotation(Quat::from_rotation_y(0.3));
        terrains.push(stage.app.world_mut().spawn((level(1.0), turned)).id());
        stage.settle();
        // It moves on, and is not logged again.
        for step in 0..5 {
            let mut place = stage.app.world_mut().get_mut::<Transform>(terrains[0]).expect("a place");
            place.translation.x = 0.1 * step as f32;
            stage.frames(1);
        }
    });
    assert_logged(&log, &terrains, "is rotated", "cracks");
}

#[test]
fn a_terrain_that_is_scaled_itself() {
    let mut terrains = Vec::new();
    let (stage, log) = logged(Stage::drawing(), |stage| {
        for scale in [2.0, 0.3] {
            let place = Transform::from_xyz(0.0, 90.0 * scale, 0.0).with_scale(Vec3::splat(scale));
            terrains.push(stage.app.world_mut().spawn((level(1.0), place)).id());
        }
        stage.settle();
        for &terrain in &terrains {
            stage.app.world_mut().get_mut::<Transform>(terrain).expect("a place").scale = Vec3::splat(3.0);
            stage.frames(2);
        }
    });
    assert_logged(&log, &terrains, "was replaced", "voxel_size");
    assert_eq!(stage.app.world().get::<Transform>(terrains[0]).expect("a place").scale, Vec3::ONE);
    // A terrain of another voxel size in its place is not a mistake.
    let (_, log) = logged(Stage::drawing(), |stage| {
        let terrain = stage.show(level(2.0));
        stage.app.world_mut().entity_mut(terrain).insert(level(0.5));
        stage.frames(4);
        stage.settle();
    });
    assert_eq!(log.text(), "");
}

#[test]
fn parents_that_mirror_stretch_or_flatten() {
    let scales = [
        (Vec3::new(-1.0, 1.0, 1.0), "is mirrored", "positive scales"),
        (Vec3::new(1.0, 2.0, 1.0), "is stretched", "scale it evenly"),
        (Vec3::new(1.0, 0.0, 1.0), "cannot be used", "finite transforms"),
        (Vec3::splat(f32::NAN), "cannot be used", "finite transforms"),
    ];
    for (scale, text, help) in scales {
        let mut terrains = Vec::new();
        let (_, log) = logged(Stage::drawing(), |stage| {
            let root = (Transform::from_scale(scale), Visibility::default());
            let root = stage.app.world_mut().spawn(root).id();
            for _ in 0..2 {
                terrains.push(stage.app.world_mut().spawn((level(1.0), ChildOf(root))).id());
            }
            stage.settle();
            stage.frames(4);
        });
        assert_logged(&log, &terrains, text, help);
    }
}

#[test]
fn a_terrain_far_from_the_origin() {
    let mut terrain = Entity::PLACEHOLDER;
    let (_, log) = logged(Stage::drawing(), |stage| {
        terrain = stage.spawn_at(level(1.0), Vec3::X * 262_144.0);
        stage.settle();
        stage.frames(4);
    });
    assert_logged(&log, &[terrain], "from the origin", "floating origins");
}

#[test]
fn a_brush_with_a_size_that_is_not_allowed() {
    let mut terrain = Entity::PLACEHOLDER;
    let (stage, log) = logged(Stage::drawing(), |stage| {
        terrain = stage.show(level(1.0));
        for radius in [-3.0, 0.0, 1e6] {
            stage.send(dig(30.0, 8.0, 30.0, radius));
            stage.send_to(terrain, dig(30.0, 8.0, 30.0, radius));
        }
        stage.frames_until("all are answered", |stage| stage.receipts().len() == 6);
    });
    assert_eq!(stage.receipts().len(), 6);
    assert_logged(&log, &[terrain], "a brush was rejected", "BrushApplied");
}

#[test]
fn the_first_brushes_reach_no_terrain() {
    let mut terrain = Entity::PLACEHOLDER;
    let (_, log) = logged(Stage::drawing(), |stage| {
        terrain = stage.spawn_at(level(1.0), Vec3::new(1000.0, 0.0, 0.0));
        stage.settle();
        for step in 0..3 {
            stage.send(dig(30.0 + step as f32, 8.0, 30.0, 4.0));
            stage.frames(2);
        }
    });
    assert_logged(&log, &[terrain], "from 1000 to 1064 along x", "world space and metres");
    // Later ones may be meant so.
    let (_, log) = logged(Stage::drawing(), |stage| {
        stage.show(level(1.0));
        stage.send(dig(30.0, 8.0, 30.0, 4.0));
        stage.settle();
        stage.send(dig(3000.0, 8.0, 30.0, 4.0));
        stage.frames(2);
    });
    assert_eq!(log.text(), "");
}

#[test]
fn levels_of_detail_that_nobody_looks_at() {
    let mut terrain = Entity::PLACEHOLDER;
    let show = |stage: &mut Stage| {
        let ground = Ground::flat(256, 256, 8.0).expect("valid");
        let model = Terrain::new(ground, &TerrainSettings { chunk_size: 16, ..default() }).expect("valid");
        let terrain = stage.app.world_mut().spawn((model, LevelsOfDetail::default())).id();
        stage.settle();
        stage.frames(4);
        terrain
    };
    let (_, log) = logged(Stage::drawing(), |stage| terrain = show(stage));
    assert_logged(&log, &[terrain], "no camera looks at it", "DetailSource");
    let (_, log) = logged(Stage::drawing(), |stage| {
        stage.app.world_mut().spawn((DetailSource::default(), Transform::from_xyz(60.0, 30.0, 60.0)));
        show(stage);
    });
    assert_eq!(log.text(), "");
    let (_, log) = logged(Stage::server(), |stage| {
        show(stage);
    });
    assert_eq!(log.text(), "", "a server draws nothing");
}

#[test]
fn a_surface_processor_that_panics() {
    struct Broken;

    impl SurfaceProcessor for Broken {
        fn build(&self, _: &Part, _: &SurfaceMesh) -> Option<CommitAction> {
            panic!("on purpose")
        }
    }

    let mut stage = Stage::drawing();
    stage.app.world_mut().resource_mut::<SurfaceProcessors>().add(Broken);
    stage.show(level(1.0));
    assert_eq!(stage.count::<Tile>(), 16, "the ground is shown without its data");
}

#[cfg(feature = "avian")]
#[test]
fn bodies_without_a_collider_source() {
    use avian3d::prelude::*;
    use bevy_burrow::physics::{ColliderSource, TerrainPhysicsPlugin};

    fn physics() -> Stage {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, PhysicsPlugins::default(), BurrowPlugins, TerrainPhysicsPlugin));
        app.finish();
        app.cleanup();
        Stage::of(app)
    }

    let mut terrains = Vec::new();
    let (_, log) = logged(physics(), |stage| {
        for number in 0..2 {
            let at = Vec3::X * 100.0 * number as f32;
            terrains.push(stage.spawn_at(level(1.0), at));
            for x in [20.0, 30.0] {
                let place = Transform::from_translation(at + Vec3::new(x, 12.0, 20.0));
                stage.app.world_mut().spawn((RigidBody::Dynamic, Collider::sphere(0.5), place));
            }
        }
        stage.frames(60);
    });
    assert_logged(&log, &terrains, "has no colliders", "ColliderSource");

    let (_, log) = logged(physics(), |stage| {
        stage.spawn_at(level(1.0), Vec3::ZERO);
        let place = Transform::from_xyz(20.0, 12.0, 20.0);
        stage.app.world_mut().spawn((RigidBody::Dynamic, Collider::sphere(0.5), place));
        stage.app.world_mut().spawn((ColliderSource { radius: 40.0 }, place));
        stage.frames(60);
    });
    assert_eq!(log.count("has no colliders"), 0, "{}", log.text());
}

/// Each mistake of the guide's table has a test here that looks for what the table quotes.
#[test]
fn every_mistake_in_the_guide_is_tested() {
    let (guide, tests) =
        (include_str!("../../docs/guide/src/troubleshooting.md"), include_str!("mistakes.rs"));
    let table = guide.split("## What is logged").nth(1).and_then(|rest| rest.split("\n## ").next());
    let rows = table.expect("the table").lines().filter(|line| line.ends_with("` |"));
    let mut count = 0;
    for row in rows {
        let test = row.rsplit('`').nth(1).expect("a test");
        let quoted = row.split('*').nth(1).expect("what is logged");
        let body = tests.split(&format!("fn {test}(")).nth(1).unwrap_or_else(|| panic!("no test {test}"));
        let body = body.split("#[test]").next().unwrap_or_default();
        assert!(body.contains(quoted), "{test} looks for something else than `{quoted}`");
        count += 1;
    }
    assert!(count >= 10, "{count}");
}

#[cfg(feature = "store")]
mod of_saved_worlds {
    use super::*;
    use crate::saved::Folder;

    #[test]
    fn a_saved_world_without_its_plugin() {
        let folder = Folder::new("mistake-plugin");
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, bevy_burrow::plugin::TerrainPlugin));
        let (_, log) = logged(Stage::of(app), |stage| {
            stage.app.world_mut().spawn((level(1.0), SavedWorld::new(&folder.0)));
            stage.app.world_mut().spawn((level(1.0), StartLevel(Handle::default())));
        });
        let text = "holds its terrain until there is a SavePlugin";
        assert_eq!((log.count(&format!("a SavedWorld {text}")), log.count("add BurrowPlugins")), (1, 2));
        assert_eq!(log.count(&format!("a StartLevel {text}")), 1);
    }

    #[test]
    fn a_saved_world_on_another_entity_than_its_terrain() {
        let folder = Folder::new("mistake-entity");
        let mut entity = Entity::PLACEHOLDER;
        let (_, log) = logged(Stage::drawing(), |stage| {
            stage.show(level(1.0));
            entity = stage.app.world_mut().spawn(SavedWorld::new(&folder.0)).id();
            let start = std::time::Instant::now();
            while start.elapsed().as_secs() < 12 {
                stage.frames(10);
            }
        });
        assert_eq!(
            log.count(&format!("the SavedWorld of {entity} waits for a terrain")),
            1,
            "{}",
            log.text()
        );
        assert!(log.count("on the entity of the Terrain") > 0);
    }

    #[test]
    fn a_level_that_is_not_there() {
        let mut terrain = Entity::PLACEHOLDER;
        let (_, log) = logged(Stage::drawing(), |stage| {
            let level = stage.app.world().resource::<AssetServer>().load("burrow-none.burrow_level");
            terrain = stage.app.world_mut().spawn((crate::stage::level(1.0), StartLevel(level))).id();
            stage.settle();
        });
        assert_eq!(log.count(&format!("the level of {terrain} can't be loaded")), 1, "{}", log.text());
        assert!(log.count("begins without it") > 0);
    }

    #[test]
    fn a_world_that_can_not_be_opened() {
        // A file is where the folder should be.
        let folder = Folder::new("mistake-file");
        std::fs::write(&folder.0, b"in the way").expect("a new file");
        let mut terrain = Entity::PLACEHOLDER;
        let (_, log) = logged(Stage::drawing(), |stage| {
            terrain = stage.app.world_mut().spawn((level(1.0), SavedWorld::new(&folder.0))).id();
            stage.settle();
        });
        drop(std::fs::remove_file(&folder.0));
        assert_eq!(log.count(&format!("the world of {terrain} is not saved")), 1, "{}", log.text());
    }
}

#[cfg(feature = "examples")]
mod of_looks {
    use super::*;
    use crate::stage::{bevys_plugins, finish_plugins};

    fn stage() -> Stage {
        let mut stage = Stage::windowless();
        stage.app.insert_resource(GroundTextures::Baked { side: 16, anisotropy: 1 });
        stage
    }

    #[test]
    fn a_terrain_without_a_look() {
        let mut terrains = Vec::new();
        let (_, log) = logged(stage(), |stage| {
            terrains.extend((0..2).map(|number| stage.spawn_at(level(1.0), Vec3::X * 100.0 * number as f32)));
            stage.settle();
            stage.frames(4);
        });
        assert_logged(&log, &terrains, "nothing of it is drawn", "GroundLook");
        assert_logged(&log, &terrains, "StandardMaterial", "TerrainMaterialPlugin");
    }

    #[test]
    fn a_terrain_that_gets_its_look_when_it_is_ready() {
        let (_, log) = logged(stage(), |stage| {
            stage.app.add_observer(|ready: On<TerrainReady>, mut commands: Commands| {
                commands.entity(ready.entity).insert(GroundLook::default());
            });
            stage.show(level(1.0));
            stage.frames(4);
        });
        assert_eq!(log.count("nothing of it is drawn"), 0, "{}", log.text());
    }

    /// A terrain whose material has a texture, which is not drawn.
    fn spawn_textured(stage: &mut Stage) -> Entity {
        let world = stage.app.world_mut();
        let image = world.resource_mut::<Assets<Image>>().add(Image::default());
        let material = StandardMaterial { base_color_texture: Some(image), ..default() };
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        world.spawn((level(1.0), MeshMaterial3d(material))).id()
    }

    #[test]
    fn materials_are_looked_at_once_they_are_propagated() {
        #[derive(Resource)]
        struct Open(bool);
        let mut stage = stage();
        stage.app.insert_resource(Open(false));
        stage.app.configure_sets(Update, BurrowSystems::Propagate.run_if(|open: Res<Open>| open.0));
        let mut terrain = Entity::PLACEHOLDER;
        let (_, log) = logged(stage, |stage| {
            terrain = spawn_textured(stage);
            stage.settle();
            stage.frames(4);
            stage.app.world_mut().resource_mut::<Open>().0 = true;
            stage.frames(4);
        });
        assert_eq!(log.count("nothing of it is drawn"), 0, "{}", log.text());
        assert_logged(&log, &[terrain], "are not drawn", "texture coordinates");
    }

    #[test]
    fn burrow_plugins_before_those_of_bevy() {
        for is_before in [true, false] {
            let mut app = App::new();
            if is_before {
                app.add_plugins(BurrowPlugins).add_plugins(bevys_plugins());
            } else {
                app.add_plugins(bevys_plugins()).add_plugins(BurrowPlugins);
            }
            let (_, log) = logged(Stage::of(app), |stage| finish_plugins(&mut stage.app));
            let text = "no terrain with a GroundLook will be drawn";
            assert_eq!(log.count(text), usize::from(is_before), "{}", log.text());
            assert_eq!(log.count("Add DefaultPlugins first"), usize::from(is_before));
        }
    }

    #[test]
    fn materials_of_two_types() {
        let mut terrain = Entity::PLACEHOLDER;
        let (_, log) = logged(stage(), |stage| {
            let world = stage.app.world_mut();
            let plain = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
            terrain = world.spawn((level(1.0), MeshMaterial3d(plain), GroundLook::default())).id();
            stage.settle();
            stage.frames_until("its look is there", |stage| {
                stage.app.world().entity(terrain).contains::<MeshMaterial3d<GroundMaterial>>()
            });
            stage.frames(4);
        });
        assert_logged(&log, &[terrain], "materials of several types", "GroundExtension");
    }

    #[test]
    fn a_standard_material_with_textures() {
        let mut terrain = Entity::PLACEHOLDER;
        let (_, log) = logged(stage(), |stage| {
            terrain = spawn_textured(stage);
            stage.settle();
        });
        assert_logged(&log, &[terrain], "are not drawn", "texture coordinates");
    }
}
