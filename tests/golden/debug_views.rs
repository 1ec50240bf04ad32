//! Each debug view over the same pit, which lies across a corner of four chunks.

use bevy::prelude::*;
use bevy_burrow::debug::{BurrowDebug, DebugView};
use bevy_burrow::prelude::*;

use crate::album::{Album, flip};
use crate::studio::Studio;

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    let noise = NoiseHeights { seed: 3, scale: 60.0, amplitude: 10.0, octaves: 4, ..default() };
    let skin = ColumnMaterial { base: MaterialId(0), overlay: MaterialId(1), blend: 255 };
    let ground = Ground::from_noise(128, 128, &noise)
        .and_then(|ground| ground.with_materials(&MaterialControl::Uniform(skin)))
        .expect("valid ground");
    studio.terrain(ground, GroundLook::default());
    let middle = Vec3::new(64.0, studio.height(64.0, 64.0), 64.0);
    // No fading, so that the picture does not depend on when it is taken.
    let mut debug = BurrowDebug { focus: Some(middle), radius: 60.0, near: 14.0, fade: 1e9, ..default() };
    debug.dirty = true;
    studio.app.world_mut().insert_resource(debug.clone());
    studio.apply([
        Brush::dig(Shape::sphere(middle, 7.0)),
        Brush::dig(Shape::sphere(middle + Vec3::new(17.0, 0.0, -3.0), 4.0)),
    ]);
    studio.look(middle + Vec3::new(-14.0, 19.0, 22.0), middle + Vec3::new(3.0, -2.0, -1.0));
    debug.dirty = false;
    let mut shot = |debug: &BurrowDebug| {
        studio.app.world_mut().insert_resource(debug.clone());
        (0..3).for_each(|_| studio.app.update());
        studio.picture()
    };
    // This view comes first: dirty bricks are recorded only while it is on.
    let dirty = shot(&BurrowDebug { dirty: true, ..debug.clone() });
    album.compare("debug_dirty", &dirty);
    let without = shot(&debug);
    for view in DebugView::ALL.into_iter().filter(|view| *view != DebugView::Dirty) {
        let mut only = debug.clone();
        *only.switch(view) = true;
        let picture = shot(&only);
        let name = format!("debug_{view:?}").to_lowercase();
        album.compare(&name, &picture);
        let (apart, _) = flip(&without, &picture);
        println!("{name}: FLIP {apart:.5} against the ground without it");
        album.check(apart > 0.003, || format!("{name} is hardly visible: FLIP {apart:.5}"));
    }
    let (apart, _) = flip(&without, &dirty);
    album.check(apart > 0.003, || format!("dirty bricks are hardly visible: FLIP {apart:.5}"));
}
