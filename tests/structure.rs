//! The structure of the source: modules import only lower modules, and files import each other in no circle.
//!
//! Imports are read from the source text: `use` declarations and paths, without comments, strings, and code that is
//! compiled for tests only. Re-exports are followed to the file that defines the item.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// The modules of the crate, from the ground up. Each imports only those before it.
const MODULES: &[&str] = &[
    "threads",
    "lattice",
    "lod",
    "ground",
    "brush",
    "volume",
    "edits",
    "surface",
    "dense",
    "backend",
    "world",
    "loose",
    "redraw",
    "terrain",
    "scatter",
    "navigation",
    "format",
    "store",
    "net",
    "plugin",
    "view",
    "saves",
    "plugins",
    "together",
    "physics",
    "plants",
    "paths",
    "debug",
    "panel",
];

/// The most names that the documentation shows: in the public modules of the crate themselves, with the public modules
/// within them, and as functions of `Terrain`. What a game needs is shown; what only tools and tests need is
/// `#[doc(hidden)]`, or behind the feature `tools`.
const NAMES_OF_ROOTS: usize = 237;
const SHOWN_NAMES: usize = 326;
const TERRAIN_FUNCTIONS: usize = 35;

/// The most files that lie side by side in a folder of `src`. Lower it when the largest folder is divided.
const FILES_OF_A_FOLDER: usize = 29;

/// The text of a crate's files, by path below `src`.
type Sources = BTreeMap<String, String>;

/// A path in the source, such as `["crate", "lattice", "ONE"]`.
type Segments = Vec<String>;

/// Blanks comments and the content of string and character literals.
fn without_comments(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let at = |index: usize| chars.get(index).copied().unwrap_or('\0');
    let (mut code, mut index) = (String::new(), 0);
    while index < chars.len() {
        let is_word = index > 0 && (at(index - 1).is_alphanumeric() || at(index - 1) == '_');
        match at(index) {
            '/' if at(index + 1) == '/' => {
                while index < chars.len() && at(index) != '\n' {
                    index += 1;
                }
            }
            '/' if at(index + 1) == '*' => {
                let mut depth = 0;
                loop {
                    let pair = (at(index), at(index + 1));
                    depth += i32::from(pair == ('/', '*')) - i32::from(pair == ('*', '/'));
                    index += if matches!(pair, ('/', '*') | ('*', '/')) { 2 } else { 1 };
                    if depth == 0 || index >= chars.len() {
                        break;
                    }
                }
            }
            'r' if !is_word && matches!(at(index + 1), '"' | '#') => {
                let hashes = (index + 1..).take_while(|&i| at(i) == '#').count();
                if at(index + 1 + hashes) != '"' {
                    code.push('r');
                    index += 1;
                    continue;
                }
                index += 2 + hashes;
                let closes = |i: usize| at(i) == '"' && (1..=hashes).all(|hash| at(i + hash) == '#');
                while index < chars.len() && !closes(index) {
                    index += 1;
                }
                index += 1 + hashes;
                code.push_str("\"\"");
            }
            '"' => {
                index += 1;
                while index < chars.len() && at(index) != '"' {
                    index += if at(index) == '\\' { 2 } else { 1 };
                }
                index += 1;
                code.push_str("\"\"");
            }
            // A character, unless it is a lifetime.
            '\'' if at(index + 1) == '\\' || at(index + 2) == '\'' => {
                index += if at(index + 1) == '\\' { 3 } else { 2 };
                while index < chars.len() && at(index) != '\'' {
                    index += 1;
                }
                index += 1;
                code.push_str("' '");
            }
            other => {
                code.push(other);
                index += 1;
            }
        }
    }
    code
}

/// The end of the item, field or arm that begins at `start`, its attributes included.
fn end_of_item(code: &str, start: usize) -> usize {
    let mut depth = 0;
    let mut has_comma_inside = false;
    let mut word = String::new();
    for (offset, c) in code[start..].char_indices() {
        if c.is_alphanumeric() || c == '_' {
            word.push(c);
        } else if !word.is_empty() {
            let is_item = ["fn", "impl", "mod", "use", "struct", "enum", "const", "static", "type", "trait"];
            has_comma_inside |= depth == 0 && is_item.contains(&word.as_str());
            word.clear();
        }
        match c {
            '(' | '[' | '{' => depth += 1,
            // The end of the block that the field or arm is in.
            ')' | ']' | '}' if depth == 0 => return start + offset,
            '}' if depth == 1 => return start + offset + 1,
            ')' | ']' | '}' => depth -= 1,
            ';' if depth == 0 => return start + offset + 1,
            ',' if depth == 0 && !has_comma_inside => return start + offset + 1,
            _ => {}
        }
    }
    code.len()
}

/// The code without items for tests only, and the names of modules in other files that are for tests only.
fn without_tests(code: &str) -> (String, BTreeSet<String>) {
    let (mut kept, mut modules, mut rest) = (String::new(), BTreeSet::new(), code);
    while let Some(start) = ["#[cfg(test)]", "#[cfg(all(test"].iter().filter_map(|mark| rest.find(mark)).min()
    {
        kept.push_str(&rest[..start]);
        let end = end_of_item(rest, start);
        let item = &rest[start..end];
        if let Some((_, name)) = item.split_once("mod ").filter(|_| item.ends_with(';')) {
            modules.insert(name.trim_end_matches(';').trim().to_owned());
        }
        rest = &rest[end..];
    }
    kept.push_str(rest);
    (kept, modules)
}

/// Words and punctuation.
fn tokens(code: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    let mut is_word = false;
    for c in code.chars() {
        let continues = c.is_alphanumeric() || c == '_';
        match tokens.last_mut() {
            Some(last) if continues && is_word => last.push(c),
            Some(last) if c == ':' && last == ":" => last.push(c),
            _ if !c.is_whitespace() => tokens.push(c.into()),
            _ => {}
        }
        is_word = continues;
    }
    tokens
}

/// Reads a use tree from `tokens[*at]` on, and adds each path with the name that it introduces.
fn read_tree(tokens: &[String], at: &mut usize, prefix: &[String], found: &mut Vec<(Segments, String)>) {
    let mut path = prefix.to_vec();
    while let Some(token) = tokens.get(*at) {
        match token.as_str() {
            "{" => {
                *at += 1;
                while tokens.get(*at).is_some_and(|token| token != "}" && token != ";") {
                    read_tree(tokens, at, &path, found);
                    *at += usize::from(tokens.get(*at).is_some_and(|token| token == ","));
                }
                *at += 1;
                return;
            }
            "," | "}" | ";" => break,
            "as" => {
                let name = tokens.get(*at + 1).cloned().unwrap_or_default();
                *at += 2;
                found.push((path, name));
                return;
            }
            "::" => *at += 1,
            _ => {
                path.push(token.clone());
                *at += 1;
            }
        }
    }
    if path.last().is_some_and(|last| last == "self") {
        path.pop();
    }
    let name = path.last().cloned().unwrap_or_default();
    found.push((path, name));
}

/// A file: its module, the names that its `use` declarations introduce, and the paths that it mentions.
#[derive(Default)]
struct File {
    module: Segments,
    names: Vec<(Segments, String)>,
    paths: Vec<Segments>,
}

/// The module of a file, by its path below `src`.
fn module_of(path: &str) -> Segments {
    let mut module: Segments = path.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
    if module.last().is_some_and(|last| last == "mod") {
        module.pop();
    }
    module
}

/// A crate: its files by path, and their paths by module.
struct Crate {
    files: BTreeMap<String, File>,
    by_module: BTreeMap<Segments, String>,
}

impl Crate {
    fn new(sources: &Sources) -> Self {
        let (mut files, mut for_tests) = (BTreeMap::new(), Vec::new());
        for (path, text) in sources {
            let (code, tests) = without_tests(&without_comments(text));
            let module = if path == "lib.rs" { Segments::new() } else { module_of(path) };
            for_tests.extend(tests.into_iter().map(|name| [module.clone(), vec![name]].concat()));
            files.insert(path.clone(), Self::read(module, &tokens(&code)));
        }
        files.retain(|path, file| {
            path != "lib.rs" && !for_tests.iter().any(|test| file.module.starts_with(test))
        });
        let by_module = files.iter().map(|(path, file)| (file.module.clone(), path.clone())).collect();
        Self { files, by_module }
    }

    fn read(module: Segments, tokens: &[String]) -> File {
        let mut file = File { module, ..File::default() };
        let mut at = 0;
        while at < tokens.len() {
            let is_start = at == 0 || tokens[at - 1] != "::";
            // Not the `use<..>` of captured lifetimes.
            let is_use = tokens[at] == "use" && tokens.get(at + 1).is_some_and(|next| next != "<");
            if is_use && is_start {
                let is_public = at > 0 && (tokens[at - 1] == "pub" || tokens[at - 1] == ")");
                at += 1;
                let first = file.names.len();
                read_tree(tokens, &mut at, &[], &mut file.names);
                // A module that re-exports what is below it does not depend on it.
                let is_own = |path: &Segments| !matches!(path[0].as_str(), "crate" | "super" | "std");
                let read = file.names[first..].iter().map(|(path, _)| path);
                file.paths
                    .extend(read.filter(|path| !(path.is_empty() || is_public && is_own(path))).cloned());
            } else if is_start && tokens.get(at + 1).is_some_and(|next| next == "::") {
                let mut path = vec![tokens[at].clone()];
                while tokens.get(at + 1).is_some_and(|next| next == "::") && at + 2 < tokens.len() {
                    path.push(tokens[at + 2].clone());
                    at += 2;
                }
                file.paths.push(path);
                at += 1;
            } else {
                at += 1;
            }
        }
        file
    }

    /// The file that defines what a path in `module` names, if it is in this crate.
    fn resolve(&self, module: &[String], path: &[String], depth: usize) -> Option<&str> {
        let mut base = match path.first()?.as_str() {
            "crate" => Segments::new(),
            "self" | "super" => module.to_vec(),
            name if self.by_module.contains_key(&[module, &[name.to_owned()]].concat()) => module.to_vec(),
            _ => return None,
        };
        let mut rest = path;
        while let Some(first) = rest.first() {
            match first.as_str() {
                "crate" | "self" => {}
                "super" => drop(base.pop()),
                _ => break,
            }
            rest = &rest[1..];
        }
        while let Some(first) = rest.first() {
            let next = [&base[..], std::slice::from_ref(first)].concat();
            if !self.by_module.contains_key(&next) {
                break;
            }
            (base, rest) = (next, &rest[1..]);
        }
        let own = self.by_module.get(&base)?;
        let Some(item) = rest.first() else { return Some(own) };
        let imported =
            self.files[own].names.iter().find(|(path, name)| name == item && *path != [item.clone()]);
        let imported = imported.filter(|_| depth < 9);
        imported.map_or(Some(own), |(path, _)| self.resolve(&base, path, depth + 1).or(Some(own)))
    }

    /// The files that each file imports.
    fn imports(&self) -> BTreeMap<&str, BTreeSet<&str>> {
        let of = |(path, file): (&'_ String, &'_ File)| -> BTreeSet<&str> {
            let found = file.paths.iter().filter_map(|import| self.resolve(&file.module, import, 0));
            // A `mod.rs` and the files below it are one module, which may use its parts as they use it.
            let folder = path.strip_suffix("mod.rs");
            found.filter(|found| found != path && folder.is_none_or(|own| !found.starts_with(own))).collect()
        };
        self.files.iter().map(|(path, file)| (path.as_str(), of((path, file)))).collect()
    }
}

/// The top-level module of a file.
fn top(path: &str) -> &str {
    path.split('/').next().unwrap_or_default().trim_end_matches(".rs")
}

/// Imports of higher modules: the file, and the module that it imports. Modules without a place in the order are
/// reported as importing themselves.
fn upward_imports(sources: &Sources, order: &[&str]) -> BTreeSet<(String, String)> {
    let read = Crate::new(sources);
    let rank = |path: &str| order.iter().position(|module| *module == top(path));
    let mut found = BTreeSet::new();
    for (path, imports) in read.imports() {
        if rank(path).is_none() {
            found.insert((path.to_owned(), top(path).to_owned()));
        }
        for import in imports.into_iter().filter(|import| rank(import) > rank(path)) {
            found.insert((path.to_owned(), top(import).to_owned()));
        }
    }
    found
}

/// Circles of imports: the files of each, where every file imports every other one directly or through others.
fn circles(sources: &Sources) -> BTreeSet<Vec<String>> {
    let read = Crate::new(sources);
    let imports = read.imports();
    let reached_from = |start| {
        let (mut reached, mut open) = (BTreeSet::new(), vec![start]);
        while let Some(path) = open.pop() {
            open.extend(imports[path].iter().copied().filter(|next| reached.insert(*next)));
        }
        reached
    };
    let reached: BTreeMap<&str, BTreeSet<&str>> =
        imports.keys().map(|path| (*path, reached_from(*path))).collect();
    let mutual =
        |path: &str, other: &&&str| reached[path].contains(**other) && reached[**other].contains(path);
    let circle = |path: &&str| {
        imports.keys().filter(|other| mutual(path, other)).map(|&path| path.to_owned()).collect()
    };
    imports.keys().map(circle).filter(|circle: &Vec<String>| circle.len() > 1).collect()
}

/// All Rust files below a folder.
fn read_sources(folder: &Path, prefix: &str, sources: &mut Sources) {
    for entry in fs::read_dir(folder).expect("a folder of sources").flatten() {
        let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
        if path.is_dir() {
            read_sources(&path, &format!("{prefix}{name}/"), sources);
        } else if name.ends_with(".rs") {
            sources.insert(format!("{prefix}{name}"), fs::read_to_string(&path).expect("a source file"));
        }
    }
}

fn library() -> Sources {
    let mut sources = Sources::new();
    read_sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), "", &mut sources);
    sources
}

fn crate_of(files: &[(&str, &str)]) -> Sources {
    files.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect()
}

/// The folders with more files side by side than this, and how many they have.
fn crowded_folders(sources: &Sources, most: usize) -> BTreeMap<&str, usize> {
    let mut files = BTreeMap::new();
    for (folder, _) in sources.keys().filter_map(|path| path.rsplit_once('/')) {
        *files.entry(folder).or_default() += 1;
    }
    files.retain(|_, count| *count > most);
    files
}

#[test]
fn no_folder_is_crowded() {
    let mut sources = library();
    let found = crowded_folders(&sources, FILES_OF_A_FOLDER);
    assert!(found.is_empty(), "these folders have more than {FILES_OF_A_FOLDER} files: {found:?}");
    // That many more files in a folder are too many. A folder below another one is counted separately.
    for index in 0..FILES_OF_A_FOLDER {
        sources.insert(format!("store/new{index}.rs"), String::new());
        sources.insert(format!("lod/new/{index}.rs"), String::new());
    }
    let crowded = crowded_folders(&sources, FILES_OF_A_FOLDER);
    assert_eq!(crowded.keys().copied().collect::<Vec<_>>(), ["store"]);
}

/// The modules whose tests use Bevy, as filters of tests name them.
fn modules_tested_with_bevy(sources: &Sources) -> BTreeSet<String> {
    let uses_bevy = |text: &str| text.contains("#[test]") && text.contains("use bevy::");
    let files = sources.iter().filter(|(_, text)| uses_bevy(text));
    files
        .map(|(path, _)| path.trim_end_matches(".rs").trim_end_matches("/mod").replace('/', "::") + "::")
        .collect()
}

#[test]
fn all_tests_that_use_bevy_are_run() {
    // A package has no Makefile.
    let Ok(makefile) = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("Makefile")) else {
        return;
    };
    let line = makefile.lines().find_map(|line| line.split_once("$(WITH_BEVY) --lib -- "));
    let filters: Vec<&str> = line.expect("the line of test-plugin").1.split_whitespace().collect();
    let is_run = |module: &String| filters.iter().any(|filter| module.contains(filter));
    let mut missing = modules_tested_with_bevy(&library());
    missing.retain(|module| !is_run(module));
    assert!(missing.is_empty(), "`make test-plugin` leaves out tests of {missing:?}");
    let control =
        crate_of(&[("a/b.rs", "use bevy::prelude::*; #[test] fn it() {}"), ("c.rs", "#[test] fn it() {}")]);
    assert_eq!(modules_tested_with_bevy(&control), BTreeSet::from(["a::b::".to_owned()]));
}

#[test]
fn modules_import_only_lower_ones() {
    let found = upward_imports(&library(), MODULES);
    assert!(found.is_empty(), "these files import a higher module: {found:#?}");
}

#[test]
fn files_import_each_other_in_no_circle() {
    let found = circles(&library());
    assert!(found.is_empty(), "these files import each other in circles: {found:#?}");
}

/// The files whose code, without comments and strings, has a word that begins like this.
fn files_that_name(sources: &Sources, word: &str) -> Vec<String> {
    let names = |text: &String| tokens(&without_comments(text)).iter().any(|token| token.starts_with(word));
    sources.iter().filter(|(_, text)| names(text)).map(|(path, _)| path.clone()).collect()
}

#[test]
fn only_one_file_names_the_transport() {
    let found: BTreeSet<String> =
        ["bevy_replicon", "Replicon"].iter().flat_map(|word| files_that_name(&library(), word)).collect();
    assert_eq!(found, BTreeSet::from(["together/replicon.rs".to_owned()]));
    let mut sources = library();
    sources
        .get_mut("together/client.rs")
        .expect("a file")
        .push_str("\nuse bevy_replicon::prelude::ClientId;\n");
    assert_eq!(files_that_name(&sources, "bevy_replicon").len(), 2);
}

/// A public item: the name that it introduces, the block that it is in, such as `impl Terrain`, whether it is hidden
/// from the documentation, and whether it is a module.
struct PublicItem {
    name: String,
    block: String,
    is_hidden: bool,
    is_module: bool,
}

/// The public items of a file, at its top level and in its `impl` blocks.
fn public_items(text: &str) -> Vec<PublicItem> {
    let tokens = tokens(&without_tests(&without_comments(text)).0);
    let (mut items, mut blocks, mut head, mut attributes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut at = 0;
    while at < tokens.len() {
        match tokens[at].as_str() {
            "#" => {
                let end = tokens[at..].iter().position(|token| token == "]").unwrap_or_default();
                attributes.extend_from_slice(&tokens[at..at + end]);
                at += end;
            }
            "{" => blocks.push(std::mem::take(&mut head).join(" ")),
            "}" => drop(blocks.pop()),
            ";" => head.clear(),
            "pub" if tokens.get(at + 1).is_some_and(|next| next != "(") && blocks.len() < 2 => {
                let mut names = Vec::new();
                let is_module = tokens[at + 1] == "mod";
                if tokens[at + 1] == "use" {
                    at += 2;
                    read_tree(&tokens, &mut at, &[], &mut names);
                } else {
                    let keywords =
                        ["async", "const", "enum", "fn", "mod", "static", "struct", "trait", "type"];
                    let name = tokens[at + 1..].iter().position(|token| !keywords.contains(&token.as_str()));
                    let is_item = name.is_some_and(|name| name > 0);
                    at += 1 + name.unwrap_or_default();
                    names.extend(is_item.then(|| (Segments::new(), tokens[at].clone())));
                }
                let is_hidden = attributes.iter().any(|token| token == "hidden");
                let block = blocks.last().cloned().unwrap_or_default();
                items.extend(names.into_iter().map(|(_, name)| PublicItem {
                    name,
                    block: block.clone(),
                    is_hidden,
                    is_module,
                }));
                attributes.clear();
            }
            word => head.push(word.to_owned()),
        }
        if tokens.get(at).is_some_and(|token| matches!(token.as_str(), ";" | "{" | "}")) {
            attributes.clear();
            head.clear();
        }
        at += 1;
    }
    items
}

/// The names that the documentation of a crate shows in its public modules and in those within them, as `module::name`.
fn shown_names(sources: &Sources) -> Vec<String> {
    let modules = public_items(&sources["lib.rs"]).into_iter().filter(|module| !module.is_hidden);
    modules.flat_map(|module| shown_in(sources, &module.name)).collect()
}

/// The names of those that are in the crate's public modules themselves, and not in modules within them.
fn names_of_roots(names: &[String]) -> Vec<&String> {
    names.iter().filter(|name| name.matches("::").count() == 1).collect()
}

/// The names that a module at this path shows.
fn shown_in(sources: &Sources, module: &str) -> Vec<String> {
    let text = ["/mod.rs", ".rs"].iter().find_map(|end| sources.get(&format!("{module}{end}")));
    let items = text.map(|text| public_items(text)).unwrap_or_default();
    let shown = items.into_iter().filter(|item| !item.is_hidden && item.block.is_empty());
    let name = |item: PublicItem| match item.is_module {
        true => shown_in(sources, &format!("{module}/{}", item.name)),
        false => vec![format!("{}::{}", module.replace('/', "::"), item.name)],
    };
    shown.flat_map(name).collect()
}

/// The public functions of a type that the documentation shows, without its constants.
fn shown_functions(sources: &Sources, folder: &str, owner: &str) -> Vec<String> {
    let files = sources.iter().filter(|(path, _)| path.starts_with(folder));
    let items = files.flat_map(|(_, text)| public_items(text));
    let block = format!("impl {owner}");
    let functions = items.filter(|item| !item.name.starts_with(char::is_uppercase));
    functions.filter(|item| item.block == block && !item.is_hidden).map(|item| item.name).collect()
}

#[test]
fn the_public_surface_does_not_grow_unnoticed() {
    let sources = library();
    let (names, functions) = (shown_names(&sources), shown_functions(&sources, "terrain/", "Terrain"));
    let of_roots = names_of_roots(&names).len();
    println!("{of_roots} names of roots, {} in all: {}", names.len(), names.join(" "));
    println!("{} functions: {}", functions.len(), functions.join(" "));
    assert!(of_roots <= NAMES_OF_ROOTS, "the public modules show {of_roots} names of their own");
    assert!(names.len() <= SHOWN_NAMES, "{} names are shown in public modules", names.len());
    assert!(functions.len() <= TERRAIN_FUNCTIONS, "`Terrain` shows {} functions", functions.len());
}

#[test]
fn public_items_are_counted_however_they_are_written() {
    let lib = "pub mod a;\npub mod e;\n#[doc(hidden)]\npub mod b;\nmod c;\npub(crate) mod d;";
    let a = "pub use x::{A, y::{B, C as D}};\n#[doc(hidden)]\npub use x::E;\n#[cfg(test)]\npub use x::F;\n\
             /// pub fn no() {}\npub const fn f() {}\npub struct S { pub field: u8 }\npub(crate) struct T;\n\
             impl S {\n pub const MOST: u8 = 1;\n pub fn one(&self) { g() }\n #[doc(hidden)]\n #[must_use]\n pub fn two() {}\n fn three() {}\n\
             #[must_use]\n pub const fn four() {} }\nimpl T { pub fn five() {} }";
    let sources = crate_of(&[
        ("lib.rs", lib),
        ("a/mod.rs", a),
        ("b.rs", "pub struct G;"),
        ("c.rs", "pub struct H;"),
        ("e/mod.rs", "pub mod f;\npub struct I;"),
        ("e/f.rs", "pub struct J;\npub struct K;"),
    ]);
    let names = shown_names(&sources);
    assert_eq!(names, ["a::A", "a::B", "a::D", "a::f", "a::S", "e::f::J", "e::f::K", "e::I"]);
    assert_eq!(names_of_roots(&names), ["a::A", "a::B", "a::D", "a::f", "a::S", "e::I"]);
    assert_eq!(shown_functions(&sources, "a/", "S"), ["one", "four"]);
}

/// Observers of a component's life that would miss it on a disabled entity: a query in their signature leaves those
/// out.
fn observers_blind_to_disabled(sources: &Sources) -> Vec<String> {
    let mut found = Vec::new();
    for (path, text) in sources {
        let code = without_comments(text);
        for function in code.split("fn ").skip(1) {
            let signature = function.split('{').next().unwrap_or_default();
            let life = ["Add", "Insert", "Discard", "Remove", "Despawn"];
            let observes = life.iter().any(|event| signature.contains(&format!(": On<{event},")));
            let (queries, aware) =
                (signature.matches("Query<").count(), signature.matches("Allow<Disabled>").count());
            if observes && queries > aware {
                let name = function.split('(').next().unwrap_or_default();
                found.push(format!("{path}: {name}"));
            }
        }
    }
    found
}

#[test]
fn what_a_disabled_entity_gains_or_loses_is_seen() {
    assert_eq!(observers_blind_to_disabled(&library()), [""; 0]);
    let blind = "\nfn forget(\n    gone: On<Remove, Mark>,\n    marks: Query<&Mark>,\n) {}\n";
    let aware = blind.replace("Query<&Mark>", "Query<&Mark, Allow<Disabled>>");
    let sources = crate_of(&[("a.rs", blind), ("b.rs", &aware)]);
    assert_eq!(observers_blind_to_disabled(&sources), ["a.rs: forget"]);
}

#[test]
fn imports_are_read_however_they_are_written() {
    let sources = crate_of(&[
        ("lib.rs", "mod low; mod high;"),
        (
            "low/mod.rs",
            "mod item; mod plain;\n#[cfg(test)]\nmod laws;\npub use item::{Item, other as Renamed};",
        ),
        ("low/item.rs", "pub struct Item; // use crate::high::Thing;\npub fn other() {}"),
        (
            "low/plain.rs",
            "fn f<'a>(c: char) -> &'a str { if c == '\"' { \"crate::high::Thing\" } else { r#\"super::item\"# } }",
        ),
        ("low/laws.rs", "use crate::high::Thing;"),
        (
            "high/mod.rs",
            "mod by_use;\nmod by_path;\npub struct Thing;\n#[cfg(test)]\nmod tests { use super::by_use::Unused; }",
        ),
        (
            "high/by_use.rs",
            "use crate::{low::{Item as It, Renamed}, high::Thing};\n#[cfg(test)] use super::by_path::g;",
        ),
        ("high/by_path.rs", "pub fn g() { let _ = (crate::low::Item, super::by_use::Other::new()); }"),
    ]);
    let read = Crate::new(&sources);
    let imports = read.imports();
    let of = |path: &str| imports[path].iter().copied().collect::<Vec<_>>();
    assert!(!imports.contains_key("low/laws.rs"));
    assert_eq!(of("low/mod.rs"), [""; 0]);
    assert_eq!(of("low/item.rs"), [""; 0]);
    assert_eq!(of("low/plain.rs"), [""; 0]);
    assert_eq!(of("high/mod.rs"), [""; 0]);
    assert_eq!(of("high/by_use.rs"), ["high/mod.rs", "low/item.rs"]);
    assert_eq!(of("high/by_path.rs"), ["high/by_use.rs", "low/item.rs"]);
    assert!(circles(&sources).is_empty() && upward_imports(&sources, &["low", "high"]).is_empty());
}

#[test]
fn upward_imports_and_circles_are_found() {
    // In a small crate.
    let sources = crate_of(&[
        ("low/mod.rs", "pub mod a; pub mod b; pub mod c;"),
        ("low/a.rs", "use super::b::B; pub struct A;"),
        ("low/b.rs", "use super::c::C; pub struct B;"),
        ("low/c.rs", "pub struct C; fn f() -> crate::low::a::A { crate::high::thing() }"),
        ("high.rs", "use crate::low::a::A; pub fn thing() {}"),
    ]);
    let all = ["high.rs", "low/a.rs", "low/b.rs", "low/c.rs"].map(str::to_owned).to_vec();
    assert_eq!(circles(&sources), BTreeSet::from([all]));
    assert_eq!(
        upward_imports(&sources, &["low", "high"]),
        BTreeSet::from([("low/c.rs".into(), "high".into())])
    );
    assert_eq!(upward_imports(&sources, &["low"]).len(), 2, "a module that is not in the order is reported");

    // In this one, with one more line in a file of its lowest module.
    let mut sources = library();
    let before = upward_imports(&sources, MODULES).len();
    let text = sources.get_mut("lattice/grid.rs").expect("a file");
    text.push_str("\nuse crate::volume::{Brick, DiggingRules};\n");
    assert_eq!(upward_imports(&sources, MODULES).len(), before + 1);
    let has = |circle: &Vec<String>, file: &str| circle.iter().any(|own| own == file);
    assert!(circles(&sources).iter().any(|all| has(all, "lattice/grid.rs") && has(all, "volume/brick.rs")));
}
