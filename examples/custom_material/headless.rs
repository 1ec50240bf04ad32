//! The app without a window: a script digs, and pictures are written.

use std::path::Path;
use std::time::Duration;

use bevy::core_pipeline::prepass::DepthPrepass;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::offscreen;
use crate::photo::{Photographer, wait_until};

const SIZE: (u32, u32) = (960, 540);

/// Two pictures: before and after digging.
pub fn run(folder: &Path) -> Result {
    std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let renderer = offscreen::find_renderer().ok_or("there is no graphics adapter, and so no picture")?;
    let mut app = offscreen::build(Some(renderer), |app| {
        app.add_plugins(super::table);
    });
    let place = Transform::from_translation(super::VIEW.0).looking_at(super::VIEW.1, Vec3::Y);
    let camera = app.world_mut().spawn((Camera3d::default(), DepthPrepass, place)).id();
    let photographer = Photographer::new(&mut app, camera, SIZE);
    until(&mut app, |app| {
        let mut tiles = app.world_mut().query_filtered::<(), (With<Tile>, With<Mesh3d>)>();
        tiles.iter(app.world()).count() == 64
    })?;
    photographer.shoot(&mut app, &folder.join("1_map.png"))?;
    let at = |app: &mut App, x: f32, z: f32| -> Result<Vec3> {
        let world = app.world_mut();
        let terrain = world.query::<&Terrain>().single(world)?;
        let height = terrain.world().height(f64::from(x), f64::from(z)).ok_or("outside the world")?;
        Ok(Vec3::new(x, height as f32, z))
    };
    let (pit, wall) = (at(&mut app, 110.0, 170.0)?, at(&mut app, 175.0, 165.0)?);
    let trench = at(&mut app, 60.0, 130.0)?;
    app.world_mut().write_message_batch([
        Brush::dig(Shape::sphere(pit, 18.0)),
        Brush::dig(Shape::capsule(pit, trench, 6.0)),
        Brush::add(Shape::capsule(wall, wall + Vec3::new(20.0, 4.0, -25.0), 6.0), MaterialId(2)),
    ]);
    until(&mut app, |app| app.world().resource::<BurrowFigures>().brushes == 3)?;
    photographer.shoot(&mut app, &folder.join("2_dug.png"))
}

fn until(app: &mut App, mut is_so: impl FnMut(&mut App) -> bool) -> Result {
    wait_until(app, |app| {
        app.update();
        std::thread::sleep(Duration::from_millis(1));
        is_so(app)
    })
}
