//! What a tool would change, drawn on the ground.

#[path = "../../shared/gizmos.rs"]
mod gizmos;

use bevy::prelude::*;
use bevy_burrow::debug::draw_shape;
use bevy_burrow::prelude::*;

use crate::player::Playing;
use crate::player::game_state::Phase;
use crate::tools::inventory::Inventory;
use crate::tools::shape::{Aim, Form};
use crate::tools::voxel_cost;
use crate::tools::{Hand, Tool};
use crate::ui::settings::Settings;
use crate::ui::widgets::RED;

/// Shows what would be changed.
pub struct PreviewPlugin;

impl Plugin for PreviewPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Prospect>().add_systems(Startup, gizmos::show_through_ground).add_systems(
            Update,
            (foresee, show_preview).chain().in_set(Playing).run_if(in_state(Phase::Playing)),
        );
    }
}

/// What is wished for, with all that decides how large it gets.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Wish {
    tool: Tool,
    form: Form,
    aim: Aim,
    radius: f32,
    /// Voxels of its material that are left; `None` where it takes none.
    stock: Option<i64>,
}

impl Wish {
    fn new(hand: &Hand, aim: Aim, settings: &Settings, inventory: &Inventory) -> Self {
        let costs = settings.survival && matches!(hand.tool, Tool::Builder | Tool::Painter);
        let stock = costs.then(|| inventory.free(hand.material));
        Self { tool: hand.tool, form: hand.form, aim, radius: hand.radius(hand.tool), stock }
    }

    fn shape(&self, radius: f32) -> Shape {
        match self.tool {
            Tool::Builder => self.form.shape(&self.aim, radius),
            _ => Shape::sphere(self.aim.place, radius),
        }
    }

    /// The radius that comes of it; `None` where too little is left for any.
    fn granted(&self) -> Option<f32> {
        let Some(stock) = self.stock else { return Some(self.radius) };
        let afforded = voxel_cost::affordable(self.tool, self.radius, stock, |radius| self.shape(radius));
        afforded.map(|(radius, _)| radius)
    }
}

/// The wish in hand, and the radius that comes of it.
#[derive(Resource, Default)]
struct Prospect(Option<(Wish, Option<f32>)>);

/// Voxels are counted only for another wish: a large body has thousands.
fn foresee(
    hand: Res<Hand>,
    settings: Res<Settings>,
    inventory: Res<Inventory>,
    mut prospect: ResMut<Prospect>,
) {
    let aim = hand.aim.filter(|_| hand.preview);
    let wish = aim.map(|aim| Wish::new(&hand, aim, &settings, &inventory));
    if prospect.0.map(|(last, _)| last) != wish {
        prospect.0 = wish.map(|wish| (wish, wish.granted()));
    }
}

/// The rim of what a tool would change, laid on the ground, or the body that it would build; in red what is wished for
/// where there is nothing to make it of.
fn show_preview(prospect: Res<Prospect>, mut gizmos: Gizmos) {
    let Some((wish, granted)) = prospect.0 else { return };
    let colour = if granted.is_some() { Color::srgb(1.0, 0.85, 0.25) } else { RED }.with_alpha(0.75);
    let radius = granted.unwrap_or(wish.radius);
    match wish.tool {
        Tool::Pickaxe | Tool::Shovel | Tool::Drill | Tool::Painter => {
            let Aim { place, normal, .. } = wish.aim;
            let flat = Quat::from_rotation_arc(Vec3::Z, normal.normalize_or(Vec3::Y));
            gizmos.circle(Isometry3d::new(place + normal * 0.05, flat), radius, colour).resolution(48);
        }
        Tool::Builder => draw_shape(&mut gizmos, &wish.shape(radius), colour),
        Tool::Bomb | Tool::Lamp | Tool::Ball => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::landscape::{CONCRETE, ROCK};

    /// A hand that would build a large ball of concrete, of which there is some.
    fn app() -> App {
        let mut app = App::new();
        app.insert_resource(Hand::new(&Settings::default()))
            .init_resource::<Settings>()
            .init_resource::<Inventory>()
            .init_resource::<Prospect>()
            .add_systems(Update, foresee);
        let mut hand = app.world_mut().resource_mut::<Hand>();
        hand.set_radius(Tool::Builder, 12.0);
        (hand.tool, hand.material) = (Tool::Builder, CONCRETE);
        hand.aim = Some(Aim { place: Vec3::splat(20.0), along: Vec3::NEG_Y, normal: Vec3::Y });
        app
    }

    fn hand(app: &mut App) -> Mut<'_, Hand> {
        app.world_mut().resource_mut::<Hand>()
    }

    /// What is foreseen after a frame.
    fn granted(app: &mut App) -> Option<f32> {
        app.update();
        app.world().resource::<Prospect>().0.and_then(|(_, radius)| radius)
    }

    #[test]
    fn what_is_seen_is_what_the_stock_allows() {
        let mut app = app();
        let stock = app.world().resource::<Inventory>().free(CONCRETE);
        for tool in [Tool::Builder, Tool::Painter] {
            hand(&mut app).tool = tool;
            hand(&mut app).set_radius(tool, 12.0);
            let radius = granted(&mut app).expect("enough for a small one");
            let voxels = voxel_cost::voxels(&Shape::sphere(Vec3::splat(20.0), radius));
            assert!(voxels <= stock && 10 * voxels > 9 * stock, "{tool:?}: {voxels} of {stock} at {radius}");
        }
        hand(&mut app).material = ROCK;
        assert_eq!(granted(&mut app), None, "there is none");
        app.world_mut().resource_mut::<Settings>().survival = false;
        assert_eq!(granted(&mut app), Some(12.0), "it costs nothing");
        app.world_mut().resource_mut::<Settings>().survival = true;
        hand(&mut app).tool = Tool::Pickaxe;
        assert_eq!(granted(&mut app), Some(hand(&mut app).radius(Tool::Pickaxe)), "digging costs nothing");
    }

    #[test]
    fn voxels_are_counted_for_another_wish_only() {
        let mut app = app();
        let mut counted = |change: fn(&mut App)| {
            change(&mut app);
            app.update();
            app.world().get_resource_change_ticks::<Prospect>().map(|ticks| ticks.changed)
        };
        let first = counted(|_| {});
        // It is aimed anew in every frame.
        let same = counted(|app| hand(app).set_changed());
        assert_eq!(same, first);
        let moved = counted(|app| {
            let mut hand = hand(app);
            hand.aim = hand.aim.map(|aim| Aim { place: aim.place + Vec3::X, ..aim });
        });
        assert_ne!(moved, first);
        let spent = counted(|app| {
            app.world_mut().resource_mut::<Inventory>().gain(CONCRETE, -100);
        });
        assert_ne!(spent, moved);
    }
}
