//! Ground that was cut off: it falls, lies about for a while, and crumbles to chips.

use bevy::prelude::*;
use bevy_burrow::physics::{Debris, DebrisCrumbled, DebrisPlugin};
use bevy_burrow::prelude::*;

use crate::world::particles::{Burst, Matter};

/// Pieces up to so many voxels vanish, others up to so many fall.
const CRUMBS: u32 = 6;
const DEBRIS: u32 = 3000;

/// Lets loose ground fall.
pub struct RubblePlugin;

impl Plugin for RubblePlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(DebrisPlugin).add_observer(look_for_pieces).add_observer(crumble);
    }
}

fn look_for_pieces(ready: On<TerrainReady>, mut commands: Commands) {
    commands.entity(ready.entity).try_insert(LooseGround { crumbs: CRUMBS, debris: DEBRIS, ..default() });
}

fn crumble(
    crumbled: On<DebrisCrumbled>,
    pieces: Query<(&Debris, &Transform)>,
    mut bursts: MessageWriter<Burst>,
) {
    let Ok((piece, transform)) = pieces.get(crumbled.entity) else { return };
    let burst = Burst {
        place: transform.translation,
        out: Vec3::Y,
        count: 18,
        speed: 2.5,
        matter: Matter::Chips(piece.material),
    };
    bursts.write(Burst { count: 4, speed: 1.0, matter: Matter::Dust(piece.material), ..burst.clone() });
    bursts.write(burst);
}
