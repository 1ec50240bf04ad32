//! The air: Bevy's atmosphere, which colours the sky, the sun's light and all that is far away. Where the device can't
//! compute it, and in low quality, there is fog, and the sky's own colours are those of `day.rs`.

use bevy::light::{Atmosphere, SunDisk, atmosphere::ScatteringMedium};
use bevy::pbr::{AtmosphereSettings, ExtractedAtmosphere, GpuAtmosphereSettings};
use bevy::prelude::*;
use bevy::render::extract_component::DynamicUniformIndex;
use bevy::render::render_resource::{DownlevelFlags, TextureFormat, TextureUsages};
use bevy::render::renderer::{RenderAdapter, RenderDevice};
use bevy::render::{ExtractSchedule, RenderApp};

use crate::player::camera::PlayerCamera;
use crate::world::light::Sun;

/// Spawns the atmosphere; cameras choose it by their settings.
pub struct AirPlugin;

impl Plugin for AirPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Air>()
            .add_systems(Startup, spawn_air)
            .add_systems(PostStartup, hide_sun_disk)
            .add_systems(PreUpdate, notice_air);
        if let Some(render) = app.get_sub_app_mut(RenderApp) {
            render.add_systems(ExtractSchedule, forget_air);
        }
    }
}

/// Bevy 0.19 continues to draw the sky of a camera that has lost its [`AtmosphereSettings`], with a pipeline for HDR.
fn forget_air(
    mut commands: Commands,
    stale: Query<Entity, (With<ExtractedAtmosphere>, Without<GpuAtmosphereSettings>)>,
) {
    for camera in &stale {
        commands.entity(camera).remove::<(ExtractedAtmosphere, DynamicUniformIndex<GpuAtmosphereSettings>)>();
    }
}

/// What the player's camera shows.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Air {
    /// Fog and a painted sky.
    #[default]
    Fog,
    /// Bevy's atmosphere.
    Atmosphere,
}

fn spawn_air(mut commands: Commands, mediums: Option<ResMut<Assets<ScatteringMedium>>>) {
    if let Some(mut mediums) = mediums {
        let medium = mediums.add(ScatteringMedium::earth(256, 256));
        commands.spawn((Name::new("air"), Atmosphere::earth(medium)));
    }
}

/// The sky draws the disc of the sun, which is larger than the real one.
fn hide_sun_disk(mut commands: Commands, sun: Query<Entity, With<Sun>>) {
    for sun in &sun {
        commands.entity(sun).insert(SunDisk::OFF);
    }
}

fn notice_air(cameras: Query<Has<AtmosphereSettings>, With<PlayerCamera>>, mut air: ResMut<Air>) {
    let is_there = cameras.iter().any(|has| has);
    air.set_if_neq(if is_there { Air::Atmosphere } else { Air::Fog });
}

/// Whether the device can compute an atmosphere. If not, Bevy leaves out the plugin for it.
pub fn is_possible(adapter: Option<&RenderAdapter>, device: Option<&RenderDevice>) -> bool {
    let Some((adapter, device)) = adapter.zip(device) else { return false };
    let flags = adapter.get_downlevel_capabilities().flags;
    let usages = adapter.get_texture_format_features(TextureFormat::Rgba16Float).allowed_usages;
    flags.contains(DownlevelFlags::COMPUTE_SHADERS)
        && usages.contains(TextureUsages::STORAGE_BINDING)
        && device.limits().max_storage_textures_per_shader_stage > 0
}
