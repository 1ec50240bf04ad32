//! The guide lists every warning, and each of its promises names existing tests.

use std::fs;
use std::path::Path;

fn text(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path))
        .unwrap_or_else(|why| panic!("{path}: {why}"))
}

/// All source files below a folder, one after the other.
fn sources(folder: &Path) -> String {
    let entries = fs::read_dir(folder).expect("a folder").flatten().map(|entry| entry.path());
    let read = |path: std::path::PathBuf| match path.is_dir() {
        true => sources(&path),
        false if path.extension().is_some_and(|own| own == "rs") => fs::read_to_string(path).expect("a file"),
        false => String::new(),
    };
    entries.map(read).collect()
}

/// The variants of an enumeration.
fn variants(source: &str, name: &str) -> Vec<String> {
    let body = source.split_once(&format!("pub enum {name} {{")).expect("it is there").1;
    let body = body.split_once("\n}").expect("it ends").0;
    let variant = |line: &str| {
        let name = line.strip_prefix("    ")?;
        let end = name.find([' ', ',', '(']).unwrap_or(name.len());
        name.starts_with(|first: char| first.is_ascii_uppercase()).then(|| name[..end].to_owned())
    };
    body.lines().filter_map(variant).collect()
}

#[test]
fn the_guide_lists_every_warning() {
    let (guide, source) = (text("docs/guide/src/saving.md"), text("src/store/error.rs"));
    let all = variants(&source, "StoreWarning");
    assert!(all.len() > 8 && all.contains(&"RegionLost".to_owned()), "{all:?}");
    let missing: Vec<_> = all.iter().filter(|name| !guide.contains(&format!("| `{name}` |"))).collect();
    assert!(missing.is_empty(), "not in the guide: {missing:?}");
}

#[test]
fn each_promise_names_tests_that_there_are() {
    let guide = text("docs/guide/src/saving.md");
    let table = guide.split_once("## What is promised").expect("a section").1;
    let rows = table.lines().skip_while(|line| !line.starts_with("| ---")).skip(1);
    let rows: Vec<&str> = rows.take_while(|line| line.starts_with('|')).collect();
    assert!(rows.len() > 8);
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let sources = sources(&root.join("tests")) + &sources(&root.join("src"));
    for row in rows {
        let tests = row.trim_end_matches('|').rsplit('|').next().expect("a last cell");
        let named: Vec<&str> = tests.split('`').skip(1).step_by(2).collect();
        assert!(!named.is_empty() || tests.contains("the same"), "{row}");
        named
            .iter()
            .for_each(|test| assert!(sources.contains(&format!("fn {test}(")), "{test} is not a test"));
    }
}
