//! The database of regions: records by key, changed in transactions.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};

use redb::{Builder, Database, ReadableDatabase, ReadableTable, TableDefinition};

use super::files::{Files, Opening, Pages};

/// The database's file.
pub(super) const DATABASE: &str = "regions.redb";
/// A database that is not complete yet.
const UNFINISHED: &str = "regions.new";

const RECORDS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("records");

/// Bytes of pages that are kept in memory: each is read once, and written once.
const CACHE: usize = 8 << 20;

/// A record that takes the place of another, or its removal.
pub(super) type Change = (Vec<u8>, Option<Vec<u8>>);

/// What is wrong with a database.
#[derive(Debug, thiserror::Error)]
pub(super) enum DatabaseError {
    /// There is none.
    #[error("the file {DATABASE} is missing")]
    Missing,
    /// The system refuses.
    #[error(transparent)]
    Files(#[from] io::Error),
    /// It is damaged.
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

/// Does the error say that a file holds something else than it should?
fn is_about_content(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof)
}

/// The database may panic where its file is damaged.
fn guarded<T>(work: impl FnOnce() -> Result<T, DatabaseError>) -> Result<T, DatabaseError> {
    let failed = |_| Err(DatabaseError::Damaged("its structure is inconsistent".into()));
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(failed)
}

/// Records by key.
pub(super) struct Records(Database);

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
        guarded(|| {
            let mut builder = Builder::new();
            builder.set_cache_size(CACHE).set_check_integrity_on_open(true);
            builder.create_with_backend(Pages(file)).map(Self).map_err(DatabaseError::of)
        })
    }

    /// Creates a database of these records. It takes its name once it is complete.
    pub fn create(files: &dyn Files, records: &[Change]) -> Result<Self, DatabaseError> {
        if files.list("")?.iter().any(|name| name == UNFINISHED) {
            files.remove(UNFINISHED)?;
        }
        let file = files.open(UNFINISHED, Opening::New)?;
        guarded(|| {
            let mut builder = Builder::new();
            let database = builder.set_cache_size(CACHE).create_with_backend(Pages(file));
            Self(database.map_err(DatabaseError::of)?).write(records)
        })?;
        files.rename(UNFINISHED, DATABASE)?;
        files.sync_folder("")?;
        Self::open(files)
    }

    /// All records.
    pub fn read_all(&self) -> Result<Vec<(Vec<u8>, Vec<u8>)>, DatabaseError> {
        guarded(|| {
            let transaction = self.0.begin_read().map_err(DatabaseError::of)?;
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

    /// Changes records, all or none; they are durable then.
    pub fn write(&self, changes: &[Change]) -> Result<(), DatabaseError> {
        guarded(|| {
            let mut transaction = self.0.begin_write().map_err(DatabaseError::of)?;
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
    pub fn compact(&mut self) -> Result<(), DatabaseError> {
        guarded(|| {
            while self.0.compact().map_err(DatabaseError::of)? {}
            Ok(())
        })
    }
}
