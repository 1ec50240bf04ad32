//! Every way of drawing shows the same: forward, with all prepasses, and deferred.

use bevy::core_pipeline::prepass::{DeferredPrepass, MotionVectorPrepass, NormalPrepass};
use bevy::pbr::DefaultOpaqueRendererMethod;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::album::{Album, flip, keep};
use crate::landscape::hills;
use crate::studio::Studio;

/// Mean FLIP between two ways: colours of the deferred way have eight bits.
const CLOSE: f32 = 0.05;

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    set_up(studio);
    let forward = studio.picture();
    let camera = studio.camera;
    let mut check = |studio: &mut Studio, way: &str| {
        let picture = studio.picture();
        let (mean, map) = flip(&forward, &picture);
        println!("{way}: FLIP {mean:.5} from forward");
        if mean > CLOSE {
            keep(way, "actual", &picture);
            keep(way, "forward", &forward);
            keep(way, "difference", &map);
        }
        album.check(mean <= CLOSE, || format!("{way} is not like forward: FLIP {mean:.5}"));
    };
    studio.app.world_mut().entity_mut(camera).insert((NormalPrepass, MotionVectorPrepass));
    check(studio, "prepasses");
    // A deferred material wants a deferred camera as long as it is there.
    studio.app.world_mut().entity_mut(camera).insert(DeferredPrepass);
    studio.app.insert_resource(DefaultOpaqueRendererMethod::deferred());
    set_up(studio);
    check(studio, "deferred");
    studio.close_terrain();
    studio.app.insert_resource(DefaultOpaqueRendererMethod::forward());
    studio.app.update();
    let mut camera = studio.app.world_mut().entity_mut(camera);
    camera.remove::<(NormalPrepass, MotionVectorPrepass, DeferredPrepass)>();
}

fn set_up(studio: &mut Studio) {
    studio.terrain(hills(64), GroundLook::default());
    let middle = Vec3::new(32.0, studio.height(32.0, 32.0), 32.0);
    studio.apply([Brush::dig(Shape::sphere(middle, 6.0))]);
    studio.look(middle + Vec3::new(14.0, 14.0, 20.0), middle);
}
