//! Which cameras choose levels of detail, and when none does.

use std::time::Duration;

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{
    Camera, CameraProjection, OrthographicProjection, PerspectiveProjection, Projection, ScalingMode,
    SubCameraView, Viewport,
};
use bevy::math::Vec3A;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::lattice::TilePos;
use bevy_burrow::plugin::Held;
use bevy_burrow::prelude::*;

use crate::stage::Stage;

/// Over one corner of the mountains.
const EYE: Vec3 = Vec3::new(40.0, 90.0, 40.0);

/// Mountains of 320 x 270 voxels.
fn mountains() -> (Terrain, LevelsOfDetail) {
    let noise =
        NoiseHeights { seed: 9, octaves: 5, scale: 70.0, amplitude: 60.0, base: 0.0, ..Default::default() };
    let ground = Ground::from_noise(320, 270, &noise).expect("valid mountains");
    let model = Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size: 1.0 }).expect("valid");
    (model, LevelsOfDetail { cell_pixels: 24.0, error_pixels: 1.0, ..default() })
}

fn perspective() -> PerspectiveProjection {
    PerspectiveProjection { fov: 0.785, ..default() }
}

/// Mountains and a camera that looks straight down at one corner.
struct View {
    stage: Stage,
    terrain: Entity,
    camera: Entity,
}

impl View {
    fn new(camera: impl Bundle) -> Self {
        let mut stage = Stage::drawing();
        let place = Transform::from_translation(EYE).looking_to(Vec3::NEG_Y, Vec3::Z);
        let camera = stage.app.world_mut().spawn((Camera::default(), place, camera)).id();
        let terrain = stage.app.world_mut().spawn(mountains()).id();
        stage.settle();
        stage.frames(30);
        Self { stage, terrain, camera }
    }

    fn perspective() -> Self {
        Self::new(Projection::Perspective(perspective()))
    }

    fn nodes(&self) -> Vec<usize> {
        self.stage.app.world().get::<ShownLevels>(self.terrain).expect("the plugin adds it").nodes.clone()
    }

    /// The level that is drawn at a tile.
    fn level_at(&self, x: i32, z: i32) -> u8 {
        let cut = self.stage.terrain(self.terrain).drawn_cut().expect("it has levels").cut();
        cut.node_at(TilePos { x, z }).expect("in the world").level
    }

    fn below(&self) -> u8 {
        self.level_at(2, 2)
    }

    fn camera(&mut self) -> Mut<'_, Camera> {
        self.stage.app.world_mut().get_mut(self.camera).expect("a camera")
    }

    fn shift(&mut self, entities: &[Entity], by: Vec3) {
        for &entity in entities {
            self.stage.app.world_mut().get_mut::<Transform>(entity).expect("a place").translation += by;
        }
    }

    /// Runs frames in which no level may change.
    fn assert_unchanged(&mut self, frames: usize, what: &str) {
        let before = self.nodes();
        for frame in 0..frames {
            self.stage.frames(1);
            assert_eq!(self.nodes(), before, "{what}: frame {frame}");
        }
    }
}

#[test]
fn while_nobody_looks_nothing_is_merged() {
    let off: [(&str, fn(&mut Camera)); 2] = [
        ("inactive", |camera| camera.is_active = false),
        ("a picture of no size", |camera| {
            camera.viewport = Some(Viewport { physical_size: UVec2::ZERO, ..default() });
        }),
    ];
    for (what, off) in off {
        let mut view = View::perspective();
        assert_eq!(view.below(), 0);
        off(&mut view.camera());
        view.assert_unchanged(60, what);
        // Digs show meanwhile, and a terrain that is loaded again is not built up from the coarsest level when cameras
        // return.
        view.stage.send(crate::stage::dig(40.0, 60.0, 40.0, 9.0));
        view.stage.settle();
        assert_eq!(view.below(), 0, "{what}");
        *view.camera() = Camera::default();
        view.assert_unchanged(30, "looks again");
    }
    let mut view = View::perspective();
    view.stage.app.world_mut().despawn(view.camera);
    view.assert_unchanged(60, "the camera is gone");
}

#[test]
fn a_terrain_that_loads_anew_while_nobody_looks_is_as_fine_as_before() {
    let mut view = View::perspective();
    let before = view.nodes();
    view.camera().is_active = false;
    view.stage.frames(2);
    view.stage.app.world_mut().trigger(Redraw::default());
    view.stage.frames(2);
    view.stage.settle();
    view.stage.frames_until("all is built again", |stage| {
        stage.app.world().get::<ShownLevels>(view.terrain).is_some_and(|shown| shown.nodes == before)
    });
}

/// A perspective of the game's own, as for a headset or a mirror.
#[derive(Clone, Debug)]
struct Own(Mat4);

impl CameraProjection for Own {
    fn get_clip_from_view(&self) -> Mat4 {
        self.0
    }

    fn get_clip_from_view_for_sub(&self, _: &SubCameraView) -> Mat4 {
        self.0
    }

    fn update(&mut self, _: f32, _: f32) {}

    fn far(&self) -> f32 {
        1000.0
    }

    fn get_frustum_corners(&self, _: f32, _: f32) -> [Vec3A; 8] {
        [Vec3A::ZERO; 8]
    }
}

#[test]
fn any_perspective_chooses_the_levels_of_its_angle() {
    let expected = View::perspective().nodes();
    let usual = perspective().get_clip_from_view();
    let mut shifted = usual;
    // An off-axis picture, and one that is turned around its axis.
    shifted.z_axis.x += 0.3;
    shifted.z_axis.y -= 0.2;
    let mut slanted = usual;
    slanted.z_axis.z = 0.4;
    let turned = Mat4::from_rotation_z(0.7) * usual;
    for (what, clip) in [("usual", usual), ("off-axis", shifted), ("oblique", slanted), ("turned", turned)] {
        let own = View::new(Projection::custom(Own(clip)));
        assert_eq!(own.nodes(), expected, "{what}");
    }
    let broken = View::new(Projection::custom(Own(Mat4::NAN)));
    assert_eq!(broken.nodes()[0], 0, "an invalid projection chooses nothing");
}

fn orthographic(height: f32) -> Projection {
    let scaling_mode = ScalingMode::FixedVertical { viewport_height: height };
    Projection::Orthographic(OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() })
}

#[test]
fn orthographic_cameras_choose_levels_by_size_on_the_screen() {
    let near = View::new(orthographic(40.0));
    assert_eq!(near.below(), 0, "27 pixels a metre");
    assert!(near.level_at(18, 15) > 0, "far out of view: {:?}", near.nodes());
    let far = View::new(orthographic(4000.0));
    assert!(far.below() > 1, "a quarter of a pixel a metre: {:?}", far.nodes());
    // The distance of an orthographic camera makes no difference.
    let mut high = View::new(orthographic(40.0));
    let up = Vec3::Y * 700.0;
    high.shift(&[high.camera], up);
    high.assert_unchanged(60, "as high as the view is long");
    // What comes into view gets finer.
    let aside = Vec3::new(250.0, -700.0, 200.0);
    high.shift(&[high.camera], aside);
    let (terrain, tile) = (high.terrain, TilePos { x: 18, z: 15 });
    high.stage.frames_until("it follows", |stage| {
        let cut = stage.terrain(terrain).drawn_cut().expect("it has levels").cut();
        cut.node_at(tile).is_some_and(|node| node.level == 0)
    });
}

#[test]
fn cameras_on_other_layers_and_of_two_dimensions_choose_nothing() {
    let portrait = View::new((Projection::Perspective(perspective()), RenderLayers::layer(7)));
    assert_eq!(portrait.nodes()[0], 0, "{:?}", portrait.nodes());
    let flat = View::new((Camera2d, orthographic(40.0)));
    assert_eq!(flat.nodes()[0], 0, "{:?}", flat.nodes());
    // Next to the player's camera they make no difference.
    let mut view = View::perspective();
    let place = Transform::from_xyz(300.0, 90.0, 250.0);
    for number in 1..9 {
        let layer = RenderLayers::layer(number);
        view.stage.app.world_mut().spawn((Camera::default(), Projection::default(), place, layer));
    }
    view.assert_unchanged(60, "eight portraits");
    // A terrain may be on their layer.
    view.stage.app.world_mut().entity_mut(view.terrain).insert(RenderLayers::from_layers(&[0, 3]));
    let terrain = view.terrain;
    view.stage.frames_until("its ground is fine", |stage| {
        let cut = stage.terrain(terrain).drawn_cut().expect("it has levels").cut();
        cut.node_at(TilePos { x: 18, z: 15 }).is_some_and(|node| node.level == 0)
    });
}

#[test]
fn a_shifted_origin_changes_no_level() {
    for has_parent in [false, true] {
        let mut view = View::perspective();
        let root = if has_parent {
            let world = view.stage.app.world_mut();
            let root = world.spawn((Transform::default(), Visibility::default())).id();
            world.entity_mut(view.terrain).insert(ChildOf(root));
            root
        } else {
            view.terrain
        };
        view.stage.frames(10);
        for _ in 0..3 {
            view.shift(&[root, view.camera], Vec3::X * -1000.0);
            view.assert_unchanged(20, "shifted");
        }
        view.shift(&[root, view.camera], Vec3::new(2.0e5, 0.0, -1.0e5));
        view.assert_unchanged(20, "shifted far");
    }
}

#[test]
fn a_shift_while_the_camera_moves_keeps_what_lies_ahead() {
    let mut view = View::perspective();
    let step = Duration::from_secs_f32(1.0 / 60.0);
    view.stage.app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    let mut fine = Vec::new();
    for frame in 0..90 {
        view.shift(&[view.camera], Vec3::X);
        if frame % 30 == 29 {
            view.shift(&[view.terrain, view.camera], Vec3::X * -1000.0);
        }
        view.stage.frames(3);
        fine.push(view.nodes()[0]);
    }
    // It flies at 20 to 60 m a second, and nothing behind it is dropped because of a shift.
    assert!(fine.windows(2).all(|pair| pair[1] + 24 >= pair[0]), "{fine:?}");
}

/// The squares of level 0 around a camera that moves at a speed of the game's time.
fn moving(speed: f32) -> Vec<usize> {
    let mut view = View::perspective();
    let step = Duration::from_secs_f32(1.0 / 60.0);
    view.stage.app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    view.stage.app.world_mut().resource_mut::<Time<Virtual>>().set_relative_speed(speed);
    // A photographer walks at 3 m a second.
    let mut seen = Vec::new();
    for _ in 0..60 {
        view.shift(&[view.camera], Vec3::X * 0.05);
        view.stage.frames(1);
        seen.push(view.nodes()[0]);
    }
    seen
}

#[test]
fn slow_motion_looks_no_farther_ahead() {
    let usual = moving(1.0).into_iter().max();
    assert_eq!(moving(0.01).into_iter().max(), usual);
    assert_eq!(moving(0.0).into_iter().max(), usual);
}

#[test]
fn a_loading_screen_without_a_camera_names_a_place() {
    let mut stage = Stage::drawing();
    stage.app.world_mut().spawn(Camera2d);
    let place = Transform::from_translation(EYE);
    let source = stage.app.world_mut().spawn((DetailSource::default(), place)).id();
    let terrain = stage.app.world_mut().spawn(mountains()).id();
    stage.settle();
    let expected = View::perspective();
    let nodes = |stage: &Stage| stage.app.world().get::<ShownLevels>(terrain).expect("levels").nodes.clone();
    assert_eq!(nodes(&stage), expected.nodes(), "as a camera would see it, when it is ready");
    // The camera comes, and the source goes.
    let projection = Projection::Perspective(perspective());
    stage.app.world_mut().spawn((Camera::default(), projection, place));
    stage.app.world_mut().despawn(source);
    for _ in 0..30 {
        stage.frames(1);
        assert_eq!(nodes(&stage), expected.nodes());
    }
}

#[test]
fn a_held_terrain_begins_no_change_of_levels() {
    let mut view = View::perspective();
    view.stage.app.world_mut().entity_mut(view.terrain).insert(Held);
    view.shift(&[view.camera], Vec3::new(260.0, 0.0, 200.0));
    view.assert_unchanged(60, "held");
    assert!(!view.stage.terrain(view.terrain).is_busy());
    view.stage.app.world_mut().entity_mut(view.terrain).remove::<Held>();
    let (terrain, tile) = (view.terrain, TilePos { x: 18, z: 15 });
    view.stage.frames_until("it follows", |stage| {
        let cut = stage.terrain(terrain).drawn_cut().expect("it has levels").cut();
        cut.node_at(tile).is_some_and(|node| node.level == 0)
    });
}

#[test]
fn a_camera_whose_picture_has_one_pixel_chooses_nothing() {
    // As of a window that is minimised.
    let mut view = View::perspective();
    view.camera().viewport = Some(Viewport { physical_size: UVec2::ONE, ..default() });
    view.assert_unchanged(60, "one pixel");
}

#[test]
fn shown_levels_that_a_game_removes_come_back() {
    let mut view = View::perspective();
    view.stage.app.world_mut().entity_mut(view.terrain).remove::<ShownLevels>();
    view.shift(&[view.camera], Vec3::new(100.0, 0.0, 100.0));
    let terrain = view.terrain;
    view.stage.frames_until("they are there", |stage| {
        stage.app.world().get::<ShownLevels>(terrain).is_some_and(|shown| shown.waiting == 0)
    });
    view.stage.frames(30);
    assert!(!view.stage.terrain(terrain).is_busy(), "nothing more is to be done");
}
