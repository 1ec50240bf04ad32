//! What many players cost a server: `cargo bench --no-default-features --features net --bench players`.
//!
//! Up to 64 players dig five times a second for 60 seconds of virtual time, with and without undo.

use bevy_burrow::net::UndoPolicy;

#[path = "../tests/net/load.rs"]
mod load;

use load::{Load, hills, load};

fn main() {
    let ground = hills(512);
    println!(
        "| clients | undo | bytes an edit | with headers | bytes up | server CPU, s of 60 | longest frame, ms |"
    );
    println!("| ---: | --- | ---: | ---: | ---: | ---: | ---: |");
    for undo in [UndoPolicy::Nobody, UndoPolicy::Own] {
        for clients in [1, 8, 16, 32, 64] {
            let Load { bytes, with_headers, up, cpu, longest } = load(clients, 60, undo, &ground);
            println!(
                "| {clients} | {undo:?} | {bytes:.1} | {with_headers:.1} | {up:.1} | {:.2} | {:.1} |",
                cpu.as_secs_f64(),
                longest.as_secs_f64() * 1000.0
            );
        }
    }
}
