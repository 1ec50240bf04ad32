//! Pieces in history, and their names.

use bevy_burrow::volume::MaterialCounts;

use super::*;

/// What a terrain's last edit cut off: the names of pieces that are gone, sorted.
fn names<'a>(pieces: impl IntoIterator<Item = &'a LoosePiece>) -> Vec<PieceId> {
    let gone = pieces.into_iter().filter(|piece| piece.is_gone());
    let mut names: Vec<PieceId> = gone.map(|piece| piece.id).collect();
    names.sort_unstable();
    names
}

fn returned(restored: &Applied) -> Vec<PieceId> {
    let mut names: Vec<PieceId> = restored.returned.iter().map(|piece| piece.id).collect();
    names.sort_unstable();
    names
}

#[test]
fn an_undo_brings_back_the_pieces_of_its_edits_and_a_redo_cuts_them_off_again() {
    let (mut steps, mut all) = (0, BTreeSet::new());
    for index in 0..world_count(60) {
        let mut rng = Rng::with_seed(54_000 + index);
        let (ground, chunk_size) = small_world(&mut rng, index);
        let brushes: Vec<Brush> = (0..10).map(|_| crumbling_brush(&mut rng, &ground, chunk_size)).collect();
        let mut terrain = terrain(ground, chunk_size);
        terrain.set_loose(Some(LooseSettings { largest: 2000, crumbs: 4, debris: 1500 }));
        // Of each step: the pieces that its edits took out, and what an inventory gained by it.
        let mut done: Vec<(Vec<LoosePiece>, [i64; 2])> = Vec::new();
        let total = |counts: &MaterialCounts| counts.total() as i64;
        let voxels = |pieces: &[LoosePiece]| pieces.iter().map(|piece| piece.voxels as i64).sum::<i64>();
        for group in brushes.chunks(2) {
            let before = terrain.history().undos;
            let (mut pieces, mut gained) = (Vec::new(), 0);
            for receipt in terrain.apply(group) {
                let Ok(applied) = receipt.outcome else { continue };
                gained += total(&applied.removed) - total(&applied.added);
                pieces.extend(applied.loose.into_iter().filter(LoosePiece::is_gone));
            }
            if terrain.history().undos > before {
                let fallen = voxels(&pieces);
                done.push((pieces, [gained, fallen]));
            }
        }
        for (pieces, [gained, fallen]) in done.iter().rev() {
            let restored = terrain.undo().outcome.expect("it can be undone");
            assert_eq!(returned(&restored), names(pieces), "world {index}");
            assert!(restored.cut_again.is_empty());
            let back: i64 = restored.returned.iter().map(|piece| total(&piece.materials)).sum();
            assert_eq!(back, *fallen, "world {index}");
            assert_eq!(total(&restored.added) - total(&restored.removed) - back, *gained, "world {index}");
        }
        for (pieces, [gained, _]) in &done {
            let restored = terrain.redo().outcome.expect("it can be redone");
            let again: Vec<LoosePiece> = restored.cut_again.into_iter().map(|(_, piece)| piece).collect();
            assert_eq!(&again, pieces, "world {index}: with names and meshes");
            assert!(restored.returned.is_empty());
            assert_eq!(total(&restored.removed) - total(&restored.added) - voxels(pieces), *gained);
            steps += usize::from(!pieces.is_empty());
            all.extend(names(pieces));
        }
    }
    assert!(steps > 40 && all.len() > 80, "{steps} steps with {} pieces", all.len());
}

#[test]
fn a_piece_has_the_same_name_on_every_machine_and_after_it_was_saved() {
    let cut = |tag: u64, is_dug_elsewhere: bool| {
        let mut terrain = table();
        terrain.set_loose(Some(LooseSettings { largest: 10_000, crumbs: 0, debris: 10_000 }));
        if is_dug_elsewhere {
            terrain.apply([Brush::dig(Shape::sphere(Vec3::new(8.0, 8.0, 8.0), 4.0))]);
        }
        let receipt = terrain.apply([saw().with_tag(tag).with_stroke(tag)]).remove(0);
        receipt.outcome.expect("it reaches the pillar").loose.remove(0)
    };
    let piece = cut(1, false);
    assert_eq!(piece.id, cut(2, true).id, "neither its tag nor other digs name a piece");
    assert_eq!(piece.id, PieceId(0x290d_3a66_8563_701c), "names are part of what machines exchange");
    let saved = serde_json::to_string(&piece).expect("it can be saved");
    assert_eq!(serde_json::from_str::<LoosePiece>(&saved).expect("it can be read").id, piece.id);
}

#[test]
fn history_counts_the_pieces_that_it_holds() {
    let bytes = |debris: u32| {
        let mut terrain = table();
        terrain.set_loose(Some(LooseSettings { largest: 10_000, crumbs: 10_000 - debris, debris }));
        terrain.clear_history();
        let loose = terrain.apply([saw()]).remove(0).outcome.expect("it reaches the pillar").loose;
        (terrain.history().bytes, loose[0].mesh.as_ref().map_or(0, |mesh| mesh.bytes()))
    };
    let ((with_mesh, mesh), (without, none)) = (bytes(10_000), bytes(0));
    assert!(mesh > 10_000 && none == 0);
    assert!(with_mesh >= without + mesh, "{with_mesh} bytes, {without} without a mesh of {mesh}");
}
