//! Messages: failures, rejections of brushes, and the result of a seam check.

use std::time::Duration;

use super::*;
use crate::brush::BrushError;
use crate::terrain::{Applied, Receipt, Rejection};

#[test]
fn a_failure_is_seen_wherever_the_panel_hides_its_message() {
    let mut screen = Screen::new(1280.0, 720.0, 1);
    screen.panel.report(Err("The folder can't be written".into()));
    screen.frame(vec![]);
    let is_seen = |screen: &Screen| screen.places.0.contains_key(texts::MESSAGE);
    assert!(!is_seen(&screen), "it is in the column");
    unfold(&screen.context, WORLD, false);
    (0..3).for_each(|_| screen.frame(vec![]));
    assert!(is_seen(&screen));
    screen.choose(texts::MESSAGE);
    screen.frame(vec![]);
    assert!(!is_seen(&screen) && screen.panel.note.is_none());
    screen.panel.report(Ok("Saved".into()));
    (0..2).for_each(|_| screen.frame(vec![]));
    assert!(!is_seen(&screen), "what went well can wait");
}

#[test]
fn messages_of_success_expire() {
    let mut app = App::new();
    app.insert_resource(Time::<Real>::default())
        .init_resource::<BurrowPanel>()
        .add_systems(Update, forget_note);
    for (message, stays) in [(Ok("done".to_string()), false), (Err("failed".to_string()), true)] {
        app.world_mut().resource_mut::<BurrowPanel>().report(message);
        for _ in 0..30 {
            app.world_mut().resource_mut::<Time<Real>>().advance_by(Duration::from_secs(1));
            app.update();
        }
        assert_eq!(app.world().resource::<BurrowPanel>().note.is_some(), stays);
    }
}

#[test]
fn a_rejection_is_seen_until_a_brush_is_accepted() {
    let mut app = App::new();
    app.init_resource::<BurrowPanel>().add_message::<BrushApplied>().add_systems(Update, note_rejection);
    let mut screen = Screen::new(1280.0, 720.0, 1);
    let small = BrushError::TooSmall { what: "radius", value: 0.1, least: 0.25 };
    for (outcome, is_seen) in [
        (Err(Rejection::Brush(small)), true),
        (Err(Rejection::OutsideWorld), true),
        (Ok(Applied::default()), false),
    ] {
        app.world_mut().write_message(BrushApplied { terrain: None, receipt: Receipt::of_edit(0, outcome) });
        // The message stays until there is another result.
        for _ in 0..3 {
            app.update();
            screen.panel = app.world().resource::<BurrowPanel>().clone();
            screen.frame(Vec::new());
            assert_eq!(screen.places.0.contains_key("Rejected"), is_seen);
        }
    }
}

/// Whether the panel shows a rejection after a frame in which this terrain, if any, rejects a brush.
fn is_rejected(app: &mut App, by: Option<Entity>) -> bool {
    if by.is_some() {
        let receipt = Receipt::of_edit(0, Err(Rejection::OutsideWorld));
        app.world_mut().write_message(BrushApplied { terrain: by, receipt });
    }
    app.update();
    app.world().resource::<BurrowPanel>().rejection.is_some()
}

#[test]
fn a_rejection_is_that_of_the_terrain_that_the_panel_is_about() {
    let mut app = App::new();
    app.init_resource::<BurrowPanel>().add_message::<BrushApplied>().add_systems(Update, note_rejection);
    let mut terrains = [(); 3].map(|()| app.world_mut().spawn(flat(1.0)).id());
    terrains.sort_unstable();
    let [first, second, gone] = terrains;
    app.world_mut().despawn(gone);
    app.world_mut().resource_mut::<BurrowPanel>().terrain = Some(gone);
    assert!(!is_rejected(&mut app, Some(second)), "the panel shows the first of those that are there");
    assert!(is_rejected(&mut app, Some(first)));
    assert!(is_rejected(&mut app, None), "nothing has changed");
    app.world_mut().resource_mut::<BurrowPanel>().terrain = Some(second);
    assert!(!is_rejected(&mut app, None), "another terrain has rejected nothing");
    assert!(!is_rejected(&mut app, Some(first)));
    assert!(is_rejected(&mut app, Some(second)));
    app.world_mut().despawn(second);
    assert!(!is_rejected(&mut app, None));
}

#[test]
fn what_a_seam_check_found_is_said_of_the_ground_that_was_checked() {
    let mut app = App::new();
    app.init_resource::<BurrowPanel>()
        .init_resource::<Files>()
        .add_message::<PanelAction>()
        .add_message::<Undo>()
        .add_message::<Redo>()
        .add_message::<AppExit>()
        .add_systems(Update, (perform_actions, survey::finish_seam_check).chain());
    let [checked, other] = [(); 2].map(|()| app.world_mut().spawn(flat(1.0)).id());
    app.world_mut().resource_mut::<BurrowPanel>().terrain = Some(checked);
    app.world_mut().write_message(PanelAction::CheckSeams);
    let verdict = (0..10_000).find_map(|_| {
        app.update();
        std::thread::sleep(Duration::from_millis(1));
        match &app.world().resource::<BurrowPanel>().note {
            Some(Note::Seams(verdict)) => Some(verdict.clone()),
            _ => None,
        }
    });
    let verdict = verdict.expect("the check ends");
    let said = |app: &App, of: Entity| {
        let terrain = app.world().get::<Terrain>(of).expect("it is there");
        verdict.about(of, terrain.world())
    };
    assert!(verdict.is_flawless);
    assert_eq!(said(&app, checked), Some(verdict.text.clone()));
    assert_eq!(said(&app, other), None, "that one was not checked");
    let mut terrain = app.world_mut().get_mut::<Terrain>(checked).expect("it is there");
    terrain.apply([dig(32.0)]);
    let then = format!("Revision {}: {}", verdict.revision, verdict.text);
    assert_eq!(said(&app, checked), Some(then));
}
