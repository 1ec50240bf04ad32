//! The geometry of handles: where they are on the screen, which one the pointer is at, and how far it is dragged.

use bevy::prelude::*;

/// Radius of the rings, in points of the screen.
const RADIUS: f32 = 80.0;
/// The ends of the arrows, and the squares that scale, as parts of that radius.
const ARROW: f32 = 1.4;
const SQUARE: f32 = 0.6;
/// Parts of a ring.
const RING: u16 = 48;
/// How near the pointer must be to a handle, in points.
const NEAR: f32 = 9.0;
/// Arrows and squares that point this much at the viewer can't be dragged: the cosine of the angle between.
const END_ON: f32 = 0.96;
/// A ring is seen from its edge, and is dragged along the screen instead of around, if the cosine of the angle between
/// its axis and the line of sight is smaller than this.
const EDGE_ON: f32 = 0.2;

/// An axis of the world or of a brush.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    pub fn unit(self) -> Vec3 {
        match self {
            Self::X => Vec3::X,
            Self::Y => Vec3::Y,
            Self::Z => Vec3::Z,
        }
    }

    /// The next two axes, a quarter turn about this one apart.
    fn others(self) -> [Vec3; 2] {
        match self {
            Self::X => [Vec3::Y, Vec3::Z],
            Self::Y => [Vec3::Z, Vec3::X],
            Self::Z => [Vec3::X, Vec3::Y],
        }
    }
}

/// A handle of a placed brush.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handle {
    /// A disc: moves over the ground.
    Ground,
    /// An arrow: moves along an axis of the world.
    Move(Axis),
    /// A ring: turns about an axis of the world.
    Turn(Axis),
    /// A square: scales along an axis of the brush.
    Scale(Axis),
}

impl Handle {
    pub fn all() -> impl Iterator<Item = Self> {
        let along = |axis| [Self::Turn(axis), Self::Move(axis), Self::Scale(axis)];
        Axis::ALL.into_iter().flat_map(along).chain([Self::Ground])
    }
}

/// What a camera sees.
#[derive(Clone, Copy)]
pub struct View<'a> {
    pub camera: &'a Camera,
    pub place: GlobalTransform,
    /// Points of the screen per logical pixel of the camera.
    pub scale: f32,
}

impl View<'_> {
    /// The point of the screen where a position is seen.
    pub fn project(&self, at: Vec3) -> Option<Vec2> {
        let pixel = self.camera.world_to_viewport(&self.place, at).ok()?;
        Some(pixel * self.scale)
    }

    /// The ray through a point of the screen.
    pub fn ray(&self, at: Vec2) -> Option<Ray3d> {
        self.camera.viewport_to_world(&self.place, at / self.scale).ok()
    }
}

/// The handles around a position, as large on the screen at any distance.
pub struct Frame<'a> {
    view: View<'a>,
    origin: Vec3,
    /// How the axes are turned along which a brush is scaled.
    rotation: Quat,
    /// Where the origin is seen, and the direction in which one looks at it.
    center: Vec2,
    sight: Vec3,
    /// Metres of [`RADIUS`] at the origin.
    radius: f32,
}

impl<'a> Frame<'a> {
    /// `None` if the position is not in front of the camera.
    pub fn new(view: View<'a>, origin: Vec3, rotation: Quat) -> Option<Self> {
        let center = view.project(origin)?;
        let sight = *view.ray(center)?.direction;
        let step = 0.01 * view.place.translation().distance(origin);
        let beside = view.project(origin + view.place.right() * step)?;
        let radius = RADIUS * step / center.distance(beside);
        radius.is_finite().then_some(Self { view, origin, rotation, center, sight, radius })
    }

    fn axis(&self, handle: Handle) -> Vec3 {
        match handle {
            Handle::Ground => Vec3::ZERO,
            Handle::Move(axis) | Handle::Turn(axis) => axis.unit(),
            Handle::Scale(axis) => self.rotation * axis.unit(),
        }
    }

    /// Whether a handle can be dragged, seen from here.
    pub fn is_shown(&self, handle: Handle) -> bool {
        matches!(handle, Handle::Turn(_)) || self.axis(handle).dot(self.sight).abs() < END_ON
    }

    /// The points of its line.
    fn line(&self, handle: Handle) -> Vec<Vec3> {
        let along = |part: f32| self.origin + self.axis(handle) * part * self.radius;
        match handle {
            Handle::Ground => vec![self.origin],
            Handle::Scale(_) => vec![along(SQUARE)],
            Handle::Move(_) => vec![self.origin, along(ARROW)],
            Handle::Turn(axis) => {
                let [right, up] = axis.others();
                let at = |step: u16| {
                    let (sin, cos) = (f32::from(step) / f32::from(RING) * std::f32::consts::TAU).sin_cos();
                    self.origin + (right * cos + up * sin) * self.radius
                };
                (0..=RING).map(at).collect()
            }
        }
    }

    /// Its line on the screen, without parts behind the camera. For a disc or a square, its middle twice.
    pub fn segments(&self, handle: Handle) -> Vec<[Vec2; 2]> {
        let points: Vec<Option<Vec2>> =
            self.line(handle).into_iter().map(|at| self.view.project(at)).collect();
        match points[..] {
            [only] => only.map(|at| [at, at]).into_iter().collect(),
            _ => points.windows(2).filter_map(|pair| Some([pair[0]?, pair[1]?])).collect(),
        }
    }

    /// A point of the screen at which the pointer grabs it: the tip of an arrow, and a ring between two axes.
    pub fn grip(&self, handle: Handle) -> Option<Vec2> {
        let line = self.line(handle);
        let at = if line.len() > 2 { line.get(usize::from(RING / 8)) } else { line.last() };
        self.view.project(*at?)
    }

    /// The handle at the pointer. Discs and squares come before the lines that they are on.
    pub fn pick(&self, handles: impl Iterator<Item = Handle>, pointer: Vec2) -> Option<Handle> {
        let near = handles.filter(|handle| self.is_shown(*handle)).filter_map(|handle| {
            let segments = self.segments(handle);
            let away = segments.iter().map(|ends| distance(pointer, *ends)).min_by(f32::total_cmp)?;
            let is_point = matches!(handle, Handle::Ground | Handle::Scale(_));
            (away < NEAR).then_some((if is_point { away - NEAR } else { away }, handle))
        });
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, handle)| handle)
    }

    /// Whether dragging may begin at this value: a size is multiplied by the ratio of the values, so it may not begin
    /// at the middle or beyond.
    pub fn can_begin(&self, handle: Handle, value: f32) -> bool {
        !matches!(handle, Handle::Scale(_)) || value > 0.1 * SQUARE * self.radius
    }

    /// How far along its axis, in metres, or around it, in radians, a handle is at the pointer. `None` where the pointer
    /// is at no such position.
    pub fn value(&self, handle: Handle, pointer: Vec2) -> Option<f32> {
        let axis = self.axis(handle);
        match handle {
            Handle::Ground => Some(0.0),
            Handle::Move(_) | Handle::Scale(_) => nearest(self.view.ray(pointer)?, self.origin, axis),
            Handle::Turn(_) if axis.dot(self.sight).abs() < EDGE_ON => {
                // The part of the ring that is nearest to the viewer moves like this for a radian.
                let near_side = axis * axis.dot(self.sight) - self.sight;
                let way = axis.cross(near_side).normalize() * self.radius;
                let way = self.view.project(self.origin + way)? - self.center;
                let turned = (pointer - self.center).dot(way) / way.length_squared();
                turned.is_finite().then_some(turned)
            }
            Handle::Turn(around) => {
                let ray = self.view.ray(pointer)?;
                let away = (self.origin - ray.origin).dot(axis) / ray.direction.dot(axis);
                let from = ray.origin + ray.direction * away - self.origin;
                let [right, up] = around.others();
                (away > 0.0).then(|| from.dot(up).atan2(from.dot(right)))
            }
        }
    }
}

/// How far along a line its point is that is nearest to a ray. `None` behind the ray, or if they are parallel.
fn nearest(ray: Ray3d, origin: Vec3, axis: Vec3) -> Option<f32> {
    let (from, cos) = (origin - ray.origin, ray.direction.dot(axis));
    let along = (cos * ray.direction.dot(from) - axis.dot(from)) / (1.0 - cos * cos);
    let is_ahead = ray.direction.dot(from + axis * along) > 0.0;
    (is_ahead && along.is_finite()).then_some(along)
}

/// The distance of a point from a line between two others.
fn distance(at: Vec2, [from, to]: [Vec2; 2]) -> f32 {
    let line = to - from;
    let part = (at - from).dot(line) / line.length_squared().max(f32::MIN_POSITIVE);
    at.distance(from + line * part.clamp(0.0, 1.0))
}

/// A camera of 1280 x 720 pixels, without an app.
#[cfg(test)]
pub fn test_camera(clip_from_view: Mat4) -> Camera {
    use bevy::camera::{ComputedCameraValues, RenderTargetInfo};
    let target = RenderTargetInfo { physical_size: UVec2::new(1280, 720), scale_factor: 1.0 };
    let computed =
        ComputedCameraValues { clip_from_view, target_info: Some(target), ..ComputedCameraValues::default() };
    Camera { computed, ..Camera::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn perspective() -> Camera {
        test_camera(Mat4::perspective_infinite_reverse_rh(0.8, 16.0 / 9.0, 0.1))
    }

    /// Cameras of both kinds, around a position at several distances, and frames of random axes there.
    fn in_frames(mut see: impl FnMut(Frame)) {
        let mut rng = fastrand::Rng::with_seed(7);
        let perspective = perspective();
        // Near and far exchanged, as Bevy does.
        let orthographic = test_camera(Mat4::orthographic_rh(-32.0, 32.0, -18.0, 18.0, 900.0, 0.0));
        for turn in 0..200 {
            let mut unit = || 2.0 * rng.f32() - 1.0;
            let origin = Vec3::new(unit(), unit(), unit()) * 90.0;
            let away = Vec3::new(unit(), unit(), unit()).normalize() * (20.0 + 15.0 * unit());
            let rotation = Quat::from_euler(EulerRot::YXZ, 3.0 * unit(), 3.0 * unit(), 3.0 * unit());
            let place =
                Transform::from_translation(origin + away).looking_at(origin + Vec3::splat(unit()), Vec3::Y);
            let camera = if turn % 3 == 0 { &orthographic } else { &perspective };
            let scale = if turn % 2 == 0 { 1.0 } else { 1.5 };
            let view = View { camera, place: place.into(), scale };
            see(Frame::new(view, origin, rotation).expect("it is ahead"));
        }
    }

    #[test]
    fn handles_are_as_large_at_any_distance() {
        in_frames(|frame| {
            let up = *frame.view.place.up() * frame.radius;
            let size = frame.view.project(frame.origin + up).expect("ahead").distance(frame.center);
            assert!((size - RADIUS).abs() < 0.05 * RADIUS, "{size}");
        });
    }

    #[test]
    fn a_handle_is_grabbed_where_it_is_seen() {
        let mut grabbed = 0;
        in_frames(|frame| {
            for handle in Handle::all().filter(|handle| frame.is_shown(*handle)) {
                let grip = frame.grip(handle).expect("ahead");
                assert_eq!(frame.pick([handle].into_iter(), grip), Some(handle));
                assert_eq!(frame.pick([handle].into_iter(), grip + 40.0 * RADIUS), None);
                // Another handle may be in front of it.
                grabbed += usize::from(frame.pick(Handle::all(), grip) == Some(handle));
            }
            assert_eq!(frame.pick(Handle::all(), frame.center), Some(Handle::Ground));
            for axis in Axis::ALL {
                let at_middle = [0.0, -1.0, f32::NAN].map(|value| value * frame.radius);
                assert!(at_middle.iter().all(|value| !frame.can_begin(Handle::Scale(axis), *value)));
                assert!(frame.can_begin(Handle::Scale(axis), SQUARE * frame.radius));
                assert!(frame.can_begin(Handle::Move(axis), 0.0));
            }
        });
        assert!(grabbed > 1200, "{grabbed} of about 2,000");
    }

    #[test]
    fn a_handle_is_dragged_by_as_much_as_the_pointer_shows() {
        in_frames(|frame| {
            for handle in Handle::all().filter(|handle| frame.is_shown(*handle)) {
                let axis = frame.axis(handle);
                for part in [-1.1_f32, -0.4, 0.3, 1.2] {
                    let (at, expected) = match handle {
                        Handle::Ground => (frame.origin, 0.0),
                        Handle::Turn(axis) => {
                            let [right, up] = axis.others();
                            (frame.origin + (right * part.cos() + up * part.sin()) * frame.radius, part)
                        }
                        _ => (frame.origin + axis * part * frame.radius, part * frame.radius),
                    };
                    if matches!(handle, Handle::Turn(_)) && axis.dot(frame.sight).abs() < EDGE_ON + 0.1 {
                        continue;
                    }
                    let pointer = frame.view.project(at).expect("ahead");
                    let found = frame.value(handle, pointer).expect("it is there");
                    assert!(
                        (found - expected).abs() < 0.02 * (1.0 + frame.radius),
                        "{handle:?} {found} {expected}"
                    );
                }
            }
        });
    }

    #[test]
    fn a_ring_from_its_edge_turns_with_its_near_side() {
        let camera = perspective();
        let place = Transform::from_xyz(0.0, 0.5, 20.0).looking_at(Vec3::ZERO, Vec3::Y);
        let frame =
            Frame::new(View { camera: &camera, place: place.into(), scale: 1.0 }, Vec3::ZERO, Quat::IDENTITY);
        let frame = frame.expect("it is ahead");
        let ring = Handle::Turn(Axis::Y);
        let value = |x: f32| frame.value(ring, frame.center + Vec2::new(x, 3.0)).expect("it is there");
        // Turning about the up axis, the side near the viewer moves from left to right.
        let turned = value(30.0) - value(-10.0);
        assert!((turned - 40.0 / RADIUS).abs() < 0.01, "{turned}");
        assert!(!frame.is_shown(Handle::Move(Axis::Z)) && frame.is_shown(Handle::Move(Axis::X)));
    }

    #[test]
    fn nothing_is_shown_behind_the_camera() {
        let camera = perspective();
        let view = View { camera: &camera, place: GlobalTransform::IDENTITY, scale: 1.0 };
        assert!(Frame::new(view, Vec3::Z * 5.0, Quat::IDENTITY).is_none());
        assert!(Frame::new(view, Vec3::ZERO, Quat::IDENTITY).is_none());
        assert!(Frame::new(view, Vec3::NAN, Quat::IDENTITY).is_none());
    }
}
