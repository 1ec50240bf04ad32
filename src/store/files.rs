//! What the store needs of files, so that tests can put a simulated disk in their place.

use std::fmt;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use redb::StorageBackend;
use redb::backends::FileBackend;

/// Files below one folder. Paths are relative to it, with `/` between their parts.
pub trait Files: fmt::Debug + Send + Sync + 'static {
    /// How messages name the folder.
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

    /// Is there such a file?
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

    /// Gives a file another path, at which there is no file yet.
    ///
    /// # Errors
    /// When there is a file already, and when the system refuses.
    fn rename(&self, from: &str, to: &str) -> io::Result<()>;

    /// Makes sure that files which were created, removed and renamed in a folder are so after a loss of power too.
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
    /// It must exist.
    Existing,
    /// It must not exist.
    New,
}

/// An open file. It is written at one place at a time.
pub trait OpenFile: fmt::Debug + Send + Sync {
    /// Its length, in bytes.
    ///
    /// # Errors
    /// When the system refuses.
    fn length(&self) -> io::Result<u64>;

    /// Fills a buffer with what is stored from an offset on.
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

    /// Makes sure that what was written is there after a loss of power too.
    ///
    /// # Errors
    /// When the system refuses; then nothing is known of what was written since the last time that it did not.
    fn sync(&self) -> io::Result<()>;
}

/// The files of a folder of the system.
#[derive(Clone, Debug)]
pub struct Folder(PathBuf);

impl Folder {
    /// The files below a folder, which need not exist yet.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self(path.into())
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }

    fn at(&self, path: &str) -> PathBuf {
        self.0.join(path)
    }
}

impl Files for Folder {
    fn name(&self) -> String {
        self.0.display().to_string()
    }

    fn open(&self, path: &str, opening: Opening) -> io::Result<Box<dyn OpenFile>> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create_new(opening == Opening::New);
        let file = FileBackend::new(options.open(self.at(path))?).map_err(io::Error::other)?;
        Ok(Box::new(file))
    }

    fn read(&self, path: &str) -> io::Result<Vec<u8>> {
        fs::read(self.at(path))
    }

    fn exists(&self, path: &str) -> io::Result<bool> {
        self.at(path).try_exists()
    }

    fn list(&self, folder: &str) -> io::Result<Vec<String>> {
        let entries = match fs::read_dir(self.at(folder)) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries?,
        };
        let mut names = Vec::new();
        for entry in entries {
            let entry = entry?;
            // No file of a store has another name.
            if let (true, Ok(name)) = (entry.file_type()?.is_file(), entry.file_name().into_string()) {
                names.push(name);
            }
        }
        names.sort_unstable();
        Ok(names)
    }

    fn create_folder(&self, folder: &str) -> io::Result<()> {
        fs::create_dir_all(self.at(folder))
    }

    fn remove(&self, path: &str) -> io::Result<()> {
        fs::remove_file(self.at(path))
    }

    fn rename(&self, from: &str, to: &str) -> io::Result<()> {
        // Only holders of the lock create files here, so nobody creates one in between.
        if self.at(to).symlink_metadata().is_ok() {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        fs::rename(self.at(from), self.at(to))
    }

    fn sync_folder(&self, folder: &str) -> io::Result<()> {
        // Windows has no way to, and needs none.
        if cfg!(unix) { File::open(self.at(folder))?.sync_all() } else { Ok(()) }
    }

    fn lock(&self, path: &str) -> io::Result<Option<Box<dyn Lock>>> {
        let open = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(self.at(path));
        let file = match open {
            // On a read-only disk a lock that exists can be held all the same.
            Err(error) if is_read_only(&error) => File::open(self.at(path)).map_err(|_| error)?,
            opened => opened?,
        };
        match file.try_lock() {
            Ok(()) => Ok(Some(Box::new(file))),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }
}

fn is_read_only(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied)
}

impl OpenFile for FileBackend {
    fn length(&self) -> io::Result<u64> {
        self.len()
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.read(offset, out)
    }

    fn write_at(&self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        self.write(offset, bytes)
    }

    fn set_length(&self, length: u64) -> io::Result<()> {
        self.set_len(length)
    }

    fn sync(&self) -> io::Result<()> {
        self.sync_data()
    }
}

/// A file as the database sees it.
#[derive(Debug)]
pub(super) struct Pages(pub Box<dyn OpenFile>);

impl StorageBackend for Pages {
    fn len(&self) -> io::Result<u64> {
        self.0.length()
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.0.read_at(offset, out)
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        self.0.set_length(len)
    }

    fn sync_data(&self) -> io::Result<()> {
        self.0.sync()
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        self.0.write_at(offset, data)
    }
}
