//! Brush messages on their way into the queues of terrains.

use bevy::prelude::*;

use super::{BrushApplied, TargetedBrush};
use crate::brush::Brush;
use crate::terrain::{Receipt, Rejection, Terrain};

/// Moves brushes into their terrains' space and queues them. A brush that no terrain can take is answered at once.
pub(super) fn collect_brushes(
    mut brushes: MessageReader<Brush>,
    mut targeted: MessageReader<TargetedBrush>,
    mut terrains: Query<(Entity, &mut Terrain, &GlobalTransform)>,
    mut receipts: MessageWriter<BrushApplied>,
) {
    let mut reject = |brush: &Brush, terrain, rejection| {
        receipts.write(BrushApplied { terrain, receipt: Receipt { tag: brush.tag, outcome: Err(rejection) } });
    };
    for brush in brushes.read() {
        let mut taken = false;
        let mut rejection = Rejection::OutsideWorld;
        for (_, mut terrain, place) in &mut terrains {
            let local = to_terrain(brush, place);
            match terrain.is_in_reach(&local) {
                Ok(true) => {
                    terrain.submit(&local);
                    taken = true;
                }
                Ok(false) => {}
                Err(error) => rejection = error.into(),
            }
        }
        if !taken {
            reject(brush, None, rejection);
        }
    }
    for TargetedBrush { terrain, brush } in targeted.read() {
        match terrains.get_mut(*terrain) {
            Ok((_, mut terrain, place)) => terrain.submit(&to_terrain(brush, place)),
            Err(_) => reject(brush, Some(*terrain), Rejection::OutsideWorld),
        }
    }
}

/// A brush in world space as its terrain sees it, in voxels.
fn to_terrain(brush: &Brush, place: &GlobalTransform) -> Brush {
    let (scale, rotation, translation) = place.to_scale_rotation_translation();
    let (rotation, scale) = (rotation.inverse(), scale.x.recip());
    brush.transformed(rotation, rotation * -translation * scale, scale)
}
