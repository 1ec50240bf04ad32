//! Tests of stamps from files.

use std::path::PathBuf;

use image::{GrayImage, RgbImage};

use super::*;

const CRATER_FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/stamps/crater.png");

/// An empty temporary folder.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("sculpt_stamps_{}_{name}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder of its own");
    folder
}

/// The tool after these files were dropped on the window, one by one.
fn drop_files(files: &[&Path]) -> BrushTool {
    let mut app = App::new();
    app.init_resource::<BrushTool>().init_resource::<BurrowPanel>().add_plugins(DropPlugin);
    for file in files {
        let (window, path_buf) = (Entity::PLACEHOLDER, file.to_path_buf());
        app.world_mut().write_message(FileDragAndDrop::HoveredFile { window, path_buf: path_buf.clone() });
        app.world_mut().write_message(FileDragAndDrop::DroppedFile { window, path_buf });
    }
    app.update();
    app.world().resource::<BrushTool>().clone()
}

#[test]
fn a_good_file_becomes_what_is_stamped() {
    let stamp = read(Path::new(CRATER_FILE)).expect("the crater");
    assert_eq!(stamp.name, Some(Name::new("crater")));
    let image = stamp.image.as_ref().expect("an image");
    assert_eq!((image.width(), image.height()), (96, 96));
    assert_eq!(image.samples().first(), Some(&0), "its border lies on the ground");
    assert_eq!(read_or_crater(None).expect("the same"), stamp);

    let tool = drop_files(&[Path::new(CRATER_FILE)]);
    assert_eq!(tool, BrushTool { stamp, operation: ToolOperation::Stamp, ..default() });
}

#[test]
fn a_missing_file_changes_nothing() {
    let folder = folder("missing");
    let file = folder.join("none.png");
    assert!(matches!(read(&file), Err(StampError::File(why)) if why.kind() == io::ErrorKind::NotFound));
    assert_eq!(drop_files(&[&file]), BrushTool::default());
    assert_eq!(drop_files(&[Path::new(CRATER_FILE), &file]), drop_files(&[Path::new(CRATER_FILE)]));
    let why = read_or_crater(Some(&file)).expect_err("there is none").to_string();
    assert!(why.contains("none.png"), "{why}");
    let _ = std::fs::remove_dir_all(folder);
}

#[test]
fn a_broken_file_changes_nothing() {
    let folder = folder("broken");
    let write = |name: &str, bytes: &[u8]| {
        let file = folder.join(name);
        std::fs::write(&file, bytes).expect("a file of its own");
        file
    };
    let draw = |name: &str, width: u32, height: u32| {
        let file = folder.join(name);
        GrayImage::new(width, height).save(&file).expect("a file of its own");
        file
    };
    let colors = folder.join("colors.png");
    RgbImage::new(8, 8).save(&colors).expect("a file of its own");
    let cases: [(PathBuf, fn(&StampError) -> bool); 8] = [
        (folder.clone(), |why| matches!(why, StampError::File(_))),
        (write("empty.png", &[]), |why| matches!(why, StampError::Image(ImageError::Truncated { .. }))),
        (write("words.png", b"no picture"), |why| {
            matches!(why, StampError::Image(ImageError::Decode { .. }))
        }),
        (write("half.png", &CRATER[..CRATER.len() / 2]), |why| {
            matches!(why, StampError::Image(ImageError::Truncated { .. } | ImageError::Decode { .. }))
        }),
        (write("long.png", &vec![0; LIMITS.max_file_bytes as usize + 9]), |why| {
            matches!(why, StampError::Image(ImageError::FileSize { .. }))
        }),
        (colors, |why| matches!(why, StampError::Image(ImageError::ColorType { .. }))),
        (draw("wide.png", 257, 2), |why| matches!(why, StampError::Image(ImageError::Dimensions { .. }))),
        (draw("dot.png", 1, 1), |why| matches!(why, StampError::Brush(BrushError::StampSize { .. }))),
    ];
    for (file, is_told) in &cases {
        let why = read(file).expect_err("not a valid stamp");
        assert!(is_told(&why), "{}: {why:?}", file.display());
        assert_eq!(drop_files(&[file]), BrushTool::default(), "{}", file.display());
    }
    let _ = std::fs::remove_dir_all(folder);
}
