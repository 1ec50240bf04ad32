//! The widgets that set the brush.

use super::*;
use crate::brush::Edit;

#[test]
fn tiles_and_sliders_set_the_brush() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    for operation in ToolOperation::all() {
        screen.choose(operation.name());
        assert_eq!(screen.tool.operation, operation);
    }
    for shape in ToolShape::ALL {
        screen.choose(&format!("{shape:?}"));
        assert_eq!(screen.tool.shape, shape);
    }
    screen.choose("Sphere");
    let rail = screen.places.0["Radius"];
    let (from, to) =
        (Pos2::new(rail.min.x + 20.0, rail.center().y), Pos2::new(rail.max.x - 4.0, rail.center().y));
    screen.frame(vec![Event::PointerMoved(from)]);
    screen.frame(vec![Screen::button(from, true)]);
    let small = screen.tool.radius;
    screen.frame(vec![Event::PointerMoved(to)]);
    screen.frame(vec![Screen::button(to, false)]);
    assert!(screen.tool.radius > 2.0 * small, "{} {small}", screen.tool.radius);
}

#[test]
fn what_does_not_apply_can_not_be_chosen() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    for (operation, shape) in [("Dig", ToolShape::Torus), ("Stamp", ToolShape::Box)] {
        for name in [operation, "Box", "Torus"] {
            screen.choose(name);
        }
        assert_eq!(screen.tool.shape, shape, "{operation}");
    }
}

#[test]
fn sculpting_makes_ground_of_a_material_where_told_so() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    assert!(!screen.places.0.contains_key("Fill"));
    for name in ["Raise", "Fill", "Fill material", "Clay"] {
        screen.choose(name);
    }
    assert!(screen.tool.is_of_material);
    assert_eq!(screen.tool.material, 4);
}

#[test]
fn every_slider_value_makes_a_valid_brush() {
    let hit = hit();
    let sliders = [
        "Radius",
        "Half width",
        "Half height",
        "Half depth",
        "Tube",
        "Length",
        "Falloff",
        "Amount",
        "Height",
        "Step",
        "Bumps",
        "Width",
    ];
    for voxel_size in [0.125, 8.0] {
        let mut screen = Screen::new(1280.0, 1600.0, 0);
        screen.terrains.push(flat(voxel_size));
        screen.choose("Rough");
        let mut dragged = 0;
        let combinations = ToolOperation::all().map(|operation| (operation, ToolShape::Sphere));
        let shapes = ToolShape::ALL.map(|shape| (ToolOperation::Stamp, shape));
        for (operation, shape) in combinations.chain(shapes) {
            (screen.tool.operation, screen.tool.shape) = (operation, shape);
            for is_up in [false, true] {
                (0..2).for_each(|_| screen.frame(Vec::new()));
                let is_seen = |name: &&str| screen.places.0.contains_key(*name);
                let seen: Vec<&str> = sliders.into_iter().filter(is_seen).collect();
                seen.iter().for_each(|name| screen.drag(name, is_up));
                dragged += seen.len();
                let brush = screen.tool.brush_at(&hit);
                let brush = brush.transformed(Quat::IDENTITY, Vec3::ZERO, voxel_size.recip());
                let edit = Edit::quantize(&brush);
                assert!(edit.is_ok(), "{edit:?} at {voxel_size}: {:?}", screen.tool);
            }
        }
        assert!(dragged > 100, "{dragged}");
    }
}

#[test]
fn other_voxels_change_no_setting_by_themselves() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    (screen.tool.radius, screen.tool.operation) = (90.0, ToolOperation::Terrace);
    let before = screen.tool.clone();
    screen.terrains = vec![flat(8.0)];
    (0..3).for_each(|_| screen.frame(Vec::new()));
    assert_eq!(screen.tool, before);
    screen.drag("Step", false);
    assert_eq!(screen.tool, BrushTool { step: 8.0, ..before });
}
