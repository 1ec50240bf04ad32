//! The README and the guide: links resolve, every page is in the summary, and commands name existing targets. Their
//! programs are documentation tests of the crate.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The repository root.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Markdown files in a folder, recursively.
fn pages_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut pages = Vec::new();
    for path in entries.flatten().map(|entry| entry.path()) {
        if path.is_dir() {
            pages.extend(pages_in(&path));
        } else if path.extension().is_some_and(|extension| extension == "md") {
            pages.push(path);
        }
    }
    pages.sort();
    pages
}

fn guide() -> PathBuf {
    root().join("docs/guide/src")
}

/// All pages for users.
fn documents() -> Vec<PathBuf> {
    let mut pages = pages_in(&root().join("docs"));
    pages.extend(
        ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "assets/README.md"].map(|name| root().join(name)),
    );
    pages
}

/// The lines inside or outside of code blocks.
fn lines(text: &str, within_code: bool) -> impl Iterator<Item = &str> {
    let mut is_code = false;
    text.lines().filter(move |line| {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        !is_fence && is_code == within_code
    })
}

/// The text without its inline code.
fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect()
}

/// The targets of all links and images: `[text](target)`.
fn links(text: &str) -> Vec<String> {
    let prose: Vec<String> = lines(text, false).map(without_code).collect();
    let prose = prose.join("\n");
    let targets = prose.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    targets.map(str::to_owned).collect()
}

/// The anchor of a heading, as GitHub and mdBook generate it.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    let kept = kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

fn anchors(text: &str) -> BTreeSet<String> {
    let headings =
        lines(text, false).filter(|line| line.starts_with('#')).map(|line| line.trim_start_matches('#'));
    headings.map(anchor).collect()
}

/// The broken links of a page.
fn broken_links(page: &Path, text: &str) -> Vec<String> {
    let folder = page.parent().expect("a file has a folder");
    let is_broken = |target: &String| {
        if target.starts_with("https://") || target.starts_with("http://") {
            return false;
        }
        let (path, anchor) =
            target.split_once('#').map_or((target.as_str(), None), |(path, own)| (path, Some(own)));
        let path = if path.is_empty() { page.to_path_buf() } else { folder.join(path) };
        if anchor.is_none() {
            return !path.exists();
        }
        let own = path == page;
        let text = if own { text.to_owned() } else { fs::read_to_string(&path).unwrap_or_default() };
        !anchor.is_some_and(|anchor| anchors(&text).contains(anchor))
    };
    links(text).into_iter().filter(is_broken).collect()
}

/// The names after each `marker` in a text, up to the first character that no name contains.
fn named<'a>(text: &'a str, marker: &'a str) -> impl Iterator<Item = &'a str> {
    let is_name = |c: char| c.is_alphanumeric() || "-_,".contains(c);
    let names =
        text.split(marker).skip(1).map(move |rest| rest.split(|c| !is_name(c)).next().unwrap_or_default());
    names.filter(|name| !name.is_empty())
}

/// The feature names in a Cargo manifest.
fn features(manifest: &str) -> BTreeSet<&str> {
    let section = manifest.split("[features]").nth(1).and_then(|rest| rest.split("\n[").next());
    let keys =
        section.unwrap_or_default().lines().filter_map(|line| line.split_once(" = ").map(|(key, _)| key));
    keys.filter(|key| !key.contains(' ')).collect()
}

/// Whether an example, test or benchmark of this name exists.
fn has_target(folder: &str, name: &str) -> bool {
    let folder = root().join(folder);
    folder.join(name).join("main.rs").exists() || folder.join(format!("{name}.rs")).exists()
}

/// Unknown names in the commands of a text: make targets, examples, tests, benchmarks and features.
fn unknown_names(text: &str, makefile: &str, manifest: &str) -> Vec<String> {
    let targets: BTreeSet<&str> =
        makefile.lines().filter_map(|line| line.split_once(':').map(|(target, _)| target)).collect();
    let features = features(manifest);
    let mut unknown = Vec::new();
    let mut check = |is_known: bool, what: &str, name: &str| {
        if !is_known {
            unknown.push(format!("{what} {name}"));
        }
    };
    // In prose, `make` is an ordinary word, so only code counts.
    let spans = lines(text, false).flat_map(|line| line.split('`').skip(1).step_by(2));
    let code: Vec<&str> = lines(text, true).chain(spans).collect();
    for line in code {
        let command = line.trim_start();
        if let Some(name) = named(command, "make ").next().filter(|_| command.starts_with("make ")) {
            check(targets.contains(name), "make", name);
        }
        for (option, folder) in [("--example ", "examples"), ("--bench ", "benches"), ("--test ", "tests")] {
            named(line, option).for_each(|name| check(has_target(folder, name), folder, name));
        }
        for name in named(line, "--features ").flat_map(|list| list.split(',')) {
            check(features.contains(name), "feature", name);
        }
    }
    unknown
}

#[test]
fn links_resolve() {
    let mut count = 0;
    for page in documents() {
        let text = read(&page);
        count += links(&text).len();
        assert_eq!(broken_links(&page, &text), [""; 0], "{}", page.display());
    }
    assert!(count > 60, "{count} links were found");
}

#[test]
fn the_summary_lists_every_page() {
    let summary = guide().join("SUMMARY.md");
    let listed: BTreeSet<PathBuf> = links(&read(&summary)).iter().map(|link| guide().join(link)).collect();
    let pages: BTreeSet<PathBuf> = pages_in(&guide()).into_iter().filter(|page| *page != summary).collect();
    assert_eq!(listed, pages);
}

#[test]
fn commands_name_what_exists() {
    let (makefile, manifest) = (read(&root().join("Makefile")), read(&root().join("Cargo.toml")));
    for page in documents() {
        assert_eq!(unknown_names(&read(&page), &makefile, &manifest), [""; 0], "{}", page.display());
    }
}

/// Files and folders of the repository that inline code of a text names, and that do not exist. Capitals stand for
/// names to be chosen.
fn missing_files(text: &str) -> Vec<&str> {
    let folders = ["src/", "tests/", "benches/", "examples/", "tools/", "docs/", "assets/"];
    let is_path = |span: &&str| {
        folders.iter().any(|folder| span.starts_with(folder))
            && !span.contains([' ', '*', '{', ':'])
            && !span.contains("NAME")
    };
    let spans = lines(text, false).flat_map(|line| line.split('`').skip(1).step_by(2));
    spans.filter(is_path).filter(|path| !root().join(path).exists()).collect()
}

#[test]
fn files_that_are_named_exist() {
    for page in documents() {
        assert_eq!(missing_files(&read(&page)), [""; 0], "{}", page.display());
    }
    let text = "`src/lib.rs` `src/none.rs` `tests/NAME.rs` src/nothing.rs\n```\n`src/no.rs`\n```\n`tools` `docs/none`";
    assert_eq!(missing_files(text), ["src/none.rs", "docs/none"]);
}

/// The names in code in the first cells of all tables of a text.
fn names_in_tables(text: &str) -> BTreeSet<&str> {
    let rows =
        text.lines().map(|line| line.trim_start_matches("//!").trim()).filter(|line| line.starts_with('|'));
    let cells = rows.filter_map(|row| row.split('|').nth(1));
    cells.flat_map(|cell| cell.split('`').skip(1).step_by(2)).collect()
}

/// The features and examples of a crate that no table of a text lists.
fn unlisted(text: &str, features: &BTreeSet<&str>, examples: &BTreeSet<String>) -> Vec<String> {
    let listed = names_in_tables(text);
    let features = features.iter().filter(|name| **name != "default" && !listed.contains(*name));
    let examples = examples.iter().filter(|name| !listed.contains(name.as_str()));
    features
        .map(|name| format!("feature {name}"))
        .chain(examples.map(|name| format!("example {name}")))
        .collect()
}

/// The names of all examples.
fn examples() -> BTreeSet<String> {
    let folders = fs::read_dir(root().join("examples")).expect("a folder of examples").flatten();
    let programs = folders.filter(|folder| folder.path().join("main.rs").exists());
    programs.map(|folder| folder.file_name().to_string_lossy().into_owned()).collect()
}

#[test]
fn every_feature_and_every_example_is_listed() {
    let (manifest, examples) = (read(&root().join("Cargo.toml")), examples());
    let features = features(&manifest);
    assert!(features.len() > 8 && examples.len() > 8, "{features:?}, {examples:?}");
    let none = BTreeSet::new();
    for page in ["README.md", "docs/guide/src/getting-started.md"] {
        assert_eq!(unlisted(&read(&root().join(page)), &features, &examples), [""; 0], "{page}");
    }
    assert_eq!(unlisted(&read(&root().join("src/lib.rs")), &features, &none), [""; 0], "src/lib.rs");
}

#[test]
fn unlisted_features_and_examples_are_found() {
    let text = "| `a` (default), `b` | adds `c` |\n`d` in prose\n//! | `e` | |";
    let examples = BTreeSet::from(["e".to_owned(), "f".to_owned()]);
    let found = unlisted(text, &BTreeSet::from(["a", "b", "c", "d", "default"]), &examples);
    assert_eq!(found, ["feature c", "feature d", "example f"]);
}

/// The features that the documentation online is built with.
fn online_features(manifest: &str) -> BTreeSet<&str> {
    let online =
        manifest.split("[package.metadata.docs.rs]").nth(1).and_then(|rest| rest.split("\n[").next());
    online.expect("a section").split('"').skip(1).step_by(2).collect()
}

#[test]
fn the_documentation_online_has_every_feature_of_the_library() {
    let manifest = read(&root().join("Cargo.toml"));
    // `render`, and `plugin` with it, are on by default; the others are for examples and tests only.
    let others = ["default", "render", "plugin", "examples", "example_crates", "gamepad", "sound", "tools"];
    let expected = &features(&manifest) - &BTreeSet::from(others);
    assert_eq!(online_features(&manifest), expected);
    // So has the one that a reader builds.
    for page in ["README.md", "docs/guide/src/introduction.md"] {
        let text = read(&root().join(page));
        let list = named(&text, "cargo doc --open --features ").next().expect("a command");
        assert_eq!(list.split(',').collect::<BTreeSet<&str>>(), expected, "{page}");
    }
}

/// The features of each module that needs some, of `lib.rs`. `plugin` and `render` are on by default.
fn features_of_modules(library: &str) -> BTreeMap<&str, Vec<&str>> {
    let (mut modules, mut needed) = (BTreeMap::new(), Vec::new());
    for line in library.lines() {
        if line.starts_with("#[cfg(") {
            needed = line
                .split('"')
                .skip(1)
                .step_by(2)
                .filter(|name| !["plugin", "render"].contains(name))
                .collect();
        } else if let Some(name) = line.strip_prefix("pub mod ").and_then(|rest| rest.strip_suffix(';')) {
            modules.insert(name, std::mem::take(&mut needed));
        } else {
            needed.clear();
        }
    }
    modules.retain(|_, features| !features.is_empty());
    modules
}

/// The features that a feature includes, itself too.
fn included<'a>(manifest: &'a str, feature: &'a str) -> BTreeSet<&'a str> {
    let section = manifest.split(&format!("\n{feature} = [")).nth(1).and_then(|rest| rest.split(']').next());
    let listed =
        section.unwrap_or_default().split('"').skip(1).step_by(2).filter(|name| !name.contains([':', '/']));
    listed.flat_map(|name| included(manifest, name)).chain([feature]).collect()
}

/// Modules that the programs of a page import, of which the page names no feature that they need.
fn unnamed_features(text: &str, modules: &BTreeMap<&str, Vec<&str>>, manifest: &str) -> Vec<String> {
    let imported: BTreeSet<&str> =
        lines(text, true).flat_map(|line| named(line, "use bevy_burrow::")).collect();
    let is_named = |feature: &str| {
        text.contains(&format!("`{feature}`"))
            || lines(text, true).any(|line| line.contains(&format!("\"{feature}\"")))
    };
    let named = features(manifest).into_iter().filter(|feature| *feature != "examples" && is_named(feature));
    let named: BTreeSet<&str> = named.flat_map(|feature| included(manifest, feature)).collect();
    let needed = modules.iter().filter(|(module, _)| imported.contains(*module));
    let pairs = needed.flat_map(|(module, features)| features.iter().map(move |feature| (module, feature)));
    pairs
        .filter(|(_, feature)| !named.contains(*feature))
        .map(|(module, feature)| format!("{module}: {feature}"))
        .collect()
}

#[test]
fn pages_name_the_features_that_their_programs_need() {
    let (library, manifest) = (read(&root().join("src/lib.rs")), read(&root().join("Cargo.toml")));
    let modules = features_of_modules(&library);
    assert!(
        modules.len() > 8 && modules["plants"] == ["scatter"] && modules["paths"] == ["landmass"],
        "{modules:?}"
    );
    for page in documents() {
        assert_eq!(unnamed_features(&read(&page), &modules, &manifest), [""; 0], "{}", page.display());
    }
    let text = "```rust\nuse bevy_burrow::plants::Plants;\nuse bevy_burrow::net::{Client, Server};\n```\nThe feature `net`.";
    assert_eq!(unnamed_features(text, &modules, &manifest), ["plants: scatter"]);
}

#[test]
fn pages_with_programs_are_documentation_tests() {
    let library = read(&root().join("src/lib.rs"));
    for page in documents() {
        let text = read(&page);
        let name = page.strip_prefix(root()).expect("below it").to_string_lossy().into_owned();
        let is_tested = library.contains(&format!("\"{name}\""));
        assert!(
            is_tested || !text.contains("```rust"),
            "{name} has programs that no documentation test compiles"
        );
        assert!(!text.contains("rust,ignore"), "{name} has a program that is not compiled");
    }
}

#[test]
fn broken_links_and_unknown_names_are_found() {
    let page = root().join("README.md");
    let text = "# A heading, with `code`\n[a](src) [b](nowhere.md) [c](#a-heading-with-code) [d](#none)\n`[e](no)`\n\
                ```\n[f](no)\n```\n![g](docs/none.png) [h](CHANGELOG.md#changelog) [i](CHANGELOG.md#none) [j](https://k)";
    assert_eq!(broken_links(&page, text), ["nowhere.md", "#none", "docs/none.png", "CHANGELOG.md#none"]);
    let commands = "make it so, `make run`, `make nothing`\n```sh\ncargo run --features examples,nonsense --example none\n\
                    cargo test --test guide --bench none\nmake test\n```";
    let unknown = unknown_names(commands, "run: ## Run\ntest: run\n", &read(&root().join("Cargo.toml")));
    assert_eq!(unknown, ["examples none", "feature nonsense", "benches none", "make nothing"]);
}
