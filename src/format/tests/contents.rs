//! Images, grids and prefabs that edits refer to by name: an encoded edit holds either the content or its name.

use super::round_trips;
use crate::brush::{Edit, Prefab};
use crate::format::FormatError;
use crate::format::bytes::Reader;
use crate::format::contents::{ContentTable, Resolved, named};
use crate::format::edits::{EditSequence, put_edit};
use crate::format::ids::ContentId;

fn edits() -> Vec<Edit> {
    round_trips::with_content().iter().map(|brush| Edit::quantize(brush).unwrap()).collect()
}

fn table(edits: &[Edit]) -> ContentTable {
    let mut contents = ContentTable::default();
    edits.iter().flat_map(Edit::contents).for_each(|content| contents.add_content(content));
    contents
}

fn read(bytes: &[u8], contents: &ContentTable) -> Result<Resolved, FormatError> {
    let mut reader = Reader(bytes);
    let head = reader.byte()?;
    let resolved = EditSequence::default().read(head, &mut reader, contents)?;
    reader.end()?;
    Ok(resolved)
}

/// An edit with the names of another one's content behind it.
fn with_names(edit: &Edit, names: &[ContentId]) -> Vec<u8> {
    let (mut bytes, mut whole) = (vec![65], Vec::new());
    put_edit(&mut whole, edit, &mut EditSequence::whole());
    bytes.extend(whole);
    for name in names {
        bytes.push(0);
        bytes.extend(name.0.to_le_bytes());
    }
    bytes
}

#[test]
fn every_content_of_an_edit_is_named() {
    let edits = edits();
    let counts: Vec<usize> = edits.iter().map(|edit| named(edit).0.len()).collect();
    assert_eq!(counts, [1, 1, 2]);
    for edit in &edits {
        let (names, placeholders) = named(edit);
        assert_ne!(placeholders, *edit);
        let mut bytes = Vec::new();
        put_edit(&mut bytes, edit, &mut EditSequence::default());
        assert_eq!(bytes, with_names(&placeholders, &names));
        assert!(bytes.len() < 120, "{} bytes", bytes.len());
        assert_eq!(read(&bytes, &table(&edits)).unwrap().whole().as_ref(), Ok(edit));
        // Whatever is missing is named.
        let none = read(&bytes, &ContentTable::default()).unwrap();
        assert_eq!((&none.edit, &none.missing), (&placeholders, &names));
        assert_eq!(none.whole(), Err(FormatError::ContentMissing(names[0])));
    }
}

#[test]
fn next_to_a_name_stands_no_content() {
    let edits = edits();
    let contents = table(&edits);
    for edit in &edits {
        let (names, placeholders) = named(edit);
        assert!(read(&with_names(&placeholders, &names), &contents).is_ok());
        let whole = read(&with_names(edit, &names), &contents);
        assert_eq!(whole, Err(FormatError::Invalid("edit: content next to its name")));
        let mut bytes = Vec::new();
        put_edit(&mut bytes, edit, &mut EditSequence::whole());
        assert_eq!(read(&bytes, &contents), Err(FormatError::Invalid("edit: content without a name")));
    }
    let dig =
        Edit::quantize(&crate::brush::Brush::dig(crate::brush::Shape::sphere(glam::Vec3::ONE, 2.0))).unwrap();
    let named = read(&with_names(&dig, &[]), &contents);
    assert_eq!(named, Err(FormatError::Invalid("edit: a name without content")));
}

#[test]
fn content_is_within_the_limits_of_edits_wherever_it_comes_from() {
    use crate::brush::{Brush, BrushError, GridShape, ShapeGrid};
    use glam::{UVec3, Vec3};
    let grid = |side: u32| ShapeGrid::from_fn(UVec3::splat(side), |at| at.as_vec3().length() - 1.5).unwrap();
    let (small, large) = (grid(4), grid(100));
    let edit = Edit::quantize(&Brush::dig(GridShape::new(small, Vec3::ZERO).with_scale(60.0))).unwrap();
    let mut contents = ContentTable::default();
    let name = contents.add(std::sync::Arc::clone(large.image()));
    let resolved = read(&with_names(&named(&edit).1, &[name]), &contents).unwrap();
    assert!(matches!(resolved.refused, Some(BrushError::TooLarge { what: "box", .. })), "{resolved:?}");
    assert_eq!(resolved.edit, named(&edit).1);
    let replaced = edit.with_stamp_image(std::sync::Arc::clone(large.image()));
    assert!(matches!(replaced, Err(BrushError::TooLarge { what: "box", .. })));
}

#[test]
fn a_prefab_is_packed_once() {
    use crate::format::prefab::packed_prefab;
    let edits = edits();
    let prefab = edits[1].prefab().unwrap();
    let unpacked = prefab.bytes();
    let packed = std::sync::Arc::clone(packed_prefab(prefab));
    assert_eq!(prefab.bytes(), unpacked + packed.len());
    // Wherever it is sent, listed or saved.
    assert!(ContentTable::default().add_prefab(std::sync::Arc::clone(prefab)).is_some());
    assert_eq!(prefab.to_bytes(), packed[..]);
    assert!(std::sync::Arc::ptr_eq(packed_prefab(prefab), &packed));
    assert_eq!(Prefab::from_bytes(&packed).as_ref(), Ok(&**prefab));
}
