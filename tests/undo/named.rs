//! Single cases: steps between brushes, steps without effect, cancelled steps, field ids.

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{FieldChange, OrderKind, Rejection};
use glam::{IVec3, Vec3};

fn ball(x: f32, y: f32, z: f32, radius: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, y, z), radius))
}

fn level() -> Terrain {
    Terrain::new(Ground::flat(64, 64, 10.0).expect("flat ground"), &TerrainSettings::default())
        .expect("valid settings")
}

#[test]
fn history_steps_keep_their_order_among_brushes() {
    let mut terrain = level();
    let pristine = terrain.world().hash();
    terrain.submit(Order::Undo);
    terrain.submit_all([ball(10.0, 10.0, 10.0, 3.0).with_tag(1), ball(12.0, 10.0, 10.0, 3.0).with_tag(2)]);
    terrain.submit(Order::Undo);
    terrain.submit(ball(40.0, 10.0, 40.0, 3.0).with_tag(3));
    terrain.submit(Order::Redo);
    terrain.submit(Order::Undo);
    terrain.submit(Order::Undo);
    terrain.submit(Order::Redo);
    let sent = [OrderKind::Undo, OrderKind::Undo, OrderKind::Redo, OrderKind::Undo, OrderKind::Undo];
    assert_eq!(terrain.queued(), 9);
    let own = terrain.apply([ball(40.0, 10.0, 10.0, 3.0).with_tag(4)]);
    assert_eq!(own.iter().map(|receipt| receipt.tag).collect::<Vec<_>>(), [4]);
    let (moves, edits): (Vec<Receipt>, Vec<Receipt>) =
        terrain.take_receipts().into_iter().partition(|receipt| receipt.kind.is_step());
    assert_eq!(edits.iter().map(|receipt| receipt.tag).collect::<Vec<_>>(), [1, 2, 3]);
    let is_done: Vec<bool> = moves.iter().map(|receipt| receipt.outcome.is_ok()).collect();
    // Nothing to undo yet; undo both balls; no redo after the third; undo the third; nothing to undo; redo the third.
    assert_eq!(is_done, [false, true, false, true, false, true]);
    assert_eq!(moves.iter().map(|receipt| receipt.kind).take(5).collect::<Vec<_>>(), sent);
    assert_eq!(terrain.history().undos, 2);
    terrain.undo();
    assert_ne!(terrain.world().hash(), pristine);
    terrain.undo();
    assert_eq!(terrain.world().hash(), pristine);
}

#[test]
fn edits_that_change_nothing_are_no_steps_and_leave_what_can_be_redone() {
    let mut terrain = level();
    terrain.apply([ball(10.0, 10.0, 10.0, 3.0)]);
    assert!(terrain.undo().outcome.is_ok());
    terrain.apply([ball(10.0, 40.0, 10.0, 3.0), ball(-90.0, 10.0, 10.0, 3.0)]);
    assert_eq!((terrain.history().undos, terrain.history().redos), (0, 1));
    terrain.apply([ball(50.0, 10.0, 10.0, 3.0)]);
    assert_eq!((terrain.history().undos, terrain.history().redos), (1, 0));
    assert_eq!(terrain.redo().outcome, Err(Rejection::NothingToRedo));
}

#[test]
fn a_cancelled_step_is_not_lost() {
    let mut terrain = level();
    let pristine = terrain.world().hash();
    terrain.apply([ball(10.0, 10.0, 10.0, 3.0)]);
    terrain.submit(Order::Undo);
    let lost = terrain.begin().expect("a queued step").run();
    assert!(!terrain.is_ready(LatticeBox::point(IVec3::new(10, 10, 10))));
    assert!(terrain.is_ready(LatticeBox::point(IVec3::new(50, 10, 50))));
    terrain.abandon();
    assert!(terrain.commit(lost).is_err());
    assert!(!terrain.is_ready(LatticeBox::point(IVec3::new(10, 10, 10))));
    let again = terrain.begin().expect("the step is queued again").run();
    // The budget is removed meanwhile; the step is taken all the same.
    terrain.set_undo_budget(0);
    let receipts = terrain.commit(again).expect("the step is still pending");
    assert_eq!(terrain.world().hash(), pristine);
    assert!(matches!(&receipts[..], [Receipt { kind: OrderKind::Undo, outcome: Ok(_), .. }]), "{receipts:?}");
    assert_eq!(terrain.history(), Default::default());
}

#[test]
fn restored_fields_keep_their_ids_and_new_fields_get_new_ids() {
    let mut terrain = level();
    let field = |terrain: &mut Terrain, brush: Brush| {
        terrain.apply([brush])[0].outcome.as_ref().expect("it reaches the world").chunks[0].field
    };
    let a = field(&mut terrain, ball(8.0, 10.0, 8.0, 2.0));
    let b = field(&mut terrain, ball(20.0, 10.0, 8.0, 2.0));
    let trench = Shape::capsule(Vec3::new(8.0, 10.0, 8.0), Vec3::new(20.0, 10.0, 8.0), 2.0);
    assert_eq!(field(&mut terrain, Brush::dig(trench)), a, "they merged");
    terrain.submit(Order::Undo);
    let commit = terrain.begin().expect("a queued step").run();
    let news = commit.field_news().to_vec();
    terrain.commit(commit).expect("no other commit");
    assert_eq!(
        news.iter().map(|news| news.1).collect::<Vec<_>>(),
        [FieldChange::Changed(a), FieldChange::Created(b)]
    );
    terrain.submit(Order::Redo);
    let commit = terrain.begin().expect("a queued step").run();
    let news: Vec<_> = commit.field_news().iter().map(|news| news.1).collect();
    assert_eq!(news, [FieldChange::Changed(a), FieldChange::Merged { gone: b, into: a }]);
    terrain.commit(commit).expect("no other commit");
    (0..3).for_each(|_| assert!(terrain.undo().outcome.is_ok()));
    let c = field(&mut terrain, ball(8.0, 10.0, 8.0, 2.0));
    assert!(c > b, "{c:?} was the id of another field");
}

#[test]
fn unread_answers_do_not_pile_up() {
    let mut terrain = level();
    for _ in 0..70_000 {
        terrain.submit(Order::Undo);
        assert!(terrain.begin().is_none(), "there is nothing to undo");
    }
    assert_eq!(terrain.take_receipts().len(), 1 << 16);
    assert!(terrain.take_receipts().is_empty());
}
