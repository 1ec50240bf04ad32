//! Colours, texts, and things to choose from: what all menus and the screen's figures are made of.
//!
//! A menu's items are chosen with the mouse, keys or a gamepad alike; each gets [`Chosen`] or [`Turned`] and observes it.

use bevy::prelude::*;

use crate::player::game_state::{Page, Phase};
use crate::player::input::ReadsDevices;

pub const SHADE: Color = Color::srgba(0.03, 0.035, 0.05, 0.72);
pub const EDGE: Color = Color::srgba(1.0, 1.0, 1.0, 0.16);
pub const WHITE: Color = Color::srgb(0.96, 0.96, 0.94);
pub const GREY: Color = Color::srgb(0.68, 0.70, 0.72);
pub const GOLD: Color = Color::srgb(1.0, 0.80, 0.32);
pub const RED: Color = Color::srgb(1.0, 0.45, 0.35);

/// A line of text.
pub fn text(words: impl Into<String>, size: f32, color: Color) -> impl Bundle {
    (
        Text::new(words),
        TextFont::from_font_size(size),
        TextColor(color),
        TextShadow { offset: vec2(1.0, 1.0), color: Color::srgba(0.0, 0.0, 0.0, 0.6) },
    )
}

/// A dark box with an edge, around whatever lies in it.
pub fn panel(node: Node) -> impl Bundle {
    let node = Node { border: UiRect::all(px(1)), border_radius: BorderRadius::all(px(8)), ..node };
    (node, BackgroundColor(SHADE), BorderColor::all(EDGE))
}

/// A bar that fills from the left. What is filled of it is a node that has `mark`, and a width in percent: 0 at first.
pub fn bar(width: f32, mark: impl Component) -> impl Bundle {
    let track = Node {
        width: px(width),
        height: px(10),
        border: UiRect::all(px(1)),
        border_radius: BorderRadius::all(px(5)),
        ..default()
    };
    let filled = Node {
        width: percent(0),
        height: percent(100),
        border_radius: BorderRadius::all(px(4)),
        ..default()
    };
    (track, BackgroundColor(SHADE), BorderColor::all(EDGE), children![(mark, filled, BackgroundColor(GOLD))])
}

/// All of the window.
pub fn full() -> Node {
    Node { width: percent(100), height: percent(100), position_type: PositionType::Absolute, ..default() }
}

/// Keys that choose the item in focus; so does a gamepad's South.
pub const CHOOSE: [KeyCode; 3] = [KeyCode::Enter, KeyCode::NumpadEnter, KeyCode::Space];

/// Something to choose, by its place in the menu.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
#[require(Button)]
pub struct Item(pub usize);

/// Turns the value of the item above it by this much when it is clicked.
#[derive(Component, Clone, Copy, Debug)]
#[require(Button)]
pub struct Arrow(pub i32);

/// An item was chosen.
#[derive(EntityEvent, Clone, Copy, Debug)]
pub struct Chosen {
    pub entity: Entity,
}

/// An item's value is to be turned up or down.
#[derive(EntityEvent, Clone, Copy, Debug)]
pub struct Turned {
    pub entity: Entity,
    pub by: i32,
}

/// The item that keys and gamepad would choose.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub struct Focus(pub usize);

/// While this is there, neither keys and buttons nor clicks mean anything to menus.
#[derive(Resource)]
pub struct Deaf;

/// An item with one line of text.
pub fn button(order: usize, words: &str, width: f32) -> impl Bundle {
    let node = Node {
        width: px(width),
        padding: UiRect::axes(px(18), px(9)),
        border: UiRect::left(px(4)),
        border_radius: BorderRadius::all(px(4)),
        ..default()
    };
    (
        Item(order),
        node,
        BackgroundColor::DEFAULT,
        BorderColor::all(Color::NONE),
        children![text(words, 22.0, WHITE)],
    )
}

/// In `Update`, when menus answer to the mouse.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Pointing;

/// Makes menus answer.
pub struct UiPlugin;

impl Plugin for UiPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Focus>()
            .add_message::<CursorMoved>()
            .add_systems(
                PreUpdate,
                press_keys
                    .after(ReadsDevices)
                    .run_if(not(in_state(Page::None)))
                    .run_if(not(resource_exists::<Deaf>)),
            )
            .add_systems(Update, fit_window)
            .add_systems(Update, (point.in_set(Pointing), light_up).chain().run_if(not(in_state(Page::None))))
            .add_systems(StateTransition, forget_focus.run_if(state_changed::<Page>))
            // The menus of the pause and of the title are both called that.
            .add_systems(OnEnter(Phase::Title), forget_focus);
    }
}

/// Everything is laid out for 1280 x 720, and as large as the window allows.
fn fit_window(windows: Query<&Window>, page: Res<State<Page>>, mut scale: ResMut<UiScale>) {
    if let Some(window) = windows.iter().next() {
        let fit = scale_for(window.width(), window.height(), **page == Page::None);
        if scale.0 != fit {
            scale.0 = fit;
        }
    }
}

/// How large everything is in a window or a picture. Menus fill it; while someone plays there is room enough to keep what
/// is written legible in a small one.
pub fn scale_for(width: f32, height: f32, plays: bool) -> f32 {
    let fit = (width / 1280.0).min(height / 720.0);
    let least = if plays { (width / 850.0).min(height / 470.0).min(0.75) } else { 0.0 };
    fit.max(least).clamp(0.4, 3.0)
}

fn forget_focus(mut focus: ResMut<Focus>) {
    focus.0 = 0;
}

/// The mouse.
fn point(
    mut commands: Commands,
    items: Query<(Entity, &Interaction), (With<Item>, Changed<Interaction>)>,
    hovered: Query<(&Item, &Interaction)>,
    mut moves: MessageReader<CursorMoved>,
    arrows: Query<(&Arrow, &Interaction, &ChildOf), Changed<Interaction>>,
    parents: Query<&ChildOf>,
    all: Query<&Item>,
    deaf: Option<Res<Deaf>>,
    mut focus: ResMut<Focus>,
) {
    let listens = deaf.is_none();
    for (entity, interaction) in &items {
        if *interaction == Interaction::Pressed && listens {
            commands.trigger(Chosen { entity });
        }
    }
    // A page that opens below a mouse that rests lights its first item, and not the one that happens to be there.
    if moves.read().count() > 0
        && let Some((item, _)) = hovered.iter().find(|(_, interaction)| **interaction == Interaction::Hovered)
    {
        focus.0 = item.0;
    }
    for (arrow, interaction, parent) in &arrows {
        let owner = std::iter::once(parent.parent()).chain(parents.iter_ancestors(parent.parent()));
        let Some((owner, item)) = owner.filter_map(|owner| Some((owner, all.get(owner).ok()?))).next() else {
            continue;
        };
        if *interaction != Interaction::None {
            focus.0 = item.0;
        }
        if *interaction == Interaction::Pressed && listens {
            commands.trigger(Turned { entity: owner, by: arrow.0 });
        }
    }
}

/// Which way a stick is pushed along an axis: a way that it was pushed lasts until it is let go.
fn tilt(now: f32, before: i32) -> i32 {
    let enough = |way: f32| now * way > if before as f32 == way { 0.35 } else { 0.65 };
    i32::from(enough(1.0)) - i32::from(enough(-1.0))
}

/// Arrow keys and Enter, or a gamepad's.
fn press_keys(
    mut commands: Commands,
    keys: Res<ButtonInput<KeyCode>>,
    pads: Query<&Gamepad>,
    items: Query<(Entity, &Item)>,
    mut focus: ResMut<Focus>,
    mut pushed: Local<IVec2>,
) {
    use GamepadButton as G;
    use KeyCode as K;
    let pressed = |some: &[KeyCode], button: GamepadButton| {
        keys.any_just_pressed(some.iter().copied()) || pads.iter().any(|pad| pad.just_pressed(button))
    };
    let stick = pads.iter().map(Gamepad::left_stick).sum::<Vec2>();
    let tilted = IVec2::new(tilt(stick.x, pushed.x), tilt(stick.y, pushed.y));
    let before = std::mem::replace(&mut *pushed, tilted);
    let is_pushed = |way: IVec2| {
        let along = |tilt: IVec2| tilt * way.abs() == way;
        along(tilted) && !along(before)
    };
    let count = items.iter().count();
    if count == 0 {
        return;
    }
    if pressed(&[K::ArrowDown, K::KeyS], G::DPadDown) || is_pushed(IVec2::NEG_Y) {
        focus.0 = (focus.0 + 1) % count;
    }
    if pressed(&[K::ArrowUp, K::KeyW], G::DPadUp) || is_pushed(IVec2::Y) {
        focus.0 = (focus.0 + count - 1) % count;
    }
    let Some((entity, _)) = items.iter().find(|(_, item)| item.0 == focus.0) else { return };
    if pressed(&CHOOSE, G::South) {
        commands.trigger(Chosen { entity });
    }
    for (keys, button, by) in
        [(&[K::ArrowRight, K::KeyD], G::DPadRight, 1), (&[K::ArrowLeft, K::KeyA], G::DPadLeft, -1)]
    {
        if pressed(keys, button) || is_pushed(IVec2::X * by) {
            commands.trigger(Turned { entity, by });
        }
    }
}

/// The item in focus is lit.
fn light_up(focus: Res<Focus>, mut items: Query<(&Item, &mut BackgroundColor, &mut BorderColor)>) {
    for (item, mut ground, mut edge) in &mut items {
        let lit = item.0 == focus.0;
        ground.set_if_neq(BackgroundColor(if lit {
            Color::srgba(1.0, 0.80, 0.32, 0.16)
        } else {
            Color::NONE
        }));
        edge.set_if_neq(BorderColor::all(if lit { GOLD } else { Color::NONE }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pushed_stick_is_one_step_until_it_is_let_go() {
        let mut steps = Vec::new();
        let mut before = 0;
        for now in [0.1, 0.5, 0.7, 1.0, 0.6, 0.5, 0.2, 0.7, 0.0, -0.9, -0.5, 0.8] {
            let after = tilt(now, before);
            if after != before && after != 0 {
                steps.push(after);
            }
            before = after;
        }
        assert_eq!(steps, [1, 1, -1, 1]);
    }

    #[test]
    fn what_is_written_over_the_game_stays_legible_in_a_small_window() {
        for (width, height, menu, game) in [
            (1280.0, 720.0, 1.0, 1.0),
            (2560.0, 1440.0, 2.0, 2.0),
            (640.0, 360.0, 0.5, 0.75),
            (960.0, 540.0, 0.75, 0.75),
            (64.0, 64.0, 0.4, 0.4),
        ] {
            let scales = [false, true].map(|plays| scale_for(width, height, plays));
            assert!(
                (scales[0] - menu).abs() < 1e-3 && (scales[1] - game).abs() < 0.02,
                "{width}: {scales:?}"
            );
        }
    }
}
