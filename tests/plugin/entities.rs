//! The entities below a terrain, and the events about them.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use bevy::prelude::*;
use bevy_burrow::plugin::{ChunkChanged, ChunkCreated, FieldChanged, FieldCreated, FieldMerged};
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level, random_brushes, steep};

/// An event, with the entity's component at that moment.
#[derive(Clone, Copy, Debug, PartialEq)]
enum TerrainEvent {
    ChunkCreated(Entity, Chunk),
    ChunkChanged(Entity, Chunk),
    FieldCreated(Entity, Field),
    FieldChanged(Entity, Field),
    FieldMerged { gone: Entity, into: Entity },
    FieldRemoved(Entity),
}

#[derive(Resource, Default)]
struct RecordedEvents(Vec<TerrainEvent>);

/// A stage that records all events. Each must name an existing entity with its component.
fn with_recorded_events(mut stage: Stage) -> Stage {
    stage
        .app
        .init_resource::<RecordedEvents>()
        .add_observer(|on: On<ChunkCreated>, chunks: Query<&Chunk>, mut events: ResMut<RecordedEvents>| {
            events.0.push(TerrainEvent::ChunkCreated(on.entity, *chunks.get(on.entity).expect("a chunk")));
        })
        .add_observer(|on: On<ChunkChanged>, chunks: Query<&Chunk>, mut events: ResMut<RecordedEvents>| {
            events.0.push(TerrainEvent::ChunkChanged(on.entity, *chunks.get(on.entity).expect("a chunk")));
        })
        .add_observer(|on: On<FieldCreated>, fields: Query<&Field>, mut events: ResMut<RecordedEvents>| {
            events.0.push(TerrainEvent::FieldCreated(on.entity, *fields.get(on.entity).expect("a field")));
        })
        .add_observer(|on: On<FieldChanged>, fields: Query<&Field>, mut events: ResMut<RecordedEvents>| {
            events.0.push(TerrainEvent::FieldChanged(on.entity, *fields.get(on.entity).expect("a field")));
        })
        .add_observer(|on: On<FieldMerged>, fields: Query<&Field>, mut events: ResMut<RecordedEvents>| {
            assert!(
                fields.contains(on.entity) && fields.contains(on.into),
                "both fields exist when the merge is reported"
            );
            events.0.push(TerrainEvent::FieldMerged { gone: on.entity, into: on.into });
        })
        .add_observer(|on: On<Remove, Field>, mut events: ResMut<RecordedEvents>| {
            events.0.push(TerrainEvent::FieldRemoved(on.entity))
        });
    stage
}

fn take_events(stage: &mut Stage) -> Vec<TerrainEvent> {
    std::mem::take(&mut stage.app.world_mut().resource_mut::<RecordedEvents>().0)
}

/// Fields by id, with their entities and the chunks above them.
fn fields(stage: &mut Stage) -> BTreeMap<u64, (Entity, Field, Chunk)> {
    let world = stage.app.world_mut();
    let mut fields = world.query::<(Entity, &Field, &ChildOf)>();
    let mut chunks = world.query::<(&Chunk, &ChildOf)>();
    let below = |(entity, field, parent): (Entity, &Field, &ChildOf)| {
        let (chunk, above) = chunks.get(world, parent.parent()).expect("a field lies below its chunk");
        assert!(world.entity(above.parent()).contains::<Terrain>(), "a chunk lies below its terrain");
        (field.id, (entity, *field, *chunk))
    };
    fields.iter(world).map(below).collect()
}

/// Checks that entities match the model: tiles, chunks and fields, with their hierarchy and positions.
pub fn assert_entities(stage: &mut Stage, terrain: Entity) {
    let shown = fields(stage);
    let world = stage.terrain(terrain).world();
    let mut expected = BTreeMap::new();
    for (chunk, in_chunk) in world.fields() {
        for field in in_chunk.iter() {
            expected.insert(field.id.0, (Field::from(field), Chunk::from(chunk)));
        }
    }
    let shown: BTreeMap<_, _> =
        shown.into_iter().map(|(id, (_, field, chunk))| (id, (field, chunk))).collect();
    assert_eq!(shown, expected);

    let size = world.grid().size();
    let drawn: BTreeSet<_> = world.drawn_chunks().map(|chunk| (chunk.x, chunk.y, chunk.z)).collect();
    let with_fields: BTreeSet<_> = world.fields().map(|(chunk, _)| (chunk.x, chunk.y, chunk.z)).collect();
    let world = stage.app.world_mut();
    let mut chunks = world.query::<(&Chunk, &Transform, &ChildOf, Has<Mesh3d>)>();
    let (mut seen, mut meshed) = (BTreeSet::new(), BTreeSet::new());
    for (chunk, place, parent, has_mesh) in chunks.iter(world) {
        let key = (chunk.x, chunk.y, chunk.z);
        assert!(seen.insert(key), "one entity a chunk");
        assert_eq!(place.translation, (IVec3::new(chunk.x, chunk.y, chunk.z) * size).as_vec3());
        assert_eq!(parent.parent(), terrain);
        meshed.extend(has_mesh.then_some(key));
    }
    assert_eq!(meshed, drawn, "chunks with a mesh are those that draw something");
    assert!(seen.is_superset(&with_fields) && seen.is_superset(&drawn));
    let mut tiles = world.query::<(&Tile, &Transform, &ChildOf)>();
    for (tile, place, parent) in tiles.iter(world) {
        assert_eq!(place.translation, (IVec3::new(tile.x, 0, tile.z) * size).as_vec3());
        assert_eq!(parent.parent(), terrain);
    }
    assert_eq!(tiles.iter(world).count(), 16);
}

#[test]
fn entities_are_those_of_the_model_after_every_commit() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(steep());
    assert_entities(&mut stage, terrain);
    for burst in random_brushes(21, 160).chunks(4) {
        burst.iter().for_each(|brush| stage.send(brush.clone()));
        stage.frame();
        assert_entities(&mut stage, terrain);
    }
    stage.settle();
    assert_entities(&mut stage, terrain);
}

#[test]
fn events_report_every_change_of_chunks_and_fields() {
    let mut stage = with_recorded_events(Stage::drawing());
    let terrain = stage.show(steep());
    assert_eq!(take_events(&mut stage), []);
    let (mut kinds, mut before) = ([0; 6], BTreeMap::new());
    let mut chunks: HashMap<Entity, Chunk> = HashMap::new();
    for burst in random_brushes(22, 200).chunks(3) {
        burst.iter().for_each(|brush| stage.send(brush.clone()));
        stage.settle();
        let after = fields(&mut stage);
        let mut rest = before.clone();
        for event in take_events(&mut stage) {
            match event {
                TerrainEvent::ChunkCreated(entity, chunk) => {
                    kinds[0] += 1;
                    assert_eq!(chunks.insert(entity, chunk), None, "a chunk is created once");
                }
                TerrainEvent::ChunkChanged(entity, chunk) => {
                    kinds[1] += 1;
                    assert_eq!(chunks.get(&entity), Some(&chunk), "only what was created changes");
                }
                TerrainEvent::FieldCreated(entity, field) => {
                    kinds[2] += 1;
                    assert!(!before.contains_key(&field.id));
                    let (now, component, _) = after[&field.id];
                    assert_eq!((now, component), (entity, field));
                    rest.insert(field.id, after[&field.id]);
                }
                TerrainEvent::FieldChanged(entity, field) => {
                    kinds[3] += 1;
                    let (now, component, _) = after[&field.id];
                    assert_eq!((now, component), (entity, field));
                    assert_ne!(before[&field.id].1, field, "it did change");
                    rest.insert(field.id, after[&field.id]);
                }
                TerrainEvent::FieldMerged { gone, into } => {
                    kinds[4] += 1;
                    let (_, (_, old, chunk)) =
                        before.iter().find(|(_, field)| field.0 == gone).expect("it was there");
                    let survivor = rest
                        .values()
                        .find(|field| field.0 == into)
                        .expect("the field that it merged into exists");
                    assert_eq!(survivor.2, *chunk, "a field never leaves its chunk");
                    rest.remove(&old.id);
                    assert!(stage.app.world().get_entity(gone).is_err(), "its entity is despawned");
                }
                TerrainEvent::FieldRemoved(entity) => {
                    kinds[5] += 1;
                    assert!(before.values().any(|field| field.0 == entity));
                }
            }
        }
        assert_eq!(rest, after, "every difference was reported");
        before = after;
    }
    assert!(kinds.iter().all(|&count| count > 5), "every kind of event came: {kinds:?}");
    assert_eq!(kinds[4], kinds[5], "fields are only removed by merging");
    assert_eq!(chunks.len(), stage.count::<Chunk>());
    assert_entities(&mut stage, terrain);
}

#[test]
fn two_pits_that_meet_become_one_field() {
    for mut stage in [with_recorded_events(Stage::drawing()), with_recorded_events(Stage::server())] {
        let mut model = level(1.0);
        let receipts = model.apply([dig(24.0, 8.0, 21.0, 1.0), dig(24.0, 8.0, 27.0, 1.0)]);
        assert!(
            receipts
                .iter()
                .all(|receipt| receipt.outcome.as_ref().is_ok_and(|applied| applied.chunks.len() == 1))
        );

        let terrain = stage.show(level(1.0));
        stage.send(dig(24.0, 8.0, 21.0, 1.0));
        stage.settle();
        stage.send(dig(24.0, 8.0, 27.0, 1.0));
        stage.settle();
        assert_eq!((stage.count::<Chunk>(), stage.count::<Field>()), (1, 2));
        let pits: Vec<Entity> = fields(&mut stage).values().map(|field| field.0).collect();
        take_events(&mut stage);
        stage.send(dig(24.0, 8.0, 24.0, 2.0));
        stage.settle();
        let events = take_events(&mut stage);
        assert!(events.contains(&TerrainEvent::FieldMerged { gone: pits[1], into: pits[0] }), "{events:?}");
        assert!(events.contains(&TerrainEvent::FieldRemoved(pits[1])), "{events:?}");
        assert_eq!(stage.with_component::<Field>(), [pits[0]], "the older field survives");
        let Ok(applied) = &stage.receipts()[2].receipt.outcome else { panic!("refused") };
        assert_eq!(applied.chunks[0].scenario, Scenario::Merged { fields: 2 });
        let (_, in_chunk) = stage.terrain(terrain).world().fields().next().expect("a chunk with fields");
        assert_eq!(
            in_chunk.iter().map(|field| field.id.0).collect::<Vec<_>>(),
            fields(&mut stage).into_keys().collect::<Vec<_>>()
        );
    }
}

#[test]
fn a_terrain_spawned_with_edits_reports_its_chunks_and_fields() {
    let mut model = steep();
    model.apply(random_brushes(23, 30));
    let mut stage = with_recorded_events(Stage::drawing());
    let terrain = stage.show(model);
    assert_entities(&mut stage, terrain);
    let events = take_events(&mut stage);
    let count = |is: fn(&TerrainEvent) -> bool| events.iter().filter(|event| is(event)).count();
    assert_eq!(count(|event| matches!(event, TerrainEvent::ChunkCreated(..))), stage.count::<Chunk>());
    assert_eq!(count(|event| matches!(event, TerrainEvent::FieldCreated(..))), stage.count::<Field>());
    assert_eq!(events.len(), stage.count::<Chunk>() + stage.count::<Field>());
    stage.send(dig(30.0, 4.0, 30.0, 6.0));
    stage.settle();
    assert_entities(&mut stage, terrain);
}

/// How many events an observer saw.
#[derive(Resource, Default)]
struct Seen(usize);

#[test]
fn a_chunk_has_its_new_mesh_when_its_event_is_triggered() {
    let mut stage = Stage::drawing();
    let see = |entity: Entity, drawn: &Query<&Mesh3d>, meshes: &Assets<Mesh>, seen: &mut Seen| {
        let mesh = drawn.get(entity).ok().and_then(|mesh| meshes.get(&mesh.0));
        assert!(mesh.is_some(), "a collider builder finds no mesh");
        seen.0 += 1;
    };
    stage.app.init_resource::<Seen>();
    stage.app.add_observer(
        move |on: On<ChunkCreated>,
              drawn: Query<&Mesh3d>,
              meshes: Res<Assets<Mesh>>,
              mut seen: ResMut<Seen>| {
            see(on.entity, &drawn, &meshes, &mut seen);
        },
    );
    stage.app.add_observer(
        move |on: On<ChunkChanged>,
              drawn: Query<&Mesh3d>,
              meshes: Res<Assets<Mesh>>,
              mut seen: ResMut<Seen>| {
            see(on.entity, &drawn, &meshes, &mut seen);
        },
    );
    stage.show(level(1.0));
    stage.send(dig(24.0, 8.0, 24.0, 3.0));
    stage.settle();
    stage.send(dig(25.0, 8.0, 24.0, 3.0));
    stage.settle();
    assert_eq!(stage.app.world().resource::<Seen>().0, 2);
}

#[test]
fn a_chunk_that_becomes_empty_keeps_its_entity_without_a_mesh() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(level(1.0));
    // This chunk contains only a rock in the air.
    stage.send(Brush::add(Shape::sphere(Vec3::new(24.0, 40.0, 24.0), 3.0), MaterialId(5)));
    stage.settle();
    let rock = stage.with_component::<Chunk>();
    assert!(rock.len() == 1 && stage.app.world().entity(rock[0]).contains::<Mesh3d>());
    let meshes = stage.meshes();
    stage.send(dig(24.0, 40.0, 24.0, 5.0));
    stage.settle();
    stage.frame();
    assert_eq!(stage.with_component::<Chunk>(), rock);
    assert!(!stage.app.world().entity(rock[0]).contains::<Mesh3d>());
    assert_eq!(stage.meshes(), meshes - 1, "its mesh is dropped");
    stage.send(Brush::add(Shape::sphere(Vec3::new(24.0, 40.0, 24.0), 3.0), MaterialId(5)));
    stage.settle();
    assert!(stage.app.world().entity(rock[0]).contains::<Mesh3d>());
    stage.assert_whole(terrain, "the rock is back");
}

#[test]
fn the_terrain_of_a_piece_is_mapped_with_other_entities() {
    let mut world = World::new();
    let (here, there) = (world.spawn_empty().id(), world.spawn_empty().id());
    let mut piece = GroundPiece { terrain: here, origin: IVec3::ZERO };
    <GroundPiece as Component>::map_entities(&mut piece, &mut (here, there));
    assert_eq!(piece.terrain, there);
}
