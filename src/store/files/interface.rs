//! The store's interface to files, so that tests can use a simulated disk instead.

use std::fmt;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use redb::StorageBackend;
use redb::backends::FileBackend;

/// Files below one folder. Paths are relative to it, with `/` between their parts. Errors should name the file, since
/// they are shown to players as they are.
pub trait Files: fmt::Debug + Send + Sync + 'static {
    /// The folder's name in messages.
    fn name(&self) -> String;

    /// Opens a file for reading and writing.
    ///
    /// # Errors
    /// Where [`Opening`] says so, and when the system refuses.
    fn open(&self, path: &str, opening: Opening) -> io::Result<Box<dyn OpenFile>>;

    /// Reads all of a file.
    ///
    /// # Errors
    /// When there is no such file, and when the system refuses.
    fn read(&self, path: &str) -> io::Result<Vec<u8>>;

    /// Whether the file exists.
    ///
    /// # Errors
    /// When the system refuses.
    fn exists(&self, path: &str) -> io::Result<bool>;

    /// The names of the files in a folder, in order; none where there is no such folder.
    ///
    /// # Errors
    /// When the system refuses.
    fn list(&self, folder: &str) -> io::Result<Vec<String>>;

    /// Creates a folder and those that it lies in, where they are missing.
    ///
    /// # Errors
    /// When the system refuses.
    fn create_folder(&self, folder: &str) -> io::Result<()>;

    /// Removes a file.
    ///
    /// # Errors
    /// When there is no such file, and when the system refuses.
    fn remove(&self, path: &str) -> io::Result<()>;

    /// Renames a file to a path without a file.
    ///
    /// # Errors
    /// When there is a file already, and when the system refuses.
    fn rename(&self, from: &str, to: &str) -> io::Result<()>;

    /// Makes the creation, removal and renaming of files in a folder durable.
    ///
    /// # Errors
    /// When the system refuses.
    fn sync_folder(&self, folder: &str) -> io::Result<()>;

    /// Takes a lock that no other process can take until it is dropped; `None` if another holds it.
    ///
    /// # Errors
    /// When the system refuses.
    fn lock(&self, path: &str) -> io::Result<Option<Box<dyn Lock>>>;
}

/// A lock that is held until it is dropped.
pub trait Lock: fmt::Debug + Send + Sync {}

impl<T: fmt::Debug + Send + Sync> Lock for T {}

/// How a file is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Opening {
    /// The file must exist.
    Existing,
    /// The file must not exist.
    New,
}

/// An open file. It is written at one place at a time.
pub trait OpenFile: fmt::Debug + Send + Sync {
    /// The file's length, in bytes.
    ///
    /// # Errors
    /// When the system refuses.
    fn length(&self) -> io::Result<u64>;

    /// Fills a buffer with the stored bytes from an offset on.
    ///
    /// # Errors
    /// When the file ends before, and when the system refuses.
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()>;

    /// Writes all of the bytes from an offset on.
    ///
    /// # Errors
    /// When the system refuses; some bytes may be written then.
    fn write_at(&self, offset: u64, bytes: &[u8]) -> io::Result<()>;

    /// Cuts the file off, or fills it up with zeros.
    ///
    /// # Errors
    /// When the system refuses.
    fn set_length(&self, length: u64) -> io::Result<()>;

    /// Makes all written data durable, so that it survives a loss of power.
    ///
    /// # Errors
    /// When the system refuses. Data written since the last success may then be lost.
    fn sync(&self) -> io::Result<()>;
}

/// The files of a folder of the system. The process may change its current folder: these stay where they are.
#[derive(Clone, Debug)]
pub struct Folder(PathBuf);

impl Folder {
    /// The files below a folder, which need not exist yet. A relative path, including an empty one, is resolved against
    /// the current folder at the time of the call.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        let path: PathBuf = path.into();
        let path = if path.as_os_str().is_empty() { PathBuf::from(".") } else { path };
        // Without a current folder it stays relative, and nothing in it can be opened.
        Self(std::path::absolute(&path).unwrap_or(path))
    }

    /// The path of the folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    fn at(&self, path: &str) -> PathBuf {
        if path.is_empty() { self.0.clone() } else { self.0.join(path) }
    }

    /// Runs an operation on a file; errors name the file.
    fn with<T>(&self, path: &str, work: impl FnOnce(&Path) -> io::Result<T>) -> io::Result<T> {
        let at = self.at(path);
        work(&at).map_err(|error| named(at.display(), &error))
    }
}

/// An error that names the file.
pub(super) fn named(file: impl fmt::Display, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{file}: {error}"))
}

impl Files for Folder {
    fn name(&self) -> String {
        self.0.display().to_string()
    }

    fn open(&self, path: &str, opening: Opening) -> io::Result<Box<dyn OpenFile>> {
        self.with(path, |at| {
            let mut options = OpenOptions::new();
            options.read(true).write(true).create_new(opening == Opening::New);
            let (file, is_read_only) = match options.open(at) {
                // What may not be written may still be read.
                Err(error) if opening == Opening::Existing && is_read_only(&error) => (File::open(at)?, true),
                opened => (opened?, false),
            };
            let pages = FileBackend::new(file).map_err(io::Error::other)?;
            Ok(Box::new(FolderFile { pages, path: at.into(), is_read_only }) as Box<dyn OpenFile>)
        })
    }

    fn read(&self, path: &str) -> io::Result<Vec<u8>> {
        self.with(path, |at| fs::read(at))
    }

    fn exists(&self, path: &str) -> io::Result<bool> {
        self.with(path, Path::try_exists)
    }

    fn list(&self, folder: &str) -> io::Result<Vec<String>> {
        let entries = match fs::read_dir(self.at(folder)) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries.map_err(|error| named(self.at(folder).display(), &error))?,
        };
        let mut names = Vec::new();
        for entry in entries {
            let entry = entry?;
            // Links are followed, and one that leads nowhere is a file that can't be read.
            let is_file = match fs::metadata(entry.path()) {
                Ok(metadata) => metadata.is_file(),
                Err(_) => !entry.file_type()?.is_dir(),
            };
            // No file of a store has another name.
            if let (true, Ok(name)) = (is_file, entry.file_name().into_string()) {
                names.push(name);
            }
        }
        names.sort_unstable();
        Ok(names)
    }

    fn create_folder(&self, folder: &str) -> io::Result<()> {
        self.with(folder, |at| fs::create_dir_all(at))
    }

    fn remove(&self, path: &str) -> io::Result<()> {
        self.with(path, |at| fs::remove_file(at))
    }

    fn rename(&self, from: &str, to: &str) -> io::Result<()> {
        let to = self.at(to);
        self.with(from, |from| {
            // Only holders of the lock create files here, so no file is created in between.
            if to.symlink_metadata().is_ok() {
                return Err(named(to.display(), &io::ErrorKind::AlreadyExists.into()));
            }
            fs::rename(from, &to)
        })
    }

    fn sync_folder(&self, folder: &str) -> io::Result<()> {
        // Windows has no way to, and needs none.
        if cfg!(unix) { self.with(folder, |at| File::open(at)?.sync_all()) } else { Ok(()) }
    }

    fn lock(&self, path: &str) -> io::Result<Option<Box<dyn Lock>>> {
        let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder);
        let folder = self.at(folder);
        self.with(path, |at| {
            let open = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(at);
            let file = match open {
                // On a read-only disk a lock that exists can be held all the same; where there is none, nobody can
                // write.
                Err(error) if is_read_only(&error) => match File::open(at) {
                    Err(missing) if missing.kind() == io::ErrorKind::NotFound => None,
                    opened => Some(opened.map_err(|_| error)?),
                },
                opened => Some(opened?),
            };
            if let Some(file) = &file {
                match file.try_lock() {
                    Ok(()) => {}
                    Err(TryLockError::WouldBlock) => return Ok(None),
                    Err(TryLockError::Error(error)) => return Err(error),
                }
            }
            // A lock that looks stale may be removed while the world is open: the folder is locked too, where the
            // system can do that.
            let folder = File::open(folder).ok();
            if let Some(Err(TryLockError::WouldBlock)) = folder.as_ref().map(File::try_lock) {
                return Ok(None);
            }
            Ok(Some(Box::new((file, folder)) as Box<dyn Lock>))
        })
    }
}

fn is_read_only(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied)
}

/// A file of a folder.
#[derive(Debug)]
struct FolderFile {
    pages: FileBackend,
    path: PathBuf,
    is_read_only: bool,
}

impl FolderFile {
    fn named<T>(&self, done: io::Result<T>) -> io::Result<T> {
        done.map_err(|error| named(self.path.display(), &error))
    }

    fn check_writable(&self) -> io::Result<()> {
        self.named(if self.is_read_only { Err(io::ErrorKind::PermissionDenied.into()) } else { Ok(()) })
    }
}

impl OpenFile for FolderFile {
    fn length(&self) -> io::Result<u64> {
        self.named(self.pages.len())
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.named(self.pages.read(offset, out))
    }

    fn write_at(&self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        self.check_writable()?;
        self.named(self.pages.write(offset, bytes))
    }

    fn set_length(&self, length: u64) -> io::Result<()> {
        self.check_writable()?;
        self.named(self.pages.set_len(length))
    }

    fn sync(&self) -> io::Result<()> {
        self.named(self.pages.sync_data())
    }
}
