//! What a terrain hands on: Bevy asks the entity of each mesh for its layers and shadows, and not that of the terrain.

use bevy::camera::visibility::RenderLayers;
#[cfg(feature = "render")]
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::prelude::*;

use super::{BurrowSystems, Chunk, GroundPiece, Tile};
use crate::terrain::Terrain;

/// Has layers and shadows handed on.
pub(super) fn add(app: &mut App) {
    app.add_systems(Update, hand_on::<RenderLayers>.in_set(BurrowSystems::Dress));
    #[cfg(feature = "render")]
    app.add_systems(
        Update,
        (hand_on::<NotShadowCaster>, hand_on::<NotShadowReceiver>).in_set(BurrowSystems::Dress),
    );
}

/// A tile or chunk.
type Drawn = Or<(With<Tile>, With<Chunk>)>;

/// What is there is given what a terrain has got or changed, and what is new what it has. A piece that comes with its own
/// keeps that, until the terrain's changes.
fn hand_on<C: Component + Clone>(
    mut commands: Commands,
    mut removed: RemovedComponents<C>,
    terrains: Query<(Entity, Ref<C>), With<Terrain>>,
    bare: Query<(), (With<Terrain>, Without<C>)>,
    children: Query<&Children>,
    drawn: Query<(), Drawn>,
    pieces: Query<(Entity, &GroundPiece)>,
    new: Query<(Entity, &ChildOf), (Drawn, Or<(Added<Tile>, Added<Chunk>)>)>,
    new_pieces: Query<(Entity, &GroundPiece), (Added<GroundPiece>, Without<C>)>,
) {
    let parts_of = |terrain: Entity| -> Vec<Entity> {
        let below = children.get(terrain).into_iter().flatten().copied();
        let own = pieces.iter().filter(|(_, piece)| piece.terrain == terrain);
        below.filter(|&child| drawn.contains(child)).chain(own.map(|(piece, _)| piece)).collect()
    };
    for terrain in removed.read().filter(|&entity| bare.contains(entity)) {
        for part in parts_of(terrain) {
            commands.entity(part).try_remove::<C>();
        }
    }
    if terrains.is_empty() {
        return;
    }
    let newly = new.iter().map(|(part, parent)| (part, parent.parent()));
    for (part, terrain) in newly.chain(new_pieces.iter().map(|(part, piece)| (part, piece.terrain))) {
        if let Ok((_, own)) = terrains.get(terrain) {
            commands.entity(part).try_insert(C::clone(&own));
        }
    }
    for (terrain, own) in terrains.iter().filter(|(_, own)| own.is_changed()) {
        for part in parts_of(terrain) {
            commands.entity(part).try_insert(C::clone(&own));
        }
    }
}
