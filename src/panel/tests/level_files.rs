//! Tests of the buttons for files: unsaved changes, questions, levels that are replaced.

use std::time::Duration;

use super::*;

/// How often the app was asked to end. Messages themselves are gone after two frames.
#[derive(Resource, Default)]
struct Exits(usize);

/// An editor without a window, whose level is in a folder of its own.
fn editor(name: &str) -> (App, Entity, std::path::PathBuf) {
    let folder = std::env::temp_dir().join(format!("burrow_files_{}_{name}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    let mut app = App::new();
    app.insert_resource(BurrowPanel { level: folder.clone(), ..BurrowPanel::default() })
        .init_resource::<Files>()
        .add_message::<PanelAction>()
        .add_message::<Undo>()
        .add_message::<Redo>()
        .add_message::<AppExit>()
        .init_resource::<Exits>()
        .add_systems(Update, (level::finish, files::track_changes, files::answer, perform_actions).chain())
        .add_systems(Last, |mut exits: MessageReader<AppExit>, mut count: ResMut<Exits>| {
            count.0 += exits.read().count();
        });
    let terrain = app.world_mut().spawn(flat(1.0)).id();
    app.update();
    (app, terrain, folder)
}

/// Performs an action, answers its question if there is an answer, and waits until nothing is running.
fn act(app: &mut App, action: PanelAction, answer: Option<&str>) -> bool {
    app.world_mut().write_message(action);
    app.update();
    let is_asked = app.world().resource::<Files>().is_asking();
    if let Some(answer) = answer {
        app.world_mut().resource_mut::<Files>().reply(answer);
    }
    for _ in 0..10_000 {
        app.update();
        let is_busy = app.world().resource::<Files>().is_busy;
        if !is_busy && app.world().resource::<Messages<PanelAction>>().is_empty() {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    app.update();
    is_asked
}

fn dig_at(app: &mut App, terrain: Entity, x: f32) -> u64 {
    let mut terrain = app.world_mut().get_mut::<Terrain>(terrain).expect("it is there");
    terrain.apply([dig(x)]);
    let hash = terrain.world().hash();
    app.update();
    hash
}

fn hash(app: &App, terrain: Entity) -> u64 {
    app.world().get::<Terrain>(terrain).expect("it is there").world().hash()
}

#[test]
fn unsaved_changes_are_marked_and_asked_about_before_they_are_lost() {
    let (mut app, terrain, folder) = editor("unsaved");
    let pristine = hash(&app, terrain);
    assert!(!app.world().resource::<Files>().is_unsaved());
    let saved = dig_at(&mut app, terrain, 20.0);
    assert!(app.world().resource::<Files>().is_unsaved());
    assert!(!act(&mut app, PanelAction::SaveLevel, None), "nothing is there to be replaced");
    assert!(folder.exists() && !app.world().resource::<Files>().is_unsaved());
    assert!(!act(&mut app, PanelAction::SaveLevel, None), "the level that is open");
    let changed = dig_at(&mut app, terrain, 40.0);
    for action in [PanelAction::LoadLevel, PanelAction::NewLevel, PanelAction::Quit] {
        assert!(act(&mut app, action, Some(texts::CANCEL)), "{action:?}");
        assert_eq!(hash(&app, terrain), changed, "{action:?}");
        assert_eq!(app.world().resource::<Exits>().0, 0);
    }
    assert!(act(&mut app, PanelAction::LoadLevel, Some(texts::DISCARD)));
    assert_eq!(hash(&app, terrain), saved);
    assert!(!act(&mut app, PanelAction::NewLevel, None), "all is saved");
    assert_eq!(hash(&app, terrain), pristine);
    assert!(!app.world().resource::<Files>().is_unsaved());
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn saving_before_one_quits_quits_once_it_is_saved() {
    let (mut app, terrain, folder) = editor("quit");
    let changed = dig_at(&mut app, terrain, 20.0);
    assert!(act(&mut app, PanelAction::Quit, Some(texts::SAVE_CHANGES)));
    assert_eq!(app.world().resource::<Exits>().0, 1);
    assert!(!act(&mut app, PanelAction::LoadLevel, None));
    assert_eq!(hash(&app, terrain), changed);
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn another_level_is_replaced_only_after_a_question() {
    let (mut app, terrain, folder) = editor("replace");
    std::fs::create_dir_all(&folder).expect("a folder");
    dig_at(&mut app, terrain, 20.0);
    for (answer, is_unsaved) in [(texts::CANCEL, true), (texts::REPLACE, false)] {
        assert!(act(&mut app, PanelAction::SaveLevel, Some(answer)));
        assert_eq!(app.world().resource::<Files>().is_unsaved(), is_unsaved, "{answer}");
    }
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn changes_that_were_discarded_are_unsaved_still_where_nothing_came_in_their_place() {
    let (mut app, terrain, folder) = editor("failed");
    let changed = dig_at(&mut app, terrain, 20.0);
    // There is no such level.
    assert!(act(&mut app, PanelAction::LoadLevel, Some(texts::DISCARD)));
    assert_eq!(hash(&app, terrain), changed);
    assert!(app.world().resource::<Files>().is_unsaved());
    assert!(act(&mut app, PanelAction::Quit, Some(texts::CANCEL)));
    assert!(!folder.exists());
}

#[test]
fn what_was_dug_while_a_level_was_saved_is_asked_about_again() {
    let (mut app, terrain, folder) = editor("meanwhile");
    dig_at(&mut app, terrain, 20.0);
    app.world_mut().write_message(PanelAction::Quit);
    app.update();
    app.world_mut().resource_mut::<Files>().reply(texts::SAVE_CHANGES);
    app.update();
    assert!(app.world().resource::<Files>().is_busy);
    app.world_mut().get_mut::<Terrain>(terrain).expect("it is there").apply([dig(40.0)]);
    while app.world().resource::<Files>().is_busy {
        app.update();
    }
    app.update();
    assert!(app.world().resource::<Files>().is_asking() && app.world().resource::<Exits>().0 == 0);
    app.world_mut().resource_mut::<Files>().reply(texts::CANCEL);
    // So is what is not dug yet.
    app.update();
    assert!(!act(&mut app, PanelAction::SaveLevel, None) && !app.world().resource::<Files>().is_unsaved());
    app.world_mut().get_mut::<Terrain>(terrain).expect("it is there").submit(dig(60.0));
    assert!(act(&mut app, PanelAction::Quit, Some(texts::CANCEL)));
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn quitting_saves_the_terrain_that_has_changes_whichever_is_shown() {
    let (mut app, first, folder) = editor("shown");
    let second = app.world_mut().spawn(flat(1.0)).id();
    app.world_mut().resource_mut::<BurrowPanel>().terrain = Some(first);
    app.update();
    dig_at(&mut app, second, 20.0);
    assert!(act(&mut app, PanelAction::Quit, Some(texts::SAVE_CHANGES)));
    assert_eq!((app.world().resource::<Exits>().0, folder.exists()), (1, true));
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn a_terrain_that_is_gone_has_nothing_to_save() {
    let (mut app, terrain, folder) = editor("gone");
    dig_at(&mut app, terrain, 20.0);
    assert!(act(&mut app, PanelAction::Quit, None));
    app.world_mut().despawn(terrain);
    app.world_mut().resource_mut::<Files>().reply(texts::SAVE_CHANGES);
    (0..3).for_each(|_| app.update());
    assert_eq!((app.world().resource::<Exits>().0, folder.exists()), (1, false));
}

#[test]
fn nothing_is_saved_over_a_packed_level() {
    let (mut app, terrain, folder) = editor("packed");
    std::fs::write(&folder, b"packed").expect("a file");
    dig_at(&mut app, terrain, 20.0);
    for action in [PanelAction::SaveLevel, PanelAction::SaveLevelAs] {
        assert!(!act(&mut app, action, None));
        assert_eq!(app.world().resource::<BurrowPanel>().note, Some(Note::Bad(texts::PACKED_FILE.into())));
    }
    assert!(app.world().resource::<Files>().is_unsaved());
    assert_eq!(std::fs::read(&folder).expect("it is there"), b"packed");
    std::fs::remove_file(folder).expect("removed");
}

#[test]
fn each_terrain_has_a_level_of_its_own() {
    let (mut app, first, folder) = editor("two");
    dig_at(&mut app, first, 20.0);
    let second = app.world_mut().spawn(flat(1.0)).id();
    let choose = |app: &mut App, terrain: Entity| {
        app.world_mut().resource_mut::<BurrowPanel>().terrain = Some(terrain);
        app.update();
        app.world().resource::<Files>().is_unsaved()
    };
    assert!(choose(&mut app, first) && !choose(&mut app, second) && choose(&mut app, first));
    assert!(!choose(&mut app, second));
    assert!(act(&mut app, PanelAction::Quit, Some(texts::CANCEL)), "the other terrain has changes");
    choose(&mut app, first);
    assert!(!act(&mut app, PanelAction::SaveLevel, None));
    choose(&mut app, second);
    // The folder holds the level of another terrain.
    assert!(act(&mut app, PanelAction::SaveLevel, Some(texts::CANCEL)));
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn a_second_action_waits_for_the_first_and_loses_nothing_of_it() {
    let (mut app, terrain, folder) = editor("twice");
    let saved = dig_at(&mut app, terrain, 20.0);
    app.world_mut().write_message(PanelAction::SaveLevel);
    app.update();
    app.world_mut().resource_mut::<BurrowPanel>().report(Ok("Copied".into()));
    for action in [PanelAction::SaveLevelAs, PanelAction::NewLevel] {
        act(&mut app, action, None);
    }
    assert!(!app.world().resource::<Files>().is_busy && folder.exists());
    app.world_mut().write_message(PanelAction::LoadLevel);
    act(&mut app, PanelAction::SaveLevel, None);
    assert_eq!(hash(&app, terrain), saved);
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn a_question_that_is_taken_back_takes_what_would_follow_with_it() {
    let (mut app, terrain, folder) = editor("taken_back");
    let other = folder.with_extension("other");
    std::fs::create_dir_all(&folder).expect("a folder");
    dig_at(&mut app, terrain, 20.0);
    assert!(act(&mut app, PanelAction::Quit, Some(texts::SAVE_CHANGES)));
    assert!(app.world().resource::<Files>().is_asking(), "whether the folder's content is replaced");
    app.world_mut().resource_mut::<Files>().reply(texts::CANCEL);
    app.update();
    assert!(!app.world().resource::<Files>().is_asking());
    app.world_mut().resource_mut::<BurrowPanel>().level = other.clone();
    assert!(!act(&mut app, PanelAction::SaveLevel, None));
    assert!(other.exists() && app.world().resource::<Exits>().0 == 0, "it is saved, and nothing more");
    std::fs::remove_dir_all(folder).expect("removed");
    std::fs::remove_dir_all(other).expect("removed");
}

#[test]
fn nothing_is_done_behind_a_question() {
    let (mut app, terrain, folder) = editor("behind");
    let changed = dig_at(&mut app, terrain, 20.0);
    assert!(act(&mut app, PanelAction::LoadLevel, None));
    let asked = app.world().resource::<Files>().question.clone();
    for action in [PanelAction::Undo, PanelAction::NewLevel, PanelAction::SaveLevel, PanelAction::PlaceBrush]
    {
        assert!(act(&mut app, action, None), "{action:?}");
        assert_eq!(app.world().resource::<Files>().question, asked, "{action:?}");
    }
    assert_eq!(hash(&app, terrain), changed);
    assert!(app.world().resource::<Messages<Undo>>().is_empty() && !folder.exists());
}

#[test]
fn changes_are_not_saved_over_the_level_that_is_to_be_opened() {
    let (mut app, terrain, folder) = editor("over");
    let saved = dig_at(&mut app, terrain, 20.0);
    act(&mut app, PanelAction::SaveLevel, None);
    act(&mut app, PanelAction::NewLevel, None);
    let changed = dig_at(&mut app, terrain, 40.0);
    assert!(act(&mut app, PanelAction::LoadLevel, Some(texts::SAVE_CHANGES)));
    let note = app.world().resource::<BurrowPanel>().note.clone();
    assert_eq!(note, Some(Note::Bad(texts::SAVE_ELSEWHERE.into())));
    assert_eq!((hash(&app, terrain), app.world().resource::<Files>().is_asking()), (changed, false));
    assert!(act(&mut app, PanelAction::LoadLevel, Some(texts::DISCARD)));
    assert_eq!(hash(&app, terrain), saved);
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn levels_without_a_folder_and_of_another_ground_are_refused_in_a_sentence() {
    let (mut app, terrain, folder) = editor("refused");
    let note = |app: &App| app.world().resource::<BurrowPanel>().note.clone();
    dig_at(&mut app, terrain, 20.0);
    act(&mut app, PanelAction::SaveLevel, None);
    // A world of another size.
    let ground = Ground::flat(80, 80, 8.0).expect("valid");
    let other = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    app.world_mut().entity_mut(terrain).insert(other);
    app.world_mut().resource_mut::<Files>().note_opened(terrain, None);
    let own = hash(&app, terrain);
    app.update();
    act(&mut app, PanelAction::LoadLevel, None);
    assert_eq!((note(&app), hash(&app, terrain)), (Some(Note::Bad(texts::OTHER_GROUND.into())), own));
    app.world_mut().resource_mut::<BurrowPanel>().level = Default::default();
    for action in [PanelAction::SaveLevel, PanelAction::SaveLevelAs, PanelAction::LoadLevel] {
        app.world_mut().resource_mut::<BurrowPanel>().note = None;
        act(&mut app, action, None);
        assert_eq!(note(&app), Some(Note::Bad(texts::NO_FOLDER.into())), "{action:?}");
    }
    std::fs::remove_dir_all(folder).expect("removed");
}
