//! Materials of pieces: each has its own, which contains the piece's origin in the ground.

use bevy::prelude::*;

use super::look::GroundLook;
use super::material::{GroundExtension, GroundMaterial};
use crate::plugin::{GroundPiece, Inherited};
use crate::terrain::Terrain;

/// The material extension of a piece of this terrain.
fn of_piece(terrain: &GroundExtension, piece: &GroundPiece) -> GroundExtension {
    GroundExtension { uniform: terrain.uniform.clone().of_piece(piece.origin), ..terrain.clone() }
}

/// Inserts the material of each new piece.
pub(super) fn add_materials(
    mut commands: Commands,
    bare: Query<(Entity, &GroundPiece), Without<MeshMaterial3d<GroundMaterial>>>,
    terrains: Query<&MeshMaterial3d<GroundMaterial>, With<Terrain>>,
    mut materials: ResMut<Assets<GroundMaterial>>,
) {
    for (entity, piece) in &bare {
        let terrain = terrains.get(piece.terrain).ok();
        let Some(terrain) = terrain.and_then(|terrain| materials.get(&terrain.0)) else { continue };
        let own =
            GroundMaterial { base: terrain.base.clone(), extension: of_piece(&terrain.extension, piece) };
        let own = MeshMaterial3d(materials.add(own));
        commands.entity(entity).try_insert((own, Inherited::<MeshMaterial3d<GroundMaterial>>::default()));
    }
}

/// Updates pieces when their terrain's look or textures change. Pieces of a removed terrain keep theirs.
pub(super) fn follow(
    changed: Query<
        &MeshMaterial3d<GroundMaterial>,
        (
            (With<Terrain>, With<GroundLook>),
            Or<(Changed<GroundLook>, Changed<GlobalTransform>, Changed<MeshMaterial3d<GroundMaterial>>)>,
        ),
    >,
    pieces: Query<(&GroundPiece, &MeshMaterial3d<GroundMaterial>)>,
    mut materials: ResMut<Assets<GroundMaterial>>,
) {
    if changed.is_empty() {
        return;
    }
    for (piece, own) in &pieces {
        // A game may have put the terrain's own material on a piece.
        let terrain = changed.get(piece.terrain).ok().filter(|&terrain| terrain != own);
        let Some(terrain) = terrain.and_then(|terrain| materials.get(&terrain.0)) else { continue };
        let extension = of_piece(&terrain.extension, piece);
        // A terrain that only moved changes nothing for its pieces.
        let is_other = materials.get(&own.0).is_some_and(|own| own.extension != extension);
        if is_other && let Some(mut own) = materials.get_mut(&own.0) {
            own.extension = extension;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::look::GroundQuality;
    use super::super::material::GroundUniform;
    use super::super::stage::{SIZE, app, extension, spawn_terrain, textures};
    use super::super::textures::GroundLoading;
    use super::*;

    /// How many materials the last frame changed.
    fn count_changes(app: &mut App) -> usize {
        let mut events = app.world_mut().resource_mut::<Messages<AssetEvent<GroundMaterial>>>();
        events.drain().filter(|event| matches!(event, AssetEvent::Modified { .. })).count()
    }

    #[test]
    fn pieces_look_as_their_terrain_does_in_every_frame() {
        let mut app = app();
        let (terrain, other) = (spawn_terrain(&mut app), spawn_terrain(&mut app));
        app.update();
        let pieces = [IVec3::new(3, -4, 5), IVec3::ZERO].map(|origin| GroundPiece { terrain, origin });
        let pieces = pieces.map(|piece| (piece, app.world_mut().spawn(piece).id()));
        let stranger = app.world_mut().spawn(GroundPiece { terrain: other, origin: IVec3::ONE }).id();
        let check = |app: &App, what: &str| {
            let ground = extension(app, terrain);
            for (piece, entity) in &pieces {
                assert_eq!(extension(app, *entity), of_piece(&ground, piece), "{what}");
            }
        };
        app.update();
        check(&app, "new ones");
        let before = extension(&app, pieces[0].1);
        let aside = extension(&app, stranger);

        let mut look = app.world_mut().get_mut::<GroundLook>(terrain).expect("a look");
        (look.variety, look.quality) = (0.9, GroundQuality::Low);
        app.update();
        check(&app, "another look");
        assert_ne!(extension(&app, pieces[0].1), before);
        assert_eq!(extension(&app, stranger), aside, "its terrain has not changed");

        let ready = textures(&mut app);
        app.world_mut().resource_mut::<GroundLoading>().ready = Some(ready.clone());
        app.update();
        check(&app, "other textures");
        assert_eq!(extension(&app, pieces[0].1).albedo, Some(ready.albedo));

        app.world_mut().entity_mut(terrain).remove::<GroundLook>();
        app.update();
        let is_dressed = |entity| app.world().get::<MeshMaterial3d<GroundMaterial>>(entity).is_some();
        assert!(!pieces.iter().any(|&(_, entity)| is_dressed(entity)) && is_dressed(stranger));
        app.world_mut().entity_mut(terrain).insert(GroundLook::default());
        app.update();
        check(&app, "a look that came back");
    }

    #[test]
    fn pieces_of_a_terrain_that_is_gone_keep_what_they_have() {
        let mut app = app();
        let terrain = spawn_terrain(&mut app);
        let piece = app.world_mut().spawn(GroundPiece { terrain, origin: IVec3::ONE }).id();
        app.update();
        app.update();
        let before = extension(&app, piece);
        assert!(app.world_mut().despawn(terrain));
        let ready = textures(&mut app);
        app.world_mut().resource_mut::<GroundLoading>().ready = Some(ready);
        app.update();
        assert_eq!(extension(&app, piece), before);
    }

    #[test]
    fn pieces_are_left_alone_where_nothing_changes_for_them() {
        let mut app = app();
        let terrain = spawn_terrain(&mut app);
        app.world_mut().spawn(GroundPiece { terrain, origin: IVec3::ONE });
        app.update();
        app.update();
        count_changes(&mut app);
        app.update();
        assert_eq!(count_changes(&mut app), 0);
        let place = GlobalTransform::from_translation(Vec3::X);
        app.world_mut().entity_mut(terrain).insert(place);
        app.update();
        assert_eq!(count_changes(&mut app), 1, "only the terrain has moved");
    }

    #[test]
    fn textures_move_in_the_frame_that_draws_the_ground_elsewhere() {
        let mut app = app();
        app.add_plugins(TransformPlugin);
        let terrain = spawn_terrain(&mut app);
        let piece = GroundPiece { terrain, origin: IVec3::ONE };
        let debris = app.world_mut().spawn(piece).id();
        app.update();
        app.update();
        count_changes(&mut app);
        let place = Transform::from_xyz(5.0, -3.0, 2.0).with_scale(Vec3::splat(2.0));
        app.world_mut().entity_mut(terrain).insert(place);
        app.update();
        let ground = extension(&app, terrain);
        assert_eq!(ground.uniform, GroundUniform::new(&GroundLook::default(), &place.into(), SIZE));
        assert_eq!(extension(&app, debris), of_piece(&ground, &piece));
        assert_eq!(count_changes(&mut app), 2, "the renderer sees the change in the same frame");
    }

    #[test]
    fn a_piece_that_shares_its_terrains_material_does_not_move_it() {
        let mut app = app();
        let terrain = spawn_terrain(&mut app);
        app.update();
        let shared = app.world().get::<MeshMaterial3d<GroundMaterial>>(terrain).expect("dressed").clone();
        app.world_mut().spawn((GroundPiece { terrain, origin: IVec3::ONE }, shared));
        let before = extension(&app, terrain);
        app.world_mut().get_mut::<GroundLook>(terrain).expect("a look").set_changed();
        app.update();
        assert_eq!(extension(&app, terrain), before);
    }
}
