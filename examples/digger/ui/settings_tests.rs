//! Facts about the file of settings.

use std::ops::Deref;

use super::*;
use crate::player::bindings::Binding;
use crate::player::input::Action;

/// A file in a folder of its own, which goes with it.
struct OwnFile(PathBuf);

impl Deref for OwnFile {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl Drop for OwnFile {
    fn drop(&mut self) {
        let _ = self.0.parent().map(std::fs::remove_dir_all);
    }
}

/// A file of its own for each test.
fn file(name: &str) -> OwnFile {
    let folder = std::env::temp_dir().join(format!("digger_settings_{}_{name}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    OwnFile(folder.join("digger.json"))
}

fn write_text(path: &Path, text: &str) {
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder of its own");
    std::fs::write(path, text).expect("a file of its own");
}

#[test]
fn a_missing_file_means_defaults() {
    let found = Settings::read(&file("missing")).expect("no error");
    assert_eq!((found.settings, found.unread), (Settings::default(), vec![]));
}

#[test]
fn what_is_written_is_read_again() {
    let path = file("round");
    let mut settings = Settings {
        sensitivity: 1.5,
        invert_y: true,
        quality: Quality::High,
        form: Form::Cube,
        survival: false,
        ..default()
    };
    settings.bindings.rebind(Action::Use, Binding::Key(KeyCode::KeyX));
    settings.write(&path).expect("a folder that is made");
    let found = Settings::read(&path).expect("what was written");
    assert_eq!((found.settings, found.unread), (settings, vec![]));
    assert!(!path.with_extension("new").exists());
}

/// The game's settings, as it starts with this file.
fn start(path: &Path) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, bevy::state::app::StatesPlugin))
        .init_state::<Page>()
        .add_plugins(SettingsPlugin(SettingsFile(Some(path.into()))));
    app.update();
    app
}

/// Opens the page of settings and leaves it.
fn visit(app: &mut App) {
    for page in [Page::Settings, Page::Menu] {
        app.world_mut().resource_mut::<NextState<Page>>().set(page);
        app.update();
    }
}

#[test]
fn who_leaves_the_game_from_a_page_of_settings_loses_none() {
    for page in [Page::Settings, Page::Controls] {
        let path = file(&format!("{page:?}"));
        let mut app = start(&path);
        app.world_mut().resource_mut::<NextState<Page>>().set(page);
        app.update();
        app.world_mut().resource_mut::<Settings>().sensitivity = 2.0;
        app.update();
        assert!(!path.exists(), "nobody has left yet");
        app.world_mut().write_message(AppExit::Success);
        app.update();
        let sensitivity = || Settings::read(&path).expect("what was written").settings.sensitivity;
        assert_eq!(sensitivity(), 2.0);
        // Once.
        app.world_mut().resource_mut::<Settings>().sensitivity = 3.0;
        app.update();
        assert_eq!(sensitivity(), 2.0);
    }
    let path = file("menu");
    let mut app = start(&path);
    app.world_mut().write_message(AppExit::Success);
    app.update();
    assert!(!path.exists(), "nothing was changed in the menu");
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).expect("a file")
}

#[test]
fn a_broken_file_is_reported_and_set_aside() {
    for (name, words) in [("empty", ""), ("half", r#"{ "sensitivity": 1."#), ("other", "[1, 2]")] {
        let path = file(name);
        write_text(&path, words);
        let error = Settings::read(&path).expect_err(name).to_string();
        assert!(error.contains("digger.json"), "{error}");
        let mut app = start(&path);
        assert_eq!(*app.world().resource::<Settings>(), Settings::default());
        // Nor is it lost: nobody has changed a setting yet.
        assert_eq!(text(&path), words);
        visit(&mut app);
        assert_eq!(text(&path.with_extension("json.broken")), words);
        assert!(Settings::read(&path).is_ok_and(|found| found.unread.is_empty()));
    }
}

#[test]
fn what_a_newer_version_wrote_costs_nobody_the_rest() {
    let path = file("newer");
    let words = r#"{ "quality": "ultra", "sensitivity": 2.0, "form": 7, "bindings": { "jump": ["KeyJ"], "pause": [] } }"#;
    write_text(&path, words);
    let mut app = start(&path);
    let settings = app.world().resource::<Settings>().clone();
    assert_eq!((settings.sensitivity, settings.quality), (2.0, Quality::Medium));
    assert_eq!(settings.bindings.of(Action::Jump), [Binding::Key(KeyCode::KeyJ)]);
    assert!(!settings.bindings.of(Action::Pause).is_empty());
    visit(&mut app);
    assert_eq!(text(&path.with_extension("json.broken")), words);
    let found = Settings::read(&path).expect("its own file");
    assert_eq!((found.settings, found.unread), (settings, vec![]));
    // What was set aside is not replaced by what is fine.
    visit(&mut app);
    assert_eq!(text(&path.with_extension("json.broken")), words);
}

#[test]
fn an_old_file_keeps_what_it_has() {
    let path = file("old");
    write_text(&path, r#"{ "sensitivity": 0.5, "gamma": 2.2, "field_of_view": 900.0 }"#);
    let found = Settings::read(&path).expect("unknown names are left out");
    assert_eq!(found.settings, Settings { sensitivity: 0.5, field_of_view: 110.0, ..default() });
    assert!(found.unread.is_empty());
}

#[test]
fn keys_that_nobody_can_read_are_named_and_set_aside_with_their_file() {
    let path = file("keys");
    let words = r#"{ "bindings": { "use": ["Mouse Thumb", "Pad RightTrigger2"], "fly": ["KeyF"] } }"#;
    write_text(&path, words);
    let found = Settings::read(&path).expect("all but a button");
    assert!(found.settings.bindings.of(Action::Use).contains(&Binding::Mouse(MouseButton::Left)));
    assert!(matches!(&found.unread[..], [one] if one.contains("use the tool")), "{:?}", found.unread);
    visit(&mut start(&path));
    assert_eq!(text(&path.with_extension("json.broken")), words);
}

#[test]
fn a_button_with_nothing_but_a_number_is_there_at_the_next_start() {
    let path = file("button");
    let mut settings = Settings::default();
    let thumb = Binding::Mouse(MouseButton::Other(9));
    settings.bindings.rebind(Action::Use, thumb);
    settings.write(&path).expect("a folder that is made");
    let found = Settings::read(&path).expect("what was written");
    assert!(found.settings.bindings.of(Action::Use).contains(&thumb));
    assert_eq!((found.settings, found.unread), (settings, vec![]));
}
