//! The bytes of records: bricks, regions, journal entries. Everything that is read is checked.
