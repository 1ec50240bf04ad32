//! The widgets of the chosen terrain: settings, history and buttons.

use super::*;

#[test]
fn one_of_several_terrains_is_chosen() {
    let mut screen = Screen::new(1280.0, 720.0, 3);
    screen.choose("Hills 2");
    assert_eq!(screen.panel.terrain, Entity::from_raw_u32(3));
}

#[test]
fn buttons_act_only_where_they_can() {
    let mut screen = Screen::new(1280.0, 720.0, 0);
    for name in ["Undo", "Redo", "Check seams"] {
        screen.choose(name);
    }
    assert_eq!(screen.actions, []);
    let mut screen = Screen::new(1280.0, 720.0, 1);
    screen.terrains[0].apply([dig(32.0)]);
    screen.frame(Vec::new());
    for name in ["Undo", "Redo", "Check seams", "Save picture"] {
        screen.choose(name);
    }
    assert_eq!(screen.actions, [PanelAction::Undo, PanelAction::CheckSeams, PanelAction::SavePicture]);
}

#[test]
fn rules_and_loose_pieces_are_set_where_they_are_shown() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    for section in ["Digging rules", "Loose pieces"] {
        screen.choose(section);
    }
    assert_eq!(screen.controls, TerrainControls::default());
    for name in ["Bedrock", "Rule of Clay", "Hardness", "Unbreakable", "Find after digs", "Search up to"] {
        screen.choose(name);
    }
    let TerrainControls { rules, loose, .. } = screen.controls.clone();
    let clay = crate::ground::MaterialId(4);
    assert_eq!((rules.bedrock, rules.unbreakable.first()), (Some(0), Some(&clay)));
    assert!((100..160).contains(&rules.hardness[&clay]), "{rules:?}");
    let default = LooseSettings::default();
    let largest = loose.expect("switched on").largest;
    assert_eq!(loose, Some(LooseSettings { largest, ..default }));
    assert!((100..1000).contains(&largest), "the middle of a logarithmic slider: {largest}");
    for name in ["Bedrock", "Unbreakable", "Find after digs"] {
        screen.choose(name);
    }
    assert_eq!((screen.controls.rules.bedrock, screen.controls.loose), (None, None));
    assert!(screen.controls.rules.unbreakable.is_empty());
}

#[test]
fn the_look_section_needs_a_look() {
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    assert!(!screen.places.0.contains_key("Look"));
    screen.controls.look = Some(GroundLook::default());
    screen.frame(Vec::new());
    for name in ["Look", "Plain", "Variety", "Scale to"] {
        screen.choose(name);
    }
    let GroundLook { quality, variety, distance, .. } = screen.controls.look.expect("it is there");
    assert_eq!(quality, crate::view::GroundQuality::Low);
    assert!((0.4..0.6).contains(&variety) && (15.0..35.0).contains(&distance.1), "{variety} {distance:?}");
}

#[test]
fn a_terrain_without_colours_is_shown_like_any_other() {
    let (mut app, context) = app_and_context();
    app.world_mut().spawn((flat(1.0), GroundLook::default())).remove::<MaterialColors>();
    assert!(places_in(&mut app, &context).0.contains_key("Look"));
}

#[test]
fn history_is_that_of_the_chosen_terrain() {
    let mut screen = Screen::new(1280.0, 1600.0, 0);
    screen.frame(Vec::new());
    screen.choose("Settings");
    assert!(!screen.places.0.contains_key("History"), "there is no terrain");
    let mut screen = Screen::new(1280.0, 1600.0, 1);
    // Not a whole number of MiB.
    let odd = (5 << 20) + 123;
    screen.controls.undo_budget = odd;
    screen.choose("Settings");
    assert_eq!(screen.controls.undo_budget, odd);
    screen.drag("History", true);
    assert_eq!(screen.controls.undo_budget, 1 << 30);
    screen.drag("History", false);
    assert_eq!(screen.controls.undo_budget, 0);
}
