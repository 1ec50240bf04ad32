//! Moves characters and keeps their capsules up to date.

use avian3d::prelude::*;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::schedule::{InternedScheduleLabel, ScheduleLabel};
use bevy::ecs::system::SystemParam;
use bevy::math::Affine3A;
use bevy::prelude::*;

use super::HeldByGround;
use super::character::{Character, CharacterMotion, CharacterSteering};
use super::walking::Walk;
use crate::plugin;

/// Moves characters, by default in `FixedUpdate`.
pub struct CharacterPlugin {
    schedule: InternedScheduleLabel,
}

impl CharacterPlugin {
    /// Moves characters in this schedule, by the `Time` of that schedule.
    pub fn new(schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern() }
    }
}

impl Default for CharacterPlugin {
    fn default() -> Self {
        Self::new(FixedUpdate)
    }
}

/// The systems that move characters. Steer them before.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CharacterSystems;

impl Plugin for CharacterPlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(give_collider)
            .add_observer(forget_size)
            .add_systems(self.schedule, (resize, move_characters).chain().in_set(CharacterSystems));
    }
}

/// The radius and height that a character's collider was made for.
#[derive(Component, Clone, Copy, PartialEq)]
struct Size(f32, f32);

impl Size {
    fn of(character: &Character) -> Self {
        Self(character.radius, character.height)
    }
}

/// Inserts the capsule of a new character. [`resize`] handles one that replaces another.
fn give_collider(
    new: On<Insert, Character>,
    characters: Query<&Character, (Without<Size>, Allow<Disabled>)>,
    mut commands: Commands,
) {
    if let Ok(character) = characters.get(new.entity) {
        commands.entity(new.entity).try_insert((character.collider(), Size::of(character)));
    }
}

/// Lets an entity that stops being a character become one again.
fn forget_size(gone: On<Remove, Character>, mut commands: Commands) {
    commands.entity(gone.entity).try_remove::<Size>();
}

/// Replaces the capsule of a character whose size changed. Its feet stay in place.
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

/// World-space places of characters, which may have parents.
#[derive(SystemParam)]
struct Places<'w, 's> {
    parents: Query<'w, 's, &'static ChildOf>,
    transforms: ParamSet<'w, 's, (plugin::Places<'w, 's>, Query<'w, 's, &'static mut Transform>)>,
}

impl Places<'_, '_> {
    /// The global transform of an entity's parent; `None` without a parent.
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
    // A long frame must not become a leap.
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
        // The solver pushes other bodies by this.
        velocity.set_if_neq(LinearVelocity((place - before) / dt));
    }
}
