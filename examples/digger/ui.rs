//! Colours, texts, and things to choose from: what all menus and the screen's figures are made of.
//!
//! A menu's items are chosen with the mouse, keys or a gamepad alike; each gets [`Chosen`] or [`Turned`] and observes it.

use bevy::prelude::*;

use crate::input::ReadsDevices;
use crate::phase::Page;

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

/// All of the window.
pub fn full() -> Node {
    Node { width: percent(100), height: percent(100), position_type: PositionType::Absolute, ..default() }
}

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

/// While this is there, keys and buttons mean nothing to menus.
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

/// Makes menus answer.
pub struct UiPlugin;

impl Plugin for UiPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Focus>()
            .add_systems(
                PreUpdate,
                press_keys
                    .after(ReadsDevices)
                    .run_if(not(in_state(Page::None)))
                    .run_if(not(resource_exists::<Deaf>)),
            )
            .add_systems(Update, fit_window)
            .add_systems(Update, (point, light_up).chain().run_if(not(in_state(Page::None))))
            .add_systems(StateTransition, forget_focus.run_if(state_changed::<Page>));
    }
}

/// Everything is laid out for 1280 x 720, and as large as the window allows.
fn fit_window(windows: Query<&Window, Changed<Window>>, mut scale: ResMut<UiScale>) {
    if let Some(window) = windows.iter().next() {
        scale.0 = scale_for(window.width(), window.height());
    }
}

/// How large everything is in a window or a picture.
pub fn scale_for(width: f32, height: f32) -> f32 {
    (width / 1280.0).min(height / 720.0).clamp(0.4, 3.0)
}

fn forget_focus(mut focus: ResMut<Focus>) {
    focus.0 = 0;
}

/// The mouse.
fn point(
    mut commands: Commands,
    items: Query<(Entity, &Item, &Interaction), Changed<Interaction>>,
    arrows: Query<(&Arrow, &Interaction, &ChildOf), Changed<Interaction>>,
    parents: Query<&ChildOf>,
    all: Query<&Item>,
    mut focus: ResMut<Focus>,
) {
    for (entity, item, interaction) in &items {
        match interaction {
            Interaction::Pressed => commands.trigger(Chosen { entity }),
            Interaction::Hovered => focus.0 = item.0,
            Interaction::None => {}
        }
    }
    for (arrow, interaction, parent) in &arrows {
        let owner = std::iter::once(parent.parent()).chain(parents.iter_ancestors(parent.parent()));
        let Some((owner, item)) = owner.filter_map(|owner| Some((owner, all.get(owner).ok()?))).next() else {
            continue;
        };
        if *interaction != Interaction::None {
            focus.0 = item.0;
        }
        if *interaction == Interaction::Pressed {
            commands.trigger(Turned { entity: owner, by: arrow.0 });
        }
    }
}

/// Arrow keys and Enter, or a gamepad's.
fn press_keys(
    mut commands: Commands,
    keys: Res<ButtonInput<KeyCode>>,
    pads: Query<&Gamepad>,
    items: Query<(Entity, &Item)>,
    mut focus: ResMut<Focus>,
) {
    use GamepadButton as G;
    use KeyCode as K;
    let pressed = |some: &[KeyCode], button: GamepadButton| {
        keys.any_just_pressed(some.iter().copied()) || pads.iter().any(|pad| pad.just_pressed(button))
    };
    let count = items.iter().count();
    if count == 0 {
        return;
    }
    if pressed(&[K::ArrowDown, K::KeyS], G::DPadDown) {
        focus.0 = (focus.0 + 1) % count;
    }
    if pressed(&[K::ArrowUp, K::KeyW], G::DPadUp) {
        focus.0 = (focus.0 + count - 1) % count;
    }
    let Some((entity, _)) = items.iter().find(|(_, item)| item.0 == focus.0) else { return };
    if pressed(&[K::Enter, K::NumpadEnter, K::Space], G::South) {
        commands.trigger(Chosen { entity });
    }
    for (keys, button, by) in
        [(&[K::ArrowRight, K::KeyD], G::DPadRight, 1), (&[K::ArrowLeft, K::KeyA], G::DPadLeft, -1)]
    {
        if pressed(keys, button) {
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
