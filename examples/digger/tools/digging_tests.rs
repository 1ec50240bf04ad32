//! Facts about tools at work.

use super::*;
use crate::world::landscape::{CONCRETE, ROCK};
use bevy_burrow::brush::shapes::Sphere;

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, WorkPlugin))
        .insert_resource(Hand::new(&Settings::default()))
        .init_resource::<Settings>()
        .init_resource::<Inventory>()
        .init_resource::<Tremor>()
        .add_message::<Brush>()
        .add_message::<BrushApplied>()
        .add_message::<Hint>()
        .add_message::<Burst>();
    app
}

fn strike(app: &mut App, tool: Tool) -> Vec<Brush> {
    let aim = Aim { place: Vec3::new(10.0, 20.0, 10.0), along: Vec3::NEG_Y, normal: Vec3::Y };
    app.world_mut().trigger(Strike { tool, aim: Some(aim), eye: aim.place + Vec3::Y, along: aim.along });
    app.world_mut().resource_mut::<Messages<Brush>>().drain().collect()
}

fn hints(app: &mut App) -> usize {
    app.world_mut().resource_mut::<Messages<Hint>>().drain().count()
}

fn choose(app: &mut App, material: MaterialId) {
    app.world_mut().resource_mut::<Hand>().material = material;
}

#[test]
fn nothing_is_built_of_nothing() {
    let mut app = app();
    choose(&mut app, ROCK);
    assert_eq!(strike(&mut app, Tool::Builder), []);
    assert_eq!(hints(&mut app), 1);
    app.world_mut().resource_mut::<Settings>().survival = false;
    assert_eq!(strike(&mut app, Tool::Builder).len(), 1);
}

#[test]
fn what_is_built_or_painted_is_as_large_as_the_stock_allows_and_is_pledged() {
    for tool in [Tool::Builder, Tool::Painter] {
        let mut app = app();
        choose(&mut app, CONCRETE);
        app.world_mut().resource_mut::<Hand>().set_radius(tool, 12.0);
        let mut free = app.world().resource::<Inventory>().free(CONCRETE);
        let mut radii = Vec::new();
        // All of it is on its way in the end, so there is none for another one.
        while let [Brush { shape: shape @ Shape::Sphere(Sphere { radius, .. }), .. }] =
            strike(&mut app, tool)[..]
        {
            free -= voxel_cost::voxels(&shape);
            assert_eq!(app.world().resource::<Inventory>().free(CONCRETE), free);
            radii.push(radius);
        }
        assert!((0..60).contains(&free) && radii[0] > 4.0, "{free}: {radii:?}");
        assert_eq!(hints(&mut app), 1);
    }
}

#[test]
fn nothing_is_painted_with_nothing() {
    let mut app = app();
    choose(&mut app, ROCK);
    assert_eq!(strike(&mut app, Tool::Painter), []);
    assert_eq!(hints(&mut app), 1);
    app.world_mut().resource_mut::<Settings>().survival = false;
    assert_eq!(strike(&mut app, Tool::Painter).len(), 1);
}

#[test]
fn every_tool_sends_its_own_brush_or_none() {
    let mut app = app();
    choose(&mut app, CONCRETE);
    let mut tags = Vec::new();
    for (tool, brushes) in [
        (Tool::Pickaxe, 1),
        (Tool::Shovel, 1),
        (Tool::Drill, 1),
        (Tool::Builder, 1),
        (Tool::Painter, 1),
        (Tool::Bomb, 0),
        (Tool::Lamp, 0),
        (Tool::Ball, 0),
    ] {
        let sent = strike(&mut app, tool);
        assert_eq!(sent.len(), brushes, "{tool:?}");
        tags.extend(sent.iter().map(|brush| brush.tag));
    }
    let count = tags.len();
    tags.sort_unstable();
    tags.dedup();
    assert_eq!(tags.len(), count);
}

#[test]
fn what_was_broken_flies_off_as_chips_of_its_material() {
    let mut app = app();
    let tag = strike(&mut app, Tool::Pickaxe)[0].tag;
    let ground = Ground::from_fn(64, 64, |_, _| 20.0).expect("a small world");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
    let receipts = terrain.apply([Brush::dig(Shape::sphere(Vec3::new(10.0, 20.0, 10.0), 2.0)).with_tag(tag)]);
    for receipt in receipts {
        app.world_mut().write_message(BrushApplied { terrain: None, receipt });
    }
    app.update();
    let bursts: Vec<Burst> = app.world_mut().resource_mut::<Messages<Burst>>().drain().collect();
    assert!(
        bursts.iter().any(|burst| burst.matter == Matter::Chips(MaterialId(0)) && burst.count > 3),
        "{bursts:?}"
    );
    // A receipt for nobody throws nothing.
    let receipt = Receipt { tag, outcome: Ok(Applied::default()) };
    app.world_mut().write_message(BrushApplied { terrain: None, receipt });
    app.update();
    assert_eq!(app.world_mut().resource_mut::<Messages<Burst>>().drain().count(), 0);
}
