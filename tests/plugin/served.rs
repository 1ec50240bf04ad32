//! Servers that are dropped: their worlds are closed without a wait, nothing is lost, and an exiting app waits.

use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy_burrow::net::{Server, ServerSettings};
use bevy_burrow::prelude::*;
use bevy_burrow::store::{DiskImage, SimulatedDisk, Store, StoreError, StoreOptions};
use bevy_burrow::together::{GroundServer, TogetherPlugin};
use bevy_replicon::prelude::*;

use crate::saved::{exit, ground, terrain};

/// A disk that does not answer while it is shut.
#[derive(Clone, Default)]
struct Gate(Arc<(Mutex<bool>, Condvar)>);

impl Gate {
    fn set_shut(&self, is_shut: bool) {
        *self.0.0.lock().expect("no panic") = is_shut;
        self.0.1.notify_all();
    }

    fn pass(&self) {
        let is_shut = self.0.0.lock().expect("no panic");
        drop(self.0.1.wait_while(is_shut, |is_shut| *is_shut).expect("no panic"));
    }
}

/// A world on a disk with a gate.
struct Saved {
    disk: SimulatedDisk,
    gate: Gate,
}

impl Saved {
    fn new() -> Self {
        let (disk, gate) = (SimulatedDisk::new(), Gate::default());
        let watched = gate.clone();
        disk.watch(Some(move |_: &DiskImage| watched.pass()));
        Self { disk, gate }
    }

    fn serve(&self) -> GroundServer {
        let mut terrain = terrain();
        // Dropping the store itself takes long.
        let options = StoreOptions { close_timeout: Duration::from_secs(60), ..StoreOptions::default() };
        let store =
            Store::create_in(Arc::new(self.disk.clone()), &mut terrain, options).expect("a new world");
        GroundServer::with_store(Server::open(terrain, &store, ServerSettings::default()), store)
    }

    fn open(&self) -> Result<Store, StoreError> {
        let files = Arc::new(self.disk.clone());
        Store::open_in(files, ground(), StoreOptions::default()).map(|(store, _)| store)
    }

    /// The value that the game has put into the world, once it is closed.
    fn value_once_closed(&self) -> Option<Vec<u8>> {
        let start = Instant::now();
        loop {
            match self.open() {
                Err(StoreError::Locked(_)) if start.elapsed() < Duration::from_secs(60) => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                store => return store.expect("it is closed").get("coal").map(<[u8]>::to_vec),
            }
        }
    }

    /// Opens the gate when the returned value is used or dropped, or after a while.
    fn open_gate_on(&self, while_it_waits: Duration) -> (Sender<()>, std::thread::JoinHandle<bool>) {
        let (sender, receiver) = channel();
        let gate = self.gate.clone();
        let thread = std::thread::spawn(move || {
            let has_returned = receiver.recv_timeout(while_it_waits).is_ok();
            gate.set_shut(false);
            has_returned
        });
        (sender, thread)
    }
}

fn game() -> App {
    let mut app = App::new();
    let replicon = RepliconPlugins.set(ServerPlugin::new(PostUpdate));
    app.add_plugins((MinimalPlugins, StatesPlugin, replicon, BurrowPlugins, TogetherPlugin)).finish();
    app.cleanup();
    app
}

/// An app whose server saves in a world that does not answer, and has something to save.
fn serving(saved: &Saved) -> App {
    let mut app = game();
    app.insert_resource(saved.serve());
    (0..5).for_each(|_| app.update());
    saved.gate.set_shut(true);
    app.world_mut().resource_mut::<GroundServer>().put("coal", [7]);
    app
}

#[test]
fn nobody_who_replaces_or_removes_a_server_waits_for_its_disk() {
    let ways: [fn(&mut App); 4] = [
        |app| drop(app.world_mut().remove_resource::<GroundServer>()),
        |app| {
            app.insert_resource(GroundServer::new(Server::new(terrain(), ServerSettings::default())));
        },
        |app| {
            app.world_mut().commands().remove_resource::<GroundServer>();
            app.update();
        },
        // Its thread is at work.
        |app| {
            app.update();
            app.world_mut().resource_mut::<GroundServer>().put("coal", [7]);
            drop(app.world_mut().remove_resource::<GroundServer>());
        },
    ];
    for way in ways {
        let saved = Saved::new();
        let mut app = serving(&saved);
        let (returned, gate) = saved.open_gate_on(Duration::from_secs(20));
        way(&mut app);
        app.update();
        returned.send(()).expect("the thread waits");
        assert!(gate.join().expect("no panic"), "it has waited for the disk");
        assert_eq!(saved.value_once_closed(), Some(vec![7]), "the last value is saved");
        app.update();
    }
}

#[test]
fn a_server_that_is_taken_out_and_put_back_goes_on() {
    let saved = Saved::new();
    let mut app = serving(&saved);
    saved.gate.set_shut(false);
    let server = app.world_mut().remove_resource::<GroundServer>().expect("it is there");
    app.insert_resource(server);
    app.world_mut().resource_scope(|_, mut server: Mut<GroundServer>| server.put("coal", [8]));
    app.update();
    assert!(matches!(saved.open(), Err(StoreError::Locked(_))));
    app.world_mut().remove_resource::<GroundServer>();
    assert_eq!(saved.value_once_closed(), Some(vec![8]));
}

/// Ends an app whose server has just been removed, or is still there.
fn ends(end: impl FnOnce(App), is_removed: bool) {
    let saved = Saved::new();
    let mut app = serving(&saved);
    if is_removed {
        app.world_mut().remove_resource::<GroundServer>();
    }
    // The disk answers some time after the end has begun.
    let (_waits, gate) = saved.open_gate_on(Duration::from_millis(100));
    end(app);
    let value = saved.open().expect("it is closed once the app has ended").get("coal").map(<[u8]>::to_vec);
    assert_eq!(value, Some(vec![7]));
    gate.join().expect("no panic");
}

#[test]
fn an_app_that_ends_waits_for_its_server() {
    for is_removed in [true, false] {
        ends(exit, is_removed);
        // Nobody has asked it to exit.
        ends(drop, is_removed);
    }
}
