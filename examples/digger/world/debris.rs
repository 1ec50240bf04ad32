//! Ground that was cut off: it falls, lies about for a while, and crumbles.

use bevy::prelude::*;
use bevy_burrow::physics::{Debris, DebrisCrumbled, DebrisPlugin};
use bevy_burrow::prelude::*;

use crate::world::particles::{Burst, ParticleKind};

/// Pieces of up to this many voxels vanish at once.
const CRUMBS: u32 = 6;
/// Larger pieces of up to this many voxels fall.
const DEBRIS: u32 = 3000;

/// Lets loose ground fall, with particles where it crumbles.
pub struct DebrisEffectsPlugin;

impl Plugin for DebrisEffectsPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(DebrisPlugin).add_observer(enable_loose_ground).add_observer(crumble);
    }
}

fn enable_loose_ground(ready: On<TerrainReady>, mut commands: Commands) {
    commands.entity(ready.entity).try_insert(LooseSettings { crumbs: CRUMBS, debris: DEBRIS, ..default() });
}

fn crumble(
    crumbled: On<DebrisCrumbled>,
    pieces: Query<(&Debris, &Transform)>,
    mut bursts: MessageWriter<Burst>,
) {
    let Ok((piece, transform)) = pieces.get(crumbled.entity) else { return };
    let burst = |count: usize, speed: f32, kind: ParticleKind| Burst {
        place: transform.translation,
        direction: Vec3::Y,
        count,
        speed,
        kind,
    };
    bursts.write(burst(18, 2.5, ParticleKind::Chips(piece.material)));
    bursts.write(burst(4, 1.0, ParticleKind::Dust(piece.material)));
}
