//! Fourteen views of one country and one of an imported world, to be looked at: `make scenes` renders them.
//!
//! | variable | meaning |
//! | --- | --- |
//! | `BURROW_SCENES` | the folder for the pictures |
//! | `BURROW_ONLY` | names of scenes, separated by commas; all by default |
//! | `BURROW_SIZE` | width and height, such as `1280x720`; 640x360 by default |
//! | `BURROW_QUALITY` | `low` for the low quality |
//!
//! `BURROW_SHADER` tries a changed shader without a build: see `studio.rs`.

use std::path::PathBuf;

use bevy::core_pipeline::prepass::DepthPrepass;
use bevy::prelude::*;
use bevy_burrow::ground::NoiseSource;
use bevy_burrow::prelude::*;
use image::RgbImage;

use crate::lod::{settle, watch};
use crate::studio::Studio;

/// Cells along a side of the world.
const SIDE: u32 = 16_384;
/// How far ground is drawn.
const VIEW: f32 = 8000.0;
/// The middle of the world.
const MIDDLE: f32 = 8192.0;

/// Ridges of 16 x 16 km with meadows, beds of rock and snow.
fn country() -> Ground {
    let heights = NoiseHeights {
        seed: 7,
        kind: NoiseKind::Ridged,
        octaves: 7,
        scale: 1400.0,
        amplitude: 240.0,
        base: -40.0,
    };
    let source = NoiseSource::new(&heights).expect("valid noise");
    let ground = Ground::from_source(SIDE, SIDE, source).expect("a valid size");
    ground.with_strata(&Strata::alpine()).expect("valid strata")
}

/// Where the scenes are.
struct Places {
    /// The highest place around the middle.
    summit: Vec3,
    /// The lowest one.
    valley: Vec3,
    /// A slope of some 30 degrees, and the direction downhill.
    slope: (Vec3, Vec3),
    /// The steepest place, and the direction downhill.
    cliff: (Vec3, Vec3),
    /// A level place.
    meadow: Vec3,
    /// Where snow begins, and the direction downhill.
    snow: (Vec3, Vec3),
}

impl Places {
    fn find(studio: &mut Studio) -> Self {
        let at = |at: usize| {
            let (x, z) = ((at % 60) as f32, (at / 60) as f32);
            Vec2::new(MIDDLE - 600.0 + 20.0 * x, MIDDLE - 600.0 + 20.0 * z)
        };
        let facts: Vec<(Vec3, Vec3)> = (0..3600)
            .map(|number| {
                let place = at(number);
                let mut height = |dx: f32, dz: f32| studio.height(place.x + dx, place.y + dz);
                let here = Vec3::new(place.x, height(0.0, 0.0), place.y);
                let fall =
                    Vec2::new(height(-6.0, 0.0) - height(6.0, 0.0), height(0.0, -6.0) - height(0.0, 6.0));
                (here, Vec3::new(fall.x, 0.0, fall.y) / 12.0)
            })
            .collect();
        let best = |score: &dyn Fn(&(Vec3, Vec3)) -> f32| {
            let (place, fall) =
                *facts.iter().max_by(|a, b| score(a).total_cmp(&score(b))).expect("some places");
            (place, fall)
        };
        let near = |value: f32, aim: f32| -(value - aim).abs();
        let direction = |(place, fall): (Vec3, Vec3)| (place, fall.normalize_or(Vec3::X));
        Self {
            summit: best(&|(place, _)| place.y).0,
            valley: best(&|(place, _)| -place.y).0,
            slope: direction(best(&|(place, fall)| {
                near(fall.length(), 0.62) + 0.05 * near(place.y, 30.0) / 10.0
            })),
            cliff: direction(best(&|(_, fall)| fall.length())),
            meadow: best(&|(place, fall)| -fall.length() + 0.02 * near(place.y, 20.0)).0,
            snow: direction(best(&|(place, fall)| near(place.y, 98.0) + 20.0 * near(fall.length(), 0.35))),
        }
    }
}

#[test]
#[ignore = "pictures to look at: make scenes"]
fn scenes_are_rendered() {
    let folder = PathBuf::from(std::env::var_os("BURROW_SCENES").expect("BURROW_SCENES=folder"));
    std::fs::create_dir_all(&folder).expect("a folder");
    let Some(mut studio) = Studio::open(|app| {
        app.insert_resource(GroundTextures::Baked { side: 512, anisotropy: 4 });
    }) else {
        return;
    };
    let size = std::env::var("BURROW_SIZE").ok().and_then(|size| {
        let (width, height) = size.split_once('x')?;
        Some((width.parse().ok()?, height.parse().ok()?))
    });
    let size = size.unwrap_or((640, 360));
    studio.resize(size);
    let only = std::env::var("BURROW_ONLY").unwrap_or_default();
    let only: Vec<&str> = only.split(',').filter(|name| !name.is_empty()).collect();
    let wants = |name: &str| only.is_empty() || only.contains(&name);
    let mut book = Book { studio, folder, size };
    if wants("swatches") {
        book.swatches();
    }
    if wants("carpet") {
        book.carpet();
    }
    if wants("import") {
        let look = book.look();
        crate::import::shoot(&mut book.studio, look);
        book.save("import");
    }
    if ["swatches", "carpet", "import"].iter().filter(|name| wants(name)).count() < only.len()
        || only.is_empty()
    {
        book.country(&wants);
    }
}

struct Book {
    studio: Studio,
    folder: PathBuf,
    size: (u32, u32),
}

impl Book {
    fn look(&self) -> GroundLook {
        let is_low = std::env::var("BURROW_QUALITY").is_ok_and(|quality| quality == "low");
        GroundLook { quality: if is_low { GroundQuality::Low } else { GroundQuality::High }, ..default() }
    }

    fn save(&mut self, name: &str) {
        let picture: RgbImage = self.studio.picture();
        let path = self.folder.join(name).with_extension("png");
        picture.save(&path).expect("a picture can be written");
        println!("{}", path.display());
    }

    /// All layers side by side on level ground, and on a wall.
    fn swatches(&mut self) {
        let noise =
            NoiseHeights { seed: 8, scale: 20.0, amplitude: 0.8, octaves: 3, base: 12.0, ..default() };
        let look = self.look();
        self.studio.terrain(Ground::from_noise(64, 64, &noise).expect("valid ground"), look);
        let squares = (0..14_u8).map(|id| {
            let at = Vec3::new(13.0 + 8.0 * f32::from(id % 5), 12.0, 13.0 + 8.0 * f32::from(id / 5));
            Brush::paint(Shape::cuboid(at, Vec3::new(4.0, 10.0, 4.0)), MaterialId(id))
        });
        let squares: Vec<Brush> = squares.collect();
        self.studio.apply(squares);
        self.studio.look(Vec3::new(29.0, 38.0, 38.0), Vec3::new(29.0, 12.0, 21.5));
        self.save("swatches");
        let walls = (0..14_u8).map(|id| {
            let at = Vec3::new(4.0 + 4.0 * f32::from(id), 16.0, 40.0);
            Brush::add(Shape::cuboid(at, Vec3::new(2.0, 6.0, 3.0)), MaterialId(id))
        });
        let walls: Vec<Brush> = walls.collect();
        self.studio.apply(walls);
        self.studio.look(Vec3::new(30.0, 19.0, 68.0), Vec3::new(30.0, 16.0, 40.0));
        self.studio.sun(Vec3::new(1.0, 0.9, 1.2));
        self.save("walls");
        self.studio.sun(Vec3::new(1.0, 0.9, 0.4));
    }

    /// Level ground of grass and rock from 30 m, where repetition would show.
    fn carpet(&mut self) {
        let noise =
            NoiseHeights { seed: 8, scale: 60.0, amplitude: 1.0, octaves: 2, base: 12.0, ..default() };
        for (name, id) in [("carpet_grass", 1), ("carpet_rock", 0), ("carpet_sand", 2), ("carpet_soil", 8)] {
            let skin = ColumnMaterial { base: MaterialId(id), overlay: MaterialId(id), blend: 255 };
            let look = self.look();
            let ground = Ground::from_noise(256, 256, &noise)
                .and_then(|ground| ground.with_materials(&MaterialControl::Uniform(skin)));
            self.studio.terrain(ground.expect("valid ground"), look);
            self.studio.look(Vec3::new(128.0, 42.0, 128.0), Vec3::new(128.0, 12.0, 108.0));
            self.save(name);
        }
    }

    fn country(&mut self, wants: &dyn Fn(&str) -> bool) {
        let look = self.look();
        watch(&mut self.studio, VIEW);
        let levels = LevelsOfDetail { view_distance: VIEW, ..default() };
        self.studio.terrain_with(country(), (look, levels));
        let fog = DistanceFog {
            color: Color::linear_rgb(0.50, 0.66, 0.86),
            falloff: FogFalloff::from_visibility_squared(2.2 * VIEW),
            ..default()
        };
        let camera = self.studio.camera;
        self.studio.app.world_mut().entity_mut(camera).insert((fog, DepthPrepass));
        let height = self.size.1 as f32;
        self.studio.one::<DetailSource>().picture_height = height;
        let places = Places::find(&mut self.studio);
        let Places { summit, valley, slope, cliff, meadow, snow } = places;
        let up = Vec3::Y;
        let noon = Vec3::new(1.0, 1.6, 0.4);
        let afternoon = Vec3::new(1.0, 0.9, 0.4);
        let dusk = Vec3::new(1.0, 0.14, 0.3);
        let towards = (summit - valley).with_y(0.0).normalize();

        // Works, dug before the pictures so that all of them show the same country.
        let (place, downhill) = slope;
        let across = downhill.cross(up);
        let pit = meadow;
        let gully = meadow + Vec3::new(60.0, 0.0, 10.0);
        let works = meadow + Vec3::new(-50.0, 0.0, 30.0);
        let tunnel = place + across * 40.0;
        let ground_at = |studio: &mut Studio, at: Vec3| at.with_y(studio.height(at.x, at.z));
        let studio = &mut self.studio;
        let [pit, gully, works, tunnel] = [pit, gully, works, tunnel].map(|at| ground_at(studio, at));
        let mut brushes =
            vec![Brush::dig(Shape::sphere(pit, 11.0)), Brush::dig(Shape::sphere(pit - up * 5.0, 9.0))];
        let bends = [-32.0_f32, -16.0, 0.0, 16.0, 32.0].map(|z| {
            let at = gully + Vec3::new(if z.abs() == 16.0 { 5.0 } else { -3.0 }, 0.0, z);
            ground_at(studio, at)
        });
        brushes.extend(
            bends
                .windows(2)
                .flat_map(|ends| [(0.0, 4.0), (3.5, 3.0)].map(|(deep, wide)| (ends[0], ends[1], deep, wide)))
                .map(|(from, to, deep, wide)| {
                    Brush::dig(Shape::capsule(from - up * deep, to - up * deep, wide))
                }),
        );
        let inner = tunnel - downhill * 34.0 - up * 1.0;
        brushes.extend([
            Brush::dig(Shape::capsule(tunnel + downhill * 4.0 + up * 1.5, inner, 3.2)),
            Brush::dig(Shape::capsule(inner, inner - downhill * 14.0 + across * 14.0, 3.2)),
            Brush::add(
                Shape::cuboid(bends[2] + up * 1.2 + Vec3::X * 2.0, Vec3::new(11.0, 0.8, 2.0)),
                MaterialId(5),
            ),
            Brush::paint(Shape::sphere(works, 9.0), MaterialId(4)),
            Brush::paint(Shape::sphere(works + Vec3::new(6.0, 0.0, 5.0), 6.0), MaterialId(2)),
            Brush::dig(Shape::sphere(works + up * 2.0, 6.0)),
            Brush::paint(Shape::cuboid(works + Vec3::new(-16.0, 0.0, 0.0), Vec3::splat(5.0)), MaterialId(5)),
            Brush::paint(Shape::sphere(works + Vec3::new(-2.0, 0.0, 16.0), 5.0), MaterialId(6)),
        ]);
        studio.apply(brushes);

        let over = |place: Vec3, metres: f32| place + up * metres;
        let beside = |studio: &mut Studio, place: Vec3, aside: Vec3, metres: f32| {
            let at = place + aside;
            over(ground_at(studio, at), metres)
        };
        let mut views = vec![];
        let eye = over(summit, 40.0);
        views.push(("landscape", eye, eye + Vec3::new(10.0, -3.0, 9.0), afternoon));
        let eye = beside(studio, valley, -towards * 40.0, 12.0);
        views.push(("valley_noon", eye, over(valley, 22.0) + towards * 60.0, noon));
        views.push(("valley_dusk", eye, over(valley, 22.0) + towards * 60.0, dusk));
        for (name, metres) in [("hillside_5", 5.0), ("hillside_50", 50.0), ("hillside_500", 500.0)] {
            let away = (downhill + up * 0.35).normalize() * metres;
            let low = beside(studio, place, away.with_y(0.0), 1.7);
            let eye = if low.y > (place + away).y { low } else { place + away };
            views.push((name, eye, place, afternoon));
        }
        let eye = beside(studio, cliff.0, cliff.1 * 30.0, 4.0);
        views.push(("cliff", eye.with_y(eye.y.max(cliff.0.y)), cliff.0, afternoon));
        let eye = beside(studio, pit, Vec3::new(14.0, 0.0, 17.0), 9.0);
        views.push(("pit", eye, pit - up * 5.0, afternoon));
        let eye = beside(studio, gully, Vec3::new(10.0, 0.0, 38.0), 8.0);
        views.push(("gully", eye, bends[2] - up * 4.0, afternoon));
        let eye = beside(studio, gully, Vec3::new(-18.0, 0.0, 20.0), 6.0);
        views.push(("bridge", eye, bends[2], afternoon));
        let eye = beside(studio, works, Vec3::new(10.0, 0.0, 26.0), 16.0);
        views.push(("works", eye, works, afternoon));
        let eye = beside(studio, snow.0, snow.1 * 60.0, 20.0);
        views.push(("snow_line", eye, snow.0, afternoon));
        let eye = over(summit, 90.0);
        views.push(("horizon", eye, eye + Vec3::new(-10.0, -1.2, 4.0), afternoon));
        for (name, eye, at, sun) in views {
            if !wants(name) {
                continue;
            }
            self.studio.look(eye, at);
            self.studio.sun(sun);
            self.studio.sky(if sun == dusk { 350.0 } else { 900.0 });
            self.studio.one::<DirectionalLight>().color =
                if sun == dusk { Color::srgb(1.0, 0.68, 0.42) } else { Color::WHITE };
            settle(&mut self.studio);
            self.save(name);
        }
        if wants("tunnel") {
            let eye = tunnel - downhill * 6.0 + up * 0.6;
            self.studio.look(eye, inner);
            self.studio.sky(30.0);
            let lamp = SpotLight {
                intensity: 1_500_000.0,
                range: 60.0,
                inner_angle: 0.3,
                outer_angle: 0.7,
                ..default()
            };
            let place = Transform::from_translation(eye).looking_at(inner, up);
            let lamp = self.studio.app.world_mut().spawn((lamp, place)).id();
            settle(&mut self.studio);
            self.save("tunnel");
            self.studio.app.world_mut().despawn(lamp);
            self.studio.sky(900.0);
        }
    }
}
