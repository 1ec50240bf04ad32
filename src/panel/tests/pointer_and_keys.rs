//! Which pointer and which keys the panel uses, and which it leaves to the game.

use super::*;

#[test]
fn egui_has_the_pointer_over_a_column_only() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    let over = screen.middle("Radius");
    for (at, is_over) in [(over, true), (Pos2::new(640.0, 400.0), false), (Pos2::new(1200.0, 60.0), true)] {
        screen.frame(vec![Event::PointerMoved(at)]);
        screen.frame(Vec::new());
        assert_eq!(screen.context.is_pointer_over_egui(), is_over, "{at:?}");
    }
}

#[test]
fn any_context_of_egui_may_have_the_pointer() {
    let mut app = App::new();
    app.init_resource::<PanelInput>().init_resource::<Files>().add_systems(Update, input::read_input);
    // The context of another camera than the panel's.
    let camera = app.world_mut().spawn(EguiContext::default()).id();
    let mut camera = app.world_mut().entity_mut(camera);
    let context = camera.get_mut::<EguiContext>().expect("it is there").get_mut().clone();
    for (at, is_over) in [(Pos2::new(30.0, 30.0), true), (Pos2::new(600.0, 400.0), false)] {
        for _ in 0..3 {
            let screen = Rect::from_min_size(Pos2::ZERO, Vec2::new(1280.0, 720.0));
            let events = vec![Event::PointerMoved(at)];
            let input = RawInput { screen_rect: Some(screen), events, ..RawInput::default() };
            let _ = context.run_ui(input, |ui| {
                let map = egui::Area::new(Id::new("map")).fixed_pos(Pos2::ZERO);
                map.show(ui.ctx(), |ui| ui.allocate_space(Vec2::splat(100.0)));
            });
        }
        app.update();
        assert_eq!(app.world().resource::<PanelInput>().has_pointer, is_over, "{at:?}");
    }
}

#[test]
fn tab_is_left_to_the_game() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    // The last widgets are sliders with numbers that can be typed.
    screen.choose("Settings");
    for modifiers in [Modifiers::NONE, Modifiers::NONE, Modifiers::SHIFT, Modifiers::SHIFT] {
        screen.press(egui::Key::Tab, modifiers);
        assert_eq!(screen.context.memory(|memory| memory.focused()), None, "{modifiers:?}");
        assert!(!screen.context.text_edit_focused());
    }
}

#[test]
fn numbers_are_typed_where_one_clicks_on_them() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    let rail = screen.places.0["Radius"];
    screen.click(Pos2::new(rail.max.x + 25.0, rail.center().y));
    assert!(screen.context.text_edit_focused());
    screen.frame(Vec::new());
    screen.frame(vec![Event::Text("7".into())]);
    assert!(screen.context.text_edit_focused());
    screen.press(egui::Key::Enter, Modifiers::NONE);
    screen.frame(Vec::new());
    assert_eq!(screen.tool.radius, 7.0);
    assert_eq!(screen.context.memory(|memory| memory.focused()), None);
}
