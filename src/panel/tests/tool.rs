//! Brushes of the panel's settings.

use bevy::prelude::*;

use crate::brush::shapes::Cylinder;
use crate::brush::{Brush, Edit, GridShape, Operation, Roughness, Shape, ShapeGrid};
use crate::ground::{GreyImage, MaterialId};
use crate::panel::tool::{BrushTool, StampImage, ToolAlign, ToolModel, ToolShape};
use crate::panel::tool_operation::ToolOperation;
use crate::plugin::TerrainHit;
use crate::terrain::Terrain;

fn hit() -> TerrainHit {
    TerrainHit {
        terrain: Entity::PLACEHOLDER,
        distance: 9.0,
        position: Vec3::new(10.0, 20.0, 30.0),
        normal: Vec3::X,
        material: MaterialId(1),
        from_inside: false,
    }
}

#[test]
fn every_setting_reaches_the_brush() {
    let tool = BrushTool::default();
    assert_eq!(tool.brush_at(&hit()), Brush::dig(Shape::sphere(hit().position, 4.0)));

    let tool = BrushTool {
        operation: ToolOperation::Add,
        shape: ToolShape::Cylinder,
        align: ToolAlign::Surface,
        length: 6.0,
        radius: 2.0,
        sink: 1.0,
        material: 7,
        is_rough: true,
        bump: 0.25,
        bump_width: 3.0,
        seed: 9,
        ..BrushTool::default()
    };
    let brush = tool.brush_at(&hit());
    // It is completely in the ground: its far end is where the ray hit the surface.
    let Shape::Cylinder(Cylinder { base, axis, radius }) = brush.shape else { panic!("a cylinder") };
    assert_eq!((base, axis, radius), (Vec3::new(4.0, 20.0, 30.0), Vec3::X * 6.0, 2.0));
    assert_eq!(brush.operation, Operation::Add { material: MaterialId(7) });
    assert_eq!(brush.roughness, Some(Roughness::new(0.25, 3.0, 9)));
}

#[test]
fn sculpting_leaves_materials_alone_unless_told_otherwise() {
    let tool = BrushTool { operation: ToolOperation::Raise, material: 7, ..BrushTool::default() };
    assert_eq!(tool.brush_at(&hit()).blend.material, None);
    let tool = BrushTool { is_of_material: true, ..tool };
    assert_eq!(tool.brush_at(&hit()).blend.material, Some(MaterialId(7)));
}

#[test]
fn each_shape_is_pushed_in_by_its_own_depth() {
    for shape in ToolShape::ALL {
        for (sink, highest) in [(1.0, 20.0), (0.0, 23.0), (-1.0, 26.0)] {
            let tool = BrushTool { shape, sink, radius: 3.0, half: Vec3::splat(3.0), ..BrushTool::default() };
            let tool = match shape {
                ToolShape::Capsule => BrushTool { radius: 1.0, length: 4.0, ..tool },
                ToolShape::Torus => BrushTool { tube: 3.0, ..tool },
                _ => BrushTool { length: 6.0, ..tool },
            };
            let mut top = f32::MIN;
            tool.shape_at(&hit()).outline(|from, to| top = top.max(from.y).max(to.y));
            assert!((top - highest).abs() < 1e-4, "{shape:?} {sink}: {top}");
        }
    }
}

#[test]
fn every_operation_and_shape_makes_a_valid_edit() {
    for row in super::super::operations::OPERATIONS {
        for shape in ToolShape::ALL {
            for align in [ToolAlign::Upright, ToolAlign::Surface] {
                let tool = BrushTool { operation: row.tool, shape, align, ..BrushTool::default() };
                let brush = tool.brush_at(&hit());
                assert!(Edit::quantize(&brush).is_ok(), "{tool:?}: {:?}", Edit::quantize(&brush));
            }
        }
    }
}

#[test]
fn a_path_is_one_brush_through_its_points() {
    let at = |x: f32| TerrainHit { position: Vec3::new(x, 20.0, 30.0), normal: Vec3::Y, ..hit() };
    for (operation, sink) in [(ToolOperation::Dig, 0.5), (ToolOperation::Road, 0.0)] {
        let mut tool =
            BrushTool { operation, shape: ToolShape::Path, sink, radius: 2.0, ..BrushTool::default() };
        assert_eq!(tool.finish_path(), None);
        tool.add_point(&at(0.0));
        tool.add_point(&at(10.0));
        let shown = tool.brush_at(&at(20.0));
        tool.add_point(&at(20.0));
        assert_eq!(tool.finish_path().as_ref(), Some(&shown), "the preview is the edit");
        assert!(tool.points.is_empty() && Edit::quantize(&shown).is_ok());
        let straight = BrushTool { is_smooth: false, ..tool.clone() };
        assert_ne!(straight.brush_at(&at(20.0)), tool.brush_at(&at(20.0)));
    }
    let mut tool = BrushTool { shape: ToolShape::Path, ..BrushTool::default() };
    (0..400).for_each(|x| tool.add_point(&at(x as f32)));
    assert!(Edit::quantize(&tool.brush_at(&at(400.0))).is_ok());
    assert!(tool.finish_path().is_some_and(|brush| Edit::quantize(&brush).is_ok()));
}

#[test]
fn what_is_copied_is_pasted_as_it_was() {
    let ground = crate::ground::Ground::flat(64, 64, 20.0).expect("valid");
    let mut terrain = Terrain::new(ground, &crate::terrain::TerrainSettings::default()).expect("valid");
    terrain.apply([Brush::add(
        Shape::cuboid(Vec3::new(16.0, 22.0, 16.0), Vec3::new(2.0, 3.0, 2.0)),
        MaterialId(5),
    )]);
    let at = |x: f32| TerrainHit { position: Vec3::new(x, 20.0, 16.0), ..hit() };
    let mut tool = BrushTool { shape: ToolShape::Box, half: Vec3::splat(8.0), ..BrushTool::default() };
    tool.copy(&terrain, &GlobalTransform::IDENTITY, &at(16.0)).expect("it is in the world");
    assert_eq!(tool.operation, ToolOperation::Paste);
    let receipts = terrain.apply([tool.brush_at(&at(40.2))]);
    assert!(receipts.iter().all(|receipt| receipt.outcome.is_ok()), "{receipts:?}");
    let solid = |x: f64| terrain.world().is_solid(bevy::math::DVec3::new(x, 23.0, 16.0));
    assert!(solid(16.0) && solid(40.0) && !solid(28.0));
    let kept = tool.prefab.clone();
    assert!(tool.copy(&terrain, &GlobalTransform::IDENTITY, &at(-900.0)).is_err());
    assert_eq!(tool.prefab, kept, "an error changes nothing");
}

#[test]
fn a_hut_can_be_entered() {
    let ground = crate::ground::Ground::flat(64, 64, 20.0).expect("valid");
    let mut terrain = Terrain::new(ground, &crate::terrain::TerrainSettings::default()).expect("valid");
    let tool = BrushTool { operation: ToolOperation::Paste, ..BrushTool::default() };
    let hit = TerrainHit { position: Vec3::new(32.0, 20.0, 32.0), normal: Vec3::Y, ..hit() };
    let receipts = terrain.apply([tool.brush_at(&hit)]);
    assert!(receipts.iter().all(|receipt| receipt.outcome.is_ok()), "{receipts:?}");
    let solid = |x: f64, y: f64, z: f64| terrain.world().is_solid(bevy::math::DVec3::new(x, y, z));
    assert!(solid(28.0, 23.0, 32.0) && solid(32.0, 26.0, 32.0), "walls and a roof");
    assert!(!solid(32.0, 22.0, 32.0) && !solid(32.0, 22.0, 28.0), "a room and a door");
}

#[test]
fn what_is_stamped_has_a_name() {
    let image = GreyImage::from_samples(3, 2, vec![0; 6]).expect("six samples");
    let named = StampImage::new("Dunes", image);
    let unnamed = StampImage { name: None, ..named.clone() };
    let labels = [&StampImage::default(), &named, &unnamed].map(StampImage::label);
    assert_eq!(labels, ["Ridge", "Dunes", "3 x 2 samples"]);
}

#[test]
fn a_stamp_is_no_ring() {
    let ring = BrushTool { shape: ToolShape::Torus, ..BrushTool::default() };
    let stamp = BrushTool { operation: ToolOperation::Stamp, ..ring.clone() };
    assert!(matches!(ring.shape_at(&hit()), Shape::Torus(_)));
    assert_eq!(stamp.shape_at(&hit()), Shape::sphere(hit().position, ring.radius));
    // The shape is not forgotten.
    assert_eq!(BrushTool { operation: ToolOperation::Dig, ..stamp }, ring);
}

#[test]
fn the_preview_of_a_stamp_is_as_high_as_its_image() {
    let image = GreyImage::from_samples(2, 2, vec![0, u16::MAX, 0, 0]).expect("four samples");
    let tool = BrushTool {
        operation: ToolOperation::Stamp,
        stamp: StampImage::new("step", image),
        amount: 3.0,
        ..BrushTool::default()
    };
    let heights = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)].map(|(u, v)| tool.stamp_height(u, v));
    assert_eq!(heights, [Some(0.0), Some(3.0), Some(0.0)]);
    assert_eq!(BrushTool::default().stamp_height(0.0, 0.0), None);
}

#[test]
fn growing_has_ends() {
    for (shape, voxel) in ToolShape::ALL.into_iter().flat_map(|shape| [(shape, 0.125), (shape, 8.0)]) {
        let mut tool = BrushTool { shape, ..BrushTool::default() };
        (0..100).for_each(|_| tool.grow(1.5, voxel));
        let most = if shape == ToolShape::Box { tool.half.x } else { tool.radius };
        (0..200).for_each(|_| tool.grow(0.5, voxel));
        let least = if shape == ToolShape::Box { tool.half.x } else { tool.radius };
        assert_eq!(least..=most, tool.radii(voxel));
    }
}

#[test]
fn a_copy_of_a_turned_terrain_is_pasted_as_it_lay() {
    let ground = crate::ground::Ground::flat(64, 64, 10.0).expect("valid ground");
    let terrain = Terrain::new(ground, &Default::default()).expect("valid settings");
    let turn = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
    let place = GlobalTransform::from(Transform { rotation: turn, scale: Vec3::splat(2.0), ..default() });
    let hit = TerrainHit { position: place.transform_point(Vec3::new(30.0, 10.0, 30.0)), ..hit() };
    let mut tool = BrushTool::default();
    tool.prefab.is_edits_only = false;
    tool.copy(&terrain, &place, &hit).expect("it lies in the world");
    let paste = tool.paste_at(&hit).expect("a copy");
    assert!(paste.rotation.dot(turn).abs() > 0.999_9, "{}", paste.rotation);
    assert!((paste.scale - 2.0).abs() < 1e-5 && !paste.edited_only, "{}", paste.scale);
    // The tool's own turn comes on top.
    tool.turn = -90.0;
    let paste = tool.paste_at(&hit).expect("a copy");
    assert!(paste.rotation.dot(Quat::IDENTITY).abs() > 0.999_9, "{}", paste.rotation);
}

#[test]
fn a_model_of_any_size_that_is_offered_is_a_valid_brush() {
    let long = ShapeGrid::from_fn(UVec3::new(5, 9, 128), |at| (at.x - 2).abs() as f32 - 1.0);
    let models = [ToolModel::default(), ToolModel::new("long", long.expect("a grid"))];
    for (model, voxel) in models.iter().flat_map(|model| [0.125, 1.0, 8.0].map(|voxel| (model, voxel))) {
        let mut tool = BrushTool { shape: ToolShape::Model, model: model.clone(), ..default() };
        for factor in [0.0, 1e9] {
            tool.grow(factor, voxel);
            let brush = tool.brush_at(&hit());
            let shape = tool.model_at(&hit()).expect("a grid");
            let in_voxels = GridShape { scale: shape.scale / voxel, center: Vec3::ZERO, ..shape };
            assert!(
                Edit::quantize(&Brush::dig(in_voxels)).is_ok(),
                "{factor} with voxels of {voxel}: {brush:?}"
            );
        }
    }
}
