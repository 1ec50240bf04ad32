//! Reading returns the written data, bit for bit.

use std::sync::Arc;

use glam::{IVec3, Quat, UVec3, Vec2, Vec3};

use super::{compare, count, worlds};
use crate::brush::{Brush, Edit, GridShape, Paste, Roughness, Shape, ShapeGrid, Stamp};
use crate::format::bytes::Reader;
use crate::format::contents::ContentTable;
use crate::format::edits::{EditSequence, put_edit};
use crate::format::level::{Level, region_name, region_of_name};
use crate::format::portable::{read_portable, read_portable_head, write_portable};
use crate::format::{Batch, Metadata, decode_region, encode_region};
use crate::ground::{GreyImage, MaterialId};
use crate::lattice::{LatticeBox, RegionPos};
use crate::terrain::{EditSettings, Terrain, TerrainSettings};
use crate::volume::layers;

#[test]
fn random_worlds_come_back() {
    for seed in 0..count("BURROW_WORLDS", 4) {
        let ground = worlds::hills(96 + 32 * (seed as u32 % 3));
        let mut terrain = worlds::eventful(&ground, 60, seed);
        let saved = worlds::portable(&mut terrain, &ground);
        for (at, region) in &saved.regions {
            let (bricks, fields) = decode_region(&region.encode(), *at, &ground).unwrap();
            assert!(compare::lists(&bricks, &region.bricks));
            assert_eq!(fields, region.fields);
        }
        for batch in &saved.journal {
            assert!(compare::batches(&Batch::decode(&batch.encode(), &ground).unwrap(), batch));
        }
        let file = write_portable(&saved).unwrap();
        let read = read_portable(&file, &ground).unwrap();
        assert!(compare::portables(&read, &saved));
        assert_eq!(write_portable(&read).unwrap(), file);
        assert!(compare::parts(&read.parts(), &terrain.parts()));
        let (world, head) = read_portable_head(&file).unwrap();
        assert_eq!((world, &head.metadata), (saved.world, &saved.metadata));
        assert_eq!([head.regions, head.journal], [saved.regions.len() as u64, saved.journal.len() as u64]);

        let settings = TerrainSettings::default();
        let restored = Terrain::restore(Arc::clone(&ground), &settings, read.parts()).unwrap();
        assert_eq!(restored.world().hash(), terrain.world().hash());
        // The journal leads to the same world.
        let mut replayed = worlds::terrain(&ground);
        for commit in read.journal.iter().flat_map(|batch| &batch.commits) {
            replayed.replay(commit).unwrap();
        }
        assert_eq!(replayed.world().hash(), terrain.world().hash());
    }
}

#[test]
fn levels_come_back_and_files_change_only_where_the_ground_did() {
    let ground = worlds::hills(192);
    let mut terrain = worlds::eventful(&ground, 80, 5);
    let game = [("spawn".to_owned(), vec![0, 255, 16])].into();
    let of = |terrain: &Terrain| {
        Level::new(terrain.parts(), 0.5, std::collections::BTreeMap::clone(&game), &ground)
    };
    let (level, files) = (of(&terrain), of(&terrain).to_files().unwrap());
    let packed = Level::pack_files(&files).unwrap();
    assert_eq!(Level::unpack_files(&packed).unwrap(), files);
    let read = Level::from_files(&files, &ground).unwrap();
    assert!(compare::regions(&read.regions, &level.regions));
    assert!(compare::parts(&read.parts(), &level.parts()));
    assert_eq!((read.settings, read.ground, &read.game), (level.settings, level.ground, &level.game));
    assert_eq!(read.to_files().unwrap(), files);

    let at = Vec3::new(150.0, 40.0, 150.0);
    terrain.apply([Brush::dig(Shape::sphere(at, 2.0))]);
    let changed = of(&terrain).to_files().unwrap();
    let own = region_name(RegionPos::of(crate::lattice::BrickPos::of(at.as_ivec3())));
    for (name, bytes) in &changed {
        let may_change = *name == own || name == "level.json";
        assert!(may_change || files.get(name) == Some(bytes), "{name} changed");
    }
    assert_ne!(changed.get(&own), files.get(&own));
}

#[test]
fn a_level_without_one_of_its_files_is_none() {
    let ground = worlds::hills(128);
    let terrain = worlds::eventful(&ground, 30, 2);
    let level = Level::new(terrain.parts(), 1.0, Default::default(), &ground);
    let files = level.to_files().unwrap();
    assert!(files.len() > 3);
    for name in files.keys() {
        let mut less = files.clone();
        less.remove(name);
        let error = Level::from_files(&less, &ground).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("missing"), "{error}");
    }
    let mut more = files.clone();
    more.insert("r.9.9.9.region".into(), Vec::new());
    assert!(Level::from_files(&more, &ground).unwrap_err().to_string().contains("r.9.9.9.region"));
    for name in
        ["r.1.2.region", "r.1.2.3.4.region", "r.01.2.3.region", "r.+1.2.3.region", "../r.1.2.3.region"]
    {
        assert_eq!(region_of_name(name), None, "{name}");
    }
}

/// Edits of every shape and operation.
pub fn all_edits() -> Vec<Edit> {
    let at = Vec3::new(-100.3, 7.7, 30000.1);
    let turn = Quat::from_rotation_y(0.3);
    let image = GreyImage::from_samples(40, 30, (0..1200).map(|i| i * 7).collect()).unwrap();
    let stamp = Stamp::new(image, at, Vec2::new(4.0, 6.0), 3.0);
    let shapes = [
        Shape::sphere(at, 3.3),
        Shape::turned_cuboid(at, Vec3::new(2.0, 3.0, 4.0), turn),
        Shape::cylinder(at, Vec3::new(1.0, 5.0, 0.0), 2.0),
        Shape::capsule(at, at + Vec3::X, 1.0),
        Shape::cone(at, Vec3::Y * 9.0, 3.0),
        Shape::torus(at, Vec3::Y, 9.0, 2.0),
    ];
    let brushes = shapes.into_iter().flat_map(|shape| {
        [
            Brush::dig(shape),
            Brush::dig(shape).with_tag(u64::MAX).with_stroke(0),
            Brush::dig(shape).with_tag(0).with_stroke(u64::MAX).with_power(1),
            Brush::dig(shape).with_roughness(Roughness::new(1.0, 4.0, u32::MAX)),
            Brush::add(shape, MaterialId(255)),
            Brush::paint(shape, MaterialId(3)),
            Brush::smooth(shape, 0.5),
            Brush::sharpen(shape, 1.0),
            Brush::flatten(shape, at, Vec3::new(1.0, 2.0, 3.0)),
            Brush::level(shape, -2.0),
            Brush::raise(shape, 0.5).with_material(MaterialId(9)),
            Brush::lower(shape, 64.0),
            Brush::stamp(shape, stamp.clone()),
            Brush::terrace(shape, 3.0),
        ]
    });
    brushes.chain(with_content()).map(|brush| Edit::quantize(&brush).unwrap()).collect()
}

/// Brushes with a grid, with a prefab, and with both.
pub fn with_content() -> [Brush; 3] {
    let grid =
        ShapeGrid::from_fn(UVec3::splat(6), |at| at.as_vec3().distance(Vec3::splat(2.5)) - 1.9).unwrap();
    let within = GridShape::new(grid, Vec3::new(20.0, 11.0, 20.0)).with_scale(2.5);
    let ground = worlds::hills(64);
    let mut terrain = worlds::terrain(&ground);
    terrain.apply([Brush::dig(Shape::sphere(Vec3::new(9.0, 12.0, 9.0), 5.0))]);
    let min = IVec3::new(4, 6, 4);
    let prefab = terrain.world().copy(LatticeBox { min, max: min + 10 }, min).unwrap();
    let paste = Brush::paste(Paste::new(prefab, Vec3::new(15.0, 6.0, 15.0)));
    let pasted_within = Brush { operation: paste.operation.clone(), ..Brush::dig(within.clone()) };
    [Brush::add(within, MaterialId(2)), paste, pasted_within]
}

#[test]
fn edits_come_back_in_whatever_order() {
    let edits = all_edits();
    let mut rng = fastrand::Rng::with_seed(3);
    for _ in 0..50 {
        let order: Vec<&Edit> = (0..40).filter_map(|_| rng.choice(&edits)).collect();
        let mut contents = ContentTable::default();
        order.iter().flat_map(|edit| edit.contents()).for_each(|content| contents.add_content(content));
        for of in [EditSequence::default, EditSequence::whole] {
            let (mut bytes, mut sequence) = (Vec::new(), of());
            order.iter().for_each(|edit| put_edit(&mut bytes, edit, &mut sequence));
            let (mut reader, mut sequence) = (Reader(&bytes), of());
            for edit in &order {
                let head = reader.byte().unwrap();
                let read = sequence.read(head, &mut reader, &contents).unwrap();
                assert_eq!(read.whole().as_ref(), Ok(*edit));
            }
            reader.end().unwrap();
        }
    }
}

#[test]
fn any_densities_come_back() {
    let (ground, region) = (worlds::hills(64), RegionPos(glam::IVec3::new(0, -1, 0)));
    let mut rng = fastrand::Rng::with_seed(9);
    for _ in 0..count("BURROW_WORLDS", 4) * 10 {
        let mut bricks = std::collections::BTreeMap::new();
        for _ in 0..rng.usize(..20) {
            let pos = crate::lattice::BrickPos(region.first_brick().0 + worlds::point(&mut rng, 8));
            let edited = match rng.u8(..3) {
                0 => layers::ALL,
                1 => std::array::from_fn(|_| rng.u64(..)),
                _ => std::array::from_fn(|_| rng.u64(..) & rng.u64(..) & rng.u64(..)),
            };
            let far = if rng.bool() { 32767 } else { 3 };
            let samples: Vec<i16> = (0..layers::count(&edited)).map(|_| rng.i16(-far..=far)).collect();
            let material = |&sample: &i16| match sample < 0 && rng.bool() {
                true => MaterialId(rng.u8(..3)),
                false => MaterialId::GROUND,
            };
            let materials: Vec<MaterialId> = samples.iter().map(material).collect();
            let brick = crate::volume::Brick::restored(&ground, pos, &edited, &samples, Some(&materials));
            bricks.insert(pos, Arc::new(brick.unwrap()));
        }
        let (read, _) = decode_region(&encode_region(&bricks, []), region, &ground).unwrap();
        assert!(compare::lists(&read, &bricks.into_iter().collect::<Vec<_>>()));
    }
}

#[test]
fn metadata_comes_back() {
    let rules = crate::volume::DiggingRules::default().with_bedrock(-9).with_hardness(MaterialId(3), 4);
    let metadata = Metadata {
        revision: u64::MAX,
        hash: 7,
        edit_settings: EditSettings { rules: Some(Arc::new(rules)), loose: Some(Default::default()) },
        game: vec![("a".into(), vec![]), (String::new(), vec![255; 300])],
        ..Metadata::default()
    };
    let bytes = metadata.encode();
    assert_eq!(Metadata::decode(&bytes), Ok(metadata));
    for end in 0..bytes.len() {
        assert!(Metadata::decode(&bytes[..end]).is_err());
    }
}
