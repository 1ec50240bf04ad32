//! Runs each example that makes pictures, as a user without a display would, and checks that the pictures come in
//! time and show ground.
//!
//! `make test-examples` builds the examples and runs this test.
#![cfg(feature = "examples")]

#[path = "../examples/shared/pixels.rs"]
mod pixels;

use std::env::consts::EXE_SUFFIX;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use pixels::Shares;

/// An example, and what each of its pictures has to show.
struct Example {
    name: &'static str,
    /// Arguments besides `--headless` and `--out`.
    arguments: &'static str,
    /// Least number of pictures.
    pictures: usize,
    /// Least share of ground in each picture.
    ground: f32,
    /// Largest share of black in each picture.
    black: f32,
}

const EXAMPLES: [Example; 6] = [
    Example {
        name: "digger",
        arguments: "--headless --width 640 --height 360",
        pictures: 9,
        ground: 0.5,
        black: 0.05,
    },
    // Its last frame shows coal by lamplight.
    Example {
        name: "digger",
        arguments: "--tour --fps 10 --frames 12 --width 320 --height 180",
        pictures: 12,
        ground: 0.3,
        black: 0.45,
    },
    Example {
        name: "sculpt",
        arguments: "--headless --width 960 --height 540",
        pictures: 5,
        ground: 0.6,
        black: 0.05,
    },
    Example {
        name: "physics",
        arguments: "--headless --seconds 3 --balls 150",
        pictures: 3,
        ground: 0.6,
        black: 0.05,
    },
    Example { name: "agents", arguments: "--headless", pictures: 4, ground: 0.5, black: 0.05 },
    Example { name: "custom_material", arguments: "--headless", pictures: 2, ground: 0.6, black: 0.05 },
];

/// Longest time for all pictures of an example; about twice the time of two busy cores without a GPU.
const LIMIT: Duration = Duration::from_secs(300);

#[test]
#[ignore = "the examples must be built before: make test-examples"]
fn examples_show_ground() {
    // Cargo's folder for temporary files lies in the target folder.
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("a target folder");
    // The tests of a profile lie next to its examples.
    let program = std::env::current_exe().expect("the test knows its own path");
    let examples = program.ancestors().nth(2).expect("the folder of a profile").join("examples");
    let faults: Vec<String> = EXAMPLES.iter().flat_map(|example| play(example, target, &examples)).collect();
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

/// Runs an example and returns the faults of its pictures.
fn play(example: &Example, target: &Path, examples: &Path) -> Vec<String> {
    let Example { name, arguments, .. } = *example;
    let is_tour = arguments.contains("--tour");
    let folder = target.join("proof").join(if is_tour { "tour" } else { name });
    // Pictures of an earlier run must not count.
    let _ = std::fs::remove_dir_all(&folder);
    let start = Instant::now();
    let mut command = Command::new(examples.join(format!("{name}{EXE_SUFFIX}")));
    command.args(arguments.split(' ')).arg("--out").arg(&folder);
    let mut process = match command.spawn() {
        Ok(process) => process,
        Err(error) => return vec![format!("{name} can't be started: {error}")],
    };
    let mut first = None;
    let mut faults = vec![];
    loop {
        if first.is_none() && pictures_in(&folder).iter().any(|path| pixels::check_is_whole(path).is_ok()) {
            first = Some(start.elapsed());
        }
        match process.try_wait() {
            Ok(None) if start.elapsed() < LIMIT => std::thread::sleep(Duration::from_millis(50)),
            Ok(Some(status)) => {
                if !status.success() {
                    faults.push(format!("{name} {arguments}: {status}"));
                }
                break;
            }
            _ => {
                let _ = process.kill().and_then(|()| process.wait());
                faults.push(format!("{name} {arguments}: not done within {} seconds", LIMIT.as_secs()));
                break;
            }
        }
    }
    let took = start.elapsed();
    let pictures = pictures_in(&folder);
    for path in &pictures {
        match Shares::of(path) {
            Ok(seen) if seen.ground >= example.ground && seen.black <= example.black => {
                println!("{}: {seen:.2?}", path.display());
            }
            Ok(seen) => faults.push(format!("{}: {seen:.2?}", path.display())),
            Err(error) => faults.push(error.to_string()),
        }
    }
    if pictures.len() < example.pictures {
        faults.push(format!("{}: {} pictures, not {}", folder.display(), pictures.len(), example.pictures));
    }
    let first = first.map_or("none".into(), |first| format!("{:.1} s", first.as_secs_f32()));
    println!("{name} {arguments}: first picture {first}, all {:.1} s", took.as_secs_f32());
    faults
}

/// The pictures in a folder.
fn pictures_in(folder: &Path) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|file| file.path());
    let mut pictures: Vec<_> =
        files.filter(|path| path.extension().is_some_and(|end| end == "png")).collect();
    pictures.sort();
    pictures
}
