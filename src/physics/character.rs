//! A body that walks: a capsule that walks, jumps, steps and slides over ground that is being dug.

use avian3d::prelude::*;
use bevy::ecs::schedule::{InternedScheduleLabel, ScheduleLabel};
use bevy::ecs::system::SystemParam;
use bevy::math::Affine3A;
use bevy::prelude::*;

use super::HeldByGround;
use super::walking::Walk;

/// A walking body: a kinematic capsule for avian, moved by its [`CharacterSteering`].
///
/// Its `Transform` is at the capsule's middle; [`feet`](Self::feet) and [`eyes`](Self::eyes) are measured from there. Below
/// a parent it is carried along, and walks in the world all the same. Change its height, and its feet stay where they are:
/// a game that lets it stand up again makes sure first that there is room.
/// [`CharacterPlugin`] moves it; with avian's `TransformInterpolation` beside it, it moves smoothly at any frame rate. It
/// needs colliders under it: give it, or the camera that follows it, a [`ColliderSource`](super::ColliderSource).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::physics::{Character, CharacterSteering, ColliderSource};
/// fn spawn(mut commands: Commands) {
///     let character = Character::default();
///     let place = character.standing_at(Vec3::new(20.0, 8.0, 20.0));
///     commands.spawn((character, place, ColliderSource::default()));
/// }
///
/// fn steer(keys: Res<ButtonInput<KeyCode>>, mut characters: Query<&mut CharacterSteering>) {
///     for mut steering in &mut characters {
///         steering.direction = if keys.pressed(KeyCode::KeyW) { Vec2::NEG_Y } else { Vec2::ZERO };
///         steering.jump = keys.pressed(KeyCode::Space);
///     }
/// }
/// ```
#[derive(Component, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component, Default)]
#[require(
    CharacterSteering,
    CharacterMotion,
    Transform,
    Visibility,
    RigidBody::Kinematic,
    CustomPositionIntegration,
    SpeculativeMargin(0.0)
)]
pub struct Character {
    /// Half the capsule's width, in metres.
    pub radius: f32,
    /// From the soles to the top of the head, in metres.
    pub height: f32,
    /// From the soles to the eyes, in metres.
    pub eye_height: f32,
    /// Metres per second.
    pub walk_speed: f32,
    /// Metres per second, in a hurry.
    pub run_speed: f32,
    /// How high a jump lifts the soles, in metres.
    pub jump_height: f32,
    /// Metres per second squared, downwards.
    pub gravity: f32,
    /// The fastest fall, in metres per second.
    pub fastest_fall: f32,
    /// The highest step that is walked up without a jump, in metres.
    pub step_height: f32,
    /// The steepest ground that can be stood on, in radians.
    pub steepest: f32,
    /// How fast the velocity follows the steering on the ground, per second.
    pub grip: f32,
    /// How fast it does so in the air.
    pub air_grip: f32,
}

impl Default for Character {
    fn default() -> Self {
        Self {
            radius: 0.4,
            height: 1.8,
            eye_height: 1.7,
            walk_speed: 5.0,
            run_speed: 10.0,
            jump_height: 1.4,
            gravity: 16.0,
            fastest_fall: 50.0,
            step_height: 0.6,
            steepest: 1.0,
            grip: 12.0,
            air_grip: 2.5,
        }
    }
}

impl Character {
    /// Where to put a character that is to stand at `feet`.
    pub fn standing_at(&self, feet: Vec3) -> Transform {
        Transform::from_translation(feet + Vec3::Y * (self.height / 2.0))
    }

    /// The lowest point of a character whose middle is here.
    pub fn feet(&self, middle: Vec3) -> Vec3 {
        middle - Vec3::Y * (self.height / 2.0)
    }

    /// Between the eyes of a character whose middle is here.
    pub fn eyes(&self, middle: Vec3) -> Vec3 {
        self.feet(middle) + Vec3::Y * self.eye_height
    }

    /// The capsule.
    pub fn collider(&self) -> Collider {
        let radius = self.radius.max(0.01);
        Collider::capsule(radius, (self.height - 2.0 * radius).max(0.01))
    }
}

/// What a character wants.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq)]
#[reflect(Component, Default)]
pub struct CharacterSteering {
    /// Where to, as (x, z) of the world; longer than 1 counts as 1.
    pub direction: Vec2,
    /// In a hurry?
    pub run: bool,
    /// Off the ground, if on it?
    pub jump: bool,
}

/// How a character moves.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq)]
#[reflect(Component, Default)]
pub struct CharacterMotion {
    /// Metres per second.
    pub velocity: Vec3,
    /// Does it stand on something?
    pub grounded: bool,
    /// The normal of what it stands on, if it does.
    pub ground_normal: Vec3,
}

/// Moves characters, in `FixedUpdate` unless told otherwise.
///
/// A game that wants them elsewhere gives the schedule; time is that of the schedule.
pub struct CharacterPlugin {
    schedule: InternedScheduleLabel,
}

impl CharacterPlugin {
    /// Moves characters in this schedule.
    pub fn new(schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern() }
    }
}

impl Default for CharacterPlugin {
    fn default() -> Self {
        Self::new(FixedUpdate)
    }
}

/// Where characters are moved; steer them before.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CharacterSystems;

impl Plugin for CharacterPlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(give_collider)
            .add_observer(forget_size)
            .add_systems(self.schedule, (resize, move_characters).chain().in_set(CharacterSystems));
    }
}

/// What a character's collider was made for: radius and height.
#[derive(Component, Clone, Copy, PartialEq)]
struct Size(f32, f32);

impl Size {
    fn of(character: &Character) -> Self {
        Self(character.radius, character.height)
    }
}

/// A new character gets its capsule; what becomes of one that takes another's place is [`resize`]'s.
fn give_collider(
    new: On<Insert, Character>,
    characters: Query<&Character, Without<Size>>,
    mut commands: Commands,
) {
    if let Ok(character) = characters.get(new.entity) {
        commands.entity(new.entity).try_insert((character.collider(), Size::of(character)));
    }
}

/// Who is no character any more may become one as if it had never been.
fn forget_size(gone: On<Remove, Character>, mut commands: Commands) {
    commands.entity(gone.entity).try_remove::<Size>();
}

/// A character whose size changed gets another capsule; its feet stay.
fn resize(
    mut commands: Commands,
    mut changed: Query<(Entity, &Character, &mut Size), Changed<Character>>,
    mut places: Places,
) {
    for (entity, character, mut size) in &mut changed {
        let taller = character.height - size.1;
        if size.set_if_neq(Size::of(character)) {
            commands.entity(entity).try_insert(character.collider());
            if let Some(middle) = places.get(entity) {
                places.set(entity, middle + Vec3::Y * (taller / 2.0));
            }
        }
    }
}

/// Where characters are in the world, whatever they are children of.
#[derive(SystemParam)]
struct Places<'w, 's> {
    parents: Query<'w, 's, &'static ChildOf>,
    transforms: ParamSet<'w, 's, (TransformHelper<'w, 's>, Query<'w, 's, &'static mut Transform>)>,
}

impl Places<'_, '_> {
    /// From the space that an entity's `Transform` counts in to the world; `None` where that is the same.
    fn frame(&mut self, entity: Entity) -> Option<Affine3A> {
        let parent = self.parents.get(entity).ok()?.parent();
        Some(self.transforms.p0().compute_global_transform(parent).ok()?.affine())
    }

    fn get(&mut self, entity: Entity) -> Option<Vec3> {
        let frame = self.frame(entity);
        let place = self.transforms.p1().get(entity).ok()?.translation;
        Some(frame.map_or(place, |frame| frame.transform_point3(place)))
    }

    fn set(&mut self, entity: Entity, place: Vec3) {
        let frame = self.frame(entity);
        let place = frame.map_or(place, |frame| frame.inverse().transform_point3(place));
        if place.is_finite()
            && let Ok(mut transform) = self.transforms.p1().get_mut(entity)
        {
            transform.translation = place;
        }
    }
}

fn move_characters(
    time: Res<Time>,
    mover: MoveAndSlide,
    mut places: Places,
    mut characters: Query<
        (
            Entity,
            &Character,
            &CharacterSteering,
            &mut CharacterMotion,
            &mut LinearVelocity,
            &Collider,
            Option<&RigidBodyColliders>,
            Option<&CollisionLayers>,
        ),
        Without<HeldByGround>,
    >,
) {
    // A hiccup of the machine must not become a leap.
    let dt = time.delta_secs().min(0.25);
    if dt <= 0.0 {
        return;
    }
    for (entity, character, steering, mut motion, mut velocity, collider, own, layers) in &mut characters {
        let Some(before) = places.get(entity).filter(|place| place.is_finite()) else { continue };
        let own = own.into_iter().flatten().chain([entity]);
        let walk = Walk::new(&mover, collider, layers, character, own);
        let (place, after) = walk.advance(before, *motion, steering, dt);
        motion.set_if_neq(after);
        if place != before {
            places.set(entity, place);
        }
        // What the solver shows to bodies that are in the way.
        velocity.set_if_neq(LinearVelocity((place - before) / dt));
    }
}
