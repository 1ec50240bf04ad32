//! Building blocks of menus and of the heads-up display: colours, texts, boxes and menu items.
//!
//! The mouse, keys and gamepads select menu items alike. An item gets [`Activated`] or [`Adjusted`] and observes it.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::state::state::{StateTransitionEvent, StateTransitionSystems};

use crate::player::game_state::{GameState, MenuPage};
use crate::player::input::ActionSystems;
use crate::ui::settings::Settings;

pub const SHADE: Color = Color::srgba(0.03, 0.035, 0.05, 0.84);
pub const EDGE: Color = Color::srgba(1.0, 1.0, 1.0, 0.16);
pub const WHITE: Color = Color::srgb(0.96, 0.96, 0.94);
pub const GREY: Color = Color::srgb(0.68, 0.70, 0.72);
pub const GOLD: Color = Color::srgb(1.0, 0.80, 0.32);
pub const RED: Color = Color::srgb(1.0, 0.45, 0.35);

/// A line of text. It is never broken: where it may be, there are [`paragraph`]s.
pub fn text(words: impl Into<String>, size: f32, color: Color) -> impl Bundle {
    (paragraph(words, size, color), TextLayout::no_wrap())
}

/// Text that is broken into lines as its node is too narrow for one.
pub fn paragraph(words: impl Into<String>, size: f32, color: Color) -> impl Bundle {
    (
        Text::new(words),
        TextFont::from_font_size(size),
        TextColor(color),
        TextShadow { offset: vec2(1.0, 1.0), color: Color::srgba(0.0, 0.0, 0.0, 0.6) },
    )
}

/// The width of a letter as a share of its height: Bevy's font has the same for all letters.
const LETTER: f32 = 0.6;

/// The width of a line of text.
pub fn width(words: &str, size: f32) -> f32 {
    LETTER * size * words.chars().count() as f32
}

/// The size of a line of text: 22, or less where it would be wider than this.
pub fn fitting(words: &str, room: f32) -> f32 {
    22.0 * (room / width(words, 22.0)).min(1.0)
}

/// A dark box with a border.
pub fn panel(node: Node) -> impl Bundle {
    let node = Node { border: UiRect::all(px(1)), border_radius: BorderRadius::all(px(8)), ..node };
    (node, BackgroundColor(SHADE), BorderColor::all(EDGE))
}

/// A progress bar. The node with `marker` is the filled part; its width is 0 % at first.
pub fn bar(width: f32, marker: impl Component) -> impl Bundle {
    let track = Node { width: px(width), height: px(10), ..default() };
    let filled = Node { width: percent(0), height: percent(100), ..default() };
    (panel(track), children![(marker, filled, BackgroundColor(GOLD))])
}

/// A node as large as the window.
pub fn full() -> Node {
    Node { width: percent(100), height: percent(100), position_type: PositionType::Absolute, ..default() }
}

/// A node as large as the window, with its children in the middle.
pub fn centered() -> Node {
    Node { align_items: AlignItems::Center, justify_content: JustifyContent::Center, ..full() }
}

/// A node whose children are below each other.
pub fn column(row_gap: Val) -> Node {
    Node { flex_direction: FlexDirection::Column, row_gap, ..default() }
}

/// Seconds for which a new page ignores clicks: the second one of a double click was meant for the page before.
const DOUBLE_CLICK: f32 = 0.4;

/// Keys that activate the focused item. A gamepad's South does it too.
pub const ACTIVATE: [KeyCode; 3] = [KeyCode::Enter, KeyCode::NumpadEnter, KeyCode::Space];

/// A menu item, with its position in the menu.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
#[require(Button)]
pub struct MenuItem(pub usize);

/// A button that adjusts the item above it by this much.
#[derive(Component, Clone, Copy, Debug)]
#[require(Button)]
pub struct Arrow(pub i32);

/// An item was activated.
#[derive(EntityEvent, Clone, Copy, Debug)]
pub struct Activated {
    pub entity: Entity,
}

/// An item's value is increased or decreased.
#[derive(EntityEvent, Clone, Copy, Debug)]
pub struct Adjusted {
    pub entity: Entity,
    pub by: i32,
}

/// The position of the item that keys and gamepads activate, and those of the pages that were left.
#[derive(Resource, Clone, Debug, Default)]
pub struct FocusedItem(pub usize, HashMap<MenuPage, usize>);

/// Menus ignore keys, buttons and clicks while this exists.
#[derive(Resource)]
pub struct MenuInputDisabled;

/// The node, background and border of a menu item.
pub fn item(position: usize, node: Node) -> impl Bundle {
    let node = Node { border: UiRect::left(px(4)), border_radius: BorderRadius::all(px(4)), ..node };
    (MenuItem(position), node, BackgroundColor::DEFAULT, BorderColor::all(Color::NONE))
}

/// A menu item with one line of text, which is smaller if it is long.
pub fn button(position: usize, words: &str, width: f32) -> impl Bundle {
    let padding = UiRect::axes(px(18), px(9));
    let node = Node { width: px(width), padding, overflow: Overflow::clip_x(), ..default() };
    (item(position, node), children![text(words, fitting(words, width - 40.0), WHITE)])
}

/// In `Update`, when menus react to the mouse.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MenuPointerSystems;

/// Makes menus react to input.
pub struct UiPlugin;

impl Plugin for UiPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<FocusedItem>()
            .add_message::<CursorMoved>()
            .add_systems(
                PreUpdate,
                navigate
                    .after(ActionSystems)
                    .run_if(not(in_state(MenuPage::None)))
                    .run_if(not(resource_exists::<MenuInputDisabled>)),
            )
            .add_systems(
                Update,
                (
                    scale_ui,
                    (point.in_set(MenuPointerSystems), highlight)
                        .chain()
                        .run_if(not(in_state(MenuPage::None))),
                ),
            )
            .add_systems(StateTransition, move_focus.after(StateTransitionSystems::EnterSchedules))
            // The menus of the pause and of the title are the same page.
            .add_systems(OnEnter(GameState::Title), forget_focus)
            .add_systems(OnEnter(GameState::Playing), forget_focus);
    }
}

fn scale_ui(
    windows: Query<&Window>,
    page: Res<State<MenuPage>>,
    settings: Res<Settings>,
    mut scale: ResMut<UiScale>,
) {
    if let Some(window) = windows.iter().next() {
        let is_playing = **page == MenuPage::None;
        let new = scale_for(window.width(), window.height(), settings.ui_scale, is_playing);
        if scale.0 != new {
            scale.0 = new;
        }
    }
}

/// The scale of the user interface, which is laid out for 1280 x 720, times the factor `wanted` as far as there is
/// room. Menus need all of the window; during play, texts in a small window stay large enough to be read.
pub fn scale_for(width: f32, height: f32, wanted: f32, is_playing: bool) -> f32 {
    let fit = (width / 1280.0).min(height / 720.0);
    let most = if is_playing { (width / 850.0).min(height / 470.0) } else { fit };
    (fit.max(most.min(0.75)) * wanted).min(most).clamp(0.3, 4.0)
}

/// Who goes back to a page finds the item selected that led away from it.
fn move_focus(mut moves: MessageReader<StateTransitionEvent<MenuPage>>, mut focus: ResMut<FocusedItem>) {
    for transition in moves.read() {
        let (Some(from), Some(to)) = (transition.exited, transition.entered) else { continue };
        let left = focus.0;
        let is_back = from == MenuPage::Question || from == to || from.parent() == Some(to);
        focus.0 = focus.1.remove(&to).filter(|_| is_back).unwrap_or(if from == to { left } else { 0 });
        if !is_back {
            focus.1.insert(from, left);
        }
    }
}

fn forget_focus(mut focus: ResMut<FocusedItem>) {
    *focus = default();
}

/// Reacts to the mouse.
fn point(
    mut commands: Commands,
    clicked: Query<(Entity, &Interaction), (With<MenuItem>, Changed<Interaction>)>,
    items: Query<(&MenuItem, &Interaction)>,
    mut moves: MessageReader<CursorMoved>,
    arrows: Query<(&Arrow, &Interaction, Entity), Changed<Interaction>>,
    parents: Query<&ChildOf>,
    disabled: Option<Res<MenuInputDisabled>>,
    page: Res<State<MenuPage>>,
    time: Res<Time<Real>>,
    mut opened: Local<f32>,
    mut focus: ResMut<FocusedItem>,
) {
    if page.is_changed() {
        *opened = time.elapsed_secs();
    }
    let is_enabled = disabled.is_none() && time.elapsed_secs() - *opened >= DOUBLE_CLICK;
    for (entity, interaction) in &clicked {
        if *interaction == Interaction::Pressed && is_enabled {
            commands.trigger(Activated { entity });
        }
    }
    // When a page opens under a resting cursor, the focus stays where it is.
    let has_moved = moves.read().count() > 0;
    if has_moved
        && let Some((item, _)) = items.iter().find(|(_, interaction)| **interaction == Interaction::Hovered)
    {
        focus.0 = item.0;
    }
    for (arrow, interaction, entity) in &arrows {
        let Some(owner) = parents.iter_ancestors(entity).find(|owner| items.contains(*owner)) else {
            continue;
        };
        let is_pressed = *interaction == Interaction::Pressed;
        let is_meant = is_pressed || has_moved && *interaction == Interaction::Hovered;
        if let (true, Ok((item, _))) = (is_meant, items.get(owner)) {
            focus.0 = item.0;
        }
        if is_pressed && is_enabled {
            commands.trigger(Adjusted { entity: owner, by: arrow.0 });
        }
    }
}

/// The direction in which a stick is pushed along an axis. A direction lasts until the stick is almost released.
fn stick_direction(now: f32, before: i32) -> i32 {
    let is_pushed = |sign: f32| now * sign > if before as f32 == sign { 0.35 } else { 0.65 };
    i32::from(is_pushed(1.0)) - i32::from(is_pushed(-1.0))
}

/// Reacts to arrow keys and Enter, and to gamepads.
fn navigate(
    mut commands: Commands,
    keys: Res<ButtonInput<KeyCode>>,
    pads: Query<&Gamepad>,
    items: Query<(Entity, &MenuItem)>,
    mut focus: ResMut<FocusedItem>,
    mut last_stick: Local<IVec2>,
) {
    use GamepadButton as G;
    use KeyCode as K;
    let stick = pads.iter().map(Gamepad::left_stick).sum::<Vec2>();
    let stick = IVec2::new(stick_direction(stick.x, last_stick.x), stick_direction(stick.y, last_stick.y));
    let before = std::mem::replace(&mut *last_stick, stick);
    let is_pressed = |some: &[KeyCode], button: GamepadButton, direction: IVec2| {
        let is_pushed = |stick: IVec2| direction != IVec2::ZERO && stick * direction.abs() == direction;
        keys.any_just_pressed(some.iter().copied())
            || pads.iter().any(|pad| pad.just_pressed(button))
            || is_pushed(stick) && !is_pushed(before)
    };
    let count = items.iter().count();
    if count == 0 {
        return;
    }
    if is_pressed(&[K::ArrowDown, K::KeyS], G::DPadDown, IVec2::NEG_Y) {
        focus.0 = (focus.0 + 1) % count;
    }
    if is_pressed(&[K::ArrowUp, K::KeyW], G::DPadUp, IVec2::Y) {
        focus.0 = (focus.0 + count - 1) % count;
    }
    let Some((entity, _)) = items.iter().find(|(_, item)| item.0 == focus.0) else { return };
    if is_pressed(&ACTIVATE, G::South, IVec2::ZERO) {
        commands.trigger(Activated { entity });
    }
    if is_pressed(&[K::ArrowRight, K::KeyD], G::DPadRight, IVec2::X) {
        commands.trigger(Adjusted { entity, by: 1 });
    }
    if is_pressed(&[K::ArrowLeft, K::KeyA], G::DPadLeft, IVec2::NEG_X) {
        commands.trigger(Adjusted { entity, by: -1 });
    }
}

/// Highlights the focused item.
fn highlight(focus: Res<FocusedItem>, mut items: Query<(&MenuItem, &mut BackgroundColor, &mut BorderColor)>) {
    for (item, mut background, mut border) in &mut items {
        let (fill, edge) =
            if item.0 == focus.0 { (GOLD.with_alpha(0.16), GOLD) } else { (Color::NONE, Color::NONE) };
        background.set_if_neq(BackgroundColor(fill));
        border.set_if_neq(BorderColor::all(edge));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pushed_stick_is_one_step_until_it_is_released() {
        let mut steps = Vec::new();
        let mut before = 0;
        for now in [0.1, 0.5, 0.7, 1.0, 0.6, 0.5, 0.2, 0.7, 0.0, -0.9, -0.5, 0.8] {
            let after = stick_direction(now, before);
            if after != before && after != 0 {
                steps.push(after);
            }
            before = after;
        }
        assert_eq!(steps, [1, 1, -1, 1]);
    }

    #[test]
    fn texts_stay_readable_during_play_in_a_small_window() {
        for (width, height, menu, game) in [
            (1280.0, 720.0, 1.0, 1.0),
            (2560.0, 1440.0, 2.0, 2.0),
            (640.0, 360.0, 0.5, 0.75),
            (960.0, 540.0, 0.75, 0.75),
            (64.0, 64.0, 0.3, 0.3),
        ] {
            let scales = [false, true].map(|is_playing| scale_for(width, height, 1.0, is_playing));
            let is_near = |scale: f32, expected: f32| (scale - expected).abs() < 0.02;
            assert!(is_near(scales[0], menu) && is_near(scales[1], game), "{width}: {scales:?}");
            // However large they are wanted, menus and the display fit into the window.
            for wanted in [0.5, 1.5, 4.0] {
                let [menu, game] =
                    [false, true].map(|is_playing| scale_for(width, height, wanted, is_playing));
                let fits = |scale: f32, of: Vec2| {
                    scale <= 0.3 || scale * of.x <= width + 0.1 && scale * of.y <= height + 0.1
                };
                assert!(
                    fits(menu, vec2(1280.0, 720.0)) && fits(game, vec2(850.0, 470.0)),
                    "{wanted}: {menu} {game}"
                );
            }
        }
    }

    #[test]
    fn long_lines_are_smaller_and_short_ones_are_not_larger() {
        for words in ["", "Play", "Continue Mound copy", "Continue a name of 24 letters..."] {
            let size = fitting(words, 220.0);
            assert!(width(words, size) < 220.1 && (10.0..=22.0).contains(&size), "{words}: {size}");
        }
        assert_eq!([fitting("", 220.0), fitting("Play", 220.0)], [22.0; 2]);
    }
}
