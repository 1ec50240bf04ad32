//! All rendering paths look the same: forward, forward with all prepasses, and deferred.

use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass, MotionVectorPrepass, NormalPrepass};
use bevy::prelude::*;
use bevy::render::render_resource::{AsBindGroup, BindingType};
use bevy::render::renderer::RenderDevice;
use bevy_burrow::prelude::*;

use crate::album::{Album, flip, threshold};
use crate::landscape::hills;
use crate::studio::Studio;

/// Largest mean FLIP between forward and deferred, whose G-buffer has eight bits per colour channel. Measured: 0.009.
const CLOSE: f32 = 0.015;

/// Textures and samplers of the ground: many GPUs have 16 of either for a whole pass, of which Bevy's views take up to 12.
const BINDINGS: (usize, usize) = (4, 2);

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    set_up(studio);
    album.compare("ways", &studio.picture());
    let camera = studio.camera;
    studio.app.world_mut().entity_mut(camera).insert((NormalPrepass, MotionVectorPrepass));
    album.compare("ways", &studio.picture());
    studio.app.world_mut().entity_mut(camera).remove::<(NormalPrepass, MotionVectorPrepass)>();
}

/// Counts what the ground binds.
pub fn count_bindings(studio: &mut Studio, album: &mut Album) {
    let device = studio.app.world().resource::<RenderDevice>();
    let entries = GroundMaterial::bind_group_layout_entries(device, true);
    let count = |is_one: fn(&BindingType) -> bool| entries.iter().filter(|entry| is_one(&entry.ty)).count();
    let found = (
        count(|binding| matches!(binding, BindingType::Texture { .. })),
        count(|binding| matches!(binding, BindingType::Sampler(_))),
    );
    album.check(found == BINDINGS, || format!("the ground binds textures and samplers: {found:?}"));
}

/// Takes the picture with a studio whose materials are all deferred.
pub fn shoot_deferred(studio: &mut Studio, album: &mut Album) {
    let camera = studio.camera;
    studio.app.world_mut().entity_mut(camera).insert((DepthPrepass, DeferredPrepass));
    set_up(studio);
    let picture = studio.picture();
    album.compare("deferred", &picture);
    let apart = album.golden("ways").map_or(1.0, |forward| flip(&forward, &picture).0);
    println!("deferred: FLIP {apart:.5} from forward");
    album
        .check(apart <= CLOSE.max(threshold()), || format!("deferred differs from forward: FLIP {apart:.5}"));
}

fn set_up(studio: &mut Studio) {
    studio.terrain(hills(64), GroundLook::default());
    let middle = Vec3::new(32.0, studio.height(32.0, 32.0), 32.0);
    studio.apply([Brush::dig(Shape::sphere(middle, 6.0))]);
    studio.look(middle + Vec3::new(14.0, 14.0, 20.0), middle);
}
