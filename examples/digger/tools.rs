//! What the player digs, builds and paints with: each use is a [`Brush`] message, the game's only way into the ground.

use std::time::Duration;

use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::landscape::{GRASS, MATERIALS};
use crate::light::Eyes;
use crate::player::{UsesMouse, mouse_is_captured};

/// How far the tools reach, in metres.
const REACH: f32 = 60.0;
/// The least and greatest radius.
const RADII: (f32, f32) = (1.0, 12.0);
/// While a button is held, a tool works this often.
const PERIOD: Duration = Duration::from_millis(120);

/// The form of what is dug or built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    #[default]
    Sphere,
    Cube,
    /// From where the player looks further along the look: for tunnels.
    Capsule,
}

impl Form {
    fn next(self) -> Self {
        match self {
            Self::Sphere => Self::Cube,
            Self::Cube => Self::Capsule,
            Self::Capsule => Self::Sphere,
        }
    }

    /// The shape of this form for a look that met the ground.
    fn shape(self, aim: &Aim, radius: f32) -> Shape {
        match self {
            Self::Sphere => Shape::sphere(aim.place, radius),
            Self::Cube => Shape::cuboid(aim.place, Vec3::splat(radius)),
            Self::Capsule => Shape::capsule(aim.place, aim.place + aim.along * 2.0 * radius, radius),
        }
    }
}

/// Where the look meets the ground.
#[derive(Clone, Copy, Debug)]
pub struct Aim {
    pub place: Vec3,
    pub along: Vec3,
}

/// The tools in hand.
#[derive(Resource)]
pub struct Tools {
    pub form: Form,
    pub radius: f32,
    pub material: MaterialId,
    /// What is aimed at, if it is in reach.
    pub aim: Option<Aim>,
    /// Show what a dig would take?
    pub preview: bool,
    cooldown: Timer,
    uses: u32,
}

impl Default for Tools {
    fn default() -> Self {
        let cooldown = Timer::new(PERIOD, TimerMode::Once);
        Self {
            form: Form::Sphere,
            radius: 3.0,
            material: GRASS,
            aim: None,
            preview: false,
            cooldown,
            uses: 0,
        }
    }
}

/// Digs, builds and paints.
pub struct ToolsPlugin;

impl Plugin for ToolsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Tools>().add_systems(Startup, show_gizmos_through_ground).add_systems(
            Update,
            (aim, (choose, work).chain().run_if(mouse_is_captured), show_preview).chain().in_set(UsesMouse),
        );
    }
}

fn aim(terrains: Terrains, eyes: Query<&Transform, With<Eyes>>, mut tools: ResMut<Tools>) {
    let Ok(eyes) = eyes.single() else { return };
    let along = eyes.forward();
    let hit = terrains.raycast(Ray3d::new(eyes.translation, along), REACH);
    tools.aim = hit.map(|hit| Aim { place: hit.position, along: *along });
}

fn choose(keys: Res<ButtonInput<KeyCode>>, wheel: Res<AccumulatedMouseScroll>, mut tools: ResMut<Tools>) {
    const DIGITS: [KeyCode; 8] = [
        KeyCode::Digit1,
        KeyCode::Digit2,
        KeyCode::Digit3,
        KeyCode::Digit4,
        KeyCode::Digit5,
        KeyCode::Digit6,
        KeyCode::Digit7,
        KeyCode::Digit8,
    ];
    let pressed = DIGITS.into_iter().zip(MATERIALS).find(|&(digit, _)| keys.just_pressed(digit));
    if let Some((_, (material, _))) = pressed {
        tools.material = material;
    }
    if keys.just_pressed(KeyCode::KeyC) {
        tools.form = tools.form.next();
    }
    let lines = match wheel.unit {
        MouseScrollUnit::Line => wheel.delta.y,
        MouseScrollUnit::Pixel => wheel.delta.y / 40.0,
    };
    tools.radius = (tools.radius + 0.5 * lines).clamp(RADII.0, RADII.1);
}

/// Left digs, right builds, the middle button or G paints.
fn work(
    time: Res<Time>,
    mouse: Res<ButtonInput<MouseButton>>,
    keys: Res<ButtonInput<KeyCode>>,
    mut tools: ResMut<Tools>,
    mut brushes: MessageWriter<Brush>,
) {
    tools.cooldown.tick(time.delta());
    let Some(aim) = tools.aim.filter(|_| tools.cooldown.is_finished()) else { return };
    let shape = tools.form.shape(&aim, tools.radius);
    let brush = if mouse.pressed(MouseButton::Left) {
        // Bumps as large as the tool allows make walls look broken, not milled.
        let amplitude = 0.12 * tools.radius.min(6.0);
        Brush::dig(shape).with_roughness(Roughness::new(amplitude, 1.0 + tools.radius, 1))
    } else if mouse.pressed(MouseButton::Right) {
        Brush::add(shape, tools.material)
    } else if mouse.pressed(MouseButton::Middle) || keys.pressed(KeyCode::KeyG) {
        Brush::paint(shape, tools.material)
    } else {
        return;
    };
    tools.uses += 1;
    brushes.write(brush.with_tag(tools.uses.into()));
    tools.cooldown.reset();
}

/// A brush is half inside the ground, and all of it should be seen.
fn show_gizmos_through_ground(mut store: ResMut<GizmoConfigStore>) {
    let (config, _) = store.config_mut::<DefaultGizmoConfigGroup>();
    config.depth_bias = -1.0;
}

fn show_preview(tools: Res<Tools>, mut gizmos: Gizmos) {
    let Some(aim) = tools.aim.filter(|_| tools.preview) else { return };
    let colour = Color::srgb(1.0, 0.85, 0.25);
    let radius = tools.radius;
    match tools.form {
        Form::Sphere => {
            gizmos.sphere(aim.place, radius, colour).resolution(48);
        }
        Form::Cube => {
            gizmos.cube(Transform::from_translation(aim.place).with_scale(Vec3::splat(2.0 * radius)), colour)
        }
        Form::Capsule => {
            let end = aim.place + aim.along * 2.0 * radius;
            gizmos.sphere(aim.place, radius, colour).resolution(32);
            gizmos.sphere(end, radius, colour).resolution(32);
            gizmos.line(aim.place, end, colour);
        }
    }
}
