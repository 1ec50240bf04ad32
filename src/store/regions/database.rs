//! The database of regions: records by key, changed in transactions.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use redb::{Builder, Database, ReadableDatabase, ReadableTable, StorageBackend, TableDefinition};

use crate::store::files::{Files, OpenFile, Opening};

/// The database's file.
pub(in crate::store) const DATABASE: &str = "regions.redb";
/// A database that is not complete yet.
pub(in crate::store) const UNFINISHED: &str = "regions.new";

const RECORDS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("records");

/// Bytes of the page cache, which is small because each page is read once and written once.
const CACHE: usize = 8 << 20;

/// The format of database files that is written. The number stands in both commit slots of the header.
pub(super) const FILE_FORMAT: u8 = 3;
/// The first bytes of database files, and the offsets of their commit slots.
const FILE_MAGIC: &[u8] = b"redb\x1A\x0A\xA9\x0D\x0A";
const SLOTS: [usize; 2] = [64, 192];

/// A record that takes the place of another, or its removal.
pub(in crate::store) type Change = (Vec<u8>, Option<Vec<u8>>);

/// Why a database can't be used.
#[derive(Debug, thiserror::Error)]
pub(in crate::store) enum DatabaseError {
    /// There is no database.
    #[error("the file {DATABASE} is missing")]
    Missing,
    /// The system returned an error.
    #[error(transparent)]
    Files(#[from] io::Error),
    /// A newer version of the database's format.
    #[error("the file {DATABASE} has the format {0}, which is newer than {FILE_FORMAT}")]
    Newer(u8),
    /// The database is damaged.
    #[error("the file {DATABASE} is damaged: {0}")]
    Damaged(String),
}

impl DatabaseError {
    fn of(error: impl Into<redb::Error>) -> Self {
        match error.into() {
            redb::Error::Io(error) if error.kind() == io::ErrorKind::NotFound => Self::Missing,
            redb::Error::Io(error) if !is_about_content(&error) => Self::Files(error),
            error => Self::Damaged(error.to_string()),
        }
    }
}

/// Whether the error means that a file's content is invalid.
fn is_about_content(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof)
}

/// The database may panic where its file is damaged.
fn guarded<T>(work: impl FnOnce() -> Result<T, DatabaseError>) -> Result<T, DatabaseError> {
    let failed = |_| Err(DatabaseError::Damaged("its structure is inconsistent".into()));
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(failed)
}

/// Whether bytes are a database of a newer format. Damage of one slot does not look like it.
fn check_format(bytes: &[u8]) -> Result<(), DatabaseError> {
    let [first, second] = SLOTS.map(|slot| bytes.get(slot).copied().unwrap_or_default());
    let is_newer = bytes.starts_with(FILE_MAGIC) && first == second && first > FILE_FORMAT;
    if is_newer { Err(DatabaseError::Newer(first)) } else { Ok(()) }
}

/// Records by key, in an open file.
pub(in crate::store) struct Records {
    database: Database,
    has_failed: Arc<AtomicBool>,
}

impl Records {
    /// Opens a database that exists, and checks all of its pages.
    pub fn open(files: &dyn Files) -> Result<Self, DatabaseError> {
        let file = files.open(DATABASE, Opening::Existing);
        let file = file.map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => DatabaseError::Missing,
            _ => DatabaseError::Files(error),
        })?;
        // A database creates itself in an empty file.
        if file.length()? == 0 {
            return Err(DatabaseError::Damaged("it is empty".into()));
        }
        Self::of_file(file, true)
    }

    fn of_file(file: Box<dyn OpenFile>, checks: bool) -> Result<Self, DatabaseError> {
        let has_failed = Arc::new(AtomicBool::new(false));
        let pages = Pages { file, has_failed: Arc::clone(&has_failed) };
        guarded(|| {
            let mut builder = Builder::new();
            builder.set_cache_size(CACHE).set_check_integrity_on_open(checks);
            let database = builder.create_with_backend(pages).map_err(DatabaseError::of)?;
            Ok(Self { database, has_failed })
        })
    }

    /// Creates a database of these records at a path at which there is no file.
    pub fn create(
        files: &dyn Files,
        path: &str,
        records: &[Change],
        is_small: bool,
    ) -> Result<(), DatabaseError> {
        let mut new = Self::of_file(files.open(path, Opening::New)?, false)?;
        new.write(records)?;
        if is_small { new.compact() } else { Ok(()) }
    }

    /// Whether the file could not be synced: nothing is known of what it holds, whatever can be read of it now.
    pub fn has_failed(&self) -> bool {
        self.has_failed.load(Ordering::Relaxed)
    }

    /// Changes records, all or none; they are durable then.
    pub fn write(&self, changes: &[Change]) -> Result<(), DatabaseError> {
        guarded(|| {
            let mut transaction = self.database.begin_write().map_err(DatabaseError::of)?;
            transaction.set_quick_repair(true);
            let mut table = transaction.open_table(RECORDS).map_err(DatabaseError::of)?;
            for (key, value) in changes {
                match value {
                    Some(value) => drop(table.insert(&key[..], &value[..]).map_err(DatabaseError::of)?),
                    None => drop(table.remove(&key[..]).map_err(DatabaseError::of)?),
                }
            }
            drop(table);
            transaction.commit().map_err(DatabaseError::of)
        })
    }

    /// Makes the file as small as it can be.
    fn compact(&mut self) -> Result<(), DatabaseError> {
        guarded(|| {
            while self.database.compact().map_err(DatabaseError::of)? {}
            Ok(())
        })
    }
}

/// The records of a database in memory, all of whose pages are checked. Its file is not changed, as opening it may do.
pub(in crate::store) fn read_all(bytes: Vec<u8>) -> Result<Vec<(Vec<u8>, Vec<u8>)>, DatabaseError> {
    if bytes.is_empty() {
        return Err(DatabaseError::Damaged("it is empty".into()));
    }
    check_format(&bytes)?;
    guarded(|| {
        let mut builder = Builder::new();
        builder.set_cache_size(CACHE).set_check_integrity_on_open(true);
        let database = builder.create_with_backend(Image(Mutex::new(bytes))).map_err(DatabaseError::of)?;
        let transaction = database.begin_read().map_err(DatabaseError::of)?;
        let table = match transaction.open_table(RECORDS) {
            Err(redb::TableError::TableDoesNotExist(_)) => return Ok(Vec::new()),
            table => table.map_err(DatabaseError::of)?,
        };
        let entries = table.iter().map_err(DatabaseError::of)?;
        let entry = |entry: Result<(redb::AccessGuard<&[u8]>, redb::AccessGuard<&[u8]>), _>| {
            let (key, value) = entry.map_err(DatabaseError::of)?;
            Ok((key.value().to_vec(), value.value().to_vec()))
        };
        entries.map(entry).collect()
    })
}

/// A file as the database sees it.
#[derive(Debug)]
struct Pages {
    file: Box<dyn OpenFile>,
    has_failed: Arc<AtomicBool>,
}

impl StorageBackend for Pages {
    fn len(&self) -> io::Result<u64> {
        self.file.length()
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.file.read_at(offset, out)
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        self.file.set_length(len)
    }

    fn sync_data(&self) -> io::Result<()> {
        let synced = self.file.sync();
        if synced.is_err() {
            self.has_failed.store(true, Ordering::Relaxed);
        }
        synced
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        self.file.write_at(offset, data)
    }
}

/// The bytes of a file as the database sees them. What it changes is not written.
#[derive(Debug)]
struct Image(Mutex<Vec<u8>>);

impl Image {
    fn part<T>(&self, offset: u64, length: usize, work: impl FnOnce(&mut [u8]) -> T) -> io::Result<T> {
        let mut bytes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let from = usize::try_from(offset).ok();
        let part = from.and_then(|from| bytes.get_mut(from..from.checked_add(length)?));
        part.map(work).ok_or_else(|| io::ErrorKind::UnexpectedEof.into())
    }
}

impl StorageBackend for Image {
    fn len(&self) -> io::Result<u64> {
        Ok(self.0.lock().unwrap_or_else(PoisonError::into_inner).len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.part(offset, out.len(), |part| out.copy_from_slice(part))
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        let mut bytes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // Repairing a database makes it no larger than a few pages more.
        let most = bytes.len().saturating_mul(2).saturating_add(16 << 20);
        match usize::try_from(len).ok().filter(|len| *len <= most) {
            Some(len) => bytes.resize(len, 0),
            None => return Err(io::ErrorKind::InvalidData.into()),
        }
        Ok(())
    }

    fn sync_data(&self) -> io::Result<()> {
        Ok(())
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        self.part(offset, data.len(), |part| part.copy_from_slice(data))
    }
}
