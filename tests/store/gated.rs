//! Files on a disk that stops answering, or whose driver panics, when a test says so.

use std::io;
use std::sync::{Arc, Condvar, Mutex};

use bevy_burrow::store::{Files, Lock, OpenFile, Opening, SimulatedDisk};

/// What happens to a thread that waits for the disk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Gate {
    #[default]
    Open,
    Shut,
    Panics,
}

/// The gate of a [`GatedDisk`].
#[derive(Clone, Debug, Default)]
pub struct Gatekeeper(Arc<(Mutex<Gate>, Condvar)>);

impl Gatekeeper {
    pub fn set(&self, gate: Gate) {
        *self.0.0.lock().expect("no panic") = gate;
        self.0.1.notify_all();
    }

    fn pass(&self) {
        let gate = self.0.0.lock().expect("no panic");
        let gate = self.0.1.wait_while(gate, |gate| *gate == Gate::Shut).expect("no panic");
        let panics = *gate == Gate::Panics;
        drop(gate);
        assert!(!panics, "the driver panics");
    }
}

/// A simulated disk behind a gate: syncing a file waits until it is open.
#[derive(Debug)]
pub struct GatedDisk {
    disk: SimulatedDisk,
    gate: Gatekeeper,
}

impl GatedDisk {
    pub fn new(disk: &SimulatedDisk, gate: &Gatekeeper) -> Self {
        Self { disk: disk.clone(), gate: gate.clone() }
    }
}

#[derive(Debug)]
struct GatedFile(Box<dyn OpenFile>, Gatekeeper);

impl OpenFile for GatedFile {
    fn length(&self) -> io::Result<u64> {
        self.0.length()
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.0.read_at(offset, out)
    }

    fn write_at(&self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        self.0.write_at(offset, bytes)
    }

    fn set_length(&self, length: u64) -> io::Result<()> {
        self.0.set_length(length)
    }

    fn sync(&self) -> io::Result<()> {
        self.1.pass();
        self.0.sync()
    }
}

impl Files for GatedDisk {
    fn name(&self) -> String {
        self.disk.name()
    }

    fn open(&self, path: &str, opening: Opening) -> io::Result<Box<dyn OpenFile>> {
        let file = Files::open(&self.disk, path, opening)?;
        Ok(Box::new(GatedFile(file, self.gate.clone())))
    }

    fn read(&self, path: &str) -> io::Result<Vec<u8>> {
        Files::read(&self.disk, path)
    }

    fn exists(&self, path: &str) -> io::Result<bool> {
        self.disk.exists(path)
    }

    fn list(&self, folder: &str) -> io::Result<Vec<String>> {
        self.disk.list(folder)
    }

    fn create_folder(&self, folder: &str) -> io::Result<()> {
        self.disk.create_folder(folder)
    }

    fn remove(&self, path: &str) -> io::Result<()> {
        self.disk.remove(path)
    }

    fn rename(&self, from: &str, to: &str) -> io::Result<()> {
        self.disk.rename(from, to)
    }

    fn sync_folder(&self, folder: &str) -> io::Result<()> {
        self.disk.sync_folder(folder)
    }

    fn lock(&self, path: &str) -> io::Result<Option<Box<dyn Lock>>> {
        self.disk.lock(path)
    }
}
