//! Tests of the command from outside: files in, files and exit codes out. Meshes are checked by a separate OBJ reader
//! that is independent of the library's seam validator.

use std::collections::HashMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Parser;
use serde_json::Value;

use crate::obj::push_voxels;
use crate::staging::Staging;
use crate::{Args, export};

const DIG: &str = r#"{"shape":"sphere","center":[9,30,9],"radius":4,"op":"dig"}"#;

/// A temporary folder that is removed when dropped.
struct TempFolder(PathBuf);

impl TempFolder {
    fn new() -> Self {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("bevy_burrow-export-{}-{count}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder for temporary files");
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn put(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        fs::write(self.path(name), content).expect("a writable folder");
        self.path(name)
    }

    /// Writes an 8-bit image of `width` columns.
    fn put_image(&self, samples: &[u8], width: u32) -> PathBuf {
        let (path, height) = (self.path("heights.png"), samples.len() as u32 / width);
        image::save_buffer(&path, samples, width, height, image::ExtendedColorType::L8).expect("an image");
        path
    }

    /// A hilly world of 40 x 33 cells.
    fn put_hills(&self) -> PathBuf {
        let hill = |i: u32| 30.0 + 14.0 * (f64::from(i % 41) * 0.31).sin() * (f64::from(i / 41) * 0.23).cos();
        self.put_image(&(0..41 * 34).map(|i| hill(i) as u8).collect::<Vec<_>>(), 41)
    }

    /// Runs the command; returns the report, or the exit code and the text on stderr.
    fn run(&self, edits: &Path, more: &[&str]) -> Result<Value, (u8, String)> {
        let (heights, out) = (self.path("heights.png"), self.path("out"));
        let mut line = vec!["export".as_ref(), "--heights".as_ref(), heights.as_os_str()];
        line.extend(["--edits".as_ref(), edits.as_os_str(), "--out".as_ref(), out.as_os_str()]);
        line.extend(more.iter().map(AsRef::<std::ffi::OsStr>::as_ref));
        let args =
            Args::try_parse_from(line).map_err(|error| (error.exit_code() as u8, error.to_string()))?;
        export(&args).map_err(|error| (error.exit_code(), error.to_string()))?;
        let report = fs::read(self.path("out/report.json")).expect("a report");
        Ok(serde_json::from_slice(&report).expect("valid JSON"))
    }

    fn mesh(&self) -> Obj {
        Obj::parse(&fs::read_to_string(self.path("out/mesh.obj")).expect("a mesh"))
    }
}

impl Drop for TempFolder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A parsed mesh: positions in voxels, triangle indices from 0, and group names.
#[derive(Default)]
struct Obj {
    places: Vec<[f64; 3]>,
    triangles: Vec<[usize; 3]>,
    groups: Vec<String>,
}

impl Obj {
    fn parse(text: &str) -> Self {
        let mut obj = Self::default();
        for line in text.lines() {
            let mut words = line.split(' ');
            let key = words.next().expect("no empty line");
            let mut three = || [(); 3].map(|()| words.next().expect("three words"));
            match key {
                "#" => {}
                "g" => obj.groups.push(line[2..].into()),
                "v" => obj.places.push(three().map(|word| word.parse().expect("a number"))),
                "f" => obj.triangles.push(three().map(|word| word.parse::<usize>().expect("a number") - 1)),
                other => panic!("unexpected line: {other}"),
            }
        }
        obj
    }

    /// Edges away from the rim that are not used exactly once in each direction; equal positions count as one vertex.
    fn loose_edges(&self, width: f64, depth: f64) -> Vec<[[f64; 3]; 2]> {
        let key = |place: [f64; 3]| place.map(|v| (v + 0.0).to_bits());
        let mut balance: HashMap<_, (i32, i32, [[f64; 3]; 2])> = HashMap::new();
        for triangle in &self.triangles {
            let corners = triangle.map(|index| self.places[index]);
            for (from, to) in [(0, 1), (1, 2), (2, 0)] {
                let (from, to) = (corners[from], corners[to]);
                assert_ne!(from, to, "a triangle has no extent");
                let (a, b) = (key(from), key(to));
                let edge = balance.entry((a.min(b), a.max(b))).or_insert((0, 0, [from, to]));
                if a < b { edge.0 += 1 } else { edge.1 += 1 }
            }
        }
        let on_rim = |[a, b]: [[f64; 3]; 2]| {
            [(0, 0.0), (0, width), (2, 0.0), (2, depth)]
                .iter()
                .any(|&(axis, at)| a[axis] == at && b[axis] == at)
        };
        let loose =
            balance.into_values().filter(|&(one, other, ends)| (one, other) != (1, 1) && !on_rim(ends));
        loose.map(|(.., ends)| ends).collect()
    }
}

#[test]
fn every_edge_of_the_mesh_joins_two_triangles() {
    for (chunk_size, batch) in [("8", "1"), ("25", "3"), ("32", "100")] {
        let temp = TempFolder::new();
        temp.put_hills();
        let edits = temp.put(
            "edits.jsonl",
            r#"# A pit over a chunk corner, a tunnel, a bridge, a turned box, a cone at the rim, paint, and a cave.
{"shape":"sphere","center":[8,32,8],"radius":5,"op":"dig"}

{"shape":"capsule","from":[2,28,20],"to":[38,31,22],"radius":3,"op":"dig"}
{"shape":"cylinder","base":[20,36,10],"axis":[0,0,20],"radius":2.5,"op":"add","material":5}
{"shape":"box","center":[30,36,30],"half":[6,2,3],"rotation":[0.5,0.5,0.5,0.5],"op":"add","material":4}
{"shape":"cone","base":[40,40,16],"axis":[0,-20,1],"radius":6,"op":"dig"}
{"shape":"sphere","center":[25,33,10],"radius":5,"op":"paint","material":3}
{"shape":"sphere","center":[12,12,25],"radius":4,"op":"dig","roughness":{"amplitude":1,"scale":3,"seed":1},"tag":7}"#,
        );
        let report =
            temp.run(&edits, &["--chunk-size", chunk_size, "--batch", batch]).expect("a good script");
        let mesh = temp.mesh();
        assert_eq!(mesh.loose_edges(40.0, 33.0), Vec::<[[f64; 3]; 2]>::new(), "chunk size {chunk_size}");
        assert_eq!(report["seams"]["flawless"], true);
        assert_eq!(report["seams"]["triangles"], mesh.triangles.len());
        assert_eq!(report["totals"]["applied"], 7);
        let groups = |kind: &str| mesh.groups.iter().filter(|name| name.starts_with(kind)).count();
        assert_eq!(report["chunks"], groups("chunk_"));
        assert!(groups("tile_") > 0 && mesh.groups.iter().any(|name| name == "tile_0_0"));
        let corners = mesh.triangles.as_flattened();
        assert!((0..mesh.places.len()).all(|index| corners.contains(&index)), "a vertex is in no triangle");
    }
}

#[test]
fn the_checker_finds_a_missing_triangle() {
    let temp = TempFolder::new();
    temp.put_hills();
    temp.run(&temp.put("edits.jsonl", DIG), &[]).expect("a good script");
    let mut mesh = temp.mesh();
    let inner =
        |triangle: &[usize; 3]| triangle.iter().all(|&index| (5.0..28.0).contains(&mesh.places[index][0]));
    let at = mesh.triangles.iter().rposition(inner).expect("an inner triangle");
    mesh.triangles.remove(at);
    assert_eq!(mesh.loose_edges(40.0, 33.0).len(), 3);
}

#[test]
fn image_columns_run_along_x_and_samples_are_lattice_heights() {
    let temp = TempFolder::new();
    temp.put_image(&[0, 51, 102, 153, 204, 255], 3);
    let none = temp.put("edits.jsonl", "\n# nothing to do\n");
    temp.run(&none, &["--chunk-size", "8"]).expect("an empty script");
    let mut places = temp.mesh().places;
    places.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
    let at = |x: f64, z: f64| [x, 51.0 * (x + 3.0 * z), z];
    assert_eq!(places, [at(0., 0.), at(0., 1.), at(1., 0.), at(1., 1.), at(2., 0.), at(2., 1.)]);

    let report =
        temp.run(&none, &["--height-range", "-8", "16.5", "--voxels-per-sample", "4"]).expect("valid");
    assert_eq!(report["world"]["heights"], serde_json::json!([-8.0, 16.5]));
    assert_eq!((&report["world"]["width"], &report["world"]["depth"]), (&8.into(), &4.into()));
}

#[test]
fn hash_and_samples_depend_on_neither_chunks_nor_batches() {
    let hashes = [("8", "1"), ("100", "1"), ("25", "2")].map(|(chunk_size, batch)| {
        let temp = TempFolder::new();
        temp.put_hills();
        let edits = temp.put("edits.jsonl", format!("{DIG}\n{}", DIG.replace("9,30,9", "12,30,11")));
        let report =
            temp.run(&edits, &["--chunk-size", chunk_size, "--batch", batch]).expect("a good script");
        (report["hash"].clone(), report["bricks"].clone(), report["totals"]["removed"].clone())
    });
    assert!(hashes[0] == hashes[1] && hashes[1] == hashes[2], "{hashes:?}");
}

#[test]
fn an_edit_outside_the_world_is_reported_with_its_line() {
    let temp = TempFolder::new();
    temp.put_hills();
    let outside = DIG.replace("9,30,9", "-500,30,9");
    let report =
        temp.run(&temp.put("edits.jsonl", format!("{DIG}\n\n{outside}\n")), &[]).expect("a good script");
    assert_eq!(report["totals"]["applied"], 1);
    assert_eq!(report["edits"][0]["line"], 1);
    assert_eq!(report["edits"][1]["line"], 3);
    assert_eq!(report["edits"][1]["rejected"], "the brush lies outside the world");
}

/// Voxels by material in a report.
fn voxels(counts: &Value) -> HashMap<u64, u64> {
    let counts = counts.as_object().expect("an object of materials");
    counts
        .iter()
        .map(|(id, voxels)| (id.parse().expect("an id"), voxels.as_u64().expect("a number")))
        .collect()
}

#[test]
fn each_line_yields_what_the_probes_say() {
    let temp = TempFolder::new();
    temp.put_hills();
    // Boxes that end between lattice points: every point inside turns to air.
    let dig = |center: [i32; 3]| {
        format!(r#"{{"shape":"box","center":{center:?},"half":[3.5,6.5,3.5],"op":"dig","power":60}}"#)
    };
    let centers = [[10, 24, 10], [25, 20, 20], [30, 8, 9]];
    let edits = temp.put("edits.jsonl", centers.map(dig).join("\n"));
    let around = |[x, y, z]: [i32; 3]| {
        let points = (-3..=3).flat_map(move |dx| {
            (-6..=6).flat_map(move |dy| (-3..=3).map(move |dz| [x + dx, y + dy, z + dz]))
        });
        points.collect::<Vec<_>>()
    };
    let lines: Vec<String> =
        centers.into_iter().flat_map(around).map(|point| format!("{point:?}\n")).collect();
    let probe = temp.put("probe.jsonl", lines.concat());
    let rules = temp.put("rules.json", r#"{"unbreakable":[6],"hardness":{"12":200}}"#);
    for strata in ["alpine", "desert", "mine"] {
        let more = [
            "--strata",
            strata,
            "--probe",
            probe.to_str().expect("a path"),
            "--rules",
            rules.to_str().expect("a path"),
        ];
        let report = temp.run(&edits, &more).expect("a good script");
        let probes = fs::read(temp.path("out/probes.json")).expect("probes");
        let probes: Vec<Value> = serde_json::from_slice(&probes).expect("valid JSON");
        assert_eq!(probes.len(), lines.len());
        for (edit, probes) in
            report["edits"].as_array().expect("a list").iter().zip(probes.chunks(7 * 13 * 7))
        {
            let mut expected = [HashMap::new(), HashMap::new()];
            for probe in probes.iter().filter(|probe| probe["solid"] == true) {
                let material = probe["material"].as_u64().expect("an id");
                *expected[usize::from(material == 6 || material == 12)].entry(material).or_default() += 1;
            }
            assert_eq!([&edit["removed"], &edit["refused"]].map(voxels), expected, "{strata}");
        }
        assert!(voxels(&report["totals"]["removed"]).len() > 2);
    }
}

#[test]
fn strata_come_from_a_file_too() {
    let temp = TempFolder::new();
    temp.put_hills();
    let edits = temp.put("edits.jsonl", DIG.replace("\"radius\":4", "\"radius\":9"));
    let strata = r#"{"strata":[{"material":9,"depth":[null,2]},{"material":4,"body":{"pocket":{"scale":8,"share":0.5}}}]}"#;
    let strata = temp.put("strata.json", strata);
    let report = temp.run(&edits, &["--strata", strata.to_str().expect("a path")]).expect("good strata");
    let mut removed: Vec<_> = voxels(&report["totals"]["removed"]).into_keys().collect();
    removed.sort_unstable();
    assert_eq!(removed, [0, 4, 9]);
    for (content, reason) in [
        ("{", "EOF while parsing"),
        (r#"{"strata":[{"material":255}]}"#, "the material of stratum 0 is 255"),
        (r#"{"strata":[{"metal":2}]}"#, "unknown field `metal`"),
    ] {
        let bad = temp.put("strata.json", content);
        let (code, error) =
            temp.run(&edits, &["--strata", bad.to_str().expect("a path")]).expect_err(content);
        assert!(code == 2 && error.contains(reason), "{error}");
    }
    for (option, name, reason) in [
        ("--strata", "moon", "neither a file nor one of the presets"),
        ("--rules", "moon", "No such file"),
        ("--probe", edits.to_str().expect("a path"), "invalid type: map"),
    ] {
        let (code, error) = temp.run(&edits, &[option, name]).expect_err(option);
        assert!(code == 2 && error.contains(reason), "{error}");
    }
}

#[test]
fn bad_lines_are_named_and_nothing_is_written() {
    let temp = TempFolder::new();
    temp.put_hills();
    for (line, reason) in [
        ("{", "EOF while parsing"),
        ("[]", "expected a JSON object"),
        ("dig here", "expected a JSON object"),
        (r#"{"undo":true}"#, "no steps through history"),
        (r#"{"shape":"ball","op":"dig"}"#, "unknown variant `ball`"),
        (r#"{"shape":"sphere","center":[0,0,0],"op":"dig"}"#, "missing field `radius`"),
        (r#"{"shape":"sphere","center":[0,0,0],"radius":-1,"op":"dig"}"#, "`radius` is -1 voxels"),
        (r#"{"shape":"sphere","center":[0,0,0],"radius":1e300,"op":"dig"}"#, "must be finite"),
        (r#"{"shape":"sphere","center":[0,0,0],"radius":1e999,"op":"dig"}"#, "number out of range"),
        (r#"{"shape":"sphere","center":[1e9,0,0],"radius":1,"op":"dig"}"#, "beyond"),
        (r#"{"shape":"sphere","center":[0,0,0],"radius":1,"op":"add"}"#, "missing field `material`"),
        (
            r#"{"shape":"cone","base":[0,0,0],"axis":[0,0,0],"radius":1,"op":"dig"}"#,
            "`axis` is 0 voxels long",
        ),
        ("{\"shape\":\"\u{0}\"}", "control character"),
    ] {
        let (code, message) =
            temp.run(&temp.put("edits.jsonl", format!("{DIG}\n{line}\n")), &[]).unwrap_err();
        assert_eq!(code, 2, "{message}");
        assert!(message.contains("edits.jsonl: line 2: ") && message.contains(reason), "{line}: {message}");
        assert!(!temp.path("out").exists(), "{line}: something was written");
    }
    temp.run(&temp.put("edits.jsonl", format!("\u{feff}{DIG}\n")), &[])
        .expect("a byte order mark is allowed");
    fs::remove_dir_all(temp.path("out")).expect("the folder");
    let (code, message) = temp.run(&temp.put("edits.jsonl", b"\xff\xfe\n{\n"), &[]).unwrap_err();
    assert!(code == 2 && message.contains("line 1: the line is not UTF-8") && message.contains("line 2: "));
    let (_, message) = temp.run(&temp.put("edits.jsonl", "{\n".repeat(30)), &[]).unwrap_err();
    assert!(message.lines().count() == 21 && message.ends_with("10 more bad lines"), "{message}");
}

#[test]
fn json_is_read_as_editors_save_it() {
    let temp = TempFolder::new();
    temp.put_hills();
    let edits = temp.put("edits.jsonl", DIG);
    for (option, json) in [("--rules", r#"{"bedrock":-20}"#), ("--strata", r#"{"seed":1}"#)] {
        for text in [json.to_owned(), format!("\u{feff}{json}\r\n")] {
            let path = temp.put("file.json", text);
            temp.run(&edits, &[option, &path.display().to_string()]).expect("a byte order mark is allowed");
            fs::remove_dir_all(temp.path("out")).expect("the folder");
        }
        let utf_16: Vec<u8> = "\u{feff}{}".encode_utf16().flat_map(u16::to_le_bytes).collect();
        let path = temp.put("file.json", utf_16);
        let (code, message) = temp.run(&edits, &[option, &path.display().to_string()]).unwrap_err();
        assert!(code == 2 && message.contains("save it as UTF-8"), "{message}");
    }
}

#[test]
fn bad_arguments_and_files_are_refused_and_nothing_is_written() {
    let temp = TempFolder::new();
    let edits = temp.put("edits.jsonl", DIG);
    let refused = |edits: &Path, more: &[&str], reason: &str| {
        let (code, message) = temp.run(edits, more).unwrap_err();
        assert!(code == 2 && message.contains(reason), "{more:?}: {code} {message}");
        assert!(!temp.path("out").exists(), "{more:?}: something was written");
    };
    refused(&edits, &[], "heights.png: No such file");
    temp.put("heights.png", "no image at all");
    refused(&edits, &[], "heights.png: the image cannot be decoded");
    temp.put_image(&[1, 2, 3], 3);
    refused(&edits, &[], "spans no cell");
    image::save_buffer(temp.path("heights.png"), &[0; 12], 2, 2, image::ExtendedColorType::Rgb8)
        .expect("an image");
    refused(&edits, &[], "heights need plain grey");
    temp.put_hills();
    refused(&temp.path("none.jsonl"), &[], "none.jsonl: No such file");
    refused(&temp.0, &[], "Is a directory");
    for (more, reason) in [
        (&["--chunk-size", "7"][..], "chunk size 7 is not in 8..=128"),
        (&["--chunk-size", "129"], "chunk size 129"),
        (&["--chunk-size", "-8"], "unexpected argument"),
        (&["--voxels-per-sample", "0"], "voxels per sample is 0"),
        (&["--voxels-per-sample", "65"], "voxels per sample is 65"),
        (&["--height-range", "0", "nan"], "height of full grey is NaN"),
        (&["--height-range", "0", "40000"], "height of full grey is 40000"),
        (&["--height-range", "0"], "2 values required"),
        (&["--height-range", "5", "5"], "flat land"),
        (&["--batch", "0"], "--batch"),
        (&["--heihgts", "x.png"], "unexpected argument"),
    ] {
        refused(&edits, more, reason);
    }
}

#[test]
fn an_unwritable_folder_has_another_exit_code_than_bad_input() {
    let temp = TempFolder::new();
    temp.put_hills();
    let edits = temp.put("edits.jsonl", DIG);
    temp.put("out", "a file where the folder should be");
    assert_eq!(temp.run(&edits, &[]).unwrap_err().0, 1);
    fs::remove_file(temp.path("out")).expect("the file");
    // A folder has the report's name, which is only found after the mesh was staged.
    fs::create_dir_all(temp.path("out/report.json")).expect("a folder");
    assert_eq!(temp.run(&edits, &[]).unwrap_err().0, 1);
    assert_eq!(fs::read_dir(temp.path("out")).expect("the folder").count(), 1, "something was left behind");
}

#[test]
fn files_get_their_names_together_or_not_at_all() {
    let temp = TempFolder::new();
    let read = || fs::read_to_string(temp.path("a")).ok();
    let stage = |content: &str| {
        let mut staging = Staging::new(&temp.0).expect("a folder");
        for name in ["a", "b"] {
            staging.write(name, |out| out.write_all(content.as_bytes())).expect("a file");
        }
        staging
    };
    // A folder takes the second name while the files are written.
    for before in [None, Some("first".to_string())] {
        let staging = stage("second");
        fs::create_dir(temp.path("b")).expect("a folder");
        assert!(staging.publish().is_err() && read() == before, "the first rename was not undone");
        fs::remove_dir(temp.path("b")).expect("the folder");
        stage("first").publish().expect("both names are free");
        assert_eq!(read().as_deref(), Some("first"));
        assert_eq!(fs::read_dir(&temp.0).expect("the folder").count(), 2, "something was left behind");
        fs::remove_file(temp.path("b")).expect("the file");
    }
}

#[test]
fn what_an_eye_sees_is_closed_and_coarser_far_away() {
    let folder = TempFolder::new();
    folder.put_hills();
    let edits = folder.put("edits.jsonl", DIG);
    let full = folder.run(&edits, &[]).expect("a valid command");
    assert!(full.get("levels").is_none());
    let more = ["--chunk-size", "8", "--eye", "4", "40", "4", "--screen-height", "40"];
    let report = folder.run(&edits, &more).expect("a valid command");
    let levels = report["levels"].as_array().expect("levels");
    let of =
        |name: &str| levels.iter().map(|level| level[name].as_u64().expect("a number")).collect::<Vec<_>>();
    assert!(of("nodes").iter().filter(|&&count| count > 0).count() > 1, "{levels:?}");
    assert_eq!(of("triangles").iter().sum::<u64>(), report["seams"]["triangles"].as_u64().expect("a number"));
    assert_eq!((&report["hash"], &report["seams"]["closed"]), (&full["hash"], &Value::Bool(true)));
    let mesh = folder.mesh();
    assert_eq!(mesh.groups.len() as u64, of("nodes").iter().sum::<u64>());
    assert!(mesh.groups.iter().any(|name| name.ends_with("level_0")), "{:?}", mesh.groups);
    assert!(mesh.loose_edges(40.0, 33.0).is_empty());
}

#[test]
fn random_cuts_are_closed() {
    let folder = TempFolder::new();
    folder.put_hills();
    let edits = folder.put("edits.jsonl", DIG);
    let mut seen = std::collections::BTreeSet::new();
    for seed in ["1", "2", "3", "4"] {
        let report =
            folder.run(&edits, &["--chunk-size", "8", "--random-cut", seed]).expect("a valid command");
        assert_eq!(report["seams"]["closed"], Value::Bool(true), "{seed}");
        seen.insert(report["levels"].to_string());
        assert!(folder.mesh().loose_edges(40.0, 33.0).is_empty(), "{seed}");
    }
    assert!(seen.len() > 1, "all cuts are alike");
    let both = folder.run(&edits, &["--random-cut", "1", "--eye", "1", "2", "3"]);
    assert_eq!(both.expect_err("which one?").0, 2);
    let nowhere = folder.run(&edits, &["--eye", "nan", "2", "3"]).expect_err("nowhere");
    assert!(nowhere.0 == 2 && nowhere.1.contains("finite"), "{nowhere:?}");
}

#[test]
fn positions_are_written_exactly() {
    for (steps, text) in
        [(0, "0"), (4096, "1"), (-4096, "-1"), (1, "0.000244140625"), (-1, "-0.000244140625"), (6144, "1.5")]
    {
        let mut written = String::new();
        push_voxels(&mut written, steps);
        assert_eq!(written, text);
    }
    for steps in (-(1i64 << 27)..1 << 27).step_by(4999) {
        let mut written = String::new();
        push_voxels(&mut written, steps);
        assert_eq!(written.parse::<f64>(), Ok(steps as f64 / 4096.0));
    }
}

#[test]
fn further_files_hold_the_same_mesh_and_surface() {
    let temp = TempFolder::new();
    temp.put_hills();
    let edits = temp.put("edits.jsonl", DIG);
    let more = ["--glb", "--splats", "--elevation", "png", "--strata", "alpine"];
    let report = temp.run(&edits, &more).expect("a good script");
    let file = fs::read(temp.path("out/mesh.glb")).expect("a mesh");
    let length = u32::from_le_bytes(file[12..16].try_into().expect("4 bytes")) as usize;
    let json: Value = serde_json::from_slice(&file[20..20 + length]).expect("valid JSON");
    let indices = json["meshes"].as_array().expect("meshes").iter().map(|mesh| {
        let accessor = mesh["primitives"][0]["indices"].as_u64().expect("indices") as usize;
        json["accessors"][accessor]["count"].as_u64().expect("a count")
    });
    assert_eq!(indices.sum::<u64>(), 3 * temp.mesh().triangles.len() as u64);
    let layers = report["splat_layers"].as_array().expect("layers").len();
    assert!(layers > 0);
    for number in 0..4 {
        let path = temp.path(&format!("out/splat_{number}.png"));
        assert_eq!(path.exists(), number * 4 < layers);
    }
    assert!(report["elevation_range"][0].as_f64() < report["elevation_range"][1].as_f64());
    assert!(temp.path("out/elevation.png").exists());
}
