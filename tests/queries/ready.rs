//! `is_ready` is false where an edit is pending.

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use glam::{IVec3, Vec3};

use crate::inputs::small_terrain;

#[test]
fn a_place_is_ready_unless_an_edit_is_pending_there() {
    let mut terrain = small_terrain();
    let around = |x: i32, y: i32, z: i32, by: i32| LatticeBox::point(IVec3::new(x, y, z)).grown(by);
    let (here, there) = (around(10, 10, 10, 3), around(35, 10, 25, 3));
    let dig = Brush::dig(Shape::sphere(Vec3::new(10.0, 10.0, 10.0), 2.0));
    assert!(terrain.is_ready(here) && terrain.is_ready(there));

    // Queued.
    terrain.submit(&dig);
    assert!(!terrain.is_ready(here) && terrain.is_ready(there));
    // The edit reaches 4 voxels: its radius and two more.
    assert!(!terrain.is_ready(around(14, 10, 10, 0)) && terrain.is_ready(around(15, 10, 10, 0)));
    assert!(!terrain.is_ready(around(15, 10, 10, 1)));

    // It runs, with another one queued elsewhere.
    let transaction = terrain.begin().expect("a queued edit");
    assert!(!terrain.is_ready(here) && terrain.is_ready(there));
    terrain.submit(Brush::dig(Shape::sphere(Vec3::new(35.0, 10.0, 25.0), 2.0)));
    assert!(!terrain.is_ready(here) && !terrain.is_ready(there));
    let commit = transaction.run();
    assert!(!terrain.is_ready(here), "computed, but not committed");
    terrain.commit(commit).expect("no other commit");
    assert!(terrain.is_ready(here) && !terrain.is_ready(there));

    // It is cancelled, and so queued again.
    let lost = terrain.begin().expect("a queued edit");
    drop(lost);
    terrain.abandon();
    assert!(terrain.is_ready(here) && !terrain.is_ready(there));
    terrain.apply(std::iter::empty::<Brush>());
    assert!(terrain.is_ready(here) && terrain.is_ready(there));

    // A brush that will be rejected does not count as an edit.
    terrain.submit(Brush::dig(Shape::sphere(Vec3::new(10.0, f32::NAN, 10.0), 2.0)));
    assert!(terrain.is_ready(here));
}
