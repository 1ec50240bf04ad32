//! Tests of the settings file.

use super::*;
use crate::player::bindings::Binding;
use crate::player::input::Action;
use crate::test_support::go_to;

/// A file in its own folder, which is removed with it.
struct TestFile(PathBuf);

impl TestFile {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("digger_settings_{}_{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("a folder");
        Self(folder.join("digger.json"))
    }

    fn with_text(name: &str, text: &str) -> Self {
        let file = Self::new(name);
        std::fs::write(&file.0, text).expect("a file");
        file
    }

    fn read(&self) -> Settings {
        Settings::read(&self.0).expect("a valid file")
    }

    /// The game's settings, as it starts with this file.
    fn start(&self) -> App {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, bevy::state::app::StatesPlugin))
            .init_state::<MenuPage>()
            .add_plugins(SettingsPlugin(SettingsFile(Some(self.0.clone()))));
        app.update();
        app
    }
}

impl Drop for TestFile {
    fn drop(&mut self) {
        let _ = self.0.parent().map(std::fs::remove_dir_all);
    }
}

#[test]
fn a_missing_file_means_defaults() {
    assert_eq!(TestFile::new("missing").read(), Settings::default());
}

#[test]
fn what_is_written_is_read_again() {
    let file = TestFile::new("round");
    let mut settings = Settings {
        sensitivity: 1.5,
        invert_y: true,
        quality: Quality::High,
        shape: BuildShape::Cube,
        survival: false,
        ..default()
    };
    settings.bindings.rebind(Action::Use, Binding::Mouse(MouseButton::Other(9)));
    settings.write(&file.0).expect("a folder");
    assert_eq!(file.read(), settings);
    assert!(!file.0.with_extension("new").exists());
}

#[test]
fn quitting_on_a_settings_page_saves_the_settings_once() {
    for page in [MenuPage::Settings, MenuPage::Controls] {
        let file = TestFile::new(&format!("{page:?}"));
        let mut app = file.start();
        go_to(&mut app, page);
        app.world_mut().resource_mut::<Settings>().sensitivity = 2.0;
        app.update();
        assert!(!file.0.exists(), "the page is still open");
        app.world_mut().write_message(AppExit::Success);
        app.update();
        assert_eq!(file.read().sensitivity, 2.0);
        app.world_mut().resource_mut::<Settings>().sensitivity = 3.0;
        app.update();
        assert_eq!(file.read().sensitivity, 2.0);
    }
    let file = TestFile::new("menu");
    let mut app = file.start();
    app.world_mut().write_message(AppExit::Success);
    app.update();
    assert!(!file.0.exists(), "the menu changes no settings");
}

#[test]
fn a_broken_file_is_reported_and_renamed() {
    for (name, text) in
        [("empty", ""), ("half", r#"{ "sensitivity": 1."#), ("other", r#"{ "quality": "ultra" }"#)]
    {
        let file = TestFile::with_text(name, text);
        let error = Settings::read(&file.0).expect_err(name).to_string();
        assert!(error.contains("digger.json"), "{error}");
        let mut app = file.start();
        assert_eq!(*app.world().resource::<Settings>(), Settings::default());
        // It stays until settings are saved.
        let read = |path: &Path| std::fs::read_to_string(path).expect("a file");
        assert_eq!(read(&file.0), text);
        let renamed = file.0.with_extension("json.broken");
        for _ in 0..2 {
            go_to(&mut app, MenuPage::Settings);
            go_to(&mut app, MenuPage::Menu);
            assert_eq!(read(&renamed), text);
            assert_eq!(file.read(), Settings::default());
        }
    }
}

#[test]
fn an_old_file_keeps_what_it_has() {
    let text = r#"{ "sensitivity": 0.5, "gamma": 2.2, "field_of_view": 900.0 }"#;
    let settings = TestFile::with_text("old", text).read();
    assert_eq!(settings, Settings { sensitivity: 0.5, field_of_view: 110.0, ..default() });
}
