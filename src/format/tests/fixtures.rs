//! Stored files of each schema: they can still be read, and are still written with the same bytes.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{IVec3, Vec3};

use super::{compare, worlds};
use crate::brush::{Brush, Shape};
use crate::format::level::{LEVEL_JSON, Level, LevelFiles};
use crate::format::portable::{PortableWorld, read_portable, write_portable};
use crate::ground::{Ground, MaterialId};
use crate::lattice::LatticeBox;
use crate::terrain::{LooseSettings, Terrain, TerrainSettings};
use crate::volume::DiggingRules;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/store/schema_1")
}

/// Stairs, the same on every machine.
fn ground() -> Arc<Ground> {
    let height = |x: i32, z: i32| f64::from((x * 7 + z * 13) % 32) / 4.0 + f64::from(x / 16);
    Arc::new(Ground::from_fn(96, 80, height).expect("valid heights"))
}

/// A world with something of everything.
fn world() -> Terrain {
    let mut terrain = worlds::terrain(&ground());
    let box_of = |low: i32, high: i32| LatticeBox { min: IVec3::splat(low), max: IVec3::splat(high) };
    let rules = DiggingRules::default().with_hardness(MaterialId(2), 9).with_bedrock(-30);
    terrain.set_rules(rules.with_protected(box_of(60, 70))).expect("valid rules");
    terrain.set_loose(Some(LooseSettings { crumbs: 30, ..LooseSettings::default() }));
    let at = Vec3::new(40.0, 5.0, 30.0);
    let ball = Shape::sphere(at, 4.5);
    worlds::apply(
        &mut terrain,
        [
            Brush::dig(Shape::sphere(at, 14.0)).with_tag(3),
            Brush::add(ball, MaterialId(2)).with_stroke(8),
            Brush::paint(Shape::sphere(at + 20.0, 6.0), MaterialId(4)),
            Brush::raise(Shape::sphere(Vec3::new(64.0, 8.0, 64.0), 6.0), 2.0),
            Brush::dig(Shape::cuboid(at + 3.0, Vec3::new(2.0, 9.0, 1.5))),
        ],
    );
    terrain.undo();
    worlds::apply(&mut terrain, [Brush::dig(Shape::sphere(Vec3::new(20.0, 1.0, 60.0), 3.0))]);
    terrain
}

/// The [`Terrain::SIMULATION`] of the stored files; those of later ones have the same form.
const STORED_SIMULATION: u32 = 1;

fn written() -> (PortableWorld, Vec<u8>, LevelFiles) {
    let (ground, mut terrain) = (ground(), world());
    let game = [("spawn".to_owned(), vec![1, 2, 3])].into();
    let level = Level::new(terrain.parts(), TerrainSettings::default().voxel_size, game, &ground);
    let mut portable = worlds::portable(&mut terrain, &ground);
    portable.metadata.simulation = STORED_SIMULATION;
    let file = write_portable(&portable).unwrap();
    let mut files = level.to_files().expect("a valid level");
    let json = files.get_mut(LEVEL_JSON).expect("each level has one");
    let line = |simulation: u32| format!("\"simulation\": {simulation},");
    let text = String::from_utf8(std::mem::take(json)).expect("JSON is text");
    assert!(text.contains(&line(Terrain::SIMULATION)));
    *json = text.replacen(&line(Terrain::SIMULATION), &line(STORED_SIMULATION), 1).into_bytes();
    (portable, file, files)
}

/// Writes the files again: only while a schema is not released yet.
#[test]
#[ignore = "writes the fixtures"]
fn write_fixtures() {
    let (_, file, level) = written();
    std::fs::create_dir_all(folder().join("level")).unwrap();
    std::fs::write(folder().join("world.burrow"), file).unwrap();
    level.iter().for_each(|(name, bytes)| std::fs::write(folder().join("level").join(name), bytes).unwrap());
}

#[test]
fn worlds_of_schema_1_can_be_read() {
    let (ground, (expected, written, _)) = (ground(), written());
    let file = std::fs::read(folder().join("world.burrow")).unwrap();
    let read = read_portable(&file, &ground).unwrap();
    assert!(compare::portables(&read, &expected));
    assert_eq!(written, file, "what is written today differs from schema 1: it needs a new number");
    let restored = Terrain::restore(Arc::clone(&ground), &read.metadata.settings, read.parts()).unwrap();
    assert_eq!(restored.world().hash(), read.metadata.hash);
}

#[test]
fn levels_of_schema_1_can_be_read() {
    let (ground, (_, _, written)) = (ground(), written());
    let mut files = LevelFiles::new();
    for entry in std::fs::read_dir(folder().join("level")).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        let mut bytes = std::fs::read(entry.path()).unwrap();
        if name == LEVEL_JSON {
            // Checkouts may change the ends of lines.
            bytes.retain(|&byte| byte != b'\r');
        }
        files.insert(name, bytes);
    }
    assert_eq!(files, written, "what is written today differs from schema 1: it needs a new number");
    Level::from_files(&files, &ground).unwrap();
}

/// A frame of a journal that names content, and the file of each content: schema 2.
#[cfg(feature = "store")]
mod named {
    use std::collections::BTreeMap;

    use super::super::{compare, round_trips, worlds};
    use super::{PathBuf, ground};
    use crate::format::Batch;
    use crate::format::contents::{ContentTable, content_file};
    use crate::format::frame::{Kind, WorldId, open, seal_named};
    use crate::format::ids::ContentId;
    use crate::terrain::CommitRecord;

    fn folder() -> PathBuf {
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/store/schema_2")
    }

    fn file_name(ContentId(name): ContentId) -> String {
        format!("{name:016x}.content")
    }

    fn batch() -> Batch {
        let mut terrain = worlds::terrain(&ground());
        worlds::apply(&mut terrain, round_trips::with_content());
        let commits: Vec<CommitRecord> = terrain.take_log();
        Batch { commits, game: vec![("turn".into(), Some(vec![3]))] }
    }

    fn written() -> BTreeMap<String, Vec<u8>> {
        let (batch, key) = (batch(), 7_u64.to_be_bytes());
        let contents = batch.table();
        let file = |name| (file_name(name), content_file(&contents, name));
        let mut files: BTreeMap<String, Vec<u8>> = contents.names().into_iter().map(file).collect();
        let frame = seal_named(Kind::Journal, WorldId(5), &key, 3, 9, &batch.encode_named());
        files.insert("frame.journal".into(), frame);
        files
    }

    #[test]
    #[ignore = "writes the fixtures"]
    fn write_fixtures() {
        std::fs::create_dir_all(folder()).unwrap();
        written().iter().for_each(|(name, bytes)| std::fs::write(folder().join(name), bytes).unwrap());
    }

    #[test]
    fn frames_of_schema_2_can_be_read() {
        let written = written();
        let read = |name: &String| (name.clone(), std::fs::read(folder().join(name)).unwrap());
        let files: BTreeMap<String, Vec<u8>> = written.keys().map(read).collect();
        assert_eq!(files, written, "what is written today differs from schema 2: it needs a new number");
        let opened =
            open(&files["frame.journal"], Kind::Journal, WorldId(5), &7_u64.to_be_bytes(), 1 << 20).unwrap();
        assert!(opened.is_named);
        let mut contents = ContentTable::default();
        for name in Batch::names(&opened.payload).unwrap() {
            assert!(contents.add_file(name, &files[&file_name(name)]));
        }
        let batch = Batch::decode_named(&opened.payload, &ground(), &contents).unwrap();
        assert!(compare::batches(&batch, &self::batch()));
    }
}
