//! Laws of the formats: written data can be read again, bit for bit; damage is detected; nothing panics.

mod compare;
mod contents;
mod damage;
mod fixtures;
mod fuzz;
mod limits;
mod round_trips;
mod sizes;
mod worlds;

/// A count from the environment, or the default.
fn count(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|count| count.parse().ok()).unwrap_or(default)
}
