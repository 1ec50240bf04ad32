//! What the player aims at, and the preview of what the tool would change there.

#[path = "../../shared/gizmos.rs"]
mod gizmos;

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use serde::{Deserialize, Serialize};

use crate::player::PlayerControlSystems;
use crate::player::game_state::GameState;
use crate::tools::digging::affordable_radius;
use crate::tools::inventory::Inventory;
use crate::tools::{Hand, Tool, cycle};
use crate::ui::settings::Settings;
use crate::ui::texts;
use crate::ui::widgets::RED;

/// Where the camera's line of sight meets the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    pub point: Vec3,
    /// The line of sight.
    pub direction: Vec3,
    /// The ground's normal.
    pub normal: Vec3,
}

/// The shape of what is built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BuildShape {
    #[default]
    Sphere,
    Cube,
    /// A capsule along the line of sight.
    Beam,
}

impl BuildShape {
    pub fn next(self) -> Self {
        cycle(&[Self::Sphere, Self::Cube, Self::Beam], self, 1)
    }

    pub const fn label(self) -> &'static str {
        texts::SHAPES[self as usize]
    }

    /// The brush's shape for this aim.
    pub fn at(self, aim: &Aim, radius: f32) -> Shape {
        match self {
            Self::Sphere => Shape::sphere(aim.point, radius),
            Self::Cube => Shape::cuboid(aim.point, Vec3::splat(radius)),
            Self::Beam => Shape::capsule(aim.point, aim.point + aim.direction * 3.0 * radius, radius),
        }
    }
}

/// Draws the preview.
pub struct AimPlugin;

impl Plugin for AimPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Preview>().add_systems(Startup, gizmos::show_through_ground).add_systems(
            Update,
            (update_preview, draw_preview)
                .chain()
                .in_set(PlayerControlSystems)
                .run_if(in_state(GameState::Playing)),
        );
    }
}

/// All that decides what the preview shows.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PreviewInput {
    tool: Tool,
    shape: BuildShape,
    aim: Aim,
    radius: f32,
    /// Available voxels of the material; `None` if the tool uses none.
    available: Option<i64>,
}

impl PreviewInput {
    fn shape_at(&self, radius: f32) -> Shape {
        match self.tool {
            Tool::Builder => self.shape.at(&self.aim, radius),
            _ => Shape::sphere(self.aim.point, radius),
        }
    }
}

/// The latest input, and the radius that the inventory allows; `None` if it allows none.
#[derive(Resource, Default)]
struct Preview(Option<(PreviewInput, Option<f32>)>);

/// Voxels are counted only if the input changed, because a large brush has thousands.
fn update_preview(
    hand: Res<Hand>,
    settings: Res<Settings>,
    inventory: Res<Inventory>,
    mut preview: ResMut<Preview>,
) {
    let uses_material = settings.survival && matches!(hand.tool, Tool::Builder | Tool::Painter);
    let input = hand.aim.filter(|_| hand.preview).map(|aim| PreviewInput {
        tool: hand.tool,
        shape: hand.shape,
        aim,
        radius: hand.radius(hand.tool),
        available: uses_material.then(|| inventory.available(hand.material)),
    });
    if preview.0.map(|(last, _)| last) != input {
        preview.0 = input.map(|input| {
            let radius = match input.available {
                Some(available) => {
                    let shape = |radius| input.shape_at(radius);
                    affordable_radius(input.tool, input.radius, available, shape).map(|(radius, _)| radius)
                }
                None => Some(input.radius),
            };
            (input, radius)
        });
    }
}

/// Draws a circle on the ground, or the shape that would be built. It is red if there is no material for it.
fn draw_preview(preview: Res<Preview>, mut gizmos: Gizmos) {
    let Some((input, affordable)) = preview.0 else { return };
    let color = if affordable.is_some() { Color::srgb(1.0, 0.85, 0.25) } else { RED }.with_alpha(0.75);
    let radius = affordable.unwrap_or(input.radius);
    match input.tool {
        Tool::Pickaxe | Tool::Shovel | Tool::Drill | Tool::Painter => {
            let Aim { point, normal, .. } = input.aim;
            let rotation = Quat::from_rotation_arc(Vec3::Z, normal.normalize_or(Vec3::Y));
            gizmos.circle(Isometry3d::new(point + normal * 0.05, rotation), radius, color).resolution(48);
        }
        Tool::Builder => input.shape_at(radius).draw(&mut gizmos, color),
        Tool::Bomb | Tool::Lamp | Tool::Ball => {}
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::world::landscape::{CONCRETE, ROCK};

    /// A builder aims a large sphere of concrete, with some concrete in the inventory.
    fn app() -> App {
        let mut app = App::new();
        app.insert_resource(Hand::new(&Settings::default()))
            .init_resource::<Settings>()
            .init_resource::<Inventory>()
            .init_resource::<Preview>()
            .add_systems(Update, update_preview);
        let mut hand = app.world_mut().resource_mut::<Hand>();
        hand.set_radius(Tool::Builder, 12.0);
        (hand.tool, hand.material) = (Tool::Builder, CONCRETE);
        hand.aim = Some(Aim { point: Vec3::splat(20.0), direction: Vec3::NEG_Y, normal: Vec3::Y });
        app
    }

    fn hand(app: &mut App) -> Mut<'_, Hand> {
        app.world_mut().resource_mut::<Hand>()
    }

    /// The previewed radius after a frame.
    fn radius(app: &mut App) -> Option<f32> {
        app.update();
        app.world().resource::<Preview>().0.and_then(|(_, radius)| radius)
    }

    #[test]
    fn the_preview_is_as_large_as_the_inventory_allows() {
        let mut app = app();
        let available = app.world().resource::<Inventory>().available(CONCRETE);
        for tool in [Tool::Builder, Tool::Painter] {
            hand(&mut app).tool = tool;
            hand(&mut app).set_radius(tool, 12.0);
            let radius = radius(&mut app).expect("enough for a small one");
            let brush = Brush::add(Shape::sphere(Vec3::splat(20.0), radius), CONCRETE);
            let voxels = brush.voxel_count().expect("a valid brush") as i64;
            assert!(voxels <= available && 10 * voxels > 8 * available, "{tool:?}: {voxels} of {available}");
        }
        hand(&mut app).material = ROCK;
        assert_eq!(radius(&mut app), None, "there is no rock");
        app.world_mut().resource_mut::<Settings>().survival = false;
        assert_eq!(radius(&mut app), Some(12.0), "it costs nothing");
        app.world_mut().resource_mut::<Settings>().survival = true;
        hand(&mut app).tool = Tool::Pickaxe;
        assert_eq!(radius(&mut app), Some(hand(&mut app).radius(Tool::Pickaxe)), "digging costs nothing");
    }

    #[test]
    fn the_preview_is_updated_only_if_something_changed() {
        let mut app = app();
        let mut last_change = |change: fn(&mut App)| {
            change(&mut app);
            app.update();
            app.world().get_resource_change_ticks::<Preview>().map(|ticks| ticks.changed)
        };
        let first = last_change(|_| {});
        // The aim is computed in every frame.
        assert_eq!(last_change(|app| hand(app).set_changed()), first);
        let moved = last_change(|app| {
            let mut hand = hand(app);
            hand.aim = hand.aim.map(|aim| Aim { point: aim.point + Vec3::X, ..aim });
        });
        assert_ne!(moved, first);
        let spent = last_change(|app| app.world_mut().resource_mut::<Inventory>().gain(CONCRETE, -100));
        assert_ne!(spent, moved);
    }
}
