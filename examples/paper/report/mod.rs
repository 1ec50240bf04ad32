//! Reports of the measurements: tables in the paper's layout, ratios against targets, a document, files.

mod checks;
mod document;
mod files;
mod markdown;
mod ratios;
mod sizes;
mod tables;

pub use checks::{agreement, checks, faults};
pub use document::document;
pub use files::{summary, timings};
pub use markdown::Table;
pub use ratios::{ratios, table as ratio_table};
pub use sizes::by_size;
#[cfg(test)]
pub use sizes::parts;
pub use tables::{all as tables, medians};
