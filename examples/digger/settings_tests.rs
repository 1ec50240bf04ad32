//! Facts about the file of settings.

use super::*;
use crate::input::{Action, Binding};

/// A file of its own for each test.
fn file(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("digger_settings_{}", std::process::id())).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    folder.join("digger.json")
}

fn write_text(path: &Path, text: &str) {
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder of its own");
    std::fs::write(path, text).expect("a file of its own");
}

#[test]
fn a_missing_file_means_defaults() {
    assert_eq!(Settings::read(&file("missing")).expect("no error"), Settings::default());
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
    assert_eq!(Settings::read(&path).expect("what was written"), settings);
    assert!(!path.with_extension("new").exists());
}

#[test]
fn a_broken_file_is_reported_and_ignored() {
    for (name, text) in
        [("empty", ""), ("half", r#"{ "sensitivity": 1."#), ("other", r#"{ "invert_y": "often" }"#)]
    {
        let path = file(name);
        write_text(&path, text);
        let error = Settings::read(&path).expect_err(name).to_string();
        assert!(error.contains("digger.json"), "{error}");
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, bevy::state::app::StatesPlugin))
            .init_state::<Page>()
            .add_plugins(SettingsPlugin(SettingsFile(Some(path.clone()))));
        assert_eq!(*app.world().resource::<Settings>(), Settings::default());
        // Nor is it lost: nobody has changed a setting yet.
        app.update();
        assert_eq!(std::fs::read_to_string(&path).expect("still there"), text);
    }
}

#[test]
fn an_old_file_keeps_what_it_has() {
    let path = file("old");
    write_text(&path, r#"{ "sensitivity": 0.5, "gamma": 2.2, "field_of_view": 900.0 }"#);
    let settings = Settings::read(&path).expect("unknown names are left out");
    assert_eq!(settings, Settings { sensitivity: 0.5, field_of_view: 110.0, ..default() });
}
