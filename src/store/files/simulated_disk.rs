//! A simulated disk in memory that loses power and fails like real ones. Tests use it instead of a folder.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::interface::{Files, Lock, OpenFile, Opening, named};

/// Bytes of a sector: a write is cut into these when power is lost.
const SECTOR: u64 = 512;

/// A fault of a simulated disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum DiskFault {
    /// Nothing.
    #[default]
    None,
    /// Writing fails: there is no space left.
    Full,
    /// Writing fails: the disk is read-only.
    ReadOnly,
    /// Everything fails.
    Broken,
}

impl DiskFault {
    fn check(self, writes: bool) -> io::Result<()> {
        match self {
            Self::Full if writes => Err(io::ErrorKind::StorageFull.into()),
            Self::ReadOnly if writes => Err(io::ErrorKind::ReadOnlyFilesystem.into()),
            Self::Broken => Err(io::Error::other("the simulated disk is broken")),
            _ => Ok(()),
        }
    }
}

/// A change of a file that a loss of power may undo.
#[derive(Clone, Debug)]
enum Unsynced {
    Write(u64, Arc<[u8]>),
    Length(u64),
}

#[derive(Clone, Debug, Default)]
struct Content {
    now: Arc<Vec<u8>>,
    synced: Arc<Vec<u8>>,
    unsynced: Vec<Unsynced>,
}

/// A change of a folder that a loss of power may undo.
#[derive(Clone, Debug)]
enum Renaming {
    Added(String, u64),
    Removed(String),
    Moved(String, String),
}

impl Renaming {
    fn apply(&self, names: &mut BTreeMap<String, u64>) {
        match self {
            Self::Added(path, file) => drop(names.insert(path.clone(), *file)),
            Self::Removed(path) => drop(names.remove(path)),
            Self::Moved(from, to) => {
                if let Some(file) = names.remove(from) {
                    names.insert(to.clone(), file);
                }
            }
        }
    }

    fn folder(&self) -> &str {
        match self {
            Self::Added(path, _) | Self::Removed(path) | Self::Moved(_, path) => folder_of(path),
        }
    }
}

fn folder_of(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

#[derive(Clone, Default)]
struct State {
    files: BTreeMap<u64, Content>,
    names: BTreeMap<String, u64>,
    synced_names: BTreeMap<String, u64>,
    renamings: Vec<Renaming>,
    next_file: u64,
    locks: BTreeSet<String>,
    operations: u64,
    fault: DiskFault,
    /// The fault that comes with this operation.
    fault_at: Option<(u64, DiskFault)>,
}

/// Called before each operation.
type Watch = Arc<dyn Fn(&DiskImage) + Send + Sync>;

/// A disk in memory. Clones are the same disk.
#[derive(Clone, Default)]
pub struct SimulatedDisk {
    state: Arc<Mutex<State>>,
    watch: Arc<Mutex<Option<Watch>>>,
}

impl fmt::Debug for SimulatedDisk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let state = self.state();
        let files = state.names.len();
        f.debug_struct("SimulatedDisk").field("files", &files).field("operations", &state.operations).finish()
    }
}

/// The state of a disk at one moment, from which it can restart after a loss of power.
#[derive(Clone)]
pub struct DiskImage(State);

impl fmt::Debug for DiskImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DiskImage").field("operations", &self.0.operations).finish_non_exhaustive()
    }
}

impl DiskImage {
    /// The number of operations on the disk.
    pub fn operations(&self) -> u64 {
        self.0.operations
    }

    /// The disk after a loss of power. Synced data is there. An unsynced sector is there if `keep` returns `true`;
    /// changes to folders are there up to the first one for which it returns `false`.
    pub fn lose_power(&self, mut keep: impl FnMut() -> bool) -> SimulatedDisk {
        let before = &self.0;
        let mut names = before.synced_names.clone();
        for renaming in &before.renamings {
            if !keep() {
                break;
            }
            renaming.apply(&mut names);
        }
        let mut files = BTreeMap::new();
        for &file in names.values() {
            let Some(content) = before.files.get(&file) else { continue };
            let mut bytes = Vec::clone(&content.synced);
            for change in &content.unsynced {
                match change {
                    Unsynced::Length(length) => {
                        if keep() {
                            bytes.resize(*length as usize, 0);
                        }
                    }
                    Unsynced::Write(offset, written) => {
                        let (mut at, end) = (*offset, offset + written.len() as u64);
                        while at < end {
                            let next = end.min((at / SECTOR + 1) * SECTOR);
                            if keep() {
                                let part = &written[(at - offset) as usize..(next - offset) as usize];
                                put(&mut bytes, at, part);
                            }
                            at = next;
                        }
                    }
                }
            }
            let bytes = Arc::new(bytes);
            files.insert(file, Content { now: bytes.clone(), synced: bytes, unsynced: Vec::new() });
        }
        let state = State {
            files,
            synced_names: names.clone(),
            names,
            next_file: before.next_file,
            ..State::default()
        };
        SimulatedDisk { state: Arc::new(Mutex::new(state)), watch: Arc::default() }
    }

    /// The disk after the process was killed: everything written is there.
    pub fn lose_process(&self) -> SimulatedDisk {
        let mut state = self.0.clone();
        state.locks.clear();
        (state.fault, state.fault_at) = Default::default();
        SimulatedDisk { state: Arc::new(Mutex::new(state)), watch: Arc::default() }
    }
}

fn put(bytes: &mut Vec<u8>, offset: u64, part: &[u8]) {
    let (from, to) = (offset as usize, offset as usize + part.len());
    if bytes.len() < to {
        bytes.resize(to, 0);
    }
    bytes[from..to].copy_from_slice(part);
}

impl SimulatedDisk {
    /// An empty disk.
    pub fn new() -> Self {
        Self::default()
    }

    /// The present state of the disk.
    pub fn image(&self) -> DiskImage {
        DiskImage(self.state().clone())
    }

    /// Sets a function that is called before each operation with the state of the disk; `None` removes it. It must not
    /// use this disk.
    pub fn watch(&self, watch: Option<impl Fn(&DiskImage) + Send + Sync + 'static>) {
        let watch = watch.map(|watch| Arc::new(watch) as Watch);
        *self.watch.lock().unwrap_or_else(PoisonError::into_inner) = watch;
    }

    /// Sets the present fault, and cancels one that was to [begin later](Self::fail_at).
    pub fn set_fault(&self, fault: DiskFault) {
        let mut state = self.state();
        (state.fault, state.fault_at) = (fault, None);
    }

    /// Makes a fault begin with a later operation, counted like [`operations`](Self::operations).
    pub fn fail_at(&self, operation: u64, fault: DiskFault) {
        self.state().fault_at = Some((operation, fault));
    }

    /// The number of operations.
    pub fn operations(&self) -> u64 {
        self.state().operations
    }

    /// The paths of all files, in order.
    pub fn paths(&self) -> Vec<String> {
        self.state().names.keys().cloned().collect()
    }

    /// Changes a file without going through the disk's interface, as damage would. Does nothing if there is no such
    /// file.
    pub fn damage(&self, path: &str, change: impl FnOnce(&mut Vec<u8>)) {
        let mut state = self.state();
        if let Some(content) = state.names.get(path).copied().and_then(|file| state.files.get_mut(&file)) {
            change(Arc::make_mut(&mut content.now));
            content.synced = content.now.clone();
            content.unsynced.clear();
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts an operation, and fails where the disk does.
    fn operate(&self, path: &str, writes: bool) -> io::Result<MutexGuard<'_, State>> {
        let watch = self.watch.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let (Some(watch), true) = (watch, writes) {
            watch(&self.image());
        }
        let mut state = self.state();
        state.operations += u64::from(writes);
        if let Some((at, fault)) = state.fault_at
            && state.operations >= at
        {
            (state.fault, state.fault_at) = (fault, None);
        }
        state
            .fault
            .check(writes)
            .map_err(|error| named(if path.is_empty() { "the folder" } else { path }, &error))?;
        Ok(state)
    }
}

fn missing() -> io::Error {
    io::ErrorKind::NotFound.into()
}

impl Files for SimulatedDisk {
    fn name(&self) -> String {
        "a simulated disk".into()
    }

    fn open(&self, path: &str, opening: Opening) -> io::Result<Box<dyn OpenFile>> {
        let mut state = self.operate(path, opening == Opening::New)?;
        let file = match (state.names.get(path), opening) {
            (Some(_), Opening::New) => return Err(io::ErrorKind::AlreadyExists.into()),
            (Some(file), Opening::Existing) => *file,
            (None, Opening::Existing) => return Err(missing()),
            (None, Opening::New) => {
                state.next_file += 1;
                let file = state.next_file;
                state.files.insert(file, Content::default());
                let added = Renaming::Added(path.into(), file);
                added.apply(&mut state.names);
                state.renamings.push(added);
                file
            }
        };
        Ok(Box::new(SimulatedFile { disk: self.clone(), path: path.into(), file }))
    }

    fn read(&self, path: &str) -> io::Result<Vec<u8>> {
        let state = self.operate(path, false)?;
        let content = state.names.get(path).and_then(|file| state.files.get(file));
        Ok(Vec::clone(&content.ok_or_else(missing)?.now))
    }

    fn exists(&self, path: &str) -> io::Result<bool> {
        Ok(self.operate(path, false)?.names.contains_key(path))
    }

    fn list(&self, folder: &str) -> io::Result<Vec<String>> {
        let state = self.operate(folder, false)?;
        let own = state.names.keys().filter(|path| folder_of(path) == folder);
        Ok(own.map(|path| path.rsplit('/').next().unwrap_or_default().into()).collect())
    }

    fn create_folder(&self, folder: &str) -> io::Result<()> {
        self.operate(folder, true).map(drop)
    }

    fn remove(&self, path: &str) -> io::Result<()> {
        let mut state = self.operate(path, true)?;
        state.names.remove(path).ok_or_else(missing)?;
        state.renamings.push(Renaming::Removed(path.into()));
        Ok(())
    }

    fn rename(&self, from: &str, to: &str) -> io::Result<()> {
        let mut state = self.operate(from, true)?;
        if state.names.contains_key(to) {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        let moved = Renaming::Moved(from.into(), to.into());
        state.names.contains_key(from).then_some(()).ok_or_else(missing)?;
        moved.apply(&mut state.names);
        state.renamings.push(moved);
        Ok(())
    }

    fn sync_folder(&self, folder: &str) -> io::Result<()> {
        let mut state = self.operate(folder, true)?;
        let state = &mut *state;
        let names = &mut state.synced_names;
        state.renamings.retain(|renaming| {
            let is_own = renaming.folder() == folder;
            if is_own {
                renaming.apply(names);
            }
            !is_own
        });
        Ok(())
    }

    fn lock(&self, path: &str) -> io::Result<Option<Box<dyn Lock>>> {
        let mut state = self.operate(path, false)?;
        let is_free = state.locks.insert(path.into());
        Ok(is_free.then(|| Box::new(SimulatedLock { disk: self.clone(), path: path.into() }) as _))
    }
}

#[derive(Debug)]
struct SimulatedLock {
    disk: SimulatedDisk,
    path: String,
}

impl Drop for SimulatedLock {
    fn drop(&mut self) {
        self.disk.state().locks.remove(&self.path);
    }
}

#[derive(Debug)]
struct SimulatedFile {
    disk: SimulatedDisk,
    path: String,
    file: u64,
}

impl SimulatedFile {
    fn change(&self, change: impl FnOnce(&mut Content)) -> io::Result<()> {
        let mut state = self.disk.operate(&self.path, true)?;
        state.files.get_mut(&self.file).map(change).ok_or_else(missing)
    }

    fn inspect<T>(&self, inspect: impl FnOnce(&Content) -> io::Result<T>) -> io::Result<T> {
        let state = self.disk.operate(&self.path, false)?;
        state.files.get(&self.file).ok_or_else(missing).and_then(inspect)
    }
}

impl OpenFile for SimulatedFile {
    fn length(&self) -> io::Result<u64> {
        self.inspect(|content| Ok(content.now.len() as u64))
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.inspect(|content| {
            let from = usize::try_from(offset).ok();
            let stored = from.and_then(|from| content.now.get(from..from.checked_add(out.len())?));
            out.copy_from_slice(stored.ok_or(io::ErrorKind::UnexpectedEof)?);
            Ok(())
        })
    }

    fn write_at(&self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        self.change(|content| {
            put(Arc::make_mut(&mut content.now), offset, bytes);
            content.unsynced.push(Unsynced::Write(offset, bytes.into()));
        })
    }

    fn set_length(&self, length: u64) -> io::Result<()> {
        self.change(|content| {
            Arc::make_mut(&mut content.now).resize(length as usize, 0);
            content.unsynced.push(Unsynced::Length(length));
        })
    }

    fn sync(&self) -> io::Result<()> {
        self.change(|content| {
            content.synced = content.now.clone();
            content.unsynced.clear();
        })
    }
}
