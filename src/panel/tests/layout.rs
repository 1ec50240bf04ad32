//! Where the columns are on the screen, and how large.

use super::*;

#[test]
fn both_columns_fit_on_common_screens() {
    for (width, height) in [(1280.0, 720.0), (1920.0, 1080.0), (800.0, 600.0)] {
        for terrains in [0, 1, 5] {
            let screen = Screen::new(width, height, terrains);
            for (name, place) in &screen.places.0 {
                assert!(place.min.x >= 0.0 && place.max.x <= width, "{name} {place:?}");
                assert!(place.width() > 4.0, "{name} {place:?}");
                let middle = place.center().x;
                assert!(middle < 0.4 * width || middle > 0.6 * width, "{name} hides the view: {place:?}");
            }
            for name in ["Dig", "Terrace", "Sphere", "Radius", "Undo", "Check seams", "Save picture"] {
                let place = screen.places.0.get(name).unwrap_or_else(|| panic!("{name} at {width}"));
                assert!(place.max.y <= height, "{name} {place:?}");
            }
        }
    }
}

#[test]
fn in_a_narrow_window_one_column_is_unfolded() {
    let mut screen = Screen::new(640.0, 360.0, 1);
    for (here, there, column) in
        [("Dig", "Undo", "World"), ("Undo", "Dig", "Brush"), ("Dig", "Undo", "World")]
    {
        assert!(screen.places.0.contains_key(here) && !screen.places.0.contains_key(there), "{here}");
        for (name, place) in &screen.places.0 {
            assert!(place.min.x >= 0.0 && place.max.x <= 640.0, "{name} {place:?}");
        }
        screen.choose(column);
        (0..2).for_each(|_| screen.frame(Vec::new()));
    }
}

#[test]
fn the_panel_is_larger_or_smaller_as_one_likes() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    screen.choose("Settings");
    let place = screen.places.0["Undo"];
    screen.choose("150");
    assert_eq!(screen.context.zoom_factor(), 1.5);
    // Positions are those in the window.
    let larger = screen.places.0["Undo"];
    assert!((larger.min - 1.5 * place.min).length() < 1.0 && larger.width() > 1.4 * place.width());
    for (key, is_larger) in [(egui::Key::Minus, false), (egui::Key::Plus, true), (egui::Key::Equals, true)] {
        let before = screen.context.zoom_factor();
        screen.press(key, Modifiers::CTRL | Modifiers::COMMAND);
        screen.frame(Vec::new());
        let now = screen.context.zoom_factor();
        assert!(if is_larger { now > before } else { now < before }, "{key:?}: {before}, then {now}");
    }
}

#[test]
fn a_closed_panel_is_nowhere() {
    let (mut app, context) = app_and_context();
    for (is_open, is_somewhere) in [(true, true), (false, false), (true, true)] {
        app.world_mut().resource_mut::<BurrowPanel>().is_open = is_open;
        let places = places_in(&mut app, &context);
        assert_eq!(places.0.contains_key("Radius"), is_somewhere);
        assert!(is_somewhere || places.0.is_empty());
    }
}

#[test]
fn a_game_that_saves_its_worlds_itself_hides_the_files() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    for shows_files in [true, false] {
        screen.panel.shows_files = shows_files;
        (0..2).for_each(|_| screen.frame(Vec::new()));
        assert!(
            ["New", "Open", "Save"].iter().all(|name| screen.places.0.contains_key(*name) == shows_files)
        );
        assert!(screen.places.0.contains_key("Undo"));
    }
}

#[test]
fn keys_of_the_game_and_the_pointer_are_shown() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    assert!(!screen.places.0.contains_key(texts::POINTER));
    screen.panel.pointer = Some(Vec3::ONE);
    screen.panel.keys.insert("Dig".into(), "1".into());
    (0..2).for_each(|_| screen.frame(Vec::new()));
    assert!(screen.places.0.contains_key(texts::POINTER));
}
