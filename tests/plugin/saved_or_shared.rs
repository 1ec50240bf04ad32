//! A world is saved or shared: a player's own save and the server's never write into each other.
#![cfg(feature = "store")]

use std::path::Path;

use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy_burrow::net::ServerSettings;
use bevy_burrow::prelude::*;
use bevy_burrow::together::{GroundServer, SharedTerrain, TogetherPlugin};
use bevy_replicon::prelude::*;

use crate::saved::{
    Folder, Heard, dig_now, exit, hash, hash_in, heard, listen, run_until, run_until_closed,
    run_until_opened, saved, terrain,
};

/// A player who may be a host.
fn game() -> App {
    let mut app = App::new();
    let replicon = RepliconPlugins.set(ServerPlugin::new(PostUpdate));
    app.add_plugins((MinimalPlugins, StatesPlugin, replicon, BurrowPlugins, TogetherPlugin));
    listen(&mut app);
    app.finish();
    app.cleanup();
    app
}

fn let_friends_in(app: &mut App, entity: Entity, path: &Path) {
    app.world_mut().entity_mut(entity).remove::<SavedWorld>().insert((terrain(), SharedTerrain::default()));
    app.insert_resource(GroundServer::saved(&saved(path), &terrain(), ServerSettings::default()));
    run_until(app, "it has joined", |world| {
        world.get::<SharedTerrain>(entity).is_some_and(SharedTerrain::has_joined)
    });
}

fn play_alone_again(app: &mut App, entity: Entity, path: &Path) {
    app.world_mut().remove_resource::<GroundServer>();
    app.world_mut().resource_mut::<Heard>().opened.clear();
    app.world_mut().entity_mut(entity).remove::<SharedTerrain>().insert((terrain(), saved(path)));
    run_until_opened(app);
}

#[test]
fn a_world_is_opened_to_friends_and_played_alone_again() {
    let folder = Folder::new("friends");
    let mut app = game();
    let entity = app.world_mut().spawn((terrain(), saved(&folder.0))).id();
    run_until_opened(&mut app);
    for turn in 0..2 {
        dig_now(&mut app, 12.0 + 30.0 * turn as f32);
        let alone = hash(&app, entity);
        let_friends_in(&mut app, entity, &folder.0);
        run_until(&mut app, "the same world is shared", move |world| {
            world.get::<Terrain>(entity).is_some_and(|own| own.world().hash() == alone)
        });
        dig_now(&mut app, 26.0 + 30.0 * turn as f32);
        let shared = hash(&app, entity);
        assert_ne!(alone, shared);
        play_alone_again(&mut app, entity, &folder.0);
        assert_eq!(hash(&app, entity), shared, "edits of all players are there");
        assert!(app.world().get::<WorldStore>(entity).is_some());
    }
    let last = hash(&app, entity);
    exit(app);
    assert_eq!(hash_in(&folder.0, terrain()).map(|(_, hash)| hash), Ok(last));
}

#[test]
fn a_terrain_that_becomes_shared_is_not_written_into_the_players_own_world() {
    for in_one_insertion in [true, false] {
        let folder = Folder::new("own");
        let mut app = game();
        let entity = app.world_mut().spawn((terrain(), saved(&folder.0))).id();
        run_until_opened(&mut app);
        dig_now(&mut app, 30.0);
        let before = hash(&app, entity);
        let mut entry = app.world_mut().entity_mut(entity);
        if in_one_insertion {
            entry.insert((terrain(), SharedTerrain::default()));
        } else {
            entry.insert(terrain());
            entry.insert(SharedTerrain::default());
        }
        run_until_closed(&mut app, 1);
        let closed = &heard(&app).closed[0];
        assert_eq!((closed.because, closed.outcome.as_ref().ok()), (ClosedBecause::Shared, Some(&1)));
        assert!(app.world().get::<SavedWorld>(entity).is_none());
        exit(app);
        assert_eq!(hash_in(&folder.0, terrain()), Ok((1, before)));
    }
}

#[test]
fn a_shared_terrain_is_not_saved_by_its_player() {
    let folder = Folder::new("guest");
    for is_spawned_with_it in [true, false] {
        let mut app = game();
        let entity = app.world_mut().spawn((terrain(), SharedTerrain::default())).id();
        if is_spawned_with_it {
            app.world_mut().despawn(entity);
        }
        let entity = match is_spawned_with_it {
            true => app.world_mut().spawn((terrain(), saved(&folder.0), SharedTerrain::default())).id(),
            false => {
                app.world_mut().entity_mut(entity).insert(saved(&folder.0));
                entity
            }
        };
        run_until_opened(&mut app);
        assert!(
            heard(&app).opened[0].as_ref().is_err_and(|why| why.contains("shared")),
            "{:?}",
            heard(&app).opened
        );
        assert!(
            app.world().get::<SavedWorld>(entity).is_none()
                && app.world().get::<bevy_burrow::plugin::Held>(entity).is_none()
        );
        exit(app);
        assert!(!bevy_burrow::store::Store::is_in(&folder.0));
    }
}
