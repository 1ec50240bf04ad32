//! What saving costs: `cargo bench --no-default-features --features store --bench saving`.
//!
//! ```text
//! saving            all of it
//! saving times      how soon a dig is durable, and how long a world takes to open after a crash
//! saving format     samples that are encoded and decoded in a second
//! saving log DIGS   digs that the journal holds (20,000 are counted by default)
//! ```

mod format;
mod log;
mod times;
#[path = "../../tests/worlds/mod.rs"]
mod worlds;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let (part, count) = (args.first().map_or("all", String::as_str), args.get(1));
    if matches!(part, "all" | "times") {
        times::print();
    }
    if matches!(part, "all" | "format") {
        format::print();
    }
    if matches!(part, "all" | "log") {
        log::print(count.map_or(20_000, |count| count.parse().expect("a number of digs")));
    }
}
