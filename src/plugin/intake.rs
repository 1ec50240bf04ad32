//! Brush messages on their way into the queues of terrains.

use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::{BrushApplied, BurrowFigures, TargetedBrush};
use crate::brush::Brush;
use crate::terrain::{Receipt, Rejection, Terrain};

/// Moves brushes into their terrains' space and queues them. A brush that no terrain can take is answered at once.
pub(super) fn collect_brushes(
    mut brushes: MessageReader<Brush>,
    mut targeted: MessageReader<TargetedBrush>,
    mut terrains: Query<(Entity, &mut Terrain)>,
    places: TransformHelper,
    mut answers: MessageWriter<BrushApplied>,
    mut figures: ResMut<BurrowFigures>,
) {
    let start = Instant::now();
    for (entity, mut terrain) in &mut terrains {
        if terrain.has_answered() {
            let answered = terrain.take_answered().into_iter();
            answers.write_batch(answered.map(|receipt| BrushApplied { terrain: Some(entity), receipt }));
        }
    }
    let mut reject = |brush: &Brush, terrain, rejection| {
        answers.write(BrushApplied { terrain, receipt: Receipt { tag: brush.tag, outcome: Err(rejection) } });
    };
    for brush in brushes.read() {
        let mut taken = false;
        let mut rejection = Rejection::OutsideWorld;
        for (entity, mut terrain) in &mut terrains {
            let Ok(place) = places.compute_global_transform(entity) else { continue };
            let local = to_terrain(brush, &place);
            match terrain.offer(&local) {
                Ok(took) => taken |= took,
                Err(error) => rejection = error.into(),
            }
        }
        if !taken {
            reject(brush, None, rejection);
        }
    }
    for TargetedBrush { terrain, brush } in targeted.read() {
        match (terrains.get_mut(*terrain), places.compute_global_transform(*terrain)) {
            (Ok((_, mut terrain)), Ok(place)) => terrain.submit(&to_terrain(brush, &place)),
            _ => reject(brush, Some(*terrain), Rejection::TerrainGone),
        }
    }
    figures.main_thread = start.elapsed();
}

/// Brushes that a terrain had not come to when it goes, or another one takes its place.
pub(super) fn answer_with_terrain(
    gone: On<Discard, Terrain>,
    terrains: Query<&Terrain>,
    mut answers: MessageWriter<BrushApplied>,
) {
    let Ok(terrain) = terrains.get(gone.entity) else { return };
    let answer = |tag| BrushApplied {
        terrain: Some(gone.entity),
        receipt: Receipt { tag, outcome: Err(Rejection::TerrainGone) },
    };
    answers.write_batch(terrain.unanswered().map(answer));
}

/// A brush in world space as its terrain sees it, in voxels.
fn to_terrain(brush: &Brush, place: &GlobalTransform) -> Brush {
    let (scale, rotation, translation) = place.to_scale_rotation_translation();
    let (rotation, scale) = (rotation.inverse(), scale.x.recip());
    brush.transformed(rotation, rotation * -translation * scale, scale)
}
