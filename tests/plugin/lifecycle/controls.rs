//! Negative controls: fixed faults are rebuilt on purpose from public parts, and the laws of the matrix find each of
//! them.

use super::*;

/// What happens in a life.
type Story = fn(&mut Life);

/// Checks that a life with a fault breaks this law, and that the same life without the fault breaks none.
fn assert_found(load: Load, fault: fn(&mut App), story: Story, law: &str) {
    let live = |fault: fn(&mut App), seed: u64| {
        let mut life = Life::with(load, seed, fault);
        life.patience = Duration::from_secs(20);
        for round in 0..3 {
            story(&mut life);
            life.check(&(load, "round", round));
        }
        life.end();
    };
    let mut others = Vec::new();
    for seed in 0..6 {
        let Err(why) = catch_unwind(AssertUnwindSafe(|| live(fault, seed))) else { continue };
        let why = why.downcast_ref::<String>().cloned().unwrap_or_default();
        if why.contains(law) {
            live(|_| {}, seed);
            return;
        }
        others.push(why);
    }
    panic!("`{law}` was never broken, but {others:?}");
}

/// Lets one event happen to a terrain at rest.
fn happen(life: &mut Life, event: Event) {
    life.reach(Phase::Idle);
    life.happen(event);
    life.frames();
}

/// Bevy drops messages after two frames: brushes that were sent while the plugin's systems were gated were never
/// answered.
#[test]
fn brushes_that_are_dropped_while_systems_are_gated_are_found() {
    fn forget(runs: Res<Runs>, mut brushes: ResMut<Messages<TargetedBrush>>) {
        if !runs.0 {
            brushes.clear();
        }
    }
    let fault = |app: &mut App| {
        app.add_systems(PostUpdate, forget);
    };
    assert_found(Load::Nothing, fault, |life| happen(life, Event::Gate), "answers");
}

/// Tiles of a terrain that was removed stayed, and belonged to nobody.
#[test]
fn tiles_that_outlive_their_terrain_are_found() {
    fn leave(gone: On<Remove, Terrain>, tiles: Query<(&Tile, &ChildOf)>, mut commands: Commands) {
        for (tile, parent) in &tiles {
            if parent.parent() == gone.entity {
                commands.spawn(*tile);
            }
        }
    }
    let fault = |app: &mut App| {
        app.add_observer(leave);
    };
    assert_found(Load::Nothing, fault, |life| happen(life, Event::RemoveAndInsert), "without a parent");
}

/// Tiles got their parent after observers had seen them.
#[test]
fn tiles_that_are_added_before_they_have_a_parent_are_found() {
    fn early(new: On<Add, Tile>, mut done: Local<bool>, tiles: Query<&Tile>, mut commands: Commands) {
        if !std::mem::replace(&mut *done, true)
            && let Ok(tile) = tiles.get(new.entity)
        {
            let tile = commands.spawn(*tile).id();
            commands.entity(tile).despawn();
        }
    }
    let fault = |app: &mut App| {
        app.add_observer(early);
    };
    assert_found(Load::Nothing, fault, |life| happen(life, Event::Dig), "when they were added");
}

#[cfg(feature = "store")]
mod of_saved_worlds {
    use bevy_burrow::store::{BaseChanged, Store, StoreOptions};

    use super::*;

    /// The ground of a terrain once more.
    fn ground_of(terrain: &Terrain) -> Ground {
        let ground = terrain.world().ground();
        let height = |x: i32, z: i32| f64::from(ground.height(bevy_burrow::lattice::Column { x, z })) / 256.0;
        Ground::from_fn(ground.width() as u32, ground.depth() as u32, height).expect("valid")
    }

    /// A component that came and went in one insertion held its terrain for ever.
    #[test]
    fn a_terrain_that_is_held_for_ever_is_found() {
        fn hold(gone: On<Remove, SavedWorld>, mut commands: Commands) {
            commands.entity(gone.entity).try_insert(Held);
        }
        let fault = |app: &mut App| {
            app.add_observer(hold);
        };
        assert_found(Load::Saved, fault, |life| happen(life, Event::Replace), "nothing is under way");
    }

    /// A new world was made of a copy of the terrain and replaced it later: commits in between were lost.
    #[test]
    fn digs_that_are_lost_when_saving_begins_are_found() {
        /// The copy, and frames until it takes the terrain's place.
        #[derive(Component)]
        struct Copied(Option<Terrain>, u32);

        fn copy(new: On<Insert, SavedWorld>, terrains: Query<&Terrain>, mut commands: Commands) {
            let Ok(terrain) = terrains.get(new.entity) else { return };
            let settings = TerrainSettings {
                chunk_size: terrain.world().grid().size() as u32,
                voxel_size: terrain.voxel_size(),
            };
            let copied = Terrain::restore(ground_of(terrain), &settings, terrain.parts());
            // Digging went on meanwhile.
            commands.entity(new.entity).insert(Copied(copied.ok(), 8)).remove::<Held>();
        }
        fn put(mut terrains: Query<(&mut Terrain, &mut Copied)>) {
            for (mut terrain, mut copied) in &mut terrains {
                copied.1 = copied.1.saturating_sub(1);
                if copied.1 == 0
                    && !terrain.is_busy()
                    && let Some(copied) = copied.0.take()
                {
                    *terrain = copied;
                }
            }
        }
        let fault = |app: &mut App| {
            app.add_observer(copy).add_systems(Last, put);
        };
        let story = |life: &mut Life| {
            life.reach(Phase::Transaction);
            life.happen(Event::SaveAnew);
            life.dig();
            life.run(12);
        };
        assert_found(Load::Saved, fault, story, "the world");
    }

    /// Another level on the entity was written into the save of the first.
    #[test]
    fn a_level_that_is_written_into_the_save_of_another_is_found() {
        fn write(mut closed: MessageReader<WorldClosed>, terrains: Query<&Terrain>) {
            for closed in closed.read() {
                let Ok(terrain) = terrains.get(closed.terrain) else { continue };
                let ground = ground_of(terrain);
                let options = StoreOptions { base_changed: BaseChanged::Keep, ..StoreOptions::default() };
                if let Ok((mut store, _)) = Store::open(&closed.path, ground, options) {
                    drop(store.append_whole(terrain));
                }
            }
        }
        let fault = |app: &mut App| {
            app.add_systems(Last, write);
        };
        assert_found(Load::Saved, fault, |life| happen(life, Event::Replace), "the folder");
    }
}
