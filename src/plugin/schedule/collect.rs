//! Queues the brushes, undos and redos that the game sends, and reports those that no transaction answers.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::system::SystemParam;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::inbox::Requests;
use crate::brush::{Brush, BrushError, Edit, reaches};
use crate::lattice::ChunkGrid;
use crate::plugin::entities::places::{Places, is_usable};
use crate::plugin::figures::MainThread;
use crate::plugin::reports::{Report, Reports};
use crate::plugin::{
    BrushApplied, BurrowFigures, EditOutbox, HistoryMoved, LoosePieceFound, LoosePieceReturned, Redo,
    TargetedBrush, Undo,
};
use crate::terrain::{
    LooseSettings, Order, OrderKind, Receipt, Rejection, Request, ReturnedPiece, Terrain, Together, unique,
};
use crate::threads::free_later;

/// Transforms brushes into the space of each terrain and queues them. A brush that a terrain cannot queue is rejected
/// at once, and so is a brush that reaches no terrain. Edits of a terrain with an [`EditOutbox`] are put there instead.
pub(in crate::plugin) fn collect_brushes(
    mut requests: Requests,
    mut terrains: Query<(Entity, &mut Terrain, Option<&LooseSettings>, Option<&mut EditOutbox>)>,
    places: Places,
    mut answers: MessageWriter<BrushApplied>,
    mut found: MessageWriter<LoosePieceFound>,
    mut figures: ResMut<BurrowFigures>,
    reports: Reports,
) {
    let start = Instant::now();
    let (brushes, targeted) = requests.take_brushes();
    for (entity, mut terrain, loose, _) in &mut terrains {
        let loose = loose.copied();
        if loose.is_some() && loose.as_ref() != terrain.loose() {
            terrain.set_loose(loose);
        }
        send_receipts((entity, terrain), &mut answers, &mut found);
    }
    let mut reject = |brush: &Brush, terrain, rejection| {
        answers.write(BrushApplied { terrain, receipt: Receipt::of_edit(brush.tag, Err(rejection)) });
    };
    // Brushes of one frame are undone together.
    let together = Together::Batch(unique());
    for brush in &brushes {
        // The rejection that is sent if no terrain answers.
        let mut unanswered = Some(Rejection::OutsideWorld);
        // Only terrains that queue a brush are borrowed mutably, so that others do not count as changed.
        for (entity, terrain, _, outbox) in &mut terrains {
            let Some(place) = places.of(entity).filter(is_usable) else { continue };
            match Effect::of(brush, &place, terrain.world().grid()) {
                Effect::Taken(edit) => {
                    let queued = queue_or_send(terrain, outbox, edit, together);
                    queued.unwrap_or_else(|rejection| reject(brush, Some(entity), rejection));
                    unanswered = None;
                }
                Effect::Refused(error) => {
                    warn_of_invalid(entity, &error, &reports);
                    reject(brush, Some(entity), error.into());
                    unanswered = None;
                }
                Effect::Beside => {}
                Effect::Nowhere(error) => unanswered = unanswered.map(|_| error.into()),
            }
        }
        if let Some(why) = unanswered {
            // Later ones may be intentional.
            if figures.brushes == 0
                && let Some((entity, terrain, ..)) = terrains.iter().next()
                && reports.is_new(entity, Report::BrushBeside)
            {
                warn_of_beside((entity, terrain), brush, places.of(entity));
            }
            reject(brush, None, why);
        }
    }
    for &TargetedBrush { terrain: entity, ref brush } in &targeted {
        let queued = match (terrains.get_mut(entity), places.of(entity).filter(is_usable)) {
            (Ok((_, terrain, _, outbox)), Some(place)) => {
                queue_targeted(brush, &place, (entity, terrain), outbox, together, &reports)
            }
            _ => Err(Rejection::TerrainGone),
        };
        queued.unwrap_or_else(|rejection| reject(brush, Some(entity), rejection));
    }
    figures.begin_frame(start.elapsed());
}

/// Sends the receipts of edits that no transaction of the plugin answers.
fn send_receipts(
    (entity, mut terrain): (Entity, Mut<Terrain>),
    answers: &mut MessageWriter<BrushApplied>,
    found: &mut MessageWriter<LoosePieceFound>,
) {
    if terrain.has_receipts(is_edit) {
        let answered = terrain.take_receipts_of(is_edit);
        found.write_batch(pieces(entity, &answered));
        let applied = |receipt| BrushApplied { terrain: Some(entity), receipt };
        answers.write_batch(answered.into_iter().map(applied));
    }
}

/// Puts an edit into the terrain's outbox, or queues it without one.
fn queue_or_send(
    mut terrain: Mut<Terrain>,
    outbox: Option<Mut<EditOutbox>>,
    edit: Edit,
    together: Together,
) -> Result<(), Rejection> {
    match outbox {
        Some(mut outbox) => {
            outbox.orders.push(Order::Edit(edit));
            Ok(())
        }
        None => queue(&mut terrain, edit.into(), together),
    }
}

/// Puts a brush that names its terrain into the terrain's outbox, or queues it without one.
fn queue_targeted(
    brush: &Brush,
    place: &GlobalTransform,
    (entity, mut terrain): (Entity, Mut<Terrain>),
    outbox: Option<Mut<EditOutbox>>,
    together: Together,
    reports: &Reports,
) -> Result<(), Rejection> {
    let edit = Edit::quantize(&to_terrain(brush, place));
    if let Err(error) = &edit {
        warn_of_invalid(entity, error, reports);
    }
    match (outbox, edit) {
        (Some(mut outbox), Ok(edit)) => {
            outbox.orders.push(Order::Edit(edit));
            Ok(())
        }
        (Some(_), Err(error)) => Err(error.into()),
        (None, edit) => queue(&mut terrain, Request::of_edit(brush, edit), together),
    }
}

/// Queues an edit if there is room for it.
fn queue(terrain: &mut Terrain, request: Request, together: Together) -> Result<(), Rejection> {
    let work = terrain.admit(&request)?;
    terrain.queue_order(request, work, together)
}

/// Whether the plugin reports an order's receipt as [`BrushApplied`].
fn is_edit(kind: OrderKind) -> bool {
    kind == OrderKind::Edit
}

/// Logs the first brush that a terrain cannot apply. Receipts report all of them.
fn warn_of_invalid(terrain: Entity, error: &BrushError, reports: &Reports) {
    if reports.is_new(terrain, Report::BrushInvalid) {
        warn!(
            "a brush was rejected by the terrain {terrain}: {error}. Read `BrushApplied` to learn of others"
        );
    }
}

/// Logs that the first brushes reach no terrain.
fn warn_of_beside((entity, terrain): (Entity, &Terrain), brush: &Brush, place: Option<GlobalTransform>) {
    let [at, _] = brush.shape.extent().ends;
    let bounds = terrain.world().grid().edit_bounds();
    let corners = place.map(|place| [bounds.min, bounds.max].map(|at| place.transform_point(at.as_vec3())));
    let extent = corners.map_or_else(
        || "has no valid transform".to_owned(),
        |[min, max]| {
            let (low, high) = (min.min(max), min.max(max));
            format!(
                "reaches from {:.0} to {:.0} along x and from {:.0} to {:.0} along z",
                low.x, high.x, low.z, high.z
            )
        },
    );
    warn!(
        "a brush at {at} reaches no terrain: brushes are in world space and metres, and the terrain {entity} {extent}. Read \
         `BrushApplied` to learn of others"
    );
}

/// How a brush in world space affects a terrain.
enum Effect {
    /// An edit that reaches it.
    Taken(Edit),
    /// The brush reaches the terrain, but is not valid there.
    Refused(BrushError),
    /// The brush does not reach the terrain.
    Beside,
    /// The brush's position is not a number.
    Nowhere(BrushError),
}

impl Effect {
    fn of(brush: &Brush, place: &GlobalTransform, grid: ChunkGrid) -> Self {
        let local = to_terrain(brush, place);
        match Edit::quantize(&local) {
            Ok(edit) if edit.reach().intersection(grid.edit_bounds()).is_some() => Self::Taken(edit),
            Ok(_) => Self::Beside,
            Err(error) => match reaches(&local.shape, grid) {
                Some(true) => Self::Refused(error),
                Some(false) => Self::Beside,
                None => Self::Nowhere(error),
            },
        }
    }
}

/// Queues undo and redo behind the brushes of this frame. A step without any terrain is answered at once.
pub(in crate::plugin) fn collect_steps(
    mut requests: Requests,
    mut terrains: Query<(Entity, &mut Terrain, Option<&mut EditOutbox>)>,
    mut messages: HistoryMessages,
    mut found: MessageWriter<LoosePieceFound>,
    mut figures: ResMut<BurrowFigures>,
) {
    let start = Instant::now();
    let (undos, redos) = requests.take_steps();
    let undos = undos.into_iter().map(|Undo { terrain }| (Order::Undo, terrain));
    let redos = redos.into_iter().map(|Redo { terrain }| (Order::Redo, terrain));
    for (step, target) in undos.chain(redos) {
        let mut is_taken = false;
        let mut submit = |mut terrain: Mut<Terrain>, outbox: Option<Mut<EditOutbox>>| {
            is_taken = true;
            match outbox {
                Some(mut outbox) => outbox.orders.push(step.clone()),
                None => terrain.submit(&step),
            }
        };
        match target {
            Some(entity) => {
                terrains.get_mut(entity).into_iter().for_each(|(_, terrain, outbox)| submit(terrain, outbox));
            }
            None => terrains.iter_mut().for_each(|(_, terrain, outbox)| submit(terrain, outbox)),
        }
        if !is_taken {
            messages.moved.write(gone(target, step.kind()));
        }
    }
    // Results of steps that the queue had no room for, and of steps that the game took itself.
    for (entity, mut terrain, _) in &mut terrains {
        let receipts = send_history(entity, &mut terrain, &mut messages);
        found.write_batch(receipts.iter().flat_map(|receipt| pieces_again(entity, receipt)));
    }
    figures.measure(start.elapsed());
}

/// The pieces that the brushes of these receipts cut off.
pub(crate) fn pieces(terrain: Entity, receipts: &[Receipt]) -> impl Iterator<Item = LoosePieceFound> {
    receipts.iter().flat_map(move |receipt| {
        let pieces = receipt.outcome.iter().flat_map(|applied| &applied.loose);
        pieces.map(move |piece| LoosePieceFound {
            terrain,
            tag: receipt.tag,
            piece: piece.clone(),
            mesh: None,
        })
    })
}

/// The pieces that a redo cut off again.
pub(super) fn pieces_again(terrain: Entity, receipt: &Receipt) -> impl Iterator<Item = LoosePieceFound> {
    let pieces = receipt.outcome.iter().flat_map(|applied| &applied.cut_again);
    pieces.map(move |(tag, piece)| LoosePieceFound { terrain, tag: *tag, piece: piece.clone(), mesh: None })
}

/// Makes a terrain that gets [`LooseSettings`] search for pieces at once.
pub(in crate::plugin) fn enable_loose_search(
    new: On<Insert, (LooseSettings, Terrain)>,
    mut terrains: Query<(&mut Terrain, &LooseSettings), Allow<Disabled>>,
) {
    if let Ok((mut terrain, &loose)) = terrains.get_mut(new.entity) {
        terrain.set_loose(Some(loose));
    }
}

/// Makes a terrain that loses [`LooseSettings`] stop searching for pieces.
pub(in crate::plugin) fn disable_loose_search(
    gone: On<Remove, LooseSettings>,
    mut terrains: Query<&mut Terrain, Allow<Disabled>>,
) {
    if let Ok(mut terrain) = terrains.get_mut(gone.entity) {
        terrain.set_loose(None);
    }
}

/// The messages that report undo and redo steps.
#[derive(SystemParam)]
pub(in crate::plugin) struct HistoryMessages<'w> {
    pub moved: MessageWriter<'w, HistoryMoved>,
    returned: MessageWriter<'w, LoosePieceReturned>,
}

/// Sends the results of a terrain's undo and redo steps, and returns them.
pub(super) fn send_history(
    entity: Entity,
    terrain: &mut Mut<Terrain>,
    messages: &mut HistoryMessages,
) -> Vec<Receipt> {
    if !terrain.has_receipts(OrderKind::is_step) {
        return Vec::new();
    }
    let receipts = terrain.take_receipts_of(OrderKind::is_step);
    for receipt in &receipts {
        let returned = receipt.outcome.iter().flat_map(|applied| &applied.returned);
        let message = |piece: &ReturnedPiece| LoosePieceReturned { terrain: entity, piece: piece.clone() };
        messages.returned.write_batch(returned.map(message));
        messages.moved.write(HistoryMoved { terrain: Some(entity), receipt: receipt.clone() });
    }
    receipts
}

fn gone(terrain: Option<Entity>, step: OrderKind) -> HistoryMoved {
    HistoryMoved { terrain, receipt: Receipt::of(step, Err(Rejection::TerrainGone)) }
}

/// Answers brushes and steps that wait in a terrain that is removed or replaced, and clears its queue.
///
/// Its world may be large: a reference keeps it until the component is gone, so that it is freed on another thread.
pub(in crate::plugin) fn answer_removed(
    gone: On<Discard, Terrain>,
    mut commands: Commands,
    mut terrains: Query<&mut Terrain, Allow<Disabled>>,
    mut answers: MessageWriter<BrushApplied>,
    mut messages: HistoryMessages,
) {
    let Ok(mut terrain) = terrains.get_mut(gone.entity) else { return };
    let answered = terrain.take_receipts_of(is_edit).into_iter();
    answers.write_batch(answered.map(|receipt| BrushApplied { terrain: Some(gone.entity), receipt }));
    send_history(gone.entity, &mut terrain, &mut messages);
    for (kind, tag) in terrain.unanswered() {
        if is_edit(kind) {
            let receipt = Receipt::of_edit(tag, Err(Rejection::TerrainGone));
            answers.write(BrushApplied { terrain: Some(gone.entity), receipt });
        } else if kind.is_step() {
            messages.moved.write(self::gone(Some(gone.entity), kind));
        }
    }
    terrain.forget();
    let world = terrain.snapshot();
    commands.queue(move |_: &mut World| free_later(world));
}

/// Frees the history of a despawned terrain on another thread.
pub(in crate::plugin) fn free_history(
    gone: On<Despawn, Terrain>,
    mut terrains: Query<&mut Terrain, Allow<Disabled>>,
) {
    if let Ok(mut terrain) = terrains.get_mut(gone.entity) {
        free_later(terrain.rebudget_undo(0));
    }
}

/// How much equal scales along two axes may differ by rounding.
const EVEN: f32 = 1e-5;

/// Transforms a brush from world space into voxels of a terrain.
fn to_terrain(brush: &Brush, place: &GlobalTransform) -> Brush {
    let (scale, rotation, translation) = place.to_scale_rotation_translation();
    if (scale / scale.x).abs_diff_eq(Vec3::ONE, EVEN) {
        brush.placed_in(scale.x, rotation, translation)
    } else {
        brush.placed_in_stretched(place.affine().matrix3, rotation.normalize(), translation)
    }
}
