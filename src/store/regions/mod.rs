//! Regions on disk: the records of a database, and the files that hold it.

pub(super) mod database;
pub(super) mod keys;
mod region;
mod region_file;
mod salvage;
pub(super) mod sources;

pub(super) use region::Region;
pub(super) use region_file::RegionFile;
