//! Tests of digging, building and painting.

use std::time::Duration;

use bevy::time::TimeUpdateStrategy;
use bevy_burrow::brush::shapes::Sphere;

use super::*;
use crate::test_support::{drain, drain_hints, flat_terrain};
use crate::world::landscape::{CONCRETE, ROCK};

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, DiggingPlugin))
        .insert_resource(Hand::new(&Settings::default()))
        .init_resource::<Settings>()
        .init_resource::<Inventory>()
        .init_resource::<CameraShake>()
        .add_message::<Brush>()
        .add_message::<BrushApplied>()
        .add_message::<Hint>()
        .add_message::<Burst>();
    app
}

fn use_tool(app: &mut App, tool: Tool) -> Vec<Brush> {
    let aim = Aim { point: Vec3::new(10.0, 20.0, 10.0), direction: Vec3::NEG_Y, normal: Vec3::Y };
    let (eye, direction) = (aim.point + Vec3::Y, aim.direction);
    app.world_mut().trigger(ToolUsed { tool, aim: Some(aim), eye, direction });
    drain(app)
}

fn choose(app: &mut App, material: MaterialId) {
    app.world_mut().resource_mut::<Hand>().material = material;
}

fn available(app: &App, material: MaterialId) -> i64 {
    app.world().resource::<Inventory>().available(material)
}

#[test]
fn building_and_painting_need_material_unless_they_are_free() {
    for tool in [Tool::Builder, Tool::Painter] {
        let mut app = app();
        choose(&mut app, ROCK);
        assert_eq!(use_tool(&mut app, tool), []);
        assert_eq!(drain_hints(&mut app), ["Not enough rock. Dig some first."]);
        app.world_mut().resource_mut::<Settings>().survival = false;
        assert_eq!(use_tool(&mut app, tool).len(), 1);
    }
}

#[test]
fn brushes_are_as_large_as_the_inventory_allows_and_reserve_their_material() {
    for tool in [Tool::Builder, Tool::Painter] {
        let mut app = app();
        choose(&mut app, CONCRETE);
        app.world_mut().resource_mut::<Hand>().set_radius(tool, 12.0);
        let mut left = available(&app, CONCRETE);
        let mut radii = Vec::new();
        // In the end all concrete is reserved.
        while let [Brush { shape: shape @ Shape::Sphere(Sphere { radius, .. }), .. }] =
            use_tool(&mut app, tool)[..]
        {
            left -= Brush::dig(shape).voxel_count().expect("a valid brush") as i64;
            assert_eq!(available(&app, CONCRETE), left);
            radii.push(radius);
        }
        assert!((0..60).contains(&left) && radii[0] > 4.0, "{left}: {radii:?}");
        assert_eq!(drain_hints(&mut app).len(), 1);
    }
}

#[test]
fn the_hint_that_something_is_too_far_away_waits_until_no_blow_has_hit_for_a_while() {
    // Ten blows a second; a letter says whether one hits, and a dot is a pause.
    let hints = |blows: &str| -> Vec<usize> {
        let mut app = app();
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(100)));
        let blow = |(at, letter): (usize, char)| {
            app.update();
            if letter == '.' {
                return None;
            }
            let aim = Aim { point: Vec3::splat(10.0), direction: Vec3::NEG_Y, normal: Vec3::Y };
            let (eye, direction, tool) = (Vec3::ZERO, aim.direction, Tool::Pickaxe);
            let aim = (letter == 'h').then_some(aim);
            app.world_mut().trigger(ToolUsed { tool, aim, eye, direction });
            (!drain_hints(&mut app).is_empty()).then_some(at)
        };
        blows.chars().enumerate().filter_map(blow).collect()
    };
    assert!(hints(&"mmmmmmmmh".repeat(9)).is_empty(), "digging at the edge of the reach");
    assert!(hints(&format!("m{}mm", ".".repeat(20))).is_empty(), "after a pause, blows begin anew");
    let told = hints(&"m".repeat(20));
    assert!(told.len() > 5 && (9..=11).contains(&told[0]), "{told:?}");
    let again = hints(&format!("{}h{}", "m".repeat(12), "m".repeat(8)));
    assert!(again.iter().all(|at| *at < 12), "a blow that hits starts the wait again: {again:?}");
}

#[test]
fn a_radius_is_affordable_if_there_are_enough_voxels() {
    let sphere = |radius| Shape::sphere(Vec3::splat(3.5), radius);
    for (available, is_enough) in [(0, false), (3, false), (8, true), (30, true), (200, true), (900, true)] {
        let found = affordable_radius(Tool::Builder, 12.0, available, sphere);
        assert_eq!(found.is_some(), is_enough, "{available}");
        assert!(found.is_none_or(|(_, voxels)| voxels <= available), "{found:?} of {available}");
    }
    let found = affordable_radius(Tool::Builder, 2.0, 900, sphere);
    assert_eq!(found.map(|(radius, _)| radius), Some(2.0));
}

#[test]
fn every_tool_sends_its_own_brush_or_none() {
    let mut app = app();
    choose(&mut app, CONCRETE);
    let mut tags = Vec::new();
    for tool in Tool::ALL {
        let sends = !matches!(tool, Tool::Bomb | Tool::Lamp | Tool::Ball);
        let sent = use_tool(&mut app, tool);
        assert_eq!(sent.len(), usize::from(sends), "{tool:?}");
        tags.extend(sent.iter().map(|brush| brush.tag));
    }
    tags.dedup();
    assert_eq!(tags.len(), 5, "every brush has its own tag");
}

#[test]
fn what_was_dug_flies_off_as_chips() {
    let mut app = app();
    let [Brush { tag, .. }] = use_tool(&mut app, Tool::Pickaxe)[..] else { panic!("one brush") };
    let dig = Brush::dig(Shape::sphere(Vec3::new(10.0, 20.0, 10.0), 2.0)).with_tag(tag);
    for receipt in flat_terrain().apply([dig]) {
        app.world_mut().write_message(BrushApplied { terrain: None, receipt });
    }
    app.update();
    let bursts: Vec<Burst> = drain(&mut app);
    let is_chips = |burst: &Burst| burst.kind == ParticleKind::Chips(MaterialId(0)) && burst.count > 3;
    assert!(bursts.iter().any(is_chips), "{bursts:?}");
    // A receipt of another brush throws no chips.
    let receipt = Receipt::of_edit(tag, Ok(Applied::default()));
    app.world_mut().write_message(BrushApplied { terrain: None, receipt });
    app.update();
    assert!(drain::<Burst>(&mut app).is_empty());
}
