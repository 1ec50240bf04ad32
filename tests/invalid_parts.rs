//! Invalid parts of a world, for example from a damaged save: each is an error, changes nothing, and causes no panic.

use std::sync::Arc;

use bevy_burrow::lattice::{BrickPos, ChunkPos, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{PartsError, Patch, RestoreError, WorldParts};
use bevy_burrow::volume::{Brick, Field, FieldId, Fields};
use glam::{IVec3, Vec3};

fn terrain() -> Terrain {
    let ground = Ground::flat(64, 64, 10.0).expect("valid");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    terrain.apply([dig(20.0)]);
    terrain
}

fn dig(x: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, 10.0, 32.0), 4.0))
}

/// The result of a change; if it is refused, nothing has changed, and the terrain still works.
fn put(change: Patch) -> Result<(), Rejection> {
    let mut terrain = terrain();
    let (before, next) = (terrain.parts().change, terrain.world().hash());
    let outcome = terrain.apply_one(Order::parts(change, None)).outcome.map(drop);
    if outcome.is_err() {
        let after = terrain.parts().change;
        assert_eq!(terrain.world().hash(), next);
        assert_eq!((after.fields, after.next_field), (before.fields, before.next_field));
        assert!(terrain.undo().outcome.is_ok(), "history is as it was");
    }
    assert!(terrain.apply([dig(44.0)])[0].outcome.is_ok(), "it can be dug on");
    outcome
}

fn bricks(list: impl IntoIterator<Item = (BrickPos, Option<Arc<Brick>>)>) -> Patch {
    Patch { bricks: list.into_iter().collect(), ..Patch::default() }
}

fn fields(list: impl IntoIterator<Item = (ChunkPos, Vec<Field>)>) -> Patch {
    let restored = |(chunk, fields)| (chunk, Fields::restored(fields).expect("valid fields"));
    Patch { fields: list.into_iter().map(restored).collect(), ..Patch::default() }
}

fn field(id: u64, low: i32, high: i32) -> Field {
    let bounds = LatticeBox { min: IVec3::splat(low), max: IVec3::splat(high) };
    Field { id: FieldId(id), bounds, revision: 0 }
}

/// The chunk (x, 0, 0).
fn chunk(x: i32) -> ChunkPos {
    ChunkPos { x, y: 0, z: 0 }
}

#[test]
fn bricks_lie_in_the_world_whatever_their_numbers() {
    let parts = terrain().parts();
    let (pos, brick) = parts.change.bricks[0].clone();
    let numbers = [i32::MIN, i32::MIN / 8, -1, 9, i32::MAX / 8, i32::MAX];
    for axis in [IVec3::X, IVec3::Y, IVec3::Z] {
        // The last ones are those whose samples seem to lie in the world, since 32 bits do not hold their coordinates.
        for at in numbers.into_iter().chain([1, 3, -1].map(|turn| pos.0.dot(axis) + (turn << 29))) {
            let wrong = BrickPos(pos.0 * (IVec3::ONE - axis) + axis * at);
            for brick in [brick.clone(), None] {
                if axis == IVec3::Y && at.unsigned_abs() < 100 {
                    continue;
                }
                assert_eq!(put(bricks([(wrong, brick)])), Err(PartsError::OutsideWorld(wrong).into()));
            }
        }
    }
}

#[test]
fn a_brick_of_any_position_can_be_made() {
    let ground = Ground::flat(64, 64, 10.0).expect("valid");
    let numbers = [i32::MIN, -1, 0, 7, i32::MAX / 8, i32::MAX];
    for (x, y, z) in numbers.into_iter().flat_map(|x| numbers.map(|y| (x, y, x ^ y))) {
        let pos = BrickPos(IVec3::new(x, y, z));
        assert!(Brick::restored(&ground, pos, &[1; 8], &[-5; 8], None).is_some());
        let _ = ground.region_hash((x, z));
    }
}

#[test]
fn fields_are_those_of_one_chunk_with_names_of_their_own() {
    let beyond = fields([(chunk(0), vec![field(7, 0, 40)])]);
    assert_eq!(put(beyond), Err(PartsError::Fields(chunk(0)).into()));
    let twice = fields([(chunk(0), vec![field(7, 1, 4)]), (chunk(0), vec![field(8, 5, 6)])]);
    assert_eq!(put(twice), Err(PartsError::Fields(chunk(0)).into()));
    let namesakes =
        fields([(chunk(0), vec![field(7, 1, 4)]), (ChunkPos { y: 1, ..chunk(0) }, vec![field(7, 33, 34)])]);
    assert!(matches!(put(namesakes), Err(Rejection::Parts(PartsError::Fields(_)))));
}

#[test]
fn a_new_field_never_gets_the_name_of_another() {
    let mut terrain = terrain();
    let chunk = ChunkPos { x: 1, y: 0, z: 1 };
    // The name that comes next.
    let next = terrain.parts().change.next_field + 1;
    let bounds = LatticeBox { min: IVec3::new(33, 1, 33), max: IVec3::new(34, 2, 34) };
    let own = Field { bounds, ..field(next, 0, 0) };
    terrain.apply_one(Order::parts(fields([(chunk, vec![own])]), None)).outcome.expect("a valid field");
    terrain.apply([Brush::dig(Shape::sphere(Vec3::new(56.0, 10.0, 56.0), 3.0))]);
    let names: Vec<u64> = terrain.world().fields_of(chunk).expect("two").iter().map(|own| own.id.0).collect();
    assert_eq!(names, [next, next + 1]);
}

#[test]
fn numbers_that_count_can_always_go_on() {
    for greatest in [u64::MAX, u64::MAX / 2 + 1] {
        let name = Patch { next_field: greatest, ..Patch::default() };
        assert_eq!(put(name), Err(PartsError::Number(greatest).into()));
        let name = fields([(chunk(0), vec![field(greatest, 1, 4)])]);
        assert_eq!(put(name), Err(PartsError::Number(greatest).into()));
        for chunk_size in [16, 32] {
            let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
            let ground = || Ground::flat(64, 64, 10.0).expect("valid");
            let parts = WorldParts { revision: greatest, ..terrain().parts() };
            let refused = Terrain::restore(ground(), &settings, parts).err();
            assert_eq!(refused, Some(RestoreError::Parts(PartsError::Number(greatest))));
            let mut parts = terrain().parts();
            parts.change.next_field = greatest;
            assert!(matches!(
                Terrain::restore(ground(), &settings, parts),
                Err(RestoreError::Parts(PartsError::Number(_)))
            ));
        }
    }
    let busy = Field { revision: u64::MAX, ..field(1, 1, 4) };
    assert_eq!(put(fields([(chunk(0), vec![busy])])), Ok(()));
    let mut terrain = terrain();
    let (of, all) = terrain.parts().change.fields[0].clone();
    let busy: Vec<Field> = all.iter().map(|field| Field { revision: u64::MAX, ..*field }).collect();
    terrain.apply_one(Order::parts(fields([(of, busy)]), None)).outcome.expect("valid fields");
    for x in [20.0, 24.0] {
        assert!(terrain.apply([dig(x)])[0].outcome.is_ok());
    }
}

#[test]
fn fields_that_are_put_alone_clear_history_too() {
    let mut terrain = terrain();
    let (of, all) = terrain.parts().change.fields[0].clone();
    let renamed: Vec<Field> = all.iter().map(|own| Field { id: FieldId(own.id.0 + 9), ..*own }).collect();
    terrain.apply_one(Order::parts(fields([(of, renamed)]), None)).outcome.expect("valid fields");
    assert_eq!(terrain.history(), History::default());
}

#[test]
fn counts_of_a_piece_can_be_added_whatever_they_are() {
    let counts: bevy_burrow::volume::MaterialCounts =
        serde_json::from_str("[[1,18446744073709551615],[2,7],[1,9],[3,0]]").expect("numbers");
    assert_eq!(counts.total(), u64::MAX);
    let mut twice = counts.clone();
    twice.add(&counts);
    assert_eq!((twice.of(MaterialId(1)), twice.total()), (u64::MAX, u64::MAX));
    assert_eq!(counts.iter().count(), 1);
}
